"""The belief that a network reads says what the world is like, where the team can know it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines.ddcs import DDCS, FLOCKING, SEARCHING
from posse_baselines.ddcs.belief import BELIEF_SIZE, LOOKS_AT, MATES_AT, SEARCH_AT, SLOT_AT, TARGET_AT, TASK_AT

Complexes = npt.NDArray[np.complex128]


def way(belief: npt.NDArray[np.float32], at: int, scale: float) -> Complexes:
    """The vector (m) that stands at a place of beliefs with its length as d / (d + scale)."""
    soft = belief[..., at] + 1j * belief[..., at + 1]
    return np.asarray(soft * scale / (1.0 - np.abs(soft)))


def test_a_team_in_formation_believes_what_is_so() -> None:
    ddcs = DDCS()
    batch = posse.batch("constant", 8, message_size=ddcs.message_size, split="train")
    observations, memory = batch.reset(seed=2), ddcs.begin(batch.layout, 8)
    for _ in range(250):
        proposals, memory = ddcs.propose(observations, memory, believes=True)
        belief, state = proposals[..., 2:], {k: v.copy() for k, v in batch.state.items()}
        actions, memory = ddcs.carry_out(observations, memory, np.zeros_like(proposals[..., :2]))
        observations = batch.step(actions)[0]
    assert belief.shape == (8, 5, BELIEF_SIZE)
    x = {who: state[f"{who}_x"] + 1j * state[f"{who}_y"] for who in ("tracker", "world")}
    ahead = {who: state[f"{who}_heading_cos"] + 1j * state[f"{who}_heading_sin"] for who in x}
    to_target = (x["world"][:, None] - x["tracker"]) / ahead["tracker"]
    assert (belief[..., TARGET_AT] == 1.0).all()
    np.testing.assert_allclose(way(belief, TARGET_AT + 1, 3.0), to_target, rtol=0, atol=0.02)
    velocity = belief[..., TARGET_AT + 3] + 1j * belief[..., TARGET_AT + 4]
    moving = batch.scenario.target_speed * ahead["world"][:, None] / ahead["tracker"]
    np.testing.assert_allclose(velocity, moving, rtol=0, atol=0.05)
    np.testing.assert_array_equal(belief[..., TASK_AT : TASK_AT + 4].sum(-1), 1.0)
    assert (belief[..., TASK_AT + FLOCKING] == 1.0).mean() > 0.9
    flocking = belief[..., TASK_AT + FLOCKING] == 1.0
    assert (np.abs(way(belief, SLOT_AT + 1, 0.3))[flocking] < 0.6).all()
    assert not belief[..., SEARCH_AT : SEARCH_AT + 3].any()
    np.testing.assert_array_equal(belief[..., MATES_AT], 1.0)
    to_mates = (x["tracker"][:, None, :] - x["tracker"][:, :, None]) / ahead["tracker"][..., None]
    nearest = np.sort(np.abs(to_mates), axis=-1)[..., 1]
    np.testing.assert_allclose(np.abs(way(belief, MATES_AT + 1, 1.0)), nearest, rtol=0, atol=0.05)
    assert ((belief[..., LOOKS_AT:] >= 0.0) & (belief[..., LOOKS_AT:] <= 1.0)).all()


def test_who_searches_believes_nothing_of_the_target() -> None:
    ddcs = DDCS()
    batch = posse.batch("search", 8, message_size=ddcs.message_size)
    observations, memory = batch.reset(seed=2), ddcs.begin(batch.layout, 8)
    lost = []
    for _ in range(20):
        proposals, memory = ddcs.propose(observations, memory, believes=True)
        belief = proposals[..., 2:]
        searching = belief[..., TASK_AT + SEARCHING] == 1.0
        assert searching.any()
        assert not belief[searching][:, TARGET_AT : TARGET_AT + 9].any()
        assert not belief[searching][:, SLOT_AT : SLOT_AT + 7].any()
        lost.append(belief[searching][:, SEARCH_AT].max())
        actions, memory = ddcs.carry_out(observations, memory, np.zeros_like(proposals[..., :2]))
        observations = batch.step(actions)[0]
    np.testing.assert_allclose(lost, [t / (t + 10.0) for t in 0.1 * np.arange(20)], rtol=1e-4, atol=1e-4)
