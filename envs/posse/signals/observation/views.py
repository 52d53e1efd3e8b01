"""Inputs of observation fields: views of eight observers, one per lane.

The eight are one tracker of eight worlds (``across`` is 1) or, with fewer worlds or large teams,
eight trackers of one world (0). A target agent uses the first lane. Unused parts of a view are
removed by the compiler.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posse.numeric import WIDTH, Lanes, Mask, Record, Records, choose, compiled, counts, eight, greater, load, root
from posse.rules.contact import touches_surroundings
from posse.rules.discs import natural
from posse.rules.state import CONDITION, FIX, NEVER, POSE, Condition, Fix, Pose, WorldArrays
from posse.signals.observation.rows import Observers
from posse.signals.observation.team import lay_out_team, own_numbers, stride_of, team_columns

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
def mate_now(
    number: Lanes,
    dx: Lanes,
    dy: Lanes,
    distance: Lanes,
    ahead: Lanes,
    left: Lanes,
    heading_cos: Lanes,
    heading_sin: Lanes,
    speed: Lanes,
    turn_rate: Lanes,
) -> Mate:
    """Return a team-mate as it is now, (dx, dy) away: ``ahead`` and to the ``left``, all in m."""
    per_metre = _ONE / greater(distance, _TINY)
    return Mate(
        number=number,
        age=eight(_ZERO),
        dx=dx,
        dy=dy,
        distance=distance,
        ahead=ahead * per_metre,
        left=left * per_metre,
        heading_cos=heading_cos,
        heading_sin=heading_sin,
        speed=speed,
        turn_rate=turn_rate,
    )


@compiled
def mate_heard(
    v: View,
    number: Lanes,
    age: Lanes,
    dx: Lanes,
    dy: Lanes,
    heading_cos: Lanes,
    heading_sin: Lanes,
    speed: Lanes,
    turn_rate: Lanes,
) -> Mate:
    """Return a team-mate as last received.

    Its rounding differs from :func:`mate_now`; changing either would change results.
    """
    distance = root(dx * dx + dy * dy)
    apart = distance > _ZERO
    per_metre = _ONE / choose(apart, distance, _ONE)
    ahead, left = ego(v, dx * per_metre, dy * per_metre)
    return Mate(
        number=number,
        age=age,
        dx=dx,
        dy=dy,
        distance=distance,
        ahead=choose(apart, ahead, _ONE),
        left=choose(apart, left, _ZERO),
        heading_cos=heading_cos,
        heading_sin=heading_sin,
        speed=speed,
        turn_rate=turn_rate,
    )


@compiled
def lay_out_observers(worlds: WorldArrays, e: int, across: int, s: Record) -> None:
    """Write the team's rows of world e, or of eight worlds, and their control steps."""
    lay_out_team(worlds.tracker, e, across, s)
    for lane in range(WIDTH):
        s.steps[lane] = np.float32(worlds.world[natural(e + lane * across)].step)


@compiled
def view_of_trackers(c: Record, worlds: WorldArrays, observers: Observers, s: Record) -> View:
    """Return the view of eight trackers; requires :func:`lay_out_observers`."""
    e, i, _, across = observers
    at = natural(stride_of(across) * i)
    own_x, own_y = load(s.team_x, at), load(s.team_y, at)
    limits = Pose(*team_columns(worlds.tracker, e, i, across, POSE))
    fix = Fix(*team_columns(worlds.tracker, e, i, across, FIX))
    condition = Condition(*team_columns(worlds.tracker, e, i, across, CONDITION))
    dx, dy, fixed_at = fix.fix_x, fix.fix_y, counts(condition.fix_step)
    if c.fix_bearing == 0:
        dx, dy = dx - own_x, dy - own_y
    return View(
        number=own_numbers(i, across, s),
        x=own_x,
        y=own_y,
        heading_cos=load(s.team_cos, at),
        heading_sin=load(s.team_sin, at),
        speed=load(s.team_speed, at),
        turn_rate=load(s.team_turn_rate, at),
        touching=counts(condition.touching),
        working=choose(counts(condition.broken_at) == np.float32(NEVER), _ONE, _ZERO),
        step=load(s.steps, 0),
        max_speed=limits.max_speed,
        max_turn_rate=limits.max_turn_rate,
        acceleration_time=limits.max_speed * c.per_acceleration,
        turn_acceleration_time=limits.max_turn_rate * c.per_turn_acceleration,
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
def view_of_target(c: Record, w: Record, obstacles: Records) -> View:
    """Return the view of a target agent, which has no acceleration limits."""
    touching = w.touching != _NOBODY or touches_surroundings(c, w, obstacles)
    zero, never = eight(_ZERO), eight(_MINUS_ONE)
    return View(
        number=eight(_MINUS_ONE),
        x=eight(w.x),
        y=eight(w.y),
        heading_cos=eight(w.heading_cos),
        heading_sin=eight(w.heading_sin),
        speed=eight(w.speed),
        turn_rate=eight(w.turn_rate),
        touching=eight(np.float32(touching)),
        working=eight(_ONE),
        step=eight(np.float32(w.step)),
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
