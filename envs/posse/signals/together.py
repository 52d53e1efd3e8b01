"""What trackers observe of themselves, their target and their team: eight at once, a lane each.

The eight are one tracker of eight worlds (``across`` is 1) or, where there are fewer worlds or the
team is large, the trackers of one (0).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    WIDTH,
    FloatArray,
    Record,
    Records,
    choose,
    compiled,
    eight,
    greater,
    load,
    root,
    store,
    transpose,
)
from posse.rules.discs import natural, within_one
from posse.rules.state import FIX, NEVER, POSE, WorldArrays
from posse.signals.mates import observe_mates
from posse.signals.scratch import MOST_IN_TEAM
from posse.signals.team import lay_out_team, team_columns, write_rows

TOGETHER: Final = WIDTH
"""Worlds that are observed together."""

# Where in an observation its parts begin: own motion at 0, then the task, the target, the sonar,
# and team-mates.
TASK_AT: Final = 8
TARGET_AT: Final = TASK_AT + 18
SONAR_AT: Final = TARGET_AT + 12

_NUMBER_AT: Final = np.float32(3)  # in the task's part: which tracker it is
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)


@compiled
def lay_out_task(c: Record, s: Record) -> None:
    """Write what every tracker of every world is told of its task to a row of scratch memory."""
    for k in range(2 * WIDTH):
        s.task[k] = _ZERO
    s.task[c.formation] = _ONE
    s.task[4] = np.float32(c.num_trackers)
    s.task[5] = c.formation_distance
    s.task[6] = c.formation_spacing
    s.task[7] = c.tracker_speed
    s.task[8] = c.tracker_turn_rate
    s.task[9] = c.acceleration_time
    s.task[10] = c.turn_acceleration_time
    s.task[11] = c.tolerance
    s.task[12] = c.radius
    s.task[13] = c.dt
    s.task[14] = c.told_sensing_range
    s.task[15] = c.sonar_range


@compiled
def write_task(number: int, s: Record, o: FloatArray) -> None:
    """Write what a tracker is told of its task, but for the last two."""
    store(o, TASK_AT, choose(load(s.index, 0) == _NUMBER_AT, np.float32(number), load(s.task, 0)))
    store(o, TASK_AT + WIDTH, load(s.task, WIDTH))


@compiled
def observe_own_and_target(
    c: Record,
    world: Records,
    tracker: Records,
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what observers know of themselves and of their target.

    They are ``count`` trackers, the first of them i of world e.
    """
    for lane in range(count):
        to, who = natural(e + lane * across), natural(i + lane * (1 - across))
        t, o = tracker[to, who], observations[to, who]
        s.step[lane] = np.float32(world[to].step)
        s.fix_step[lane], s.sees[lane] = np.float32(t.fix_step), np.float32(t.sees)
        s.touching[lane] = np.float32(t.touching)
        s.working[lane] = np.float32(t.broken_at == NEVER)
        write_task(who, s, o)
    own_x, own_y, hc, hs, speed, turn_rate, _, _ = team_columns(tracker, e, i, across, POSE)
    own = transpose(
        within_one(hc), within_one(hs), own_x, own_y, speed, turn_rate,
        load(s.touching, 0), load(s.working, 0),
    )  # fmt: skip
    write_rows(own, e, i, count, across, observations, 0)
    x, y, heading_x, heading_y, frame_x, frame_y, vx, vy = team_columns(tracker, e, i, across, FIX)
    dx, dy = x - own_x, y - own_y
    distance = root(dx * dx + dy * dy)
    per_metre = _ONE / greater(distance, _TINY)
    ux, uy = dx * per_metre, dy * per_metre
    fixed_at = load(s.fix_step, 0)
    known = fixed_at >= _ZERO
    age = choose(known, (load(s.step, 0) - fixed_at) * c.dt, _MINUS_ONE)
    ahead = choose(distance > _ZERO, within_one(ux * hc + uy * hs), _ONE)
    ahead = choose(known, ahead, _ZERO)
    left = choose(known, within_one(uy * hc - ux * hs), _ZERO)
    heading_cos = choose(known, within_one(heading_x * hc + heading_y * hs), _ZERO)
    heading_sin = choose(known, within_one(heading_y * hc - heading_x * hs), _ZERO)
    frame_cos = choose(known, within_one(frame_x * hc + frame_y * hs), _ZERO)
    frame_sin = choose(known, within_one(frame_y * hc - frame_x * hs), _ZERO)
    # The end of the task and the first of the target; then its last, eight at once.
    time_left = (np.float32(c.horizon) - load(s.step, 0)) * c.dt
    fields = transpose(
        eight(c.told_arena), time_left, choose(known, _ONE, _ZERO), load(s.sees, 0), age,
        choose(known, distance, _MINUS_ONE), ahead, left,
    )  # fmt: skip
    write_rows(fields, e, i, count, across, observations, TARGET_AT - 2)
    fields = transpose(
        ahead, left, heading_cos, heading_sin, frame_cos, frame_sin,
        choose(known, vx * hc + vy * hs, _ZERO), choose(known, vy * hc - vx * hs, _ZERO),
    )  # fmt: skip
    write_rows(fields, e, i, count, across, observations, TARGET_AT + 4)


@compiled
def _observe_some(
    c: Record,
    worlds: WorldArrays,
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what ``count`` trackers, the first of them i of world e, observe together."""
    observe_own_and_target(c, worlds.world, worlds.tracker, e, i, count, across, s, observations)
    if observes_mates(c):
        k = SONAR_AT + natural(c.sonar_beams)
        observe_mates(c, worlds.tracker, e, i, count, across, worlds.message, s, observations, k)


@compiled
def observes_mates(c: Record) -> bool:
    """Say whether trackers observe where team-mates are now, not what they last heard of them."""
    return bool(c.perfect_radio != 0 and c.neighbours > 0)


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, count: int, s: Record, observations: FloatArray
) -> None:
    """Write what trackers of ``count`` worlds, at most eight, observe together."""
    n = natural(c.num_trackers)
    if count == TOGETHER and n <= MOST_IN_TEAM:
        if observes_mates(c):
            lay_out_team(worlds.tracker, first, 1, s)
        for i in range(n):
            _observe_some(c, worlds, first, i, WIDTH, 1, s, observations)
        return
    for e in range(first, first + count):
        if observes_mates(c):
            lay_out_team(worlds.tracker, e, 0, s)
        for i in range(0, n, WIDTH):
            _observe_some(c, worlds, e, i, min(WIDTH, n - i), 0, s, observations)
