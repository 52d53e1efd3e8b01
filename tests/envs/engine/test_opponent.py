"""A batch in which a policy moves the target."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from tests.envs.engine.test_batch import actions_for

import posse

WORLDS, HORIZON = 3, 12
SHORT = posse.get_scenario("constant", num_trackers=2, horizon=HORIZON, settle_time=1.0)


class Weaver:
    """Turns by the time since the start of the episode, which its memory counts."""

    def begin(self, layout: posse.ObservationLayout, num_worlds: int) -> Any:
        return np.zeros(num_worlds)

    def act(self, observations: Any, memory: Any) -> Any:
        assert observations.shape == (len(memory), 1, observations.shape[2])
        away = observations[:, 0, :1]  # its own heading
        turn = np.sin(memory)[:, None]
        return np.stack([0.5 * away, turn], axis=2).astype(np.float32), memory + 1

    def restart(self, memory: Any, mask: Any) -> Any:
        return np.where(mask, 0, memory)


class Crossing(Weaver):
    """Moves two trackers, and says its age."""

    def act(self, observations: Any, memory: Any) -> Any:
        assert observations.shape[1] == 2
        said = np.tile(np.sin(memory)[:, None, None], (1, 2, 1))
        moves = np.concatenate([observations[..., :2], said], axis=2)
        return moves.astype(np.float32), memory + 1


@pytest.mark.parametrize("autoreset", ["next_step", "same_step", "disabled"])
@pytest.mark.parametrize(("side", "policy"), [("target", Weaver()), ("team", Crossing())])
def test_it_plays_as_a_batch_whose_other_side_is_driven_from_outside(side: str, policy: Weaver, autoreset: str) -> None:
    make: dict[str, Any] = {"seed": 4, "autoreset": autoreset, "message_size": int(side == "team")}
    inside: Any = posse.batch(SHORT, WORLDS, **{**make, f"{side}_policy": policy})
    outside = posse.batch(SHORT, WORLDS, **make, target_motion="agent")
    own, other = (slice(2), slice(2, 3)) if side == "target" else (slice(2, 3), slice(2))
    mine, theirs, age = inside.reset(), outside.reset(), np.zeros(WORLDS)
    assert mine.shape == inside.observation_shape == theirs[:, own].shape
    for step in range(2 * HORIZON + 3):
        np.testing.assert_array_equal(mine, theirs[:, own])
        over = outside.arrays.world["over"] != 0
        if autoreset == "disabled" and over.any():
            options = {"reset_mask": over}
            mine, theirs = inside.reset(options=options), outside.reset(options=options)
            age[over] = 0
            continue
        moves, age = policy.act(theirs[:, other], age)
        if autoreset == "next_step":
            age[over] = 0
        action, whole = actions_for(inside, step), np.zeros(outside.action_shape, np.float32)
        whole[:, own, :2], whole[:, other, : moves.shape[2]] = action, moves
        mine, rewards, _, truncated, infos = inside.step(action)
        theirs, gained, _, ended, told = outside.step(whole)
        np.testing.assert_array_equal(rewards, gained[:, own])
        np.testing.assert_array_equal(inside.everyone[0], whole)
        np.testing.assert_array_equal(inside.everyone[1].observations, theirs)
        np.testing.assert_array_equal(inside.everyone[1].rewards, gained)
        np.testing.assert_array_equal(truncated, ended)
        np.testing.assert_array_equal(infos["reward/slot"], told["reward/slot"][:, own])
        if autoreset == "same_step" and truncated.any():
            age[truncated] = 0
            np.testing.assert_array_equal(infos["final_obs"], told["final_obs"][:, own])


class Wrong(Weaver):
    """Returns what it is told to from its third step on."""

    def __init__(self, returned: Any) -> None:
        self.returned = returned

    def act(self, observations: Any, memory: Any) -> Any:
        actions, after = super().act(observations, memory)
        return (actions if memory[0] < 2 else self.returned), after


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "must be real numbers, got None"),
        (np.zeros((WORLDS, 2)), r"actions of shape \(3, 2\), wanted \(3, 1, 2\)"),
        (np.zeros((WORLDS, 1)), r"actions of shape \(3, 1\), wanted \(3, 1, 2\)"),
        (np.full((WORLDS, 1, 2), np.nan), r"\[0, 0, 0\] = nan is not a number in \[-1, 1\]"),
    ],
    ids=str,
)
def test_a_refused_call_leaves_worlds_and_memory(returned: Any, message: str) -> None:
    policy = Wrong(returned)
    batch: Any = posse.batch(SHORT, WORLDS, seed=1, target_policy=policy)
    vector: Any = gym.make_vec("posse/Team-v0", WORLDS, scenario=SHORT, seed=1, target_policy=policy)
    action = actions_for(batch, 0)
    for env, inner in ((batch, batch), (vector, vector.batch)):
        env.reset(seed=1)
        policy.returned = np.zeros((WORLDS, 1, 2))
        env.step(action)
        for wrong, words in ((action * 2, "action"), (None, "action"), (action, f"target's policy.*{message}")):
            if wrong is action:
                env.step(action)
                policy.returned = returned
            before, memory = inner.arrays.copy(), inner.memory
            with pytest.raises(ValueError, match=words):
                env.step(wrong)
            with pytest.raises(ValueError, match="would start in"):
                env.reset(options={"tracker_pose": np.zeros((SHORT.num_trackers, 3))})
            assert inner.memory is memory
            assert all(np.array_equal(*both) for both in zip(before, inner.arrays, strict=True))


def test_clipping_is_for_both_sides() -> None:
    policy = Wrong(np.full((WORLDS, 1, 2), 30.0))
    clipping, clipped = (posse.batch(SHORT, WORLDS, clip_actions=True, target_policy=policy) for _ in range(2))
    clipping.reset()
    clipped.reset()
    for step in range(5):
        actions = 9 * actions_for(clipping, step)
        np.testing.assert_array_equal(clipping.step(actions)[0], clipped.step(actions.clip(-1, 1))[0])


def test_an_object_that_is_no_target_policy_is_refused() -> None:
    with pytest.raises(ValueError, match="exclude each other"):
        posse.batch(SHORT, team_policy=Crossing(), target_policy=Weaver())
    for wrong in (3, Weaver):
        with pytest.raises(TypeError, match="begin, act or restart"):
            posse.batch(SHORT, 1, target_policy=wrong)  # type: ignore[arg-type]
    with pytest.raises(posse.ScenarioError, match="leaves nothing to move the target"):
        posse.PairedBatch(SHORT.replace(target_motion="agent"), 1, Crossing(), outside=1)
    for outside, words in (("tracker", "known: trackers, target"), (2, "not in the team"), (1.0, "whole number")):
        with pytest.raises(posse.ScenarioError, match=words):
            posse.PairedBatch(SHORT, 1, Crossing(), outside=outside)  # type: ignore[arg-type]


def test_the_targets_reward_is_the_weighted_sum_of_named_terms() -> None:
    """The target drives into a tracker that stands before it."""
    weights = {"team": -1.0, "contact": -0.5, "effort": -0.25}
    scenario = SHORT.replace(target_reward_weights=weights, target_motion="agent")
    batch = posse.batch(scenario, 1, autoreset="disabled")
    poses = {"tracker_pose": [[0.5, 0, 0], [-5, 0, 0]], "target_pose": [0, 0, 0]}
    batch.reset(options=poses)
    contacts = 0.0
    for _ in range(HORIZON):
        actions = np.array([[[-1, 0], [-1, 0], [1, 0]]], np.float32)
        _, rewards, _, _, infos = batch.step(actions)
        terms = {name: float(infos[f"reward/{name}"][0, 2]) for name in batch.term_names}
        expected = sum(weights.get(name, 0) * value for name, value in terms.items())
        assert rewards[0, 2] == pytest.approx(expected)
        assert terms["slot"] == terms["distance"] == 0, "terms of trackers"
        contacts += terms["contact"]
    assert contacts == 1 == batch.metrics()["target_contacts"][0]
    assert scenario.to_dict()["target_reward_weights"] == weights


def test_who_works_is_told_of_those_that_are_moved_from_outside() -> None:
    batch = posse.PairedBatch(SHORT, 1, Crossing(), outside=1)
    batch.reset()
    batch.arrays.tracker["broken_at"][0, 1] = 0
    assert batch.working.tolist() == [[False]]


def test_a_copy_has_a_memory_of_its_own() -> None:
    one: Any = posse.batch(SHORT, WORLDS, target_policy=Weaver())
    assert copy.copy(one).memory is not one.memory
