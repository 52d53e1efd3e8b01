"""Searching: exploration that spreads the team over areas not yet covered."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import GRID
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.laws.geometry import length


@compiled
def mark_seen(f: Record, d: Record, seen: npt.NDArray[np.uint16], x: float, y: float, step: int) -> None:
    """Mark the cells of a map (GRID²,) covered by a tracker at (x, y)."""
    # In cells from the map's corner; the centre of cell i is at i + 0.5.
    scale = GRID / (2.0 * f.area)
    x, y, reach = (x - d.area_x + f.area) * scale, (y - d.area_y + f.area) * scale, f.sight * scale
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


@compiled(seldom=True)
def begin_search(f: Record, d: Record, seen: npt.NDArray[np.uint16]) -> None:
    """Mark the target as lost; on the open plane, search around its predicted position."""
    d.lost_step, d.goal_step = d.step, -1
    if f.walled == 0 and d.fix_step >= 0:
        d.area_x, d.area_y = d.now_x, d.now_y
        for k in range(len(seen)):
            seen[k] = 0


@compiled
def look_around(
    f: Record, s: Record, d: Record, mates: Records, seen: npt.NDArray[np.uint16], x: float, y: float
) -> None:
    """Update the map of areas covered by this tracker and those it hears."""
    if len(seen) == 0 or d.step % max(1, round(s.look_time / f.dt)) != 0:
        return
    mark_seen(f, d, seen, x, y, d.step)
    for j in range(len(mates)):
        if mates[j].step >= 0 and (d.step - mates[j].step) * f.dt <= s.lost_after:
            mark_seen(f, d, seen, mates[j].x, mates[j].y, d.step)


@compiled(seldom=True)
def wander(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    own: int,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    max_speed: float,
) -> tuple[float, float]:
    """Return the velocity (m/s) of a tracker that searches from (x, y)."""
    dx, dy = d.goal_x - x, d.goal_y - y
    near = s.goal_reached * min(f.sight, 4.0)
    time = (d.step - d.goal_step) * f.dt
    arrived = dx * dx + dy * dy < near * near and time > s.look_time
    if d.goal_step < 0 or arrived or time > s.goal_time:
        choose_goal(f, s, d, mates, seen, own, x, y, heading_c, heading_s)
        dx, dy = d.goal_x - x, d.goal_y - y
    distance = length(dx, dy)
    if distance < 1e-6:
        return 0.0, 0.0
    return max_speed * dx / distance, max_speed * dy / distance


@compiled
def age_of(f: Record, s: Record, d: Record, seen: npt.NDArray[np.uint16], i: int, j: int, lost: bool) -> float:
    """Return the time (s) since a cell (i, j) was last covered, at most ``stale_after``.

    With ``lost``, a cell not covered since the target was lost counts as never covered.
    """
    # Signed: uncompiled, a cell that was never covered would count as one covered last.
    looked = np.int64(seen[i * GRID + j]) - 1 if len(seen) > 0 else -1
    if looked < 0 or (lost and looked < d.lost_step):
        return float(s.stale_after)
    return min(float((d.step - looked) * f.dt), float(s.stale_after))


@compiled
def age_around(f: Record, s: Record, d: Record, seen: npt.NDArray[np.uint16], i: int, j: int, reach: int) -> float:
    """Return the mean age (s) of the cells in a square around a cell; outside, age is 0."""
    total = 0.0
    for k in range(max(0, i - reach), min(GRID, i + reach + 1)):
        for m in range(max(0, j - reach), min(GRID, j + reach + 1)):
            total += age_of(f, s, d, seen, k, m, False)
    return total / (2 * reach + 1) ** 2


@compiled
def choose_goal(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    own: int,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
) -> None:
    """Set the goal: near, long not covered, and nearer to this tracker than to any other."""
    cell = 2.0 * f.area / GRID
    inner = f.area - min(1.5, 0.5 * f.area)
    best = -1e9
    reach = 2.0 + s.lost_drift * (d.step - d.fix_step) * f.dt
    d.goal_x, d.goal_y, d.goal_step = 0.0, 0.0, d.step
    heard = 0
    for m in range(len(mates)):
        if m != own and is_there(f, s, d, mates[m], len(mates)):
            heard += 1
    deaf = 1.0 - heard / max(1.0, min(f.neighbours, len(mates) - 1.0))
    around = max(1, round(0.7 * f.sight / cell))
    for i in range(GRID):
        for j in range(GRID):
            cx = d.area_x + min(max((i + 0.5) * cell - f.area, -inner), inner)
            cy = d.area_y + min(max((j + 0.5) * cell - f.area, -inner), inner)
            bonus, lost = 0.0, False
            if d.fix_step >= 0:
                # Near the last known position.
                away = length(cx - d.now_x, cy - d.now_y)
                if away < reach:
                    bonus, lost = s.lost_worth - s.lost_slope * away, True
            age = age_of(f, s, d, seen, i, j, lost)
            if s.swath > 0.0:
                age += s.swath * (age_around(f, s, d, seen, i, j, around) - age)
            # A tracker that hears few others stays near the middle, where a report is likely heard.
            bonus -= s.middle_weight * deaf * length(cx - d.area_x, cy - d.area_y)
            way = length(cx - x, cy - y)
            turn = 1.0 - ((cx - x) * heading_c + (cy - y) * heading_s) / max(way, 1e-6)
            value = s.age_weight * age + bonus - way - s.turn_weight * turn
            if value <= best:
                continue  # team-mates can only reduce it
            for m in range(len(mates)):
                if m != own and is_there(f, s, d, mates[m], len(mates)):
                    mx, my = mate_now(f, s, d, mates[m])
                    # A team-mate's goal counts more than its position.
                    other = length(cx - mx - 2.0 * mates[m].speed_x, cy - my - 2.0 * mates[m].speed_y)
                    if other < way:
                        value -= way - other
            if value > best:
                best, d.goal_x, d.goal_y = value, cx, cy
