"""The discs around a tracker, case by case."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

surroundings, safeguard = plain("ddcs.surroundings"), plain("laws.safeguard")
WIDE = math.cos(1.2 * math.pi / 8)


def listed(m: Mind, position: complex = 0j, heading: float = 0.0, room: int = 20) -> Any:
    m.stand(position, heading)
    discs = np.zeros(room, safeguard.DISC)
    facing = turn(heading)
    angles = 2 * np.pi * np.arange(8) / 8
    beams = np.stack([np.cos(angles), np.sin(angles)]).astype(np.float32)
    count = surroundings.surround(
        m.f,
        m.s,
        m.d,
        m.mates,
        m.slots,
        m.own,
        position.real,
        position.imag,
        facing.real,
        facing.imag,
        m.o,
        beams,
        discs,
    )
    return [[float(v) for v in discs[k].item()] for k in range(count)]


def disc(at: complex, velocity: complex, reach: float, margin: float) -> Any:
    return pytest.approx([at.real, at.imag, velocity.real, velocity.imag, reach, margin], rel=1e-6, abs=1e-5)


def open_plane(**world: Any) -> Mind:
    m = Mind("constant", own=1, **world)
    m.d.step = 40
    return m


def echo(m: Mind, beam: int, reading: float) -> None:
    m.o[m.f.sonar + beam] = reading


def test_the_target_is_kept_off_unless_a_chase_closes_in() -> None:
    m = open_plane()
    m.target(2 + 1j, 0.3 - 0.1j)
    assert listed(m) == [disc(2 + 1j, 0.3 - 0.1j, 0.3, m.s.target_margin)]
    assert listed(m, 0.5 - 0.5j) == [disc(1.5 + 1.5j, 0.3 - 0.1j, 0.3, m.s.target_margin)]
    m.d.closing = 1
    assert listed(m) == [disc(2 + 1j, 0.3 - 0.1j, 0.0, 0.0)]
    m.target(2.99 + 0j, 0j)
    assert len(listed(m)) == 1
    m.target(3.01 + 0j, 0j)
    assert listed(m) == []
    m.target(2.9 + 1j, 0j)
    assert listed(m) == []
    m.target(1 + 0j, known=0)
    assert listed(m) == []


def test_team_mates_are_kept_off_farther_the_older_their_message() -> None:
    m = open_plane()
    m.mate(0, 1 + 1j, 0.4 + 0.2j)
    m.mate(2, -1 + 1j, 0.4 + 0.2j, step=38)
    m.mate(3, -1 - 1j, 0.4 + 0.2j, step=20)  # silent for too long: it counts as stopped
    m.mate(4, 1 + 4j, 0j)
    m.mate(1, 0.5 + 0j)  # itself
    found = listed(m)
    assert found == [
        disc(1 + 1j, 0.4 + 0.2j, 0.3, 0.15),
        disc(-1 + 1j + 0.2 * (0.4 + 0.2j), 0.4 + 0.2j, 0.3, 0.15 + 0.2 * 0.15),
        disc(-1 - 1j, 0j, 0.3, 0.15 + 0.7 * 0.15),
    ]
    assert listed(m, 0.2 + 0.1j)[0] == disc(0.8 + 0.9j, 0.4 + 0.2j, 0.3, 0.15)
    m.d.step = 345
    m.mates[3].step = 42
    assert [d[:2] for d in listed(m)] == []  # forgotten after 30 s
    m.mates[3].step = 47
    assert len(listed(m)) == 1
    m.mates[2].step = m.mates[3].step = -1
    m.d.step = 10
    m.mates[0].step = 0
    assert len(listed(m)) == 1
    assert len(listed(m, room=0)) == 0


def test_a_silent_one_stops_and_is_forgotten_beyond_the_bounds() -> None:
    m = open_plane()
    m.f.dt, m.d.usual_gap = 0.5, 0.6  # the timeout is 1.5 s
    m.mate(0, 1 + 1j, 0.4 + 0j, step=10)
    for step, at, velocity in ((13, 1.6 + 1j, 0.4 + 0j), (14, 1 + 1j, 0j), (70, 1 + 1j, 0j)):
        m.d.step = step
        assert listed(m) == [disc(at, velocity, 0.3, 0.15 + 0.7 * 0.15)]
    m.d.step = 71
    assert listed(m) == []


def test_one_that_would_have_a_place_in_the_observation_has_gone() -> None:
    m = open_plane(num_trackers=6, num_neighbours=4)
    m.mate(0, 1 + 0j, step=10)
    m.d.horizon = 0.9
    assert listed(m) == [disc(1 + 0j, 0j, 0.3, 0.15 + 0.7 * 0.15)]
    m.d.horizon = 1.1
    assert listed(m) == []
    m.mate(3, 1 + 0j)
    assert listed(m) == [disc(1 + 0j, 0j, 0.3, 0.15)]  # the others are still there
    m.mates[3].step = -1
    m.mate(0, 1 + 0j, step=39)
    assert len(listed(m)) == 1
    few = open_plane()  # all have a place
    few.mate(0, 1 + 0j, step=10)
    few.d.horizon = 1.1
    assert len(listed(few)) == 1


def test_walls_are_large_discs() -> None:
    m = Mind("field", own=1)
    extent, planet = float(m.f.extent), 1000.0
    for k, normal in enumerate((1, -1, 1j, -1j)):
        assert complex(*surroundings.wall_normal(k)) == normal
        at = complex(normal) * (extent - 2.0)
        assert listed(m, at) == [disc(normal * (2.0 - 0.15 + planet), 0j, planet, 0.15)]
        assert listed(m, complex(normal) * (extent - 3.1)) == []
    assert len(listed(m, (extent - 2.9) * (1 + 1j))) == 2
    narrow = Mind("field", own=1)
    narrow.f.extent = 2.0
    assert len(listed(narrow)) == 4
    m.mate(3, (extent - 1.0) * (1 + 0j))
    m.d.step = 0
    m.mates[3].step = 0
    assert len(listed(m, (extent - 2.0) * (1 + 0j))) == 2


@pytest.mark.parametrize("heading", [0.0, 1.0])
@pytest.mark.parametrize("beam", [0, 2, 5])
def test_an_echo_without_an_explanation_is_a_disc_that_fills_the_beam(beam: int, heading: float) -> None:
    m = open_plane()
    direction = turn(heading + beam * math.pi / 4)
    for reading in (0.4, 1.5):
        echo(m, beam, reading)
        wide = min(0.5, 0.4 * (reading + 0.15))
        away = reading + 0.15 + wide
        assert listed(m, 1 + 1j, heading) == [disc(away * direction, 0j, wide + 0.15, m.s.echo_margin)]
    echo(m, beam, 1.95)
    assert listed(m, 1 + 1j, heading) == []
    echo(m, beam, 1.93)
    assert len(listed(m, 1 + 1j, heading)) == 1


def test_what_is_too_far_to_explain_an_echo_hides_nothing_that_does() -> None:
    m = open_plane()
    m.mate(0, 2.5 + 0j)
    m.mate(2, 1.3 + 0j)
    echo(m, 0, 1.0)
    assert len(listed(m)) == 2
    echo(m, 1, 1.0)
    assert len(listed(m)) == 3  # that one is not explained


def explained(m: Mind, x: float, y: float, reading: float, robots: int = 1) -> bool:
    discs = np.zeros(2, safeguard.DISC)
    discs[0].x, discs[0].y = x, y
    beam = turn(0.6)
    place = complex(x, y) * beam
    discs[0].x, discs[0].y = place.real, place.imag
    return bool(surroundings.is_explained(m.f, discs, robots, 0.0, 0.0, beam.real, beam.imag, reading))


def test_a_robot_explains_an_echo_from_its_distance_in_its_beam() -> None:
    m = open_plane()
    # The beam is along x, here; 1.2 of half its width is 27 degrees.
    assert explained(m, 1.3, 0.0, 1.0)
    assert not explained(m, 1.3, 0.0, 1.0, robots=0)
    assert explained(m, 1.35, 0.0, 1.0)
    assert not explained(m, 1.37, 0.0, 1.0)  # farther than the echo: 0.3 and 0.06 m
    assert explained(m, 0.5, 0.0, 1.0)
    assert explained(m, math.cos(0.46), math.sin(0.46), 1.0)
    assert not explained(m, math.cos(0.49), math.sin(0.49), 1.0)
    assert not explained(m, 1.2 * math.cos(0.49), 1.2 * math.sin(0.49), 1.0)
    assert explained(m, 0.3, 0.24, 1.0)  # the beam touches it
    assert explained(m, 0.3, -0.24, 1.0)
    assert not explained(m, 0.3, 0.27, 1.0)
    assert not explained(m, -0.3, 0.1, 1.0)
    assert not explained(m, 1.0, 0.98, 1.0)  # beyond its reach
    assert not explained(m, 0.0, 0.1, 1.0)


def by_wall(m: Mind, x: float, y: float, angle: float, reading: float) -> bool:
    beam = turn(angle)
    return bool(surroundings.wall_explains(m.f, x, y, beam.real, beam.imag, reading))


def test_a_wall_explains_an_echo_from_where_the_beam_meets_it() -> None:
    m = Mind("field")
    e = float(m.f.extent)
    for k in range(4):
        normal = turn(k * math.pi / 2)
        at = normal * (e - 1.5)
        angle = k * math.pi / 2
        assert by_wall(m, at.real, at.imag, angle, 1.30)
        assert not by_wall(m, at.real, at.imag, angle, 1.28)
        assert by_wall(m, at.real, at.imag, angle + 0.45, 1.30)  # within the beam: its near edge
        oblique = 1.5 / math.cos(0.8) - 0.21
        assert by_wall(m, at.real, at.imag, angle + 0.8, oblique + 0.01)
        assert not by_wall(m, at.real, at.imag, angle + 0.8, oblique - 0.01)
        assert not by_wall(m, at.real, at.imag, angle + math.pi, 1.9)
        assert not by_wall(m, at.real, at.imag, angle + math.pi / 2 + 1e-3, 1.9)
        far = normal * (e - 3.05)
        assert not by_wall(m, far.real, far.imag, angle, 3.0)
    assert not surroundings.wall_explains(m.f, e - 1.5, 0.0, 0.0, 1.0, 1.9)  # along the wall
    away = Mind("constant")
    away.f.extent = 2.0
    discs = np.zeros(1, safeguard.DISC)
    for walled in (0, 1):
        away.f.walled = walled
        assert surroundings.is_explained(away.f, discs, 0, 0.5, 0.0, 1.0, 0.0, 1.4) == bool(walled)


def strangers() -> Mind:
    """Tracker 1 of six, who hears two at most, at rest ahead of slot 3 of a moving target."""
    m = open_plane(num_trackers=6, num_neighbours=2, formation="ring")
    m.target(0j, 0.5 + 0.1j, psi=0.4, psi_rate=0.2)
    return m


@pytest.mark.parametrize("slot", [0, 3])
def test_an_echo_from_a_slot_is_a_team_mate_in_it(slot: int) -> None:
    m = strangers()
    arm = m.slot(slot) * turn(0.4)
    away = arm / abs(arm)
    at = arm + 1.2 * away
    heading = math.atan2(-away.imag, -away.real)
    echo(m, 0, 0.95)  # 1.2 m less two radii is 0.9
    moving = 0.5 + 0.1j + 0.2j * arm
    found = listed(m, at, heading)
    assert found[-1] == disc(arm - at, moving, 0.3, 0.15)
    assert m.d.taken == 1 << slot
    echo(m, 0, 1.12)
    assert listed(m, at, heading)[-1] == disc(arm - at, moving, 0.3, 0.15)
    echo(m, 4, 1.0)
    assert listed(m, at, heading)[-2] == disc(arm - at, moving, 0.3, 0.15)
    echo(m, 4, 2.0)
    echo(m, 0, 1.2)  # too far from the slot's
    assert listed(m, at, heading)[-1][4] > 0.4
    m.d.step = 41
    echo(m, 0, 2.0)
    listed(m, at, heading)
    assert m.d.taken == 1 << slot  # remembered
    m.d.step = 60
    listed(m, at, heading)
    assert m.d.taken == 0  # every three seconds
    m.d.step, m.d.taken = 61, np.uint64(5)
    m.d.known = 0
    listed(m, at, heading)
    assert m.d.taken == 0


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_an_echo_can_be_remembered_for_one_step(dt: float) -> None:
    m = strangers()
    m.s.taken_memory, m.f.dt = 0.1, dt
    for step in (60, 61, 62):
        m.d.step, m.d.taken = step, np.uint64(5)
        listed(m, 9 + 0j)
        assert m.d.taken == 0


def test_a_slot_beside_the_beam_gives_no_echo() -> None:
    m = strangers()
    x, y, _, _ = plain("ddcs.tracking.slots").slot_place(m.d, m.slots[3])
    place = complex(x, y)
    for aside, found in ((0.0, 3), (0.45, 3), (0.5, -1), (-0.45, 3)):
        beam = turn(2.0 + aside)
        at = place - 1.2 * turn(2.0)

        def slot(reading: float, beam: complex = beam, at: complex = at) -> int:
            return int(surroundings.slot_in_beam(m.f, m.d, m.slots, at.real, at.imag, beam.real, beam.imag, reading))

        assert slot(0.9) == found
        assert slot(0.66) == found
        assert slot(0.64) == -1
