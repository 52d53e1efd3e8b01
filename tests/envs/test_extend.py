"""The examples of the manual's chapter *Extend posse*, as modules of a user."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.process import examples, run

EXAMPLES = examples("extend.md")
TWICE = """
import posse
from posse.numeric import choose


@posse.field("1", low=-1, high=lambda s: s.num_trackers, unknown=-1, size=2)
def twice(c, v):
    \"\"\"Whether it moves, and the team's size.\"\"\"
    return choose(v.speed > 0.0, 1.0, -1.0), c.num_trackers

"""
FIELDS_AND_TERMS = """
import pickle

import numpy as np
import posse
import closing
import steady
import twice
import walls
from tests.support.reference.state import directions, points

settings = dict(
    extra_fields=("closing_speed", "wall_distance", "twice"),
    target_motion="agent",
    reward_weights={"slot": 1.0, "steady": 0.5}, message_size=1, num_neighbours=4,
    num_trackers=4, tracker_speed=(1.0, 1.1, 1.2, 1.3),
)

batch = posse.batch("obstacles", 11, **settings)
s, layout = batch.scenario, batch.layout
plain = posse.batch("obstacles", 11, **{**settings, "extra_fields": (), "reward_weights": {}})
low, high = layout.bounds()
rng = np.random.default_rng(0)
observed, expected = batch.reset(seed=1), plain.reset(seed=1)
for step in range(60):
    o, other = layout.views(observed), plain.layout.views(expected)
    for name, view in other.items():
        np.testing.assert_array_equal(o[name], view, err_msg=name)
    assert ((observed >= low) & (observed <= high)).all()
    place, heading = (np.column_stack([each(batch, "tracker"), each(batch, "world")]) for each in (points, directions))
    speed = np.column_stack([batch.state["tracker_speed"], batch.state["world_speed"]])
    wall = s.arena / 2 - s.robot_radius - np.maximum(abs(place.real), abs(place.imag))
    np.testing.assert_allclose(o["wall_distance"], wall, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(o["twice"][..., 0], np.where(speed > 0, 1, -1))
    np.testing.assert_array_equal(o["twice"][..., 1], 4)
    velocity = speed * heading
    for i in range(5):
        number = o["neighbour_number"][:, i].astype(int)
        apart = np.take_along_axis(place, number, 1) - place[:, i : i + 1]
        moving = np.take_along_axis(velocity, number, 1) - velocity[:, i : i + 1]
        closing_speed = -(apart.conj() * moving).real / abs(apart)
        there = number >= 0
        np.testing.assert_allclose(o["closing_speed"][:, i][there], closing_speed[there], rtol=1e-4, atol=2e-3)
        assert (o["closing_speed"][:, i][~there] == 0).all()
    actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
    observed, rewards, *_, infos = batch.step(actions)
    expected = plain.step(actions)[0]
    terms = {name: infos[f"reward/{name}"] for name in ("slot", "steady")}
    turn = abs(batch.state["tracker_turn_rate"]) / s.tracker_turn_rate
    np.testing.assert_allclose(terms["steady"][:, :4], 1 - turn, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(rewards[:, :4], (terms["slot"] + 0.5 * terms["steady"])[:, :4], rtol=1e-5, atol=1e-5)
copy = pickle.loads(pickle.dumps(batch))
np.testing.assert_array_equal(copy.step(actions)[0], batch.step(actions)[0])
assert "steady" not in posse.batch("smart").term_names
print("done")
"""


@pytest.mark.long
def test_fields_and_terms_are_part_of_the_kernel(tmp_path: Path) -> None:
    """Of that of any scenario, which is kept on disk until a term is edited."""
    modules = {**EXAMPLES, "twice": TWICE}
    for _ in range(2):
        done = run(tmp_path, FIELDS_AND_TERMS, **modules)
        assert done.stdout == "done\n", done.stderr
    assert "compiling kernels" not in done.stderr
    steady = EXAMPLES["steady"].replace("return 1 -", "return 2 -")
    assert "Not equal to tolerance" in run(tmp_path, FIELDS_AND_TERMS, **{**modules, "steady": steady}).stderr


MOTION_SENSOR_AND_METRIC = """
import numpy as np
import posse
import bearing
import distance
import spiral
from posse.signals.layout import StateLayout
from tests.support.reference.state import directions, points

@posse.metric("1")
def last_heading(s, w):
    '''Cosine of the target's heading at the end.'''
    return w["heading_cos"]

batch = posse.batch(
    "constant", 40, target_motion="spiral", sensor="bearing-only", sensing_range=6.0,
    num_trackers=3, radio_loss=0.1, metrics=["target_distance", "last_heading"], horizon=101,
)
s, layout = batch.scenario, StateLayout(batch.scenario)
low, high = batch.layout.bounds()
observations = batch.reset(seed=0)
heading, ever, bearings, losses, distances = [], 0, np.nan, 0, []
for step in range(100):
    o = batch.layout.views(observations)
    heading.append(np.angle(directions(batch, "world")))
    offset = points(batch, "world")[:, None] - points(batch, "tracker")
    told = o["target_bearing"] @ [1, 1j] * directions(batch, "tracker")
    seen, known = o["target_seen"] > 0, o["target_known"] > 0
    np.testing.assert_array_equal(seen, abs(offset) <= s.sensing_range)
    ever = ever | seen
    np.testing.assert_array_equal(known, ever)  # a bearing is not sent
    error = np.angle(told / offset)[seen]
    assert np.abs(error).max() <= 0.0601
    assert error.std() > 0.01
    kept = known & ~seen  # the direction stands, whoever moves
    np.testing.assert_allclose(told[kept], np.broadcast_to(bearings, told.shape)[kept], rtol=1e-4, atol=1e-4)
    bearings, losses = told.copy(), losses + kept.sum()
    assert (o["target_range"] == -1).all()
    assert (abs(told[~known]) == 0).all()
    for name in ("target_heading", "target_frame", "target_velocity"):
        assert (o[name] == 0).all()
    assert ((observations >= low) & (observations <= high)).all()
    distances += [abs(offset)] * (step > 0)
    observations, *_, infos = batch.step(np.ones(batch.action_shape))
assert losses > 0
turned = np.unwrap(heading, axis=0)
turned -= turned[0]
side = batch.state["world_spiral_side"]
assert set(side) == {-1.0, 1.0}
rates = s.target_turn_rate / (1 + 0.1 * s.control_step * np.arange(100))
expected = np.append(0, np.cumsum(rates[:-1] * s.control_step))
np.testing.assert_allclose(turned, side * expected[:, None], rtol=1e-4, atol=1e-3)
np.testing.assert_array_equal(layout.views(layout.vector(batch.arrays))["spiral_side"], side)
assert "spiral_side" not in StateLayout(posse.get_scenario("smart")).offsets

# The metric, at any time and at the end of the episode; beside the built-in ones, which it leaves.
metrics = batch.metrics()
assert list(metrics) == [metric.name for metric in posse.METRICS] + ["target_distance", "last_heading"]
np.testing.assert_array_equal(metrics["last_heading"], batch.state["world_heading_cos"])
distances.append(abs(points(batch, "world")[:, None] - points(batch, "tracker")))
np.testing.assert_allclose(metrics["target_distance"], np.mean(distances, (0, 2)), rtol=1e-5)
assert (infos["metrics/target_distance"] == 0).all()
infos = batch.step(np.ones(batch.action_shape))[-1]
assert infos["metrics/target_distance"].shape == (40,)
batch.step(np.ones(batch.action_shape))  # the next episode's start: sums begin anew
assert (batch.state["world_target_distance_sum"] == 0).all()
print("done")
"""


@pytest.mark.long
def test_a_motion_a_sensor_and_a_metric_are_part_of_the_kernel(tmp_path: Path) -> None:
    done = run(tmp_path, MOTION_SENSOR_AND_METRIC, **EXAMPLES)
    assert done.stdout.endswith("done\n"), done.stderr
