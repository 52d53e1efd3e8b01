"""Searching: exploration that spreads the team over areas not yet covered."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Record, Records, compiled, out_of_line
from posse_baselines.ddcs.memory import GRID, Team
from posse_baselines.ddcs.monitoring import is_there, mate_now, silence
from posse_baselines.laws.geometry import clip, dot, length, scaled

_LOOK_TIME: Final = 0.5  # s; between two updates of the map; least time between two goals
_OFF_WALL: Final = 1.5  # m; of a goal
_SWATH: Final = 0.7  # times the range of sight, to either side of a goal
_LOST_SLOPE: Final = 0.3  # what a cell near a lost target is worth less per metre from its predicted position


@compiled
def mark_seen(team: Team, me: Record, seen: npt.NDArray[np.uint16], position: complex) -> None:
    """Mark the cells of a map (GRID²,) covered by a tracker as covered now."""
    world = team.world
    # In cells from the map's corner; the centre of cell i is at i + 0.5.
    scale_x, scale_y = GRID / (2.0 * world.area_x), GRID / (2.0 * world.area_y)
    x = (position.real - me.area.real + world.area_x) * scale_x
    y = (position.imag - me.area.imag + world.area_y) * scale_y
    reach, narrower = world.sight * scale_x, scale_y / scale_x
    for i in range(max(0, math.floor(x - reach)), min(GRID, math.floor(x + reach) + 1)):
        # The cells with centres in range are contiguous in each row.
        square = reach * reach - (i + 0.5 - x) ** 2
        if square <= 0.0:
            continue
        half = math.sqrt(square) * narrower
        first = max(0, math.ceil(y - half - 0.5))
        last = min(GRID - 1, math.floor(y + half - 0.5))
        for k in range(i * GRID + first, i * GRID + last + 1):
            seen[k] = me.step + 1


@out_of_line
def begin_search(team: Team, me: Record, seen: npt.NDArray[np.uint16]) -> None:
    """Mark the target as lost; on the open plane, search around its predicted position."""
    me.lost_step, me.goal_step = me.step, -1
    if team.world.walled == 0 and me.fix_step >= 0:
        me.area = me.target
        for k in range(len(seen)):
            seen[k] = 0


@compiled
def look_around(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> None:
    """Update the map of areas covered by this tracker and those it hears."""
    if len(seen) == 0 or me.step % max(1, round(_LOOK_TIME / team.world.dt)) != 0:
        return
    mark_seen(team, me, seen, me.position)
    for j in range(len(mates)):
        if mates[j].step >= 0 and silence(team, me, mates[j]) <= team.settings.lost_after:
            mark_seen(team, me, seen, mates[j].position)


@out_of_line
def wander(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> complex:
    """Return the velocity (m/s) of a tracker that searches."""
    settings = team.settings
    way = me.goal - me.position
    near = settings.goal_reached * min(team.world.sight, 4.0)
    time = (me.step - me.goal_step) * team.world.dt
    arrived = dot(way, way) < near * near and time > _LOOK_TIME
    if me.goal_step < 0 or arrived or time > settings.goal_time:
        choose_goal(team, me, mates, seen)
        way = me.goal - me.position
    distance = length(way)
    if distance < 1e-6:
        return 0j
    return complex(me.max_speed * way.real / distance, me.max_speed * way.imag / distance)


@compiled
def age_of(team: Team, me: Record, seen: npt.NDArray[np.uint16], i: int, j: int, lost: bool) -> float:
    """Return the time (s) since a cell (i, j) was last covered, at most ``stale_after``.

    With ``lost``, a cell not covered since the target was lost counts as never covered.
    """
    stale = float(team.settings.stale_after)
    # Signed: uncompiled, a cell that was never covered would count as one covered last.
    looked = np.int64(seen[i * GRID + j]) - 1 if len(seen) > 0 else -1
    if looked < 0 or (lost and looked < me.lost_step):
        return stale
    return min(float((me.step - looked) * team.world.dt), stale)


@compiled
def age_around(team: Team, me: Record, seen: npt.NDArray[np.uint16], i: int, j: int) -> float:
    """Return the mean age (s) of the cells in a square as wide as sight around a cell; outside, age is 0."""
    world, total = team.world, 0.0
    wide = max(1, round(_SWATH * world.sight / (2.0 * world.area_x / GRID)))
    high = max(1, round(_SWATH * world.sight / (2.0 * world.area_y / GRID)))
    for k in range(max(0, i - wide), min(GRID, i + wide + 1)):
        for m in range(max(0, j - high), min(GRID, j + high + 1)):
            total += age_of(team, me, seen, k, m, False)
    return float(total / ((2 * wide + 1) * (2 * high + 1)))


@compiled
def choose_goal(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> None:
    """Set the goal: near, long not covered, and nearer to this tracker than to any other."""
    world, settings = team.world, team.settings
    cell_x, cell_y = 2.0 * world.area_x / GRID, 2.0 * world.area_y / GRID
    inner_x = world.area_x - min(_OFF_WALL, 0.5 * world.area_x)
    inner_y = world.area_y - min(_OFF_WALL, 0.5 * world.area_y)
    lost_within = 2.0 + settings.lost_drift * (me.step - me.fix_step) * world.dt
    heard = 0
    for m in range(len(mates)):
        if m != me.number and is_there(team, me, mates[m]):
            heard += 1
    deaf = 1.0 - heard / max(1.0, min(team.at.neighbours, len(mates) - 1.0))
    best, me.goal, me.goal_step = -1e9, 0j, me.step
    for i in range(GRID):
        for j in range(GRID):
            from_middle = complex(
                clip((i + 0.5) * cell_x - world.area_x, -inner_x, inner_x),
                clip((j + 0.5) * cell_y - world.area_y, -inner_y, inner_y),
            )
            place = me.area + from_middle
            bonus, lost = 0.0, False
            if me.fix_step >= 0:
                # Near the last known position.
                away = length(place - me.target)
                if away < lost_within:
                    bonus, lost = settings.lost_worth - _LOST_SLOPE * away, True
            age = age_of(team, me, seen, i, j, lost)
            if settings.swath > 0.0:
                age += settings.swath * (age_around(team, me, seen, i, j) - age)
            # A tracker that hears few others stays near the middle, where a report is likely heard.
            bonus -= settings.middle_weight * deaf * length(place - me.area)
            way = length(place - me.position)
            turn = 1.0 - dot(place - me.position, me.heading) / max(way, 1e-6)
            value = settings.age_weight * age + bonus - way - settings.turn_weight * turn
            if value <= best:
                continue  # team-mates can only reduce it
            for m in range(len(mates)):
                if m != me.number and is_there(team, me, mates[m]):
                    # A team-mate's goal counts more than its position.
                    position, _ = mate_now(team, me, mates[m])
                    other = length(place - position - scaled(mates[m].velocity, 2.0))
                    if other < way:
                        value -= way - other
            if value > best:
                best, me.goal = value, place
