"""A tracker's slot: the assignment of least total arrival time, by SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from tests.support.minds import Mind, turn
from tests.support.plain import plain

slots, steering = plain("ddcs.tracking.slots"), plain("laws.steering")
PSI = 0.7


def choose(m: Mind, at: complex, heading: float) -> int:
    return int(chosen(m, at, heading)[0])


def chosen(m: Mind, at: complex, heading: float) -> Any:
    """The slot, and the costs that were compared."""
    n = m.n
    cost, work = np.full((n, n), np.nan), np.full((7, n + 1), np.nan)
    facing = turn(heading)
    slots.choose_slot(
        m.f, m.s, m.d, m.mates, m.slots, m.own, at.real, at.imag, facing.real, facing.imag, 1.0, 2.0, cost, work
    )
    return int(m.d.slot), cost


def arrival(m: Mind, k: int, at: complex, heading: complex, held: int, taken: bool = False) -> float:
    """The time that a tracker takes to a slot, with what speaks for and against it."""
    way = complex(m.d.now_x, m.d.now_y) + m.slot(k) * turn(PSI) - at
    time = steering.time_to_slot(
        way.real,
        way.imag,
        float(m.d.speed_x),
        float(m.d.speed_y),
        float(m.d.mean_x),
        float(m.d.mean_y),
        m.s.weave_time,
        1.0,
    )
    angle = (way / abs(way) / heading).real
    time += 0.25 * np.pi * (1.0 - angle) / 2.0 * min(1.0, time)
    time -= m.s.loyalty * (held == k)
    time += m.s.taken_cost * taken
    time -= m.s.sight_worth * (abs(m.slot(k)) < m.s.in_sight * m.f.sight)
    return float(time)


@pytest.mark.parametrize("model", ["distributed", "centralized"])
@pytest.mark.parametrize("seed", range(12))
def test_the_slot_is_that_of_the_least_total_arrival_time(seed: int, model: str) -> None:
    rng = np.random.default_rng(seed)
    m = Mind(
        "constant",
        own=2,
        played={"model": model, "equally_near": 0.0},
        num_trackers=6,
        sensing_range=float(rng.choice([2.5, 4.0])),
        start_distance=(1.0, 2.0),
    )
    m.d.step = 50
    m.target(complex(*rng.normal(size=2)), 0.5 * turn(1.0), PSI)
    m.d.mean_x, m.d.mean_y = 0.1, -0.2
    near = rng.random() < 0.5
    places = [complex(*rng.normal(0, 0.8 if near else 5.0, 2)) for _ in range(6)]
    headings = [turn(a) for a in rng.uniform(-3, 3, 6)]
    held = rng.permutation(6)  # different ones: nobody loses a slot to another
    heard = [j for j in range(6) if j == 2 or rng.random() < 0.8]
    for j in range(6):
        if j != 2:
            m.mate(j, places[j], 1e-9 * headings[j], slot=held[j], step=50 if j in heard else 3)
    m.d.slot, m.d.leader = held[2], heard[0]
    full = rng.integers(0, 6)
    m.d.taken = np.uint64(1 << int(full))
    cost = np.array(
        [[arrival(m, k, places[j], headings[j], held[j], j == 2 and k == full) for k in range(6)] for j in heard]
    )
    if model == "centralized":
        for row, j in enumerate(heard):
            cost[row] += [1e4 * ((k == 0) != (j == heard[0])) for k in range(6)]
    _, columns = linear_sum_assignment(cost)
    wanted = columns[heard.index(2)]
    found, compared = chosen(m, places[2], float(np.angle(headings[2])))
    assert found == wanted
    first = 1e-4 * np.array(heard)[:, None]  # of equal ones, the lower number
    np.testing.assert_allclose(compared[: len(heard)], cost + first, atol=2e-5)


MIDDLE = 1 + 4j


def pair(**played: Any) -> Mind:
    """Trackers 0 and 1 of two; the slots are on either side of a resting target."""
    m = Mind("constant", own=1, played=played, num_trackers=2, formation="ring")
    m.d.step = 50
    m.target(MIDDLE, 0j)
    return m


@pytest.mark.parametrize(
    ("own", "mate", "loses"),
    [(1.0, 0.5, True), (1.0, 0.95, True), (1.0, 1.05, True), (1.0, 1.2, False), (0.5, 1.0, False)],
)
def test_the_nearer_one_keeps_a_slot_that_two_claim(own: float, mate: float, loses: bool) -> None:
    for number in (0, 1):
        m = pair()
        m.own = number
        other = m.mate(1 - number, MIDDLE + m.slot(0) + mate * 1j, slot=0)
        m.d.slot = 0
        at = MIDDLE + m.slot(0) - own * 1j

        def lost(slot: int = 0, m: Mind = m, at: complex = at) -> bool:
            return bool(slots.loses_slot(m.f, m.s, m.d, m.mates, m.slots, m.own, slot, at.real, at.imag))

        within = abs(own - mate) < 0.1
        assert lost() == ((number == 1) if within else loses)
        assert not lost(1)
        m.d.slot = 1
        assert not lost()
        m.d.slot, other.step = 0, 3
        assert not lost()


@pytest.mark.parametrize("slot", range(5))
def test_who_loses_a_slot_of_five_takes_another(slot: int) -> None:
    m = Mind("constant", own=3, num_trackers=5, formation="ring", played={"loyalty": 5.0})
    m.d.step, m.d.slot = 50, slot
    m.target(2 - 1j, 0j)
    place = 2 - 1j + m.slot(slot)
    m.mate(1, place - 0.35, -0.1 + 0j, slot=slot)
    m.mates[1].speed_x = 0.0
    assert choose(m, place + 0.5, np.pi) != slot


def test_one_in_its_slot_need_not_turn_to_it() -> None:
    m = pair(model="centralized")  # without a leader, who would take the first slot
    x, y, _, _ = slots.slot_place(m.d, m.slots[0])
    assert choose(m, complex(x, y), 1.0) == 0


def test_who_loses_a_slot_takes_another() -> None:
    m = pair(loyalty=5.0)
    m.d.slot = 0
    m.mate(0, MIDDLE + m.slot(0) + 0.3j, slot=0)
    m.mates[0].heading_cos = 1.0
    # Each thinks it best to stay; this one has to go.
    assert choose(m, MIDDLE + m.slot(0) + 0.5j, 0.0) == 1


def test_without_radio_the_slot_is_that_of_the_number() -> None:
    m = pair(radio=False)
    assert choose(m, MIDDLE + m.slot(0), 0.0) == 1


CENTRE = 2 - 3j


def crowd(places: int = 2) -> Mind:
    """Tracker 1 of six, each with room for two others in its observation; nobody is heard now."""
    m = Mind("constant", own=1, num_trackers=6, num_neighbours=places, formation="ring")
    m.d.step = 50
    m.target(CENTRE, 0j)
    return m


@pytest.mark.parametrize("places", [2, 4])
@pytest.mark.parametrize("slot", [3, 0])
def test_a_claim_of_one_that_has_no_place_in_the_observation_is_respected(slot: int, places: int) -> None:
    m = crowd(places)
    at = CENTRE + m.slot(slot) * 1.1
    first = choose(m, at, 0.0)
    assert first == slot
    m.mate(4, 9 + 9j, slot=slot, step=3)
    m.d.slot = -1
    assert choose(m, at, 0.0) != slot
    assert m.mates[4].slot == slot
    # In reach of those that are listed it would be heard: the claim is void.
    m.d.slot, m.d.horizon = -1, 0.45 + abs(m.slot(slot)) * 0.1
    assert choose(m, at, 0.0) == slot
    assert m.mates[4].slot == -1
    m.mates[4].slot, m.d.slot, m.d.horizon = slot, -1, 0.35 + abs(m.slot(slot)) * 0.1
    assert choose(m, at, 0.0) != slot


def test_after_a_claim_the_others_count_too() -> None:
    m = crowd()
    at = CENTRE + m.slot(3) * 1.1
    m.mate(2, 9 + 9j, slot=3, step=3)
    m.mate(4, 9 + 9j, slot=2, step=3)
    found, cost = chosen(m, at, 0.0)
    assert found not in (3, 2)
    assert np.isfinite(cost[:3]).all()
    assert np.isnan(cost[3:]).all()
    # The nearest slot's claim is void; that of the farthest one holds.
    far = max(range(6), key=lambda k: abs(m.slot(k) - 1.1 * m.slot(3)))
    m.d.slot, m.d.horizon = -1, 0.45 + abs(m.slot(3)) * 0.1
    m.mates[4].slot = far
    found, cost = chosen(m, at, 0.0)
    assert found == 3
    assert (m.mates[2].slot, m.mates[4].slot) == (-1, far)
    assert (cost[1, far], cost[1, 3]) == (0.0, 1e4)


def test_a_slot_is_an_arm_in_the_slot_frame() -> None:
    m = Mind()
    m.target(2 + 1j, 0j, PSI)
    x, y, arm_x, arm_y = slots.slot_place(m.d, m.slots[3])
    arm = m.slot(3) * turn(PSI)
    assert complex(arm_x, arm_y) == pytest.approx(arm, abs=1e-6)
    assert complex(x, y) == pytest.approx(2 + 1j + arm, abs=1e-6)


def test_a_slot_counts_as_seeing_the_target_within_its_share_of_the_range() -> None:
    m = Mind("constant", own=1, num_trackers=6, formation="ring", sensing_range=2.5, start_distance=(1.0, 2.0))
    m.d.step = 50
    m.target(0j, 0j)
    at = 1.0
    m.slots["x"][2], m.slots["y"][2] = 2.3, 0.0  # in sight
    for k in (0, 1, 3, 4, 5):
        m.slots["x"][k], m.slots["y"][k] = 2.5 + 0.5 * k, 0.0  # out of sight
    assert 2.3 < m.s.in_sight * m.f.sight < 2.5
    assert choose(m, m.slot(0) + at * 0.1, 0.0) == 2
