"""The law that the planner plays: slots by least total time, courses that meet them, the safeguard.

It reads the state: poses, the slot frame, obstacles; the path on which the target was foreseen.
What it leaves open for each tracker is a :data:`~posse_baselines.policies.planner.ways.WAY`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Blocks, BoolArray, FloatArray, Record, Records, compiled, kernel, worlds_of
from posse.rules import NEVER
from posse_baselines.laws.geometry import wrap
from posse_baselines.laws.heading import regulate
from posse_baselines.laws.safeguard import safe_velocity
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import approach_velocity, meeting_velocity, way_round, write_motion
from posse_baselines.policies.planner.assigning import WEAVE_TIME, assign_slots
from posse_baselines.policies.planner.foresight import arrival_time, foreseen
from posse_baselines.policies.planner.surroundings import surround

_UNLIMITED: Final = 1e4  # m/s² or rad/s²: what stands for no limit
_REPLAN_STEPS: Final = 3  # control steps between two assignments of the slots
_MEAN_TIME: Final = 6.0  # s; time constant of that mean
_CLEARANCE: Final = 0.75  # m; distance at which the way to a slot leads round the target
_MARGIN: Final = 0.15  # m; free width that is kept
_SOON: Final = 0.3  # s; a slot met sooner is followed as it moves now


@compiled
def wanted_velocity(
    c: Record,
    slot: Record,
    way: Record,
    w: Record,
    t: Record,
    p: Record,
    path: FloatArray,
    since: int,
    frame_rate: float,
    acceleration: float,
) -> tuple[float, float]:
    """Return the velocity (m/s) on a course that meets a tracker's slot, round the target."""
    speed = float(t.max_speed)
    arm_x, arm_y = rotate(slot.x, slot.y, w.frame_cos, w.frame_sin)
    shift_x, shift_y = rotate(way.ahead, way.left, w.heading_cos, w.heading_sin)
    from_x, from_y = t.x - w.x, t.y - w.y
    if since >= 0 and way.foresees > 0.0:
        time = arrival_time(path, float(since), slot, t.x, t.y, speed, c.dt)
        if time > _SOON:
            to_x, to_y = foreseen(path, since + time / c.dt, slot)
            slot_vx, slot_vy = (to_x - w.x - arm_x) / time, (to_y - w.y - arm_y) / time
            round_x, round_y = way_round(from_x, from_y, arm_x, arm_y, _CLEARANCE)
            return approach_velocity(
                round_x + shift_x - from_x, round_y + shift_y - from_y, slot_vx, slot_vy, way.gain, speed, acceleration
            )
    return meeting_velocity(
        from_x,
        from_y,
        arm_x + shift_x,
        arm_y + shift_y,
        float(w.speed * w.heading_cos),
        float(w.speed * w.heading_sin),
        float(p.mean_x),
        float(p.mean_y),
        frame_rate,
        WEAVE_TIME,
        _CLEARANCE,
        way.gain,
        speed,
        acceleration,
    )


@compiled
def drive(
    c: Record,
    slots: Records,
    ways: Records,
    w: Record,
    trackers: Records,
    obstacles: Records,
    plans: Records,
    path: FloatArray,
    begun: int,
    cost: FloatArray,
    work: FloatArray,
    discs: Records,
    body: Record,
    plays: Record,
    actions: FloatArray,
) -> None:
    """Write the actions (N, 2 + m) of one world's team.

    ``begun`` is the control step at which ``path`` begins; -1: there is none.
    """
    n = c.num_trackers
    dt = float(c.dt)
    body.dt, body.acceleration, body.turn_acceleration = dt, _UNLIMITED, _UNLIMITED
    if c.per_acceleration > 0.0:
        body.acceleration = 1.0 / c.per_acceleration
    if c.per_turn_acceleration > 0.0:
        body.turn_acceleration = 1.0 / c.per_turn_acceleration
    # The slot frame turns towards the heading, at its limit until it is there.
    lag = wrap(math.atan2(w.heading_sin, w.heading_cos) - math.atan2(w.frame_sin, w.frame_cos))
    most = math.atan2(c.frame_s, c.frame_c) / dt
    frame_rate = min(max(lag / dt, -most), most)
    share = min(1.0, dt / _MEAN_TIME) if w.step > 0 else 1.0
    p = plans[0]
    p.mean_x += share * (w.speed * w.heading_cos - p.mean_x)
    p.mean_y += share * (w.speed * w.heading_sin - p.mean_y)
    since = w.step - begun if 0 <= begun <= w.step else -1
    if w.step % _REPLAN_STEPS == 0 or p.slot < 0:
        assign_slots(c, slots, ways, w, trackers, plans, path, since, cost, work)
    for i in range(n):
        t = trackers[i]
        if t.broken_at != NEVER:
            write_motion(actions[i], 0.0, 0.0, 1.0, 1.0)
            continue
        vx, vy = wanted_velocity(c, slots[plans[i].slot], ways[i], w, t, p, path, since, frame_rate, body.acceleration)
        count = surround(c, w, trackers, obstacles, i, _MARGIN, discs)
        body.heading_cos, body.heading_sin = t.heading_cos, t.heading_sin
        body.speed, body.omega = t.speed, t.turn_rate
        body.max_speed, body.max_omega = t.max_speed, t.max_turn_rate
        vx, vy, _ = safe_velocity(body, discs, count, vx, vy, plays)
        v, omega = regulate(body, vx, vy, 0.0)
        write_motion(actions[i], v, omega, t.max_speed, t.max_turn_rate)


@kernel
def drive_all(
    config: Records,
    slots: Records,
    costs: FloatArray,
    work: FloatArray,
    discs: Records,
    bodies: Records,
    plays: Records,
    world: Records,
    tracker: Records,
    obstacle: Records,
    going: BoolArray,
    ways: Records,
    plans: Records,
    paths: FloatArray,
    begun: npt.NDArray[np.int64],
    worlds_per_path: int,
    actions: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Write the actions of those of a thread's worlds that are going on."""
    for e in worlds_of(thread, blocks):
        if going[e]:
            shared = e // worlds_per_path
            drive(
                config[0],
                slots,
                ways[e],
                world[e],
                tracker[e],
                obstacle[e],
                plans[e],
                paths[shared],
                begun[shared],
                costs[thread],
                work[thread],
                discs[thread],
                bodies[thread],
                plays[thread],
                actions[e],
            )
