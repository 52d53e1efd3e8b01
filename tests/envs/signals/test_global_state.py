"""The state vector: worlds with equal vectors and equal draws evolve equally."""

from typing import Any, Final

import hypothesis
import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from tests.envs.test_random_worlds import SETTINGS, started
from tests.support.reference.state import directions, points

import posse
from posse.rules.state import WorldArrays
from posse.signals.layout import StateLayout

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
