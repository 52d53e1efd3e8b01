"""Nearest team-mates: both algorithms agree with sorting by exact distances."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import posse
from posse.engine.scratch import SCRATCH
from posse.numeric import kernel
from posse.rules.discs import BLOCK, lay_out_constants
from posse.rules.scratch import new_scratch
from posse.rules.state import TRACKER, config_record
from posse.signals.observation.nearest import list_nearest
from posse.signals.observation.team import lay_out_team
from posse.signals.scratch import MOST_IN_TEAM

Numbers = npt.NDArray[np.float32]
Teams = npt.NDArray[Any]


@kernel
def make_lists(
    config: Any, trackers: Any, beams: Numbers, across: int, places: int, scratch: Any, lists: Numbers, certain: Numbers
) -> None:
    """List the nearest of every tracker, of eight worlds at once or of one, as observed."""
    n, s = trackers.shape[1], scratch[0]
    lay_out_constants(config[0], beams, s)
    lay_out_team(trackers, 0, across, s)
    for first in range(0, n, 1 if across else BLOCK):
        count = BLOCK if across else min(BLOCK, n - first)
        s.certain[:] = 0
        list_nearest(n, places, first, count, across, s)
        for lane in range(count):
            e, i = lane * across, first + lane * (1 - across)
            for p in range(places):
                lists[e, i, p] = s.listed[BLOCK * p + lane]
            certain[e, i] = s.certain[lane]


def team(x: Numbers, y: Numbers, heading: Numbers) -> Teams:
    trackers = np.zeros(x.shape, TRACKER)
    trackers["x"], trackers["y"] = x, y
    trackers["heading_cos"], trackers["heading_sin"] = np.cos(heading), np.sin(heading)
    return trackers


def listed(trackers: Teams, places: int, across: int) -> tuple[Numbers, Numbers]:
    worlds, n = trackers.shape
    lists = np.full((worlds, n, places), -1, np.float32)
    certain = np.zeros((worlds, n), np.float32)
    # Uninitialised memory must not have an effect.
    scratch = new_scratch(SCRATCH)
    scratch.view(np.float32)[:] = np.nan
    config = config_record(posse.get_scenario("constant"))
    beams = np.zeros((2, 0), np.float32)
    make_lists(config, trackers, beams, across, places, scratch, lists, certain)
    return lists, certain


def expected(trackers: Teams, places: int) -> npt.NDArray[np.int64]:
    """Sort the distances as a robot measures them, in float32; of equal ones the lower number."""
    lists = []
    for world in trackers:
        for i, t in enumerate(world):
            dx, dy = world["x"] - t["x"], world["y"] - t["y"]
            ahead = dx * t["heading_cos"] + dy * t["heading_sin"]
            left = dy * t["heading_cos"] - dx * t["heading_sin"]
            distance = np.sqrt(ahead * ahead + left * left)
            order = np.argsort(distance, kind="stable")
            lists.append(order[order != i][:places])
    return np.array(lists).reshape(*trackers.shape, places)


# One world's team at once, and a tracker of eight worlds where so many fit.
TEAMS = [(0, 1, n) for n in (2, 3, 5, 8, 9, 10, 16, 17, 40, 63, 64)]
TEAMS += [(1, 8, n) for n in (2, 3, 5, 8, 9, 10, MOST_IN_TEAM)]


@pytest.mark.parametrize("places", [1, 2, 3, 8, 9])
@pytest.mark.parametrize(("across", "worlds", "number"), TEAMS)
def test_the_nearest_are_listed_in_order(across: int, worlds: int, number: int, places: int) -> None:
    rng = np.random.default_rng(number)
    x, y = rng.uniform(-20, 20, (2, worlds, number)).astype(np.float32)
    trackers = team(x, y, rng.uniform(-3, 3, (worlds, number)).astype(np.float32))
    places = min(places, number - 1)
    lists, certain = listed(trackers, places, across)
    np.testing.assert_array_equal(lists, expected(trackers, places))
    if places <= 8:
        assert certain.mean() > 0.9, "lanes alone make nearly every list"


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    st.sampled_from([0, 1]), st.integers(3, 64), st.sampled_from([0.0, 1e-7, 1e-6, 1e-5, 1e-4]), st.integers(0, 2**31)
)
def test_equal_and_nearly_equal_distances_are_told_apart(across: int, number: int, apart: float, seed: int) -> None:
    """On a grid each has many team-mates that are as far; jitter makes them nearly so."""
    rng = np.random.default_rng(seed)
    worlds, number = (8, min(number, MOST_IN_TEAM)) if across else (1, number)
    cells = np.array([rng.choice(100, number, replace=False) for _ in range(worlds)])
    grid = np.stack([cells % 10, cells // 10])
    x, y = grid * (1 + rng.uniform(-apart, apart, grid.shape))
    heading = rng.choice([0.0, 0.3, np.pi / 2, -2.0], (worlds, number))
    trackers = team(x.astype(np.float32), y.astype(np.float32), heading.astype(np.float32))
    places = min(8, number - 1)
    lists, certain = listed(trackers, places, across)
    np.testing.assert_array_equal(lists, expected(trackers, places))
    if apart == 0.0 and number > 8:
        assert not certain.all(), "where lanes cannot tell, they say so"
