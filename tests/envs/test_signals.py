"""What is told of a world: observations, and the state vector, by which equal worlds and equal draws evolve equally."""

from typing import Any, Final

import hypothesis
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.envs.test_random_worlds import SETTINGS, started
from tests.support.reference.senses import sonar
from tests.support.reference.state import directions, headings, one_world, points, positions, snapshot

import posse
from posse.rules.state import WorldArrays
from posse.signals.layout import StateLayout


def test_what_the_target_agent_is_given() -> None:
    batch = posse.batch("obstacles", 6, target_motion="agent", num_trackers=4, num_neighbours=6)
    s = batch.scenario
    observations = batch.reset(seed=2)
    rng = np.random.default_rng(2)
    for _ in range(20):
        views = batch.layout.views(observations)
        state = snapshot(batch)
        for e in range(6):
            world = one_world(state, e)
            mine = {name: view[e, 4] for name, view in views.items()}
            p, h = positions(world), headings(world)
            assert mine["number"] == mine["target_age"] == mine["target_range"] == -1
            assert mine["target_known"] == mine["acceleration_time"] == 0, "an agent's limits act at once"
            assert mine["max_speed"] == np.float32(s.target_speed)
            assert mine["max_turn_rate"] == np.float32(s.target_turn_rate)
            np.testing.assert_allclose(mine["sonar"], sonar(s, world, 4), rtol=1e-4, atol=2e-3)
            away = (p[:4] - p[4]) / h[4]
            at = mine["neighbour_bearing"][:4] @ [1, 1j] * mine["neighbour_range"][:4]
            order = [int(number) for number in mine["neighbour_number"][:4]]
            assert sorted(order) == [0, 1, 2, 3]
            np.testing.assert_allclose(at, away[order], rtol=1e-4, atol=1e-4)
            assert (np.diff(mine["neighbour_range"][:4]) >= 0).all(), "nearest first"
            assert (mine["neighbour_number"][4:] == -1).all()
            assert (mine["neighbour_heading"][4:] == 0).all()
        observations = batch.step(rng.uniform(-1, 1, batch.action_shape))[0]


@pytest.mark.parametrize("beams", [2, 5, 12])
def test_no_robot_hides_between_two_beams(beams: int) -> None:
    angle, away = np.meshgrid((2 * np.arange(beams) + 1) * np.pi / beams, np.arange(0.8, 1.6, 0.05))
    place = np.stack([away * np.cos(angle), away * np.sin(angle), 0 * angle], axis=-1).reshape(-1, 1, 3)
    batch = posse.batch(num_worlds=len(place), num_trackers=2, sonar_beams=beams)
    options = {"tracker_pose": np.concatenate([0 * place, place], axis=1), "target_pose": (9.0, 9.0, 0.0)}
    readings = batch.layout.views(batch.reset(options=options))["sonar"][:, 0].min(axis=-1)
    np.testing.assert_allclose(readings, away.reshape(-1) - 2 * batch.scenario.robot_radius, rtol=1e-4, atol=1e-4)


def test_the_target_agent_feels_a_wall() -> None:
    batch = posse.batch(target_motion="agent", num_trackers=1, arena=10.0, start_distance=(1, 9))
    batch.reset(options={"target_pose": [4.5, 0, 0], "tracker_pose": [[0, 0, 0]]})
    for _ in range(10):
        observations = batch.step([[[-1.0, 0.0], [1.0, 0.0]]])[0]
    assert batch.state["world_x"][0] == pytest.approx(4.85, abs=1e-3)
    assert batch.layout.views(observations)["touching"][0].tolist() == [0.0, 1.0]


WORLDS: dict[str, dict[str, Any]] = {
    "smart": {"num_trackers": 5, "num_neighbours": 7, "message_size": 1},
    "smart, one": {"num_trackers": 1, "num_neighbours": 0},
    "smart, eight": {"num_trackers": 8, "num_neighbours": 3, "sonar_beams": 5, "message_size": 2},
    "smart, the target an agent": {"num_trackers": 9, "num_neighbours": 8, "target_motion": "agent"},
    "smart, seventeen": {"num_trackers": 17, "num_neighbours": 9, "message_size": 1},
    "smart, sixty-four": {"num_trackers": 64, "num_neighbours": 63},
    "constant": {"field_of_view": 2.0, "sensing_range": 9.0},
    "obstacles": {"autoreset": "same_step"},
    "radio": {"message_size": 2},
    "leader-loss": {"autoreset": "same_step", "break_window": (0.2, 0.5)},
    "field": {"num_trackers": 3},
    "robots": {"command_delay": 2, "odometry_drift": 0.05, "heading_drift": 0.02, "heading_noise": 0.05},
}
COUNT = 11  # eight together, and three each alone


@pytest.mark.parametrize("world", WORLDS)
def test_worlds_that_are_played_together_are_as_each_alone(world: str) -> None:
    scenario = world.partition(",")[0]
    make: dict[str, Any] = {"horizon": 31, "num_threads": 1, "seed": 4, "settle_time": 1.0, **WORLDS[world]}
    together = posse.batch(scenario, COUNT, **make)
    alone = [posse.batch(scenario, 1, first_world=e, **make) for e in range(COUNT)]
    rng = np.random.default_rng(0)
    outputs: list[Any] = [together.reset()]
    expected: list[Any] = [np.concatenate([each.reset() for each in alone])]
    for step in range(40):  # past the horizon, where worlds start anew
        np.testing.assert_equal(outputs, expected)
        actions = rng.uniform(-1, 1, together.action_shape).astype(np.float32)
        *outputs, infos = together.step(actions)
        outputs.append(infos["score"])
        each = [one.step(actions[e : e + 1]) for e, one in enumerate(alone)]
        expected = [np.concatenate(parts) for parts in zip(*(step[:4] for step in each), strict=True)]
        expected.append(np.concatenate([step[4]["score"] for step in each]))
        if step == 12:  # some start anew, in their midst some that are only looked at
            mask = rng.random(COUNT) < 0.5
            outputs[0] = together.reset(options={"reset_mask": mask})
            for e in np.flatnonzero(mask):
                expected[0][e] = alone[e].reset()[0]


@pytest.mark.parametrize("worlds", [1, 8])
def test_among_equally_near_mates_the_lower_number_comes_first(worlds: int) -> None:
    batch = posse.batch("constant", worlds, num_trackers=5)
    # Four at the corners of a square round the last, in no order, and nothing to round.
    corners = [(4.0, -4.0, 0.0), (-4.0, 4.0, 0.0), (4.0, 4.0, 0.0), (-4.0, -4.0, 0.0)]
    poses = np.array([*corners, (0.0, 0.0, 0.0)])
    observed = batch.layout.views(batch.reset(seed=0, options={"tracker_pose": poses}))
    numbers, ranges = observed["neighbour_number"], observed["neighbour_range"]
    assert (ranges[:, 4] == ranges[:, 4, :1]).all()
    orders = [[4, 2, 3, 1], [4, 2, 3, 0], [4, 0, 1, 3], [4, 0, 1, 2], [0, 1, 2, 3]]
    np.testing.assert_array_equal(numbers, np.broadcast_to(orders, numbers.shape))


DRAWS: Final = ("world_seed", "world_split", "world_index", "world_episode", "world_key")
FOLLOWS: Final = (
    # from poses: contacts, and who is near to what (test_solid)
    "world_touching",
    "world_near",
    "tracker_touching",
    "tracker_touching_trackers",
    "tracker_touching_obstacles",
    "tracker_near",
    "tracker_onsets",  # counted again if anything is near, else 0
    # from poses, the slot frame and contacts: who occupies which slot (test_random_worlds)
    "tracker_slot",
    "tracker_slot_distance",
    # from the scenario, always the same
    "tracker_max_speed",
    "tracker_max_turn_rate",
    # from the heading's error
    "odometry_cos",
    "odometry_sin",
    "broadcast_odometry_cos",
    "broadcast_odometry_sin",
    # from the times of faults, from time and contacts
    "world_working",
    "world_over",
    "world_undrawn",
    "world_terminated",
)
"""What the vector leaves out because it follows from the rest, and the engine keeps."""


def junk(array: npt.NDArray[Any], rng: np.random.Generator) -> npt.NDArray[Any]:
    return rng.integers(1, 40, array.shape).astype(array.dtype)


def disturb(scenario: posse.Scenario, arrays: WorldArrays, rng: np.random.Generator) -> set[str]:
    """Overwrite all that the state vector does not hold; return the names of what was."""
    layout = StateLayout(scenario)
    vector, disturbed = layout.vector(arrays), set()
    for name, array in arrays.by_name().items():
        if name in DRAWS or name in FOLLOWS or array.size == 0:
            continue
        before = array.copy()
        array[...] = junk(array, rng)
        if np.array_equal(layout.vector(arrays), vector):
            disturbed.add(name)
        else:
            array[...] = before
    # Of messages never received or sent, the vector holds only that.
    for name, absent in (("heard_", arrays.heard["step"] < 0), ("broadcast_", arrays.broadcast["sent"] == 0)):
        for field, array in arrays.by_name().items():
            if field.startswith(name) and field not in ("heard_step", "heard_message", "broadcast_sent"):
                array[absent] = junk(array, rng)[absent]
    np.testing.assert_array_equal(layout.vector(arrays), vector)
    return disturbed


def drive(batch: posse.Batch, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Head for the target at random speeds, so that it is pressed, and talk."""
    away = points(batch, "world")[:, None] - points(batch, "tracker")
    actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
    n = batch.scenario.num_trackers
    actions[:, :n, 0] = np.maximum(actions[:, :n, 0], actions[:, :1, 0])
    actions[:, :n, 1] = np.clip(np.angle(away / directions(batch, "tracker")), -1, 1)
    return actions


@hypothesis.settings(max_examples=25)
@given(
    name=st.sampled_from(posse.scenario_names()),
    changes=SETTINGS,
    drift=st.sampled_from([0.0, 0.1]),
    steps=st.integers(0, 60),
    seed=st.integers(0, 2**20),
)
def test_equal_states_with_equal_draws_go_on_alike(
    name: str, changes: dict[str, Any], drift: float, steps: int, seed: int
) -> None:
    one, _ = started(name, 8, seed=seed, odometry_drift=drift, **changes)
    other = posse.batch(scenario := one.scenario, 8, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        one.step(drive(one, rng))
    other.restore(one.save())
    disturbed = disturb(scenario, other.arrays, rng)
    assert {"world_score_sum", "world_held", "tracker_start_x"} <= disturbed
    for _ in range(30):  # some of them into the next episode
        actions = drive(one, rng)
        try:
            told = one.step(actions)
        except posse.ScenarioError:  # it is too tight for the start of the next episode
            hypothesis.reject()
        np.testing.assert_equal(told[:4], other.step(actions)[:4])
