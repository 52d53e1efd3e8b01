"""The safeguard as an action layer: nothing else of the script moves a robot, and robots do not touch."""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from tests.baselines.laws.test_guidance import body_of
from tests.support.learned import network_for
from tests.support.reference.state import directions, points

import posse
from posse_baselines import PolicyError, Safeguard, rollout
from posse_baselines.laws.safeguard import DISC, put_disc, safe_velocity
from posse_baselines.learned import Encoding, LearnedPolicy
from posse_baselines.safeguard import Guard


def guarded(scenario: str, **changes: Any) -> LearnedPolicy:
    """A policy behind the safeguard whose untrained network gives small numbers."""
    encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario(scenario)), "features")
    network = network_for(encoding.size, **changes)
    weights, biases = (tuple(np.float32(1e-3) * a for a in arrays) for arrays in (network.weights, network.biases))
    network = replace(network, weights=weights, biases=biases)
    return LearnedPolicy(network, encoding, {"name": "untrained"}, safeguard=True)


@pytest.mark.parametrize("scenario", ["smart", "search", "obstacles", "radio", "field"])
def test_an_untrained_network_goes_nowhere(scenario: str) -> None:
    batch = posse.batch(scenario, 16, seed=3, horizon=200)
    played = rollout(batch, guarded(scenario), "tracker_pose")
    assert played.metrics["score"].mean() < 0.01
    gone = np.linalg.norm(np.diff(played["tracker_pose"][..., :2], axis=0), axis=-1).sum(axis=0)
    assert np.median(gone) < 0.2, "nothing of the script's guidance moves it"


LIMITED: dict[str, Any] = {"tracker_acceleration": 1.0, "tracker_turn_acceleration": 4.0}
CROSSING: dict[str, Any] = {"scenario": "constant", "num_trackers": 4, "start_distance": (2.0, 3.0)}
DRIFTING = CROSSING | {"odometry_drift": 0.4, "heading_drift": 0.08, "message_size": 7}  # the last five are the layer's
FAR_WALL: dict[str, Any] = {"scenario": "obstacles", "num_trackers": 3, "arena": 14.0, "num_obstacles": 3}


def full_speed(settings: dict[str, Any], safe: bool) -> tuple[float, float]:
    """Drive at full speed to the other side of the team's middle, or among obstacles along the x-axis to the wall.

    Return the share of worlds with contact, and the way, m.
    """
    batch = posse.batch(num_worlds=20, seed=1, autoreset="disabled", horizon=100, **settings)
    observations, guard, s, way = batch.reset(), Guard(batch.layout, 20), batch.scenario, 0.0
    opposite = 2 * points(batch, "tracker").mean(axis=1, keepdims=True) - points(batch, "tracker")
    for _ in range(100):
        wanted = np.ones((20, s.num_trackers)) if s.walled else opposite - points(batch, "tracker")
        wanted = wanted / np.maximum(np.abs(wanted), 1e-6) / directions(batch, "tracker")
        actions = guard.actions(observations, np.stack([wanted.real, wanted.imag], axis=-1).astype(np.float32))
        if not safe:
            turn = np.angle(wanted) / (s.control_step * s.tracker_turn_rates[0])
            actions[..., :2] = np.stack([2 * np.maximum(wanted.real, 0) - 1, turn], axis=-1).clip(-1, 1)
        observations, *_ = batch.step(actions)
        way += float(batch.state["tracker_speed"].mean()) * s.control_step
    return float((batch.metrics()["contact_free"] == 0).mean()), way


@pytest.mark.parametrize(
    "settings", [CROSSING, CROSSING | LIMITED, DRIFTING, FAR_WALL | LIMITED | {"tracker_acceleration": 0.25}]
)
def test_it_keeps_robots_from_each_other_obstacles_and_walls(settings: dict[str, Any]) -> None:
    (bare, far), (safe, way) = full_speed(settings, False), full_speed(settings, True)
    assert bare == 1.0
    assert safe <= 0.1
    assert way > 0.2 * far


@pytest.mark.parametrize("aside", [0.0, 0.2, -0.4])
def test_it_gets_past_a_wide_obstacle(aside: float) -> None:
    batch = posse.batch("obstacles", 1, num_trackers=1, num_obstacles=3)
    batch.reset()
    state = {"tracker": (-3.0, aside), "obstacle": (0.0, np.array([-1.0, 0.0, 1.0])), "world": (0.0, 8.0)}
    for name, (x, y) in state.items():
        array = getattr(batch.arrays, name)
        array["x"], array["y"] = x, y
    batch.arrays.obstacle["radius"] = 0.6
    observations, guard = batch.observe(), Guard(batch.layout, 1)
    for _ in range(120):
        towards = np.conj(directions(batch, "tracker"))  # along the x axis
        wanted = np.stack([towards.real, towards.imag], axis=-1)
        observations, *_ = batch.step(guard.actions(observations, wanted))
    assert batch.state["tracker_x"][0, 0] > 2.0
    assert batch.metrics()["contact_free"][0] == 1.0


@pytest.mark.parametrize("heading", [0.0, 1.0, 2.0, 3.0])
def test_a_resting_robot_gives_way_to_what_comes_at_it(heading: float) -> None:
    batch = posse.batch("constant", 1, num_trackers=1, **LIMITED)
    options = {"tracker_pose": [[0.0, 0.0, heading]], "target_pose": [-4.0, 0.0, 0.0]}
    observations, guard = batch.reset(options=options), Guard(batch.layout, 1)
    for _ in range(100):
        observations, *_ = batch.step(guard.actions(observations, np.zeros(batch.action_shape, np.float32)))
    assert batch.state["world_x"][0] > 1.5
    assert batch.metrics()["contact_free"][0] == 1.0


def test_it_foresees_commands_that_act_late() -> None:
    """Robots that want to go one way settle on it without swinging about it, though commands lag and wait."""
    late: dict[str, Any] = {"actuator_lag": 0.3, "command_delay": 3, "start_distance": (3.0, 5.0)}
    batch = posse.batch("constant", 8, autoreset="disabled", **late)
    observations, guard = batch.reset(seed=2), Guard(batch.layout, 8)
    errors = []
    for _ in range(60):
        heading = directions(batch, "tracker")
        along = 0.5 * np.stack([heading.real, -heading.imag], axis=-1)  # the common x axis
        observations, *_ = batch.step(guard.actions(observations, along.astype(np.float32)))
        errors.append(np.abs(np.angle(heading)))
    assert np.median(errors[0]) > 0.5
    assert np.quantile(errors[40:], 0.9) < 0.05


def test_environments_do_as_the_batch_does() -> None:
    """PettingZoo, Gymnasium and the layer itself make the same motions of the same velocities."""
    batch = posse.batch("obstacles", 1, seed=5, message_size=1, autoreset="disabled")
    team = Safeguard(gymnasium.make("posse/Team-v0", scenario="obstacles", seed=5, message_size=1))
    parallel = Safeguard(posse.parallel_env("obstacles", seed=5, message_size=1))
    generator = np.random.default_rng(0)
    for _ in range(2):  # episodes
        seen, guard = batch.reset(), Guard(batch.layout, 1)
        seen_team, _ = team.reset()
        seen_each, _ = parallel.reset()
        for _ in range(30):
            wanted = generator.uniform(-1, 1, (5, 3)).astype(np.float32)
            seen, *_ = batch.step(guard.actions(seen, wanted[None]))
            seen_team, *_ = team.step(wanted)
            each = {f"tracker_{i}": wanted[i] for i in range(5)}
            with pytest.raises(ValueError, match="unknown agent 'target_0'"):
                parallel.step({**each, "target_0": wanted[0]})  # refused, it changes nothing
            seen_each, *_ = parallel.step(each)
            np.testing.assert_array_equal(seen[0], seen_team)
            np.testing.assert_array_equal(seen[0], np.stack(list(seen_each.values())))


def test_one_tracker_and_a_target_that_is_an_agent() -> None:
    solo = Safeguard(gymnasium.make("posse/Solo-v0", scenario="smart"))
    mate = Safeguard(gymnasium.make("posse/Tracker-v0", scenario="smart", number=2))
    for env in (solo, mate):
        assert gymnasium.make(env.spec).has_wrapper_attr("guard"), "it can be made again"
        env.reset(seed=1)
        for _ in range(5):
            observation, *_ = env.step(np.zeros(2, np.float32))
        assert env.observation_space.contains(observation)
    duel = Safeguard(posse.parallel_env("smart", target_motion="agent"))
    duel.reset(seed=1)
    actions = {agent: np.zeros(2, np.float32) for agent in duel.agents}
    actions["target_0"] = np.ones(2, np.float32)
    for _ in range(5):
        duel.step(actions)
    assert duel.unwrapped.batch.arrays.world["speed"][0] > 0.1, "the target is not guarded"
    assert duel.unwrapped.batch.arrays.tracker["speed"].max() == 0


def test_messages_of_a_learner_do_not_move_the_safeguard_where_poses_drift() -> None:
    batch, actions = posse.batch("smart", 4, message_size=7, odometry_drift=0.05, autoreset="disabled"), []
    for said in (0.0, 1.0):
        observations, guard, rng = batch.reset(seed=1), Guard(batch.layout, 4), np.random.default_rng(1)
        for _ in range(100):
            given = said * rng.random(batch.action_shape)
            given[..., :2] = batch.layout.views(observations)["target_bearing"]  # where they come near each other
            observations, *_ = batch.step(guard.actions(observations, given))
        actions.append(batch.arrays.tracker["x"].copy())
    np.testing.assert_array_equal(actions[0], actions[1])


def test_invalid_environments_are_not_guarded() -> None:
    with pytest.raises(PolicyError, match="discrete_actions=False"):
        Safeguard(gymnasium.make("posse/Team-v0", discrete_actions=True))
    with pytest.raises(PolicyError, match="'robots' drift, and message_size=0 has no room for the 5 numbers"):
        Safeguard(posse.parallel_env("robots"))
    with pytest.raises(PolicyError, match="put it round the safeguard"):
        Safeguard(gymnasium.wrappers.FlattenObservation(gymnasium.make("posse/Team-v0")))
    for other in (3, gymnasium.make("Pendulum-v1")):
        with pytest.raises(TypeError, match="nor a single environment"):
            Safeguard(other)
    for env in (Safeguard(gymnasium.make("posse/Team-v0")), Safeguard(posse.parallel_env())):
        env.unwrapped.reset()  # not that of the guarded environment
        with pytest.raises(gymnasium.error.ResetNeeded, match="of the guarded environment"):
            env.step({})
        with pytest.raises(PolicyError, match="guard it once"):
            Safeguard(env)
    batch = posse.batch("smart", 1)
    for wrong, words in ((np.full((1, 5, 2), np.nan), "finite"), (0.0, "shape")):
        with pytest.raises(ValueError, match=words):
            Guard(batch.layout, 1).actions(batch.reset(), wrong)


@pytest.mark.parametrize("turn", [1.5, 0.0, -1.5])
def test_a_disc_that_turns_is_avoided_where_its_arc_leads(turn: float) -> None:
    """A quarter of a circle of 0.53 m leads to the robot; straight on it is passed, and more so on the other circle."""
    disc, radius = np.zeros(1, DISC), 0.8 / 1.5
    put_disc(disc, 0, complex(-radius, radius), -0.8j, 0.3, 0.15)
    disc["turn"] = turn
    _, changed = safe_velocity(body_of(1.0, 0.0, (1.0, 4.0)), disc, 0j)
    assert changed == (turn > 0.0)
