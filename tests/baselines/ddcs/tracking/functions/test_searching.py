"""The search, against sums over all cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

searching = plain("ddcs.tracking.searching")
GRID = 16


def cells(m: Mind, size: int = GRID) -> Any:
    """The centres of all cells, (size, size) complex, the first axis along x."""
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * m.f.area
    return (at[:, None] + m.d.area_x) + 1j * (at[None, :] + m.d.area_y)


def grid(m: Mind, size: int = GRID) -> Any:
    return m.seen[: size * size].reshape(size, size)


@pytest.mark.parametrize("at", [0.3 + 0.2j, -11.8 + 11.9j, 5 - 7j, 11.9 - 11.7j, 30 + 0j])
@pytest.mark.parametrize("middle", [0j, 1 - 2j])
def test_the_cells_with_their_centre_in_sight_are_covered(at: complex, middle: complex) -> None:
    m = Mind()
    m.d.area_x, m.d.area_y = middle.real, middle.imag
    searching.mark_seen(m.f, m.d, m.seen, at.real, at.imag, 41)
    covered = abs(cells(m) - at) < m.f.sight
    np.testing.assert_array_equal(grid(m), np.where(covered, 42, 0))


def test_a_search_begins_where_the_target_was_lost_on_the_open_plane() -> None:
    for scenario, middle, left in (("constant", 3 - 1j, 0), ("field", 0j, 7)):
        m = Mind(scenario, sensing_range=4.0)
        m.target(3 - 1j)
        m.seen[:], m.d.step, m.d.fix_step, m.d.goal_step = 7, 60, 50, 55
        searching.begin_search(m.f, m.d, m.seen)
        assert (m.d.lost_step, m.d.goal_step) == (60, -1)
        assert complex(m.d.area_x, m.d.area_y) == middle
        assert (m.seen == left).all()
    m = Mind("constant", sensing_range=4.0)
    m.seen[:] = 7
    searching.begin_search(m.f, m.d, m.seen)
    assert (m.seen == 7).all()
    m.d.fix_step = 0
    searching.begin_search(m.f, m.d, m.seen)
    assert (m.seen == 0).all()


def test_the_map_holds_what_this_one_and_those_that_it_hears_covered() -> None:
    m = Mind(own=0)
    m.mate(2, -6 + 0j, step=6)
    m.mate(3, 9j, step=0)
    m.mate(4, -9j, step=-1)
    m.d.step = 19
    searching.look_around(m.f, m.s, m.d, m.mates, m.seen, 6.0, 0.0)
    assert (m.seen == 0).all()  # every half a second
    m.d.step = 20
    searching.look_around(m.f, m.s, m.d, m.mates, m.seen, 6.0, 0.0)
    covered = (abs(cells(m) - 6) < m.f.sight) | (abs(cells(m) + 6) < m.f.sight)
    np.testing.assert_array_equal(grid(m), np.where(covered, 21, 0))
    m.mates[3].step = 6
    searching.look_around(m.f, m.s, m.d, m.mates, m.seen, 6.0, 0.0)
    assert (grid(m) == 21).sum() > covered.sum()


def test_the_map_holds_whom_it_heard_up_to_the_timeout_and_from_the_first_step_on() -> None:
    for dt, step, told, counts in ((0.5, 3, 0, True), (0.5, 4, 0, False), (0.1, 10, 0, True), (0.1, 10, -1, False)):
        m = Mind(own=0)
        m.f.dt, m.d.step = dt, step
        m.mate(2, -6 + 0j, step=told)
        searching.look_around(m.f, m.s, m.d, m.mates, m.seen, 6.0, 0.0)
        assert (grid(m)[abs(cells(m) + 6) < 1.5] == counts * (step + 1)).all()


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_the_map_is_updated_in_every_step_at_the_least(dt: float) -> None:
    m = Mind(own=0, played={"look_time": 0.1})
    m.f.dt = dt
    for step in (4, 5):
        m.d.step = step
        searching.look_around(m.f, m.s, m.d, m.mates, m.seen, 6.0, 0.0)
        assert m.seen.max() == step + 1


def test_the_age_of_a_cell_is_the_time_since_it_was_covered() -> None:
    m = Mind()
    m.d.step, m.d.lost_step = 100, 60

    def age(looked: int, lost: bool = False) -> float:
        grid(m)[3, 5] = looked
        return float(searching.age_of(m.f, m.s, m.d, m.seen, 3, 5, lost))

    assert [age(0), age(101), age(1), age(61)] == pytest.approx([30.0, 0.0, 10.0, 4.0])
    assert [age(60, lost=True), age(61, lost=True)] == pytest.approx([30.0, 4.0])
    empty = np.zeros(0, np.uint16)
    assert searching.age_of(m.f, m.s, m.d, empty, 3, 5, False) == 30.0
    m.d.step = 1000
    assert age(61) == 30.0


def test_the_age_around_a_cell_is_a_mean_with_nothing_outside() -> None:
    rng = np.random.default_rng(0)
    m = Mind()
    m.d.step, m.d.lost_step = 200, 150
    m.seen[:] = rng.integers(0, 200, m.seen.size)
    ages = np.where(grid(m) == 0, 30.0, np.minimum(30.0, 0.1 * (201.0 - grid(m))))
    wide = np.pad(ages, 3)
    for i, j, reach in ((0, 0, 1), (8, 5, 2), (15, 14, 3), (2, 15, 1)):
        around = wide[i + 3 - reach : i + 4 + reach, j + 3 - reach : j + 4 + reach]
        found = searching.age_around(m.f, m.s, m.d, m.seen, i, j, reach)
        assert found == pytest.approx(around.mean(), abs=1e-5)


def best_cell(m: Mind, at: complex, heading: float, heard: list[int], size: int = GRID) -> complex:
    """The goal by its value in every cell."""
    s, d = m.s, m.d
    inner = m.f.area - min(1.5, m.f.area / 2)
    middle = complex(d.area_x, d.area_y)
    from_middle = cells(m, size) - middle
    centre = middle + np.clip(from_middle.real, -inner, inner) + 1j * np.clip(from_middle.imag, -inner, inner)
    looked = grid(m, size).astype(float) - 1
    ages = np.where(looked < 0, s.stale_after, np.minimum(s.stale_after, 0.1 * (d.step - looked)))
    age, value = ages.copy(), np.zeros((size, size))
    if d.fix_step >= 0:
        away = abs(centre - complex(d.now_x, d.now_y))
        lost = away < 2.0 + s.lost_drift * 0.1 * (d.step - d.fix_step)
        age[lost & (looked < d.lost_step)] = s.stale_after
        value += np.where(lost, s.lost_worth - s.lost_slope * away, 0.0)
    k = max(1, round(0.7 * m.f.sight / (2 * m.f.area / size)))
    wide = np.pad(ages, k)
    sums = sum(wide[a : a + size, b : b + size] for a in range(2 * k + 1) for b in range(2 * k + 1))
    age += s.swath * (sums / (2 * k + 1) ** 2 - age)
    deaf = 1.0 - len(heard) / max(1, min(m.f.neighbours, m.n - 1))
    value += s.age_weight * age - s.middle_weight * deaf * abs(centre - middle)
    way = centre - at
    there = way / np.maximum(abs(way), 1e-9)
    value -= abs(way) + s.turn_weight * (1.0 - (there / turn(heading)).real)
    for j in heard:
        mate = m.mates[j]
        ahead = complex(mate.x, mate.y) + (0.1 * (d.step - mate.step) + 2.0) * complex(mate.speed_x, mate.speed_y)
        value -= np.maximum(0.0, abs(way) - abs(centre - ahead))
    return complex(centre[np.unravel_index(value.argmax(), value.shape)])


@pytest.mark.parametrize("seed", range(10))
def test_the_goal_is_the_cell_of_the_greatest_value(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = Mind(
        "field" if seed % 3 else "constant",
        own=3,
        played={"swath": 0.6 * (seed % 2), "middle_weight": 2.0, "turn_weight": 3.0},
        sensing_range=2.2 if seed % 2 else 4.0,
    )
    m.d.step = 150
    m.d.area_x, m.d.area_y = rng.normal(0, 2, 2) * (m.f.walled == 0)
    m.seen[:] = rng.integers(0, 150, m.seen.size) * (rng.random(m.seen.size) < 0.7)
    if seed % 2:
        m.d.fix_step, m.d.lost_step = 60, 100
        m.target(complex(*rng.normal(0, 5, 2)), known=0)
    heard = [j for j in (0, 1, 2, 4) if rng.random() < 0.6]
    for j in (0, 1, 2, 4):
        place, velocity = complex(*rng.normal(0, 5, 2)), complex(*rng.normal(0, 0.5, 2))
        m.mate(j, place, velocity, step=149 if j in heard else 20)
    at, heading = complex(*rng.normal(0, 5, 2)), rng.uniform(-3, 3)
    facing = turn(heading)
    searching.choose_goal(m.f, m.s, m.d, m.mates, m.seen, 3, at.real, at.imag, facing.real, facing.imag)
    assert complex(m.d.goal_x, m.d.goal_y) == pytest.approx(best_cell(m, at, heading, heard), abs=1e-4)
    assert m.d.goal_step == 150


@pytest.mark.parametrize("size", [1, 2, 5])
@pytest.mark.parametrize("seed", range(24))
def test_the_goal_is_that_cell_on_a_coarse_map_too(seed: int, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As above, with fewer cells, of smaller areas, for teams of ``size``."""
    rng, cut = np.random.default_rng(seed), 5
    monkeypatch.setattr(searching, "GRID", cut)
    m = Mind(
        "constant",
        own=0,
        num_trackers=size,
        num_neighbours=6,
        breaks=0,
        sensing_range=4.0,
        played={"swath": 0.8 * (seed % 2), "middle_weight": 2.0, "turn_weight": 4.0},
    )
    m.f.area, m.f.sight = rng.choice([1.8, 6.0]), rng.choice([0.5, 3.0])
    m.d.step = 150
    m.d.area_x, m.d.area_y = rng.normal(0, 2, 2)
    m.seen[:] = rng.integers(0, 150, m.seen.size) * (rng.random(m.seen.size) < 0.8)
    if seed % 4 > 1:
        m.d.fix_step, m.d.lost_step = 140, 145
        near = complex(*rng.normal(0, 0.6 * m.f.area, 2))
        m.target(near + complex(m.d.area_x, m.d.area_y), known=0)
    heard = [j for j in range(1, size) if rng.random() < 0.6]
    for j in range(1, size):
        place, velocity = complex(*rng.normal(0, 3, 2)), complex(*rng.normal(0, 2, 2))
        m.mate(j, place, velocity, step=149 if j in heard else 20)
    at, heading = complex(*rng.normal(0, 1, 2)), rng.uniform(-3, 3)
    facing = turn(heading)
    searching.choose_goal(m.f, m.s, m.d, m.mates, m.seen, 0, at.real, at.imag, facing.real, facing.imag)
    assert complex(m.d.goal_x, m.d.goal_y) == pytest.approx(best_cell(m, at, heading, heard, cut), abs=1e-4)


@pytest.mark.parametrize("along", [1, 1j])
def test_a_cell_where_a_team_mate_is_in_two_seconds_is_left_to_it(
    along: complex, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "GRID", 3)
    played = {"age_weight": 0.0, "turn_weight": 0.0, "middle_weight": 0.0}
    m = Mind("constant", own=0, sensing_range=4.0, played=played)
    m.f.area, m.d.step = 6.0, 150
    at = 2.2 * along
    for speed, goal in ((0.0, 4), (1.0, 4), (2.0, 0), (3.0, 4)):  # cells are 4 m apart
        m.mate(2, 0j, speed * along)
        searching.choose_goal(m.f, m.s, m.d, m.mates, m.seen, 0, at.real, at.imag, 1.0, 0.0)
        assert complex(m.d.goal_x, m.d.goal_y) == pytest.approx(goal * along, abs=1e-6)


def test_one_in_the_middle_of_a_cell_need_not_turn_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "GRID", 3)
    m = Mind("constant", own=0, sensing_range=4.0)
    m.f.area, m.d.step = 6.0, 150
    searching.choose_goal(m.f, m.s, m.d, m.mates, m.seen, 0, 0.0, 0.0, 1.0, 0.0)
    assert (m.d.goal_x, m.d.goal_y) == (0.0, 0.0)


def test_a_searcher_goes_to_its_goal_at_full_speed_and_then_chooses_another() -> None:
    def goes(at: complex, since: int, goal: complex = 6 + 8j, step: int = 100, dt: float = 0.1) -> tuple[complex, bool]:
        m = Mind(sensing_range=3.0)
        m.seen[:], m.f.dt = 1, dt
        m.d.step, m.d.goal_x, m.d.goal_y, m.d.goal_step = step, goal.real, goal.imag, since
        v = searching.wander(m.f, m.s, m.d, m.mates, m.seen, m.own, at.real, at.imag, 1.0, 0.0, 0.9)
        return complex(*v), bool(m.d.goal_step == since)

    velocity, kept = goes(0j, 80)
    assert kept
    assert velocity == pytest.approx(0.54 + 0.72j)
    for at, since, stays in (
        (0j, 55, False),  # longer than 4 s
        (0j, -1, False),
        (6 + 6.6j, 80, False),  # within half of the sensing range
        (6 + 6.4j, 80, True),
        (6 + 6.6j, 96, True),  # chosen less than half a second ago
        (0j, 0, False),
    ):
        velocity, kept = goes(at, since)
        assert kept == stays
        assert abs(velocity) == pytest.approx(0.9)
    assert goes(6 + 8j, 99) == (0j, True)
    assert goes(0j, 0, step=1)[1]  # chosen in the first step


def test_a_goal_is_kept_for_just_the_times_set() -> None:
    for away, step, kept in ((3.0, 8, True), (3.0, 9, False), (1.0, 1, True), (1.0, 2, False)):
        m = Mind(sensing_range=3.0)
        m.f.dt, m.d.step, m.d.goal_x, m.d.goal_step = 0.5, step, away, 0
        searching.wander(m.f, m.s, m.d, m.mates, m.seen, m.own, 0.0, 0.0, 1.0, 0.0, 0.9)
        assert (m.d.goal_step == 0) == kept


def test_a_goal_is_reached_at_a_share_of_a_range_of_up_to_four_metres() -> None:
    for away, kept in ((2.1, True), (1.9, False)):
        m = Mind(sensing_range=7.0, start_distance=(3.0, 6.0))
        m.d.step, m.d.goal_x, m.d.goal_step = 100, away, 80
        searching.wander(m.f, m.s, m.d, m.mates, m.seen, m.own, 0.0, 0.0, 1.0, 0.0, 0.9)
        assert (m.d.goal_step == 80) == kept


@pytest.mark.parametrize(("fix", "target"), [(0, 4 + 3j), (-1, 4 + 3j), (60, 90 + 0j)])
def test_only_cells_near_a_lost_target_count_as_never_covered(fix: int, target: complex) -> None:
    m = Mind(own=3, played={"age_weight": 2.0, "lost_drift": 0.0})
    m.d.step, m.d.lost_step, m.d.fix_step = 150, 140, fix
    m.target(target, known=0)
    m.seen[:] = 131  # covered before the target was lost
    grid(m)[2, 3] = 21  # covered long ago
    searching.choose_goal(m.f, m.s, m.d, m.mates, m.seen, 3, 0.5, 0.2, 1.0, 0.0)
    wanted = best_cell(m, 0.5 + 0.2j, 0.0, [])
    assert complex(m.d.goal_x, m.d.goal_y) == pytest.approx(wanted, abs=1e-4)
    assert (abs(wanted - target) < 2.0) == (fix == 0)
