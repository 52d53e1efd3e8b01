"""Nearby discs of a tracker: known ones, and unexplained echoes of the sonar."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.monitoring import mate_now, patience, silence
from posse_baselines.laws.geometry import cross, dot, length, scaled
from posse_baselines.laws.safeguard import NEAR, WALLS, put_disc, put_walls, to_wall
from posse_baselines.laws.steering import slot_velocity

_SLOT_ECHO: Final = 0.25  # m; how well an echo has to fit a slot
_EXPLAINED: Final = 0.06  # m; an echo this near to the expected one needs no other explanation
_TAKEN_TIME: Final = 3.0  # s; longest time for which a slot counts as taken after an echo from it
_MOST_AGE: Final = 0.7  # s; of a message, up to which the margin of its sender grows
_FORGOTTEN: Final = 30.0  # s; silence after which a team-mate is no longer assumed at its last position


@compiled
def is_explained(team: Team, me: Record, robots: Records, beam: complex, reading: float) -> bool:
    """Return whether one of the known robots (discs), or a wall, explains a sonar reading (m) along a beam."""
    world, radius, wide_beam = team.world, float(team.world.radius), float(team.world.wide_beam)
    reach = reading + 2.0 * radius + _EXPLAINED
    for j in range(len(robots)):
        place = robots[j].place
        square = dot(place, place)
        if square > reach * reach:
            continue
        # A little wider than beam and disc, since the position is not exact.
        along = dot(place, beam)
        if along >= wide_beam * math.sqrt(square) or (along > 0.0 and abs(cross(place, beam)) < radius + 0.1):
            return True
    if world.walled:
        for k in range(4):
            away, towards = to_wall(world, k, me.position), dot(WALLS[k], beam)
            if away < NEAR and towards > 0.0:
                away = away / towards if towards < wide_beam else away
                if reading >= away - radius - _EXPLAINED:
                    return True
    return False


@compiled
def slot_in_beam(team: Team, me: Record, beam: complex, reading: float) -> int:
    """Return the slot whose occupant would give this echo, or -1.

    Where not all team-mates have a place in the observation, an echo from a slot is attributed to
    one of them, moving with the formation.
    """
    for k in range(len(team.slots)):
        way = me.target + team.slots[k] * me.frame - me.position
        distance = length(way)
        fits = abs(distance - 2.0 * team.world.radius - reading) < _SLOT_ECHO
        if fits and dot(way, beam) >= team.world.wide_beam * distance:
            return k
    return -1


@compiled
def surround(team: Team, me: Record, mates: Records, row: FloatArray, discs: Records) -> int:
    """List the nearby discs; return their number."""
    at, world, settings = team.at, team.world, team.settings
    count, two, radius = 0, 2.0 * world.radius, float(world.radius)
    if me.known:
        way = me.target - me.position
        if dot(way, way) < NEAR * NEAR:
            # In a chase the target is not avoided: the law ends the chase in time.
            reach, margin = (0.0, 0.0) if me.closing else (two, float(settings.target_margin))
            count = put_disc(discs, count, way, me.target_velocity, reach, margin)
    few = at.neighbours < len(mates) - 1  # not all team-mates have a place in the observation
    for j in range(len(mates)):
        mate = mates[j]
        age = silence(team, me, mate)
        if j == me.number or mate.step < 0 or age > _FORGOTTEN:
            continue
        position, velocity = mate_now(team, me, mate)
        way = position - me.position
        # If it were still there after a silence, it would have a place in the observation.
        gone = few and age > patience(team, me) and length(way) < me.horizon
        if dot(way, way) < NEAR * NEAR and not gone:
            margin = settings.margin + settings.age_margin * min(age, _MOST_AGE)
            count = put_disc(discs, count, way, velocity, two, margin)
    robots = count
    if world.walled:
        count = put_walls(discs, count, world, me.position, world.radius, settings.margin)
    strangers = me.known != 0 and few
    if not strangers or me.step % max(1, round(_TAKEN_TIME / world.dt)) == 0:
        me.taken = np.uint64(0)
    for k in range(at.sonar_beams):
        reading = float(row[at.sonar + k])
        beam = team.beams[k] * me.heading
        if reading >= world.sonar_range - _EXPLAINED or is_explained(team, me, discs[:robots], beam, reading):
            continue
        slot = slot_in_beam(team, me, beam, reading) if strangers else -1
        if slot >= 0:
            me.taken |= np.uint64(1) << np.uint64(slot)
            arm = team.slots[slot] * me.frame
            velocity = slot_velocity(me.target_velocity, me.psi_rate, arm)
            count = put_disc(discs, count, me.target + arm - me.position, velocity, two, settings.margin)
            continue
        # Its position within the beam is unknown: a disc that fills most of the beam.
        wide = min(0.5, 0.4 * (reading + radius))
        place = scaled(beam, reading + radius + wide)
        count = put_disc(discs, count, place, 0j, wide + radius, settings.echo_margin)
    return count
