"""Learned policies with a scripted adviser."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.learned import network_for, policy_for

import posse
from posse_baselines import PolicyError, load, play
from posse_baselines.learned import Encoding, LearnedPolicy
from posse_baselines.learned.advice import Advice, Advising

DDCS = "ddcs-distributed"
SAID = load(DDCS).message_size


def listener(answer: tuple[float, float], correction: str = "motion", kind: str = "slots") -> LearnedPolicy:
    """Return a policy whose network has a constant output."""
    encoding, adviser = Encoding.of(worlds().layout, kind), load(DDCS)
    size = encoding.size + Advising(adviser, correction, believes=encoding.believes).inputs
    network = network_for(size, weights=(np.zeros((2, size), np.float32),), biases=(np.array(answer, np.float32),))
    return LearnedPolicy(network, encoding, {"name": "mine"}, adviser, correction)


def worlds(count: int = 6, first: int = 0) -> posse.Batch:
    return posse.batch("field", count, message_size=SAID, first_world=first, horizon=80)


KINDS = pytest.mark.parametrize(
    ("correction", "kind"), [("motion", "slots"), ("velocity", "plain"), ("velocity", "belief")]
)


@KINDS
def test_an_answer_of_zero_is_the_adviser_itself(correction: str, kind: str) -> None:
    mine = play(worlds(), listener((0.0, 0.0), correction, kind), seed=3)
    ddcs = play(worlds(), load(DDCS), seed=3)
    for name, values in ddcs.items():
        np.testing.assert_array_equal(mine[name], values, err_msg=name)


def test_an_answer_is_twice_as_large_a_correction_and_leaves_the_message() -> None:
    batch, ddcs = worlds(), load(DDCS)
    observations = batch.reset(seed=3)
    actions, _ = ddcs.act(observations, ddcs.begin(batch.layout, 6))
    for answer in ((1.0, -1.0), (0.125, -0.25)):
        policy = listener(answer)
        corrected, _ = policy.act(observations, policy.begin(batch.layout, 6))
        np.testing.assert_array_equal(
            corrected[..., :2], np.clip(actions[..., :2] + 2 * np.array(answer, np.float32), -1, 1)
        )
        np.testing.assert_array_equal(corrected[..., 2:], actions[..., 2:])


def test_the_safeguard_comes_after_a_corrected_velocity() -> None:
    def contacts(correction: str) -> float:
        return 1.0 - float(play(worlds(40), listener((0.3, 0.0), correction), seed=3)["contact_free"].mean())

    # Always faster, come what may: without the safeguard, most teams touch something.
    assert contacts("velocity") < 0.5 * contacts("motion")


@pytest.mark.parametrize(("correction", "believes"), [("motion", False), ("velocity", True)])
def test_worlds_that_begin_anew_leave_the_advice_in_the_others_as_it_was(correction: str, believes: bool) -> None:
    rng = np.random.default_rng(0)
    batch, alone = worlds(4), worlds(1, first=2)
    advising = Advising(load(DDCS), correction, believes=believes)
    advice, other = Advice(advising, batch), Advice(advising, alone)
    advice.restart(batch.reset(seed=5), np.ones(4, np.bool_))
    other.restart(alone.reset(seed=5), np.ones(1, np.bool_))
    for step in range(40):
        np.testing.assert_array_equal(advice.inputs[2], other.inputs[0])
        answers = rng.uniform(-0.2, 0.2, (4, 5, 2)).astype(np.float32)
        actions, alone_actions = advice.actions(answers), other.actions(answers[2:3])
        advice.follow(batch.step(actions)[0])
        other.follow(alone.step(alone_actions)[0])
        if step % 3 == 0:
            mask = np.array([True, step % 2 == 0, False, False])
            advice.restart(batch.reset(options={"reset_mask": mask}), mask)


def test_who_cannot_advise() -> None:
    for name, settings, message in (
        ("planner", {}, "use a policy of the DDCS"),
        ("pursuit", {"correction": "velocity"}, "use a policy of the DDCS"),
        (DDCS, {"believes": True}, '"belief" goes with correction="velocity"'),
        (DDCS, {"correction": "speed"}, "motion, velocity"),
    ):
        with pytest.raises(PolicyError, match=message):
            Advising(load(name), **settings)
    with pytest.raises(PolicyError, match="needs an adviser"):
        policy_for(worlds().layout, "belief")
