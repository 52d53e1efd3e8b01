"""The search finds a known optimum, and goes on from its past as if it had never stopped."""

from __future__ import annotations

import numpy as np
import pytest

from posse_baselines import Tunable, settings_of, tunable
from posse_training.tuning.search import Generation, Search
from posse_training.tuning.space import Point, Space, select

START = np.full(4, 0.5)
PEAK = np.array([0.2, 0.9, 0.5, 0.65])


def height(point: Point) -> float:
    return -float(np.sum((point - PEAK) ** 2 * np.array([1.0, 5.0, 20.0, 2.0])))


def climb(search: Search, count: int) -> list[Generation]:
    past = []
    for _ in range(count):
        points = search.ask()
        scores = [height(point) for point in points]
        search.tell(points, scores)
        past.append(Generation(points=points.tolist(), scores=scores))
    return past


def test_it_finds_the_peak() -> None:
    search = Search(START, 8, seed=1)
    past = climb(search, 60)
    np.testing.assert_allclose(search.mean, PEAK, atol=0.005)
    points = np.array([generation["points"] for generation in past])
    assert points.min() >= 0.0
    assert points.max() <= 1.0


def test_a_search_with_a_past_goes_on_bit_for_bit() -> None:
    whole = Search(START, 8, seed=1)
    past = climb(whole, 9)
    half = Search(START, 8, 1, past[:4])
    assert climb(half, 5) == past[4:]
    np.testing.assert_array_equal(half.mean, whole.mean)


def test_the_seed_decides() -> None:
    assert climb(Search(START, 8, seed=1), 2) == climb(Search(START, 8, seed=1), 2)
    assert climb(Search(START, 8, seed=1), 2) != climb(Search(START, 8, seed=2), 2)


def test_a_past_that_cannot_be_is_refused() -> None:
    wrong: list[Generation] = [{"points": [[0.5] * 4] * 7, "scores": [0.0] * 7}]
    with pytest.raises(ValueError, match=r"a generation has \(7, 4\) points, not \(8, 4\)"):
        Search(START, 8, 1, wrong)
    wrong = [{"points": [[0.5] * 4] * 8, "scores": [0.0] * 7 + [float("nan")]}]
    with pytest.raises(ValueError, match="not finite"):
        Search(START, 8, 1, wrong)


def test_every_point_is_a_setting_that_can_be_played() -> None:
    tunables = tunable("ddcs-distributed")
    space = Space(tunables)
    rng = np.random.default_rng(1)
    for point in [*rng.random((200, len(tunables))), np.zeros(len(tunables)), np.ones(len(tunables))]:
        settings_of("ddcs-distributed").replace(**space.values(point))


def test_a_setting_that_must_exceed_one_that_is_not_searched() -> None:
    for name in ("near", "far"):
        space = Space(*select(tunable("ddcs-distributed"), [name]))
        for end in (0.0, 1.0):
            settings_of("ddcs-distributed").replace(**space.values(np.array([end])))


def test_the_start_is_the_default_and_wide_ranges_are_logarithmic() -> None:
    for t in tunable("pngl-l-phi"):
        space = Space((t,), ())
        values = Space((t,), tuple(o for o in tunable("pngl-l-phi") if o is not t)).values(space.start)
        assert values[t.name] == pytest.approx(t.default, rel=1e-5, abs=1e-9)
    wide = Space((Tunable("x", 1.0, 0.1, 10.0, "s"),))
    assert wide.values(np.array([0.25]))["x"] == pytest.approx(10**-0.5, rel=1e-5)
    narrow = Space((Tunable("x", 1.0, 0.5, 2.5, "s"),))
    assert narrow.values(np.array([0.25]))["x"] == pytest.approx(1.0)
