"""Learned policies with a scripted adviser."""

import numpy as np
import pytest
from tests.support.learned import network_for

import posse
from posse_baselines import DDCS, PolicyError, load, play
from posse_baselines.learned import Encoding, LearnedPolicy
from posse_baselines.safeguard import Advice, check_adviser

SCRIPT = DDCS.of("ddcs-distributed")


def listener(answer: tuple[float, float], kind: str = "features") -> LearnedPolicy:
    """Return a policy whose network has a constant output."""
    encoding, adviser = Encoding.of(worlds().layout, kind), SCRIPT
    size = encoding.size + check_adviser(adviser)
    network = network_for(size, weights=(np.zeros((2, size), np.float32),), biases=(np.array(answer, np.float32),))
    return LearnedPolicy(network, encoding, {"name": "mine"}, adviser)


def worlds(count: int = 6, first: int = 0) -> posse.Batch:
    return posse.batch("field", count, message_size=SCRIPT.message_size, first_world=first, horizon=80)


@pytest.mark.parametrize("kind", ["plain", "features"])
def test_an_answer_of_zero_is_the_adviser_itself(kind: str) -> None:
    mine = play(worlds(), listener((0.0, 0.0), kind), seed=3)
    ddcs = play(worlds(), SCRIPT, seed=3)
    for name, values in ddcs.items():
        np.testing.assert_array_equal(mine[name], values, err_msg=name)


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


def test_the_safeguard_comes_after_a_corrected_velocity() -> None:
    played = play(worlds(40), listener((0.3, 0.0)), seed=3)
    assert played["contact_free"].mean() > 0.8, "always faster, come what may"


def test_restarted_worlds_change_no_advice_in_the_others() -> None:
    rng = np.random.default_rng(0)
    batch, alone = worlds(4), worlds(1, first=2)
    advice, other = (Advice(SCRIPT, each.layout, each.num_worlds) for each in (batch, alone))
    advice.follow(batch.reset(seed=5))
    other.follow(alone.reset(seed=5))
    for step in range(40):
        np.testing.assert_array_equal(advice.inputs[2], other.inputs[0])
        answers = rng.uniform(-0.2, 0.2, (4, 5, 2)).astype(np.float32)
        actions, alone_actions = advice.actions(answers), other.actions(answers[2:3])
        advice.follow(batch.step(actions)[0])
        other.follow(alone.step(alone_actions)[0])
        if step % 3 == 0:
            mask = np.array([True, step % 2 == 0, False, False])
            advice.restart(mask)
            advice.follow(batch.reset(options={"reset_mask": mask}), mask)


def test_only_policies_of_the_ddcs_are_advisers() -> None:
    for name in ("planner", "pursuit"):
        with pytest.raises(PolicyError, match="use a policy of the DDCS"):
            check_adviser(load(name))
