"""Inputs of observation fields: views of the same robot of eight worlds, one per lane.

With fewer than eight worlds the last one is repeated. Unused parts of a view are removed by the
compiler.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posse.numeric import (
    ONE,
    WIDTH,
    ZERO,
    FloatArray,
    Lanes,
    Mask,
    Record,
    Records,
    choose,
    compiled,
    counts,
    eight,
    load,
    root,
    store,
)
from posse.rules.discs import TOUCHING_GAP, columns, nonnegative, surroundings_within
from posse.rules.kinematics import turned
from posse.rules.state import (
    CONDITION,
    FIX,
    NEVER,
    NO_BITS,
    POSE,
    TARGET_POSE,
    TEAM,
    Condition,
    Fields,
    Fix,
    Odometry,
    Pose,
    WorldArrays,
)

OBSERVING: Final[Fields] = (
    # Eight numbers, one for each of eight worlds.
    ("column", WIDTH),  # of observations
    ("steps", WIDTH),  # control steps
    ("target_touching", WIDTH),  # 1: the target touches anything
    # Eight numbers for each tracker.
    ("team_x", WIDTH * TEAM),
    ("team_y", WIDTH * TEAM),
    # Eight numbers for each place of a team-mate.
    ("placed", WIDTH * TEAM),  # number of the team-mate; -1: none
    ("placed_at", WIDTH * TEAM),  # its distance, m
)
"""Fields of a thread's scratch memory used by observations (:mod:`posse.rules.state`)."""


class Observers(NamedTuple):
    """Robot i of ``number`` worlds, at most eight, from world e on."""

    e: int
    i: int
    number: int


class Rows(NamedTuple):
    """Where to write in the observations of eight robots."""

    observers: Observers
    observations: FloatArray
    """(E, rows, F)."""
    start: int
    """Place in an observation that the first column goes to."""


@compiled
def world_of(observers: Observers, lane: int) -> int:
    """Return the world of a lane."""
    return nonnegative(observers.e + min(lane, observers.number - 1))


@compiled
def of_worlds(records: Records, observers: Observers, at: int) -> tuple[Lanes, ...]:
    """Return a block of fields, ``at`` bytes into the record (E,) of each observer's world, field by field."""
    return columns(records, observers.e, observers.e + observers.number, at)


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
    """Write what all agents of ``count`` worlds, at most eight, need: positions, control steps, contacts of targets."""
    n = nonnegative(c.num_trackers)
    observers = Observers(first, n, count)
    for i in range(n):
        pose = Pose(*of_worlds(worlds.tracker[:, i], observers, POSE))
        store(s.team_x, WIDTH * i, pose.x)
        store(s.team_y, WIDTH * i, pose.y)
    for lane in range(WIDTH):
        e = world_of(observers, lane)
        w = worlds.world[e]
        s.steps[lane] = np.float32(w.step)
        if c.target_agent != 0:
            reach, obstacles = c.robot_radius + TOUCHING_GAP, worlds.obstacle[e]
            touching = w.touching != NO_BITS or surroundings_within(c, obstacles, w.x, w.y, reach)
            s.target_touching[lane] = np.float32(touching)


@compiled
def view_of(c: Record, worlds: WorldArrays, observers: Observers, s: Record) -> View:
    """Return the view of a robot of eight worlds; requires :func:`lay_out_observers`."""
    i = nonnegative(observers.i)
    if i < c.num_trackers:
        number = eight(np.float32(i))
        own = Pose(*of_worlds(worlds.tracker[:, i], observers, POSE))
        if c.drifts != 0:  # its pose as it knows it
            error = Odometry(*of_worlds(worlds.odometry[:, i], observers, 0))
            cos, sin = turned(own.heading_cos, own.heading_sin, error.cos, error.sin)
            x, y = own.x + error.x, own.y + error.y
            own = Pose(x, y, cos, sin, own.speed, own.turn_rate, own.max_speed, own.max_turn_rate)
        fix = Fix(*of_worlds(worlds.tracker[:, i], observers, FIX))
        condition = Condition(*of_worlds(worlds.tracker[:, i], observers, CONDITION))
        touching, sees, fixed_at = counts(condition.touching), counts(condition.sees), counts(condition.fix_step)
        working = choose(counts(condition.broken_at) == np.float32(NEVER), ONE, ZERO)
        per_acceleration, per_turn_acceleration = c.per_acceleration, c.per_turn_acceleration
    else:  # a target agent: its limits act at once, and it has no target
        zero, number = eight(ZERO), eight(-ONE)
        x, y, cos, sin, speed, turn_rate, _, _ = of_worlds(worlds.world, observers, TARGET_POSE)
        own = Pose(x, y, cos, sin, speed, turn_rate, eight(c.target_speed), eight(c.target_turn_rate))
        fix = Fix(zero, zero, zero, zero, zero, zero, zero, zero)
        touching, sees, fixed_at = load(s.target_touching, 0), zero, number
        working = eight(ONE)
        per_acceleration = per_turn_acceleration = ZERO
    dx, dy = fix.x, fix.y
    if c.fix_bearing == 0:
        dx, dy = dx - own.x, dy - own.y
    return View(
        number=number,
        x=own.x,
        y=own.y,
        heading_cos=own.heading_cos,
        heading_sin=own.heading_sin,
        speed=own.speed,
        turn_rate=own.turn_rate,
        touching=touching,
        working=working,
        step=load(s.steps, 0),
        max_speed=own.max_speed,
        max_turn_rate=own.max_turn_rate,
        acceleration_time=own.max_speed * per_acceleration,
        turn_acceleration_time=own.max_turn_rate * per_turn_acceleration,
        target_known=fixed_at >= ZERO,
        target_seen=sees,
        target_step=fixed_at,
        target_dx=dx,
        target_dy=dy,
        target_distance=root(dx * dx + dy * dy),
        target_cos=fix.cos,
        target_sin=fix.sin,
        target_frame_cos=fix.frame_cos,
        target_frame_sin=fix.frame_sin,
        target_vx=fix.vx,
        target_vy=fix.vy,
    )
