"""What is near a tracker, as discs: those it knows, and those that only the sonar tells of."""

from __future__ import annotations

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse_baselines.ddcs.monitoring import mate_now, patience
from posse_baselines.ddcs.slots import slot_place
from posse_baselines.guidance import length
from posse_baselines.safeguard import put_disc, put_wall

_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_SLOT_ECHO = 0.25  # m; how well an echo has to fit a slot
_NEAR = 3.0  # m; farther things are no danger yet
_NOTHING = 1e-3  # m; a reading this near to the sonar's reach means that nothing is there
_EXPLAINED = 0.06  # m; an echo this near to the expected one needs no other explanation
_MOST_AGE = 0.7  # s; a team-mate is not made wider for an older message
_FORGOTTEN = 30.0  # s; where a team-mate that long silent stands is anybody's guess


@compiled
def expect_disc(
    f: Record, beams: FloatArray, ahead: float, left: float, radius: float, echo: FloatArray
) -> None:
    """Lower the expected sonar readings (S,) by a disc that lies (ahead, left) of the tracker."""
    distance = length(ahead, left)
    gap = distance - radius - f.radius
    if gap > f.sonar_range + 0.2:
        return
    # A little wider than the beam and the disc, since the place is not known exactly.
    in_width = f.wide_beam * distance
    for k in range(f.sonar_beams):
        along = ahead * beams[0, k] + left * beams[1, k]
        across = left * beams[0, k] - ahead * beams[1, k]
        if along >= in_width or (along > 0.0 and abs(across) < radius + 0.1):
            echo[k] = min(echo[k], gap)


@compiled
def expect_wall(
    f: Record, beams: FloatArray, ahead: float, left: float, distance: float, echo: FloatArray
) -> None:
    """Lower the expected readings (S,) by a wall whose outward normal points (ahead, left)."""
    for k in range(f.sonar_beams):
        towards = ahead * beams[0, k] + left * beams[1, k]
        if towards >= f.wide_beam:
            echo[k] = min(echo[k], distance - f.radius)
        elif towards > 0.0:
            echo[k] = min(echo[k], distance / towards - f.radius)


@compiled
def hears_echo(f: Record, o: FloatArray) -> bool:
    """Say whether any sonar beam finds anything."""
    for k in range(f.sonar_beams):  # noqa: SIM110 (numba compiles no generator)
        if o[f.sonar + k] < f.sonar_range - _NOTHING:
            return True
    return False


@compiled
def slot_in_beam(
    f: Record,
    d: Record,
    slots: Records,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    beam_c: float,
    beam_s: float,
    reading: float,
) -> int:
    """Return the slot whose occupant would give this echo, or -1.

    Where not all team-mates have a place in the observation, an echo from a slot is taken for one
    of them, who moves with the formation.
    """
    ux = beam_c * heading_c - beam_s * heading_s
    uy = beam_s * heading_c + beam_c * heading_s
    for k in range(len(slots)):
        place_x, place_y, _, _ = slot_place(d, slots[k])
        dx, dy = place_x - x, place_y - y
        distance = length(dx, dy)
        fits = abs(distance - 2.0 * f.radius - reading) < _SLOT_ECHO
        if fits and dx * ux + dy * uy >= f.wide_beam * distance:
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
    echo: FloatArray,
    discs: Records,
) -> int:
    """List what is near the tracker; return how many things. ``echo`` (S,) is work space."""
    c, sn = heading_c, heading_s
    listening = hears_echo(f, o)
    for k in range(f.sonar_beams):
        echo[k] = f.sonar_range
    count, two, radius = 0, 2.0 * f.radius, float(f.radius)
    if d.known:
        dx, dy = d.now_x - x, d.now_y - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            count = put_disc(discs, count, dx, dy, d.speed_x, d.speed_y, two, s.target_margin)
            if listening:
                expect_disc(f, beams, dx * c + dy * sn, dy * c - dx * sn, radius, echo)
    for j in range(len(mates)):
        mate = mates[j]
        if j == own or mate.step < 0 or (d.step - mate.step) * f.dt > _FORGOTTEN:
            continue
        mx, my = mate_now(f, s, d, mate)
        dx, dy = mx - x, my - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = float(mate.speed_x), float(mate.speed_y)
            age = (d.step - mate.step) * f.dt
            if age > patience(s, d):
                vx, vy = 0.0, 0.0
            margin = s.margin + s.age_margin * min(age, _MOST_AGE)
            count = put_disc(discs, count, dx, dy, vx, vy, two, margin)
            if listening:
                expect_disc(f, beams, dx * c + dy * sn, dy * c - dx * sn, radius, echo)
    if f.walled:
        half = float(f.extent)
        for k in range(4):
            nx = 1.0 if k == 0 else (-1.0 if k == 1 else 0.0)
            ny = 1.0 if k == 2 else (-1.0 if k == 3 else 0.0)
            away = half - nx * x - ny * y
            if away < _NEAR:
                count = put_wall(discs, count, away, nx, ny, f.radius, s.margin)
                if listening:
                    expect_wall(f, beams, nx * c + ny * sn, ny * c - nx * sn, away, echo)
    d.taken = _NO_BITS
    if not listening:
        return count
    strangers = d.known != 0 and f.neighbours < len(mates) - 1
    for k in range(f.sonar_beams):
        reading = float(o[f.sonar + k])
        if reading < f.sonar_range - _NOTHING and reading < echo[k] - _EXPLAINED:
            if strangers:
                k_slot = slot_in_beam(f, d, slots, x, y, c, sn, beams[0, k], beams[1, k], reading)
                if k_slot >= 0:
                    d.taken |= _BIT << np.uint64(k_slot)
                    place_x, place_y, arm_x, arm_y = slot_place(d, slots[k_slot])
                    vx = d.speed_x - d.psi_rate * arm_y
                    vy = d.speed_y + d.psi_rate * arm_x
                    count = put_disc(discs, count, place_x - x, place_y - y, vx, vy, two, s.margin)
                    continue
            # It may lie anywhere in the beam's width: a disc that fills most of it.
            wide = min(0.5, 0.4 * (reading + radius))
            away = reading + radius + wide
            bx, by = beams[0, k] * c - beams[1, k] * sn, beams[1, k] * c + beams[0, k] * sn
            count = put_disc(
                discs, count, away * bx, away * by, 0.0, 0.0, wide + radius, s.echo_margin
            )
    return count
