"""Learned policies with a scripted adviser."""

import numpy as np
import pytest
from tests.support.learned import network_for

import posse
from posse_baselines import DDCS, PolicyError, play
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.learned import Encoding, LearnedPolicy

SCRIPT = DDCS(FAMILY["ddcs-distributed"])


def listener(answer: tuple[float, float], kind: str = "features", safeguard: bool = False) -> LearnedPolicy:
    """Return a policy whose network has a constant output."""
    encoding = Encoding.of(worlds().layout, kind)
    size = encoding.size + 2
    network = network_for(size, weights=(np.zeros((2, size), np.float32),), biases=(np.array(answer, np.float32),))
    return LearnedPolicy(network, encoding, {"name": "mine"}, SCRIPT, safeguard)


def worlds(count: int = 6) -> posse.Batch:
    return posse.batch("field", count, message_size=SCRIPT.message_size, horizon=80)


def test_an_adviser_that_its_name_does_not_make_again_is_refused() -> None:
    mine = listener((0.0, 0.0))
    with pytest.raises(PolicyError, match=r"'ddcs-distributed' cannot be an adviser: .* by its name"):
        LearnedPolicy(mine.network, mine.encoding, {}, SCRIPT.with_settings(gain=2.0))


@pytest.mark.parametrize(("kind", "safeguard"), [("plain", False), ("features", True)])
def test_an_answer_of_zero_is_the_adviser_itself(kind: str, safeguard: bool) -> None:
    mine, script = (play(worlds(), team, seed=3) for team in (listener((0.0, 0.0), kind, safeguard), SCRIPT))
    np.testing.assert_equal(mine, script)


def test_an_answer_is_twice_as_large_a_correction_and_leaves_the_message() -> None:
    batch, ddcs, answer = worlds(), SCRIPT, np.array((0.125, -0.25), np.float32)
    observations = batch.reset(seed=3)
    proposals, memory = ddcs.propose(observations, ddcs.begin(batch.layout, 6))
    wanted, _ = ddcs.carry_out(observations, memory, np.broadcast_to(2 * answer, proposals.shape))
    policy = listener((0.125, -0.25))
    corrected, _ = policy.act(observations, policy.begin(batch.layout, 6))
    np.testing.assert_array_equal(corrected, wanted)
    plain, _ = ddcs.act(observations, ddcs.begin(batch.layout, 6))
    assert (corrected[..., :2] != plain[..., :2]).any()
    np.testing.assert_array_equal(corrected[..., 2:], plain[..., 2:])
