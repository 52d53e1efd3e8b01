import json
from pathlib import Path

import numpy as np
import pytest

import posse
from posse_baselines import Trajectory
from posse_training.reproduce.reproduce import MEMBERS, MODELS, reproduce
from posse_training.reproduce.runs import Floats, draw_starts, median_world, settling_times


def run_with(relative: Floats, speeds: Floats) -> Trajectory:
    """Return a run of one world whose trackers move so relative to a target that runs on."""
    frames = len(relative)
    target = np.zeros((frames, 1, 3))
    target[:, 0, 0] = -0.05 * np.arange(frames)
    trackers = np.zeros((frames, 1, relative.shape[1], 3))
    trackers[..., :2] = relative[:, None] + target[:, :, None, :2]
    arrays = {"tracker_pose": trackers, "target_pose": target, "tracker_speed": speeds[:, None]}
    layout = posse.batch("constant", 1).layout
    return Trajectory(frames - 1, arrays, layout, "test", np.array([frames - 1]), {})


def test_settling_time_of_a_known_approach() -> None:
    time = np.arange(81) * 0.1
    gap = np.exp(-time)  # within 0.1 m of the last value from t = -ln(0.1 + e^-8)
    relative = np.stack([np.stack([gap, 0 * gap], -1), np.zeros((81, 2))], axis=1)
    still = np.full((81, 2), 0.5)
    expected = np.ceil(-np.log(0.1 + np.exp(-8.0)) * 10) / 10
    assert settling_times(run_with(relative, still))[0] == pytest.approx(expected)
    # A speed that is still off later settles later, however well the places are held.
    fast = still.copy()
    fast[:50, 1] = 0.7
    assert settling_times(run_with(relative, fast))[0] == pytest.approx(5.0)
    # A team that still moves at the end has not settled.
    relative[:, 1, 0] = 0.05 * np.arange(81)
    assert np.isnan(settling_times(run_with(relative, still))[0])
    assert [median_world(np.array(times)) for times in ([np.nan] * 2, [np.nan, 3.0, 1.0, 2.0])] == [0, 3]


def test_starts_are_the_figures() -> None:
    scenario = posse.get_scenario("paper-centralized")
    starts = draw_starts(scenario, 20, seed=3)
    trackers, targets = starts["tracker_pose"], starts["target_pose"]
    assert trackers.shape == (20, 5, 3)
    assert (trackers[..., 0] > targets[:, None, 0]).all()
    np.testing.assert_array_equal(targets[:, 2], np.pi)
    np.testing.assert_array_equal(draw_starts(scenario, 5, seed=3)["tracker_pose"], trackers[:5])


@pytest.mark.long
def test_figures_and_numbers_are_written(tmp_path: Path) -> None:
    rows = reproduce(tmp_path, starts=8)
    assert json.loads((tmp_path / "settling.json").read_text())["policies"] == rows
    names = [f"{model.name}-{kind}" for model in MODELS for kind in ("frames", "curves")]
    for name in (*names, "tracks", "leader-loss"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
        assert "test split, seed 7<" in (tmp_path / f"{name}.svg").read_text(), "a figure says what was played"
    assert tuple(row["policy"] for row in rows) == MEMBERS
    assert rows[MEMBERS.index("pngl-l-phi")]["settling_time_quartiles"][1] < 4.5, "s; the paper: 1.6, at another scale"
    for row in rows:
        if row["policy"] != "velocity-pursuit":  # all pursue to one point behind the target
            assert row["settled"] >= 7
            # With the law as printed, the team settles beside its slots.
            assert row["in_slots"] >= 7 or row["policy"] == "pngl-l-phi-literal"
