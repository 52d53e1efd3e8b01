"""Target motions, sensors and metrics of a user's module: the examples of the manual."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.user_modules import examples, lines_of, run

CHAPTER = "extend_targets.md"
MOST_LINES = {"spiral": 15, "bearing": 25, "distance": 8}


@pytest.mark.parametrize("name", MOST_LINES)
def test_an_example_is_short(name: str) -> None:
    assert lines_of(examples(CHAPTER)[name]) <= MOST_LINES[name]


PLAY = """
import numpy as np
import posse
import bearing
import distance
import spiral
from posse.signals.global_state import StateLayout
from posse_training.evaluation.evaluation import evaluate

batch = posse.batch(
    "constant", 40, target_motion="spiral", sensor="bearing-only", sensing_range=6.0,
    num_trackers=3, radio_loss=RADIO_LOSS, metrics=["target_distance"], horizon=101,
)
s, layout = batch.scenario, StateLayout(batch.scenario)
low, high = batch.layout.bounds()
observations = batch.reset(seed=0)
heading, ever, bearings, losses, distances = [], 0, np.nan, 0, []
for step in range(100):
    state, o = batch.state, batch.layout.views(observations)
    heading.append(np.arctan2(state["world_heading_sin"], state["world_heading_cos"]))
    offset = state["world_x"][:, None] - state["tracker_x"]
    offset = offset + 1j * (state["world_y"][:, None] - state["tracker_y"])
    own = state["tracker_heading_cos"] + 1j * state["tracker_heading_sin"]
    told = (o["target_bearing"][..., 0] + 1j * o["target_bearing"][..., 1]) * own
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
    vector = layout.vector(batch.arrays)
    assert np.isfinite(vector).all()
    distances += [abs(offset)] * (step > 0)
    observations, *_, infos = batch.step(np.ones(batch.action_shape))
assert losses > 0
state = batch.state
turned = np.unwrap(heading, axis=0)
turned -= turned[0]
side = batch.state["world_spiral_side"]
assert set(side) == {-1.0, 1.0}
times = s.control_step * np.arange(100)
rates = s.target_turn_rate / (1 + 0.1 * times)
expected = np.append(0, np.cumsum(rates[:-1] * s.control_step))
np.testing.assert_allclose(turned, side * expected[:, None], rtol=1e-4, atol=1e-3)
np.testing.assert_array_equal(
    layout.views(layout.vector(batch.arrays))["spiral_side"], side
)
assert "spiral_side" not in StateLayout(posse.get_scenario("smart")).offsets

# The metric, at any time and at the end of the episode; beside the built-in ones, which it leaves.
metrics = batch.metrics()
assert list(metrics) == [metric.name for metric in posse.METRICS] + ["target_distance"]
x, y = state["world_x"][:, None], state["world_y"][:, None]
distances.append(np.hypot(x - state["tracker_x"], y - state["tracker_y"]))
np.testing.assert_allclose(metrics["target_distance"], np.mean(distances, (0, 2)), rtol=1e-5)
assert (infos["metrics/target_distance"] == 0).all()
infos = batch.step(np.ones(batch.action_shape))[-1]
assert infos["metrics/target_distance"].shape == (40,)
batch.step(np.ones(batch.action_shape))  # the next episode's start: sums begin anew
assert (batch.state["world_target_distance_sum"] == 0).all()
results = evaluate("idle", batch.scenario, 10, progress=False)
assert np.isfinite(results["target_distance"]).all()
print(sum(batch._untyped.stats.cache_hits.values()))
"""


def play(folder: Path, loss: str, **changed: str) -> tuple[str, str]:
    """Return the output and the errors of a game with the examples."""
    code = PLAY.replace("RADIO_LOSS", loss)
    done = run(folder, code, **{**examples(CHAPTER), **changed})
    return done.stdout, done.stderr


@pytest.mark.long
def test_the_examples_are_part_of_the_kernel(tmp_path: Path) -> None:
    """Which is kept on disk."""
    for loss in ("0.0", "0.1"):
        said, errors = play(tmp_path, loss)
        assert said.split()[-1:] in (["0"], ["1"]), errors
    assert said.split()[-1:] == ["1"]


@pytest.mark.long
def test_an_edited_motion_is_compiled_anew(tmp_path: Path) -> None:
    said, errors = play(tmp_path, "0.0")
    assert said, errors
    spiral = examples(CHAPTER)["spiral"].replace("0.1 * w.step", "0.2 * w.step")
    _, errors = play(tmp_path, "0.0", spiral=spiral)
    assert "Not equal to tolerance" in errors


def test_a_motion_that_is_not_declared_is_named_with_near_ones(tmp_path: Path) -> None:
    code = 'import posse, spiral\nposse.batch("constant", 1, target_motion="spirall")'
    done = run(tmp_path, code, **examples(CHAPTER))
    assert "unknown target_motion 'spirall' (did you mean 'spiral'?)" in done.stderr
