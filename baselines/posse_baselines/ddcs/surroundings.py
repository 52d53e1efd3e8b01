"""Nearby discs of a tracker: known ones, and unexplained echoes of the sonar."""

from __future__ import annotations

import math

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.monitoring import mate_now, patience
from posse_baselines.ddcs.slots import slot_place
from posse_baselines.laws.geometry import length
from posse_baselines.laws.safeguard import put_disc, put_walls, wall_normal

_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_SLOT_ECHO = 0.25  # m; how well an echo has to fit a slot
_NEAR = 3.0  # m; objects farther away are ignored
_EXPLAINED = 0.06  # m; an echo this near to the expected one needs no other explanation


@compiled
def wall_explains(team: Team, me: Record, beam_x: float, beam_y: float, reading: float) -> bool:
    """Return whether a wall explains a sonar reading (m)."""
    world = team.world
    for k in range(4):
        nx, ny = wall_normal(k)
        away = world.extent - nx * me.x - ny * me.y
        towards = nx * beam_x + ny * beam_y
        if away >= _NEAR or towards <= 0.0:
            continue
        if towards < world.wide_beam:
            away /= towards
        if reading >= away - world.radius - _EXPLAINED:
            return True
    return False


@compiled
def is_explained(
    team: Team, me: Record, discs: Records, robots: int, beam_x: float, beam_y: float, reading: float
) -> bool:
    """Return whether a known object explains a sonar reading (m).

    One of the ``robots`` that head the list, or a wall. (beam_x, beam_y) is the beam's direction.
    """
    world = team.world
    radius, wide_beam = float(world.radius), float(world.wide_beam)
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
    return bool(world.walled) and wall_explains(team, me, beam_x, beam_y, reading)


@compiled
def slot_in_beam(team: Team, me: Record, beam_x: float, beam_y: float, reading: float) -> int:
    """Return the slot whose occupant would give this echo, or -1.

    Where not all team-mates have a place in the observation, an echo from a slot is attributed to
    one of them, moving with the formation.
    """
    world = team.world
    for k in range(len(team.slots)):
        place_x, place_y, _, _ = slot_place(me, team.slots[k])
        dx, dy = place_x - me.x, place_y - me.y
        distance = length(dx, dy)
        fits = abs(distance - 2.0 * world.radius - reading) < _SLOT_ECHO
        if fits and dx * beam_x + dy * beam_y >= world.wide_beam * distance:
            return k
    return -1


@compiled
def surround(team: Team, me: Record, mates: Records, row: FloatArray, discs: Records) -> int:
    """List the nearby discs; return their number."""
    at, world, settings = team.at, team.world, team.settings
    count, two, radius = 0, 2.0 * world.radius, float(world.radius)
    if me.known:
        dx, dy = me.target_x - me.x, me.target_y - me.y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            # In a chase the target is not avoided: the law ends the chase in time.
            reach, margin = (0.0, 0.0) if me.closing else (two, float(settings.target_margin))
            count = put_disc(discs, count, dx, dy, me.target_vx, me.target_vy, reach, margin)
    few = at.neighbours < len(mates) - 1  # not all team-mates have a place in the observation
    for j in range(len(mates)):
        mate = mates[j]
        if j == me.number or mate.step < 0 or (me.step - mate.step) * world.dt > settings.forgotten:
            continue
        mx, my = mate_now(team, me, mate)
        dx, dy = mx - me.x, my - me.y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = float(mate.speed_x), float(mate.speed_y)
            age = (me.step - mate.step) * world.dt
            if age > patience(team, me):
                if few and length(dx, dy) < me.horizon:
                    continue  # there still, it would have a place in the observation
                vx, vy = 0.0, 0.0
            margin = settings.margin + settings.age_margin * min(age, settings.most_age)
            count = put_disc(discs, count, dx, dy, vx, vy, two, margin)
    robots = count
    if world.walled:
        count = put_walls(discs, count, me.x, me.y, world.extent, _NEAR, world.radius, settings.margin)
    strangers = me.known != 0 and few
    if not strangers or me.step % max(1, round(settings.taken_memory / world.dt)) == 0:
        me.taken = _NO_BITS
    farthest = world.sonar_range - _EXPLAINED
    for k in range(at.sonar_beams):
        reading = float(row[at.sonar + k])
        if reading >= farthest:
            continue
        beam_x = team.beams[0, k] * me.heading_cos - team.beams[1, k] * me.heading_sin
        beam_y = team.beams[1, k] * me.heading_cos + team.beams[0, k] * me.heading_sin
        if is_explained(team, me, discs, robots, beam_x, beam_y, reading):
            continue
        if strangers:
            k_slot = slot_in_beam(team, me, beam_x, beam_y, reading)
            if k_slot >= 0:
                me.taken |= _BIT << np.uint64(k_slot)
                place_x, place_y, arm_x, arm_y = slot_place(me, team.slots[k_slot])
                vx, vy = me.target_vx - me.psi_rate * arm_y, me.target_vy + me.psi_rate * arm_x
                count = put_disc(discs, count, place_x - me.x, place_y - me.y, vx, vy, two, settings.margin)
                continue
        # Its position within the beam is unknown: a disc that fills most of the beam.
        wide = min(0.5, 0.4 * (reading + radius))
        away = reading + radius + wide
        count = put_disc(discs, count, away * beam_x, away * beam_y, 0.0, 0.0, wide + radius, settings.echo_margin)
    return count
