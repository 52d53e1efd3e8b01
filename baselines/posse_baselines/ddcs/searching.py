"""Searching: exploration that spreads the team over areas not yet covered."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import GRID, Team
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.laws.geometry import length


@compiled
def mark_seen(team: Team, me: Record, seen: npt.NDArray[np.uint16], x: float, y: float, step: int) -> None:
    """Mark the cells of a map (GRID²,) covered by a tracker at (x, y)."""
    world = team.world
    # In cells from the map's corner; the centre of cell i is at i + 0.5.
    scale = GRID / (2.0 * world.area)
    x, y, reach = (x - me.area_x + world.area) * scale, (y - me.area_y + world.area) * scale, world.sight * scale
    for i in range(max(0, math.floor(x - reach)), min(GRID, math.floor(x + reach) + 1)):
        # The cells with centres in range are contiguous in each row.
        square = reach * reach - (i + 0.5 - x) ** 2
        if square <= 0.0:
            continue
        half = math.sqrt(square)
        first = max(0, math.ceil(y - half - 0.5))
        last = min(GRID - 1, math.floor(y + half - 0.5))
        for k in range(i * GRID + first, i * GRID + last + 1):
            seen[k] = step + 1


@compiled(out_of_line=True)
def begin_search(team: Team, me: Record, seen: npt.NDArray[np.uint16]) -> None:
    """Mark the target as lost; on the open plane, search around its predicted position."""
    world = team.world
    me.lost_step, me.goal_step = me.step, -1
    if world.walled == 0 and me.fix_step >= 0:
        me.area_x, me.area_y = me.target_x, me.target_y
        for k in range(len(seen)):
            seen[k] = 0


@compiled
def look_around(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> None:
    """Update the map of areas covered by this tracker and those it hears."""
    world, settings = team.world, team.settings
    if len(seen) == 0 or me.step % max(1, round(settings.look_time / world.dt)) != 0:
        return
    mark_seen(team, me, seen, me.x, me.y, me.step)
    for j in range(len(mates)):
        if mates[j].step >= 0 and (me.step - mates[j].step) * world.dt <= settings.lost_after:
            mark_seen(team, me, seen, mates[j].x, mates[j].y, me.step)


@compiled(out_of_line=True)
def wander(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> tuple[float, float]:
    """Return the velocity (m/s) of a tracker that searches from (x, y)."""
    world, settings = team.world, team.settings
    dx, dy = me.goal_x - me.x, me.goal_y - me.y
    near = settings.goal_reached * min(world.sight, 4.0)
    time = (me.step - me.goal_step) * world.dt
    arrived = dx * dx + dy * dy < near * near and time > settings.look_time
    if me.goal_step < 0 or arrived or time > settings.goal_time:
        choose_goal(team, me, mates, seen)
        dx, dy = me.goal_x - me.x, me.goal_y - me.y
    distance = length(dx, dy)
    if distance < 1e-6:
        return 0.0, 0.0
    return me.max_speed * dx / distance, me.max_speed * dy / distance


@compiled
def age_of(team: Team, me: Record, seen: npt.NDArray[np.uint16], i: int, j: int, lost: bool) -> float:
    """Return the time (s) since a cell (i, j) was last covered, at most ``stale_after``.

    With ``lost``, a cell not covered since the target was lost counts as never covered.
    """
    world, settings = team.world, team.settings
    # Signed: uncompiled, a cell that was never covered would count as one covered last.
    looked = np.int64(seen[i * GRID + j]) - 1 if len(seen) > 0 else -1
    if looked < 0 or (lost and looked < me.lost_step):
        return float(settings.stale_after)
    return min(float((me.step - looked) * world.dt), float(settings.stale_after))


@compiled
def age_around(team: Team, me: Record, seen: npt.NDArray[np.uint16], i: int, j: int, reach: int) -> float:
    """Return the mean age (s) of the cells in a square around a cell; outside, age is 0."""
    total = 0.0
    for k in range(max(0, i - reach), min(GRID, i + reach + 1)):
        for m in range(max(0, j - reach), min(GRID, j + reach + 1)):
            total += age_of(team, me, seen, k, m, False)
    return total / (2 * reach + 1) ** 2


@compiled
def choose_goal(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16]) -> None:
    """Set the goal: near, long not covered, and nearer to this tracker than to any other."""
    at, world, settings = team.at, team.world, team.settings
    cell = 2.0 * world.area / GRID
    inner = world.area - min(1.5, 0.5 * world.area)
    best = -1e9
    reach = 2.0 + settings.lost_drift * (me.step - me.fix_step) * world.dt
    me.goal_x, me.goal_y, me.goal_step = 0.0, 0.0, me.step
    heard = 0
    for m in range(len(mates)):
        if m != me.number and is_there(team, me, mates[m]):
            heard += 1
    deaf = 1.0 - heard / max(1.0, min(at.neighbours, len(mates) - 1.0))
    around = max(1, round(0.7 * world.sight / cell))
    for i in range(GRID):
        for j in range(GRID):
            cx = me.area_x + min(max((i + 0.5) * cell - world.area, -inner), inner)
            cy = me.area_y + min(max((j + 0.5) * cell - world.area, -inner), inner)
            bonus, lost = 0.0, False
            if me.fix_step >= 0:
                # Near the last known position.
                away = length(cx - me.target_x, cy - me.target_y)
                if away < reach:
                    bonus, lost = settings.lost_worth - settings.lost_slope * away, True
            age = age_of(team, me, seen, i, j, lost)
            if settings.swath > 0.0:
                age += settings.swath * (age_around(team, me, seen, i, j, around) - age)
            # A tracker that hears few others stays near the middle, where a report is likely heard.
            bonus -= settings.middle_weight * deaf * length(cx - me.area_x, cy - me.area_y)
            way = length(cx - me.x, cy - me.y)
            turn = 1.0 - ((cx - me.x) * me.heading_cos + (cy - me.y) * me.heading_sin) / max(way, 1e-6)
            value = settings.age_weight * age + bonus - way - settings.turn_weight * turn
            if value <= best:
                continue  # team-mates can only reduce it
            for m in range(len(mates)):
                if m != me.number and is_there(team, me, mates[m]):
                    mx, my = mate_now(team, me, mates[m])
                    # A team-mate's goal counts more than its position.
                    other = length(cx - mx - 2.0 * mates[m].speed_x, cy - my - 2.0 * mates[m].speed_y)
                    if other < way:
                        value -= way - other
            if value > best:
                best, me.goal_x, me.goal_y = value, cx, cy
