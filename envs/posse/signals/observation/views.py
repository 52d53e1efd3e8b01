"""Inputs of observation fields: views of the same robot of eight worlds, one per lane.

Unused parts of a view are removed by the compiler.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posse.numeric import (
    WIDTH,
    Lanes,
    Mask,
    Record,
    Records,
    choose,
    compiled,
    counts,
    eight,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.rules.contact import touches_surroundings
from posse.rules.discs import natural
from posse.rules.state import CONDITION, FIX, NEVER, POSE, Condition, Fix, Pose, WorldArrays
from posse.signals.observation.rows import Observers, world_of

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)
_NOBODY: Final = np.uint64(0)


class View(NamedTuple):
    """Eight observers, and their knowledge of the target.

    Positions and directions are in the common frame.
    """

    number: Lanes
    """Number of the tracker; -1: the target."""
    x: Lanes
    """m."""
    y: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    """m/s."""
    turn_rate: Lanes
    """rad/s, positive to the left."""
    touching: Lanes
    """1 while it touches anything, else 0."""
    working: Lanes
    """0 once it is broken, else 1."""
    step: Lanes
    """Control steps since the start."""
    max_speed: Lanes
    """m/s."""
    max_turn_rate: Lanes
    """rad/s."""
    acceleration_time: Lanes
    """From rest to full speed, s; 0: at once."""
    turn_acceleration_time: Lanes
    """From no turn to the greatest turn rate, s; 0: at once."""
    target_known: Mask
    """Whether it has a fix of the target, described by the following."""
    target_seen: Lanes
    """1 while its own sensor sees the target, else 0."""
    target_step: Lanes
    """Control step of the fix."""
    target_dx: Lanes
    """Vector to the target at the fix, m; for a bearing: a unit vector."""
    target_dy: Lanes
    target_distance: Lanes
    target_cos: Lanes
    """Heading of the target at the fix."""
    target_sin: Lanes
    target_frame_cos: Lanes
    """The slot frame ψ."""
    target_frame_sin: Lanes
    target_vx: Lanes
    """Velocity from successive fixes, m/s."""
    target_vy: Lanes


@compiled
def ego(v: View, x: Lanes, y: Lanes) -> tuple[Lanes, Lanes]:
    """Return a vector of the common frame in the robot's frame: ahead, and to the left."""
    return x * v.heading_cos + y * v.heading_sin, y * v.heading_cos - x * v.heading_sin


class Mate(NamedTuple):
    """A team-mate of each of eight observers: current or as last received."""

    number: Lanes
    age: Lanes
    """Age of the data, s."""
    dx: Lanes
    """Vector to it, common frame, m."""
    dy: Lanes
    distance: Lanes
    """m."""
    ahead: Lanes
    """Its direction in the robot's frame; may exceed 1 by rounding."""
    left: Lanes
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes
    """m/s."""
    turn_rate: Lanes
    """rad/s."""


@compiled
def lay_out_observers(c: Record, worlds: WorldArrays, first: int, count: int, s: Record) -> None:
    """Write the rows of ``count`` worlds, at most eight: positions, control steps, target agents."""
    n = natural(c.num_trackers)
    for i in range(n):
        pose = Pose(*_columns(worlds.tracker, Observers(first, i, count), POSE))
        store(s.team_x, WIDTH * i, pose.x)
        store(s.team_y, WIDTH * i, pose.y)
    for lane in range(WIDTH):
        e = world_of(Observers(first, n, count), lane)
        w = worlds.world[e]
        s.steps[lane] = np.float32(w.step)
        if c.target_agent != 0:
            s.target_x[lane], s.target_y[lane] = w.x, w.y
            s.target_cos[lane], s.target_sin[lane] = w.heading_cos, w.heading_sin
            s.target_speed[lane], s.target_turn_rate[lane] = w.speed, w.turn_rate
            touching = w.touching != _NOBODY or touches_surroundings(c, w, worlds.obstacle[e])
            s.target_touching[lane] = np.float32(touching)


@compiled
def _columns(tracker: Records, observers: Observers, offset: int) -> tuple[Lanes, ...]:
    """Return a block of fields of eight trackers, field by field; see :func:`posse.rules.discs.columns`."""
    i = natural(observers.i)
    return transpose(
        load_fields(tracker[world_of(observers, 0), i], offset),
        load_fields(tracker[world_of(observers, 1), i], offset),
        load_fields(tracker[world_of(observers, 2), i], offset),
        load_fields(tracker[world_of(observers, 3), i], offset),
        load_fields(tracker[world_of(observers, 4), i], offset),
        load_fields(tracker[world_of(observers, 5), i], offset),
        load_fields(tracker[world_of(observers, 6), i], offset),
        load_fields(tracker[world_of(observers, 7), i], offset),
    )


@compiled
def view_of_trackers(c: Record, worlds: WorldArrays, observers: Observers, s: Record) -> View:
    """Return the view of a tracker of eight worlds; requires :func:`lay_out_observers`."""
    own = Pose(*_columns(worlds.tracker, observers, POSE))
    fix = Fix(*_columns(worlds.tracker, observers, FIX))
    condition = Condition(*_columns(worlds.tracker, observers, CONDITION))
    dx, dy, fixed_at = fix.fix_x, fix.fix_y, counts(condition.fix_step)
    if c.fix_bearing == 0:
        dx, dy = dx - own.x, dy - own.y
    return View(
        number=eight(np.float32(observers.i)),
        x=own.x,
        y=own.y,
        heading_cos=own.heading_cos,
        heading_sin=own.heading_sin,
        speed=own.speed,
        turn_rate=own.turn_rate,
        touching=counts(condition.touching),
        working=choose(counts(condition.broken_at) == np.float32(NEVER), _ONE, _ZERO),
        step=load(s.steps, 0),
        max_speed=own.max_speed,
        max_turn_rate=own.max_turn_rate,
        acceleration_time=own.max_speed * c.per_acceleration,
        turn_acceleration_time=own.max_turn_rate * c.per_turn_acceleration,
        target_known=fixed_at >= _ZERO,
        target_seen=counts(condition.sees),
        target_step=fixed_at,
        target_dx=dx,
        target_dy=dy,
        target_distance=root(dx * dx + dy * dy),
        target_cos=fix.fix_cos,
        target_sin=fix.fix_sin,
        target_frame_cos=fix.fix_frame_cos,
        target_frame_sin=fix.fix_frame_sin,
        target_vx=fix.fix_vx,
        target_vy=fix.fix_vy,
    )


@compiled
def view_of_targets(c: Record, s: Record) -> View:
    """Return the view of the target agents of eight worlds, which have no acceleration own.

    Requires :func:`lay_out_observers`.
    """
    zero, never = eight(_ZERO), eight(_MINUS_ONE)
    return View(
        number=eight(_MINUS_ONE),
        x=load(s.target_x, 0),
        y=load(s.target_y, 0),
        heading_cos=load(s.target_cos, 0),
        heading_sin=load(s.target_sin, 0),
        speed=load(s.target_speed, 0),
        turn_rate=load(s.target_turn_rate, 0),
        touching=load(s.target_touching, 0),
        working=eight(_ONE),
        step=load(s.steps, 0),
        max_speed=eight(c.target_speed),
        max_turn_rate=eight(c.target_turn_rate),
        acceleration_time=zero,
        turn_acceleration_time=zero,
        target_known=never >= _ZERO,
        target_seen=zero,
        target_step=never,
        target_dx=zero,
        target_dy=zero,
        target_distance=zero,
        target_cos=zero,
        target_sin=zero,
        target_frame_cos=zero,
        target_frame_sin=zero,
        target_vx=zero,
        target_vy=zero,
    )
