"""Nearby discs of a tracker: known ones, and unexplained echoes of the sonar."""

from __future__ import annotations

import math

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.monitoring import mate_now, patience
from posse_baselines.ddcs.tracking.slots import slot_place
from posse_baselines.laws.geometry import length
from posse_baselines.laws.safeguard import put_disc, put_wall

_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_SLOT_ECHO = 0.25  # m; how well an echo has to fit a slot
_NEAR = 3.0  # m; objects farther away are ignored
_EXPLAINED = 0.06  # m; an echo this near to the expected one needs no other explanation


@compiled
def wall_explains(f: Record, x: float, y: float, beam_x: float, beam_y: float, reading: float) -> bool:
    """Return whether a wall explains a sonar reading (m)."""
    for k in range(4):
        nx, ny = wall_normal(k)
        away = f.extent - nx * x - ny * y
        towards = nx * beam_x + ny * beam_y
        if away >= _NEAR or towards <= 0.0:
            continue
        if towards < f.wide_beam:
            away /= towards
        if reading >= away - f.radius - _EXPLAINED:
            return True
    return False


@compiled
def is_explained(
    f: Record, discs: Records, robots: int, x: float, y: float, beam_x: float, beam_y: float, reading: float
) -> bool:
    """Return whether a known object explains a sonar reading (m).

    One of the ``robots`` that head the list, or a wall. (beam_x, beam_y) is the beam's direction.
    """
    radius, wide_beam = float(f.radius), float(f.wide_beam)
    reach = reading + 2.0 * radius + _EXPLAINED
    for j in range(robots):
        dx, dy = discs[j].x, discs[j].y
        square = dx * dx + dy * dy
        if square > reach * reach:
            continue
        # A little wider than beam and disc, since the position is not exact.
        along, across = dx * beam_x + dy * beam_y, dy * beam_x - dx * beam_y
        if along >= wide_beam * math.sqrt(square) or (along > 0.0 and abs(across) < radius + 0.1):
            return True
    return bool(f.walled) and wall_explains(f, x, y, beam_x, beam_y, reading)


@compiled
def wall_normal(k: int) -> tuple[float, float]:
    """Return the outward normal of one of the four walls."""
    return (1.0 if k == 0 else (-1.0 if k == 1 else 0.0), 1.0 if k == 2 else (-1.0 if k == 3 else 0.0))


@compiled
def slot_in_beam(
    f: Record, d: Record, slots: Records, x: float, y: float, beam_x: float, beam_y: float, reading: float
) -> int:
    """Return the slot whose occupant would give this echo, or -1.

    Where not all team-mates have a place in the observation, an echo from a slot is attributed to
    one of them, moving with the formation.
    """
    for k in range(len(slots)):
        place_x, place_y, _, _ = slot_place(d, slots[k])
        dx, dy = place_x - x, place_y - y
        distance = length(dx, dy)
        fits = abs(distance - 2.0 * f.radius - reading) < _SLOT_ECHO
        if fits and dx * beam_x + dy * beam_y >= f.wide_beam * distance:
            return k
    return -1


@compiled
def surround(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    slots: Records,
    own: int,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    o: FloatArray,
    beams: FloatArray,
    discs: Records,
) -> int:
    """List the nearby discs; return their number."""
    count, two, radius = 0, 2.0 * f.radius, float(f.radius)
    if d.known:
        dx, dy = d.now_x - x, d.now_y - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            # In a chase the target is not avoided: the law ends the chase in time.
            reach, margin = (0.0, 0.0) if d.closing else (two, float(s.target_margin))
            count = put_disc(discs, count, dx, dy, d.speed_x, d.speed_y, reach, margin)
    few = f.neighbours < len(mates) - 1  # not all team-mates have a place in the observation
    for j in range(len(mates)):
        mate = mates[j]
        if j == own or mate.step < 0 or (d.step - mate.step) * f.dt > s.forgotten:
            continue
        mx, my = mate_now(f, s, d, mate)
        dx, dy = mx - x, my - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = float(mate.speed_x), float(mate.speed_y)
            age = (d.step - mate.step) * f.dt
            if age > patience(s, d):
                if few and length(dx, dy) < d.horizon:
                    continue  # there still, it would have a place in the observation
                vx, vy = 0.0, 0.0
            margin = s.margin + s.age_margin * min(age, s.most_age)
            count = put_disc(discs, count, dx, dy, vx, vy, two, margin)
    robots = count
    if f.walled:
        for k in range(4):
            nx, ny = wall_normal(k)
            away = f.extent - nx * x - ny * y
            if away < _NEAR:
                count = put_wall(discs, count, away, nx, ny, f.radius, s.margin)
    strangers = d.known != 0 and few
    if not strangers or d.step % max(1, round(s.taken_memory / f.dt)) == 0:
        d.taken = _NO_BITS
    farthest = f.sonar_range - _EXPLAINED
    for k in range(f.sonar_beams):
        reading = float(o[f.sonar + k])
        if reading >= farthest:
            continue
        beam_x = beams[0, k] * heading_c - beams[1, k] * heading_s
        beam_y = beams[1, k] * heading_c + beams[0, k] * heading_s
        if is_explained(f, discs, robots, x, y, beam_x, beam_y, reading):
            continue
        if strangers:
            k_slot = slot_in_beam(f, d, slots, x, y, beam_x, beam_y, reading)
            if k_slot >= 0:
                d.taken |= _BIT << np.uint64(k_slot)
                place_x, place_y, arm_x, arm_y = slot_place(d, slots[k_slot])
                vx, vy = d.speed_x - d.psi_rate * arm_y, d.speed_y + d.psi_rate * arm_x
                count = put_disc(discs, count, place_x - x, place_y - y, vx, vy, two, s.margin)
                continue
        # Its position within the beam is unknown: a disc that fills most of the beam.
        wide = min(0.5, 0.4 * (reading + radius))
        away = reading + radius + wide
        count = put_disc(discs, count, away * beam_x, away * beam_y, 0.0, 0.0, wide + radius, s.echo_margin)
    return count
