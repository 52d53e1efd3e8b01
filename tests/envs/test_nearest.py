"""Who is nearest: both ways of making the list give what sorting the exact distances gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import posse
from posse.compiled import kernel
from posse.nearest import _CERTAIN, list_nearest
from posse.state import OBSTACLE, TRACKER, WORLD, beam_directions, config_record
from posse.survey import BLOCK, LISTED, SIZE_FOR_ONE, lay_out, lay_out_constants

Numbers = npt.NDArray[np.float32]


@kernel
def make_lists(
    config: Any, world: Any, trackers: Any, obstacles: Any, beams: Numbers, s: Numbers,
    lists: Numbers, certain: Numbers,
) -> None:  # fmt: skip
    """List the nearest of every tracker, as an observation does."""
    c = config[0]
    lay_out_constants(c, beams, s)
    lay_out(c, world[0], trackers, obstacles, s)
    for first in range(0, c.num_trackers, BLOCK):
        count = min(BLOCK, c.num_trackers - first)
        s[_CERTAIN : _CERTAIN + BLOCK] = 0
        list_nearest(c, trackers, first, count, s)
        for lane in range(count):
            for p in range(c.neighbours):
                lists[first + lane, p] = s[LISTED + BLOCK * p + lane]
            certain[first + lane] = s[_CERTAIN + lane]


def team(x: Numbers, y: Numbers, heading: Numbers) -> npt.NDArray[Any]:
    trackers = np.zeros(len(x), TRACKER)
    trackers["x"], trackers["y"] = x, y
    trackers["heading_cos"], trackers["heading_sin"] = np.cos(heading), np.sin(heading)
    return trackers


def listed(trackers: npt.NDArray[Any], neighbours: int) -> tuple[Numbers, Numbers]:
    n = len(trackers)
    scenario = posse.get_scenario(
        "constant", num_trackers=n, num_neighbours=neighbours, formation="ring"
    )
    lists = np.full((n, neighbours), -1, np.float32)
    certain = np.zeros(n, np.float32)
    make_lists(
        config_record(scenario), np.zeros(1, WORLD), trackers, np.zeros(0, OBSTACLE),
        beam_directions(scenario), np.zeros(SIZE_FOR_ONE, np.float32), lists, certain,
    )  # fmt: skip
    return lists, certain


def expected(trackers: npt.NDArray[Any], neighbours: int) -> npt.NDArray[np.int64]:
    """Sort the distances as a robot measures them, in float32; of equal ones the lower number."""
    lists = []
    for i, t in enumerate(trackers):
        dx, dy = trackers["x"] - t["x"], trackers["y"] - t["y"]
        ahead = dx * t["heading_cos"] + dy * t["heading_sin"]
        left = dy * t["heading_cos"] - dx * t["heading_sin"]
        distance = np.sqrt(ahead * ahead + left * left)
        order = np.argsort(distance, kind="stable")
        lists.append(order[order != i][:neighbours])
    return np.array(lists)


@pytest.mark.parametrize("neighbours", [1, 3, 8, 9])
@pytest.mark.parametrize("number", [10, 16, 17, 40, 63, 64])
def test_the_nearest_are_listed_in_order(number: int, neighbours: int) -> None:
    rng = np.random.default_rng(number)
    x, y = rng.uniform(-20, 20, (2, number)).astype(np.float32)
    trackers = team(x, y, rng.uniform(-3, 3, number).astype(np.float32))
    lists, certain = listed(trackers, neighbours)
    np.testing.assert_array_equal(lists, expected(trackers, neighbours))
    if neighbours <= 8:
        assert certain.mean() > 0.9, "lanes alone make nearly every list"


@settings(derandomize=True, max_examples=60, deadline=None)
@given(st.integers(10, 64), st.sampled_from([0.0, 1e-7, 1e-6, 1e-5, 1e-4]), st.integers(0, 2**31))
def test_equal_and_nearly_equal_distances_are_told_apart(
    number: int, apart: float, seed: int
) -> None:
    """On a grid each has many team-mates that are as far; jitter makes them nearly so."""
    rng = np.random.default_rng(seed)
    cells = rng.choice(100, number, replace=False)
    x, y = np.stack([cells % 10, cells // 10]) * (1 + rng.uniform(-apart, apart, (2, number)))
    heading = rng.choice([0.0, 0.3, np.pi / 2, -2.0], number)
    trackers = team(x.astype(np.float32), y.astype(np.float32), heading.astype(np.float32))
    lists, certain = listed(trackers, 8)
    np.testing.assert_array_equal(lists, expected(trackers, 8))
    if apart == 0.0:
        assert not certain.all(), "where lanes cannot tell, they say so"
