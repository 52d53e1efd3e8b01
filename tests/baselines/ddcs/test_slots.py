"""Slots are assigned for all formations, team sizes and radios."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import load, play
from posse_baselines.ddcs.baseline import FAMILY


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"formation": "ring", "num_trackers": 6},
        {"formation": "rows", "num_trackers": 9},
        {"radio_loss": 0.3, "radio_delay": 2},
        {"num_trackers": 8, "formation": "ring", "num_neighbours": 3},
    ],
)
def test_trackers_end_in_slots_of_their_own(settings: dict[str, Any]) -> None:
    batch = posse.batch("constant", 40, split="train", message_size=5, **settings)
    metrics = play(batch, load("ddcs-distributed"))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.95
    assert metrics["score"].mean() >= 0.85 * metrics["bound"].mean()


def test_a_large_team_of_which_each_knows_eight_settles() -> None:
    # Team-mates that are no longer in the observation must not stay as obstacles where they were.
    batch = posse.batch(
        "constant",
        10,
        split="validation",
        message_size=5,
        autoreset="disabled",
        num_trackers=40,
        num_neighbours=8,
        formation="rows",
    )
    metrics = play(batch, load("ddcs-distributed"))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.9


@pytest.mark.parametrize("name", sorted({*FAMILY} - {"velocity-pursuit", "ddcs-no-radio"}))
def test_every_member_of_the_family_settles_on_a_straight_target(name: str) -> None:
    batch = posse.batch("constant", 40, split="train", message_size=5)
    metrics = play(batch, load(name))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.9
    assert (metrics["tracker_contacts"] + metrics["target_contacts"] == 0).mean() >= 0.9


def test_obstacles_are_kept_off() -> None:
    batch = posse.batch("obstacles", 60, split="train", message_size=5)
    metrics = play(batch, load("ddcs-distributed"))
    assert (metrics["obstacle_contacts"] == 0).mean() >= 0.95
    assert (metrics["tracker_contacts"] == 0).mean() >= 0.95
