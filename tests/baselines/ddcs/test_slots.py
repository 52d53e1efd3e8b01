"""The whole team at play: it takes its slots, searches, keeps off obstacles, bears late commands and drift."""

from typing import Any

import numpy as np
import pytest
from tests.support.drive import drive

import posse
from posse.numeric import FloatArray
from posse_baselines import load, play
from posse_baselines.ddcs import DDCS, SEARCHING
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.policy import Memory


@pytest.mark.parametrize(
    ("worlds", "settings"),
    [
        (40, {"formation": "ring", "num_trackers": 6}),
        (40, {"formation": "rows", "num_trackers": 9}),
        (40, {"radio_loss": 0.3, "radio_delay": 2}),
        (40, {"num_trackers": 8, "formation": "ring", "num_neighbours": 3}),
        # Team-mates that are no longer in the observation must not stay as obstacles where they were.
        (4, {"num_trackers": 40, "num_neighbours": 8, "formation": "rows"}),
    ],
)
def test_trackers_end_in_slots_of_their_own(worlds: int, settings: dict[str, Any]) -> None:
    batch = posse.batch("constant", worlds, split="train", message_size=5, **settings)
    metrics = play(batch, load("ddcs-distributed"))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.95
    assert metrics["score"].mean() >= 0.85 * metrics["bound"].mean()


@pytest.mark.parametrize("name", sorted({*FAMILY} - {"velocity-pursuit", "ddcs-no-radio"}))
def test_every_member_of_the_family_settles_on_a_straight_target(name: str) -> None:
    batch = posse.batch("constant", 40, split="train", message_size=5)
    metrics = play(batch, load(name))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.9
    assert (metrics["tracker_contacts"] + metrics["target_contacts"] == 0).mean() >= 0.9


@pytest.mark.parametrize("neighbours", [4, 1])
def test_obstacles_are_kept_off(neighbours: int) -> None:
    batch = posse.batch("obstacles", 60, split="train", message_size=5, num_neighbours=neighbours)
    metrics = play(batch, load("ddcs-distributed"))
    assert (metrics["obstacle_contacts"] == 0).mean() >= 0.95
    assert (metrics["tracker_contacts"] == 0).mean() >= 0.95


def test_a_rectangle_is_searched_as_fast_as_a_square_of_its_area() -> None:
    make: dict[str, Any] = {"seed": 4, "split": "train", "message_size": 5, "horizon": 300}
    batches = [posse.batch("search", 80, arena=arena, **make) for arena in (20.0, (28.0, 14.0))]
    found = [play(batch, load("ddcs-distributed"))["detection_time"] for batch in batches]
    square, rectangle = np.nan_to_num(found, nan=30.0)
    assert rectangle.max() < 30.0, "found in every world"
    assert rectangle.mean() < square.mean() + 1.0


LATE, DRIFTING = {"actuator_lag": 0.5, "command_delay": 3}, {"odometry_drift": 0.05, "heading_drift": 0.01}


@pytest.mark.parametrize(
    ("name", "fault"), [("pngl-l-phi", LATE), ("ddcs-distributed", LATE), ("pngl-l-phi", DRIFTING)]
)
def test_late_commands_and_drifting_poses_cost_the_team_little(name: str, fault: dict[str, Any]) -> None:
    policy = load(name)
    metrics = play(posse.batch("constant", 60, split="train", message_size=policy.message_size, **fault), policy)
    assert metrics["safe_score"].mean() >= 0.75
    assert (metrics["contact_free"] == 0).mean() <= 0.02


class Blinded(DDCS):
    """A team whose sensors fail after 40 s."""

    steps = 0

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        self.steps += 1
        seen = observations.copy()
        if self.steps > 400:
            views = memory.layout.views(seen)
            views["target_known"][...], views["target_seen"][...] = 0.0, 0.0
        return super().act(seen, memory)


def test_on_the_open_plane_a_lost_target_is_searched_for_where_it_was_lost() -> None:
    pose: dict[str, Any] = {"tracker_pose": [(5.0, 0.0, 0.0)], "target_pose": (8.0, 0.0, 0.0), "num_trackers": 1}
    run = drive(Blinded(), "constant", 1, 1000, **pose)
    places = np.array([now.tracker[0, 0, :2] for now in run if (now.notes["task"] == SEARCHING).all()])
    assert len(places) > 400
    assert places[0, 0] > 25.0
    assert np.hypot(*(places - places[0]).T).max() < 15.0
