"""Assignment of trackers to slots, and its memory."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse.rules import NEVER
from posse_baselines.laws.assignment import assign
from posse_baselines.laws.geometry import wrap
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import time_to_slot
from posse_baselines.policies.planner.foresight import arrival_time

WEAVE_TIME: Final = 1.5
"""Time for which the target is assumed to keep its velocity; then its mean one is used, s."""
_LOYALTY: Final = 0.5  # s; least gain for which a tracker changes its slot
_TURNING: Final = 0.5  # delay of an arrival as a share of the time for a turn on the spot

PLAN: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("slot", np.int32),  # -1: none yet
                ("mean_x", np.float32),  # running mean of the target's velocity, m/s; used only in
                ("mean_y", np.float32),  # the first record
            ],
            align=True,
        ),
    )
)
"""Memory of one tracker."""


@compiled
def assign_slots(
    c: Record,
    slots: Records,
    ways: Records,
    w: Record,
    trackers: Records,
    plans: Records,
    path: FloatArray,
    since: int,
    cost: FloatArray,
    work: FloatArray,
) -> None:
    """Assign the working trackers to slots with the least total arrival time."""
    n, rows = c.num_trackers, 0
    vx, vy = float(w.speed * w.heading_cos), float(w.speed * w.heading_sin)
    for i in range(n):
        t = trackers[i]
        if t.broken_at != NEVER:
            continue
        speed = float(t.max_speed)
        for k in range(n):
            arm_x, arm_y = rotate(slots[k].x, slots[k].y, w.frame_cos, w.frame_sin)
            x, y = w.x + arm_x - t.x, w.y + arm_y - t.y
            if since >= 0 and ways[i].foresees > 0.0:
                time = arrival_time(path, float(since), slots[k], t.x, t.y, speed, c.dt)
            else:
                time = time_to_slot(x, y, vx, vy, plans[0].mean_x, plans[0].mean_y, WEAVE_TIME, speed)
            # Time for turning towards it.
            away = wrap(math.atan2(y, x) - math.atan2(t.heading_sin, t.heading_cos))
            time += _TURNING * abs(away) / t.max_turn_rate * min(1.0, time)
            if plans[i].slot == k:
                time -= _LOYALTY
            cost[rows, k] = time
        rows += 1
    assign(cost, rows, n, work)
    rows = 0
    for i in range(n):
        if trackers[i].broken_at == NEVER:
            plans[i].slot = int(work[0, rows])
            rows += 1
