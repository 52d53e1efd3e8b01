"""How a scripted target moves: the three motions of the paper's section 2.

Each motion sets a goal heading; one steering law turns the target to it within its turn limit. In
an arena the goal is mirrored near walls (the smart target looks ahead instead), and a safeguard
keeps the target from obstacles and walls: it only takes a turn that leaves one of its two turning
circles free, so that it can always go on turning for ever without touching anything. Trackers that
hold it fast, so that it turns on the spot, can leave it without a free circle: then it turns to the
wider side until one is free, and what is in its way stops it (posse.rules.contact).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import (
    WIDTH,
    Record,
    Records,
    choose,
    compiled,
    eight,
    lesser,
    load,
    root,
    store,
)
from posse.rules.kinematics import arc, turn_towards
from posse.rules.randomness import TARGET, between, uniform
from posse.rules.state import NEVER
from posse.scenarios.formation import follow_heading

CONSTANT: Final = 0
ACCELERATING: Final = 1
SMART: Final = 2
AGENT: Final = 3

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)
_NO_BITS: Final = np.uint64(0)
_TWO: Final = np.float32(2.0)
_TWO_PI: Final = np.float32(2 * math.pi)
_TINY: Final = np.float32(1e-12)
_ROUNDING: Final = np.float32(1e-3)  # m, far more than an episode of rounding adds up to
_SOFT_WALL: Final = np.float32(2.0)  # a goal heading is mirrored this far before a wall, m

_WEAVE_LEAST_RATE: Final = 0.2  # rad/s
_WEAVE_MOST_RATE: Final = 0.8
_WEAVE_LEAST: Final = 0.4  # least and greatest turn, as shares of the limit
_WEAVE_MOST: Final = 0.9

# The smart motion. It weighs these many directions, every so many control steps.
SMART_DIRECTIONS: Final = 2 * WIDTH
SMART_REPLAN: Final = 5
_HALF_ROUND: Final = WIDTH
_FORESIGHT: Final = np.float32(0.5)  # s; trackers are taken to be where they will be then
_LOYALTY: Final = np.float32(0.5)  # s; going back on its choice has to be worth twice that
_LOOKOUT: Final = np.float32(4.0)  # s; an obstacle or wall that is farther ahead does not matter
PATIENCE: Final = np.float32(3.0)  # s of station keeping that provoke a dart
_STATION_MARGIN: Final = np.float32(1.0)  # m beyond the farthest slot that count as near
_STATION_SPEED: Final = np.float32(0.9)  # relative speed, as a share of V - v_t, that counts
_DANGER: Final = np.float32(0.6)  # a tracker this near provokes a dart, x formation_distance
DART_TURN: Final = np.float32(1.3 * math.pi)  # rad; a dart lasts as long as turning so far
_DART_MOMENTS: Final = 6  # at which a dart is looked at beforehand
_DART_TURN_COS: Final = np.float32(math.cos(1.3 * math.pi / _DART_MOMENTS))  # between two of them
_DART_TURN_SIN: Final = np.float32(math.sin(1.3 * math.pi / _DART_MOMENTS))
_DART_STRIDE: Final = 2  # every second direction is played through
_CLEARANCE: Final = np.float32(0.3)  # m between the rims of the target and a tracker
_FAR: Final = np.float32(1e3)  # for a direction that nobody bars
_BLOCKED: Final = np.float32(100.0)  # m; what running into a tracker takes off a dart's worth
_ALARM: Final = np.float32(1e3)

_ANGLES: Final = 2 * np.pi * np.arange(SMART_DIRECTIONS) / SMART_DIRECTIONS
_DIRECTION_COS: Final = np.cos(_ANGLES).astype(np.float32)
_DIRECTION_SIN: Final = np.sin(_ANGLES).astype(np.float32)


@compiled
def draw_motion(c: Record, w: Record) -> None:
    """Draw what an episode's target motion depends on besides its start."""
    w.weave_amplitude, w.weave_rate, w.weave_phase = _ZERO, _ZERO, _ZERO
    w.pressed = _ZERO
    if c.motion == ACCELERATING:
        limit = c.target_turn_rate
        w.weave_amplitude = between(_WEAVE_LEAST, _WEAVE_MOST, w.key, 0, TARGET, 100) * limit
        w.weave_rate = between(_WEAVE_LEAST_RATE, _WEAVE_MOST_RATE, w.key, 0, TARGET, 101)
        w.weave_phase = _TWO_PI * uniform(w.key, 0, TARGET, 102)


@compiled
def target_turn_rate(
    c: Record, w: Record, trackers: Records, obstacles: Records, s: Record
) -> np.float32:
    """Return the turn rate that a scripted target takes for the next control step, rad/s."""
    if c.motion == ACCELERATING:
        time = np.float32(w.step) * c.dt
        turn = w.weave_amplitude * np.float32(math.sin(w.weave_rate * time + w.weave_phase))
        for _ in range(c.physics_steps):  # an arc turns by 1 rad at most
            _, _, w.goal_cos, w.goal_sin = arc(w.goal_cos, w.goal_sin, _ZERO, turn, c.physics_dt)
    elif c.motion == SMART and w.step % SMART_REPLAN == 0:
        evade(c, w, trackers, obstacles, s)
    if c.walled and c.motion != SMART:
        mirror_at_walls(c, w)
    turn = turn_towards(
        w.heading_cos, w.heading_sin, w.goal_cos, w.goal_sin, c.target_turn_rate, c.dt
    )
    if c.walled:
        turn = safe_turn(c, w, obstacles, turn)
    return turn


@compiled
def evade(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading of a smart target.

    It makes ground through the widest gap, until the team keeps station on it or a tracker comes
    too near. Then it darts: it takes the turn that tears the formation apart, and holds it.
    """
    past = np.float32(SMART_REPLAN) * c.dt
    if w.touching != _NO_BITS:
        # Held fast: the way out is where nobody stands.
        w.pressed = _ZERO
        plan_escape(c, w, trackers, obstacles, s)
        return
    if w.pressed < _ZERO:
        w.pressed = min(_ZERO, w.pressed + past)
        return
    pressure = team_pressure(c, w, trackers)
    w.pressed = max(_ZERO, w.pressed + pressure * past)
    if w.pressed >= PATIENCE:
        w.pressed = -DART_TURN / c.target_turn_rate
        plan_dart(c, w, trackers, obstacles)
    else:
        plan_escape(c, w, trackers, obstacles, s)


@compiled
def team_pressure(c: Record, w: Record, trackers: Records) -> np.float32:
    """Return how committed the team is: from -1, no tracker keeps station, to 1, all of them do.

    A tracker keeps station when it is about as near as a slot is and moves as the target does. One
    that comes nearer than any slot is a danger, which takes more than all patience at once.
    """
    near = c.slots_reach + _STATION_MARGIN
    danger = max(_DANGER * c.formation_distance, c.radius + c.radius)
    vx, vy = c.target_speed * w.heading_cos, c.target_speed * w.heading_sin
    committed = _ZERO
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at != NEVER:
            continue
        slow = _STATION_SPEED * (t.max_speed - c.target_speed)
        dx, dy = t.x - w.x, t.y - w.y
        d2 = dx * dx + dy * dy
        if d2 < danger * danger:
            return _ALARM
        ux, uy = t.speed * t.heading_cos - vx, t.speed * t.heading_sin - vy
        if d2 < near * near and ux * ux + uy * uy < slow * slow:
            committed += _ONE
    return _TWO * committed / np.float32(max(w.working, 1)) - _ONE


@compiled
def plan_escape(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading through the widest gap that the team leaves.

    For every direction u, the soonest that any tracker, straight on at full speed, could be where
    the target then is: the least root t of |p - u v t| = V t. The target takes the direction where
    that is latest, seen from where the trackers will be shortly, and does not go back on a choice
    for little: among trackers that surround it, it would dither.
    """
    v, most = c.target_speed, c.fastest
    a = most * most - v * v
    per_a = _ONE / a
    clear = c.radius + c.radius + _CLEARANCE
    # What it heads for at the start was not its choice, and one that ended in contact was bad.
    loyalty = _LOYALTY if w.step > 0 and w.touching == _NO_BITS else _ZERO
    # Half the directions and, astern, their opposites, which have the square root in common.
    ux, uy = load(_DIRECTION_COS, 0), load(_DIRECTION_SIN, 0)
    ahead, astern = eight(_FAR), eight(_FAR)
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at != NEVER:
            # It goes nowhere, and is met only by running into it.
            px, py = t.x - w.x, t.y - w.y
            along, across = px * ux + py * uy, px * uy - py * ux
            met = (across < clear) & (across > -clear)
            along = along * (a / v)
            ahead = lesser(ahead, choose(met & (along > _ZERO), along, _FAR))
            astern = lesser(astern, choose(met & (along < _ZERO), _ZERO - along, _FAR))
        else:
            px = t.x + _FORESIGHT * t.speed * t.heading_cos - w.x
            py = t.y + _FORESIGHT * t.speed * t.heading_sin - w.y
            b = v * (px * ux + py * uy)
            until = root(b * b + a * (px * px + py * py))
            ahead, astern = lesser(ahead, until - b), lesser(astern, until + b)
    same_way = loyalty * (ux * w.goal_cos + uy * w.goal_sin)
    store(s.worth, 0, ahead * per_a + same_way)
    store(s.worth, _HALF_ROUND, astern * per_a - same_way)
    best = np.float32(-1e9)
    for k in range(_HALF_ROUND):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        for side in range(2):
            value = s.worth[_HALF_ROUND * side + k]
            if c.walled and value + _LOOKOUT > best:
                value += free_time(c, w, obstacles, ux, uy)
            if value > best:
                best = value
                w.goal_cos, w.goal_sin = ux, uy
            ux, uy = -ux, -uy


@compiled(seldom=True)
def free_time(
    c: Record, w: Record, obstacles: Records, ux: np.float32, uy: np.float32
) -> np.float32:
    """Return for how long, at most ``_LOOKOUT``, a direction is free of obstacles and walls, s."""
    far = c.target_speed * _LOOKOUT
    inner = c.half_arena - c.safe_distance
    if abs(ux) > _TINY:
        far = min(far, (inner - w.x) / ux if ux > _ZERO else (-inner - w.x) / ux)
    if abs(uy) > _TINY:
        far = min(far, (inner - w.y) / uy if uy > _ZERO else (-inner - w.y) / uy)
    for k in range(c.num_obstacles):
        o = obstacles[k]
        ox, oy = o.x - w.x, o.y - w.y
        along, across = ox * ux + oy * uy, ox * uy - oy * ux
        reach = o.radius + c.safe_distance
        if along > _ZERO and abs(across) < reach:
            far = min(far, max(_ZERO, along - reach))
    return np.float32(far / c.target_speed)


@compiled(seldom=True)
def plan_dart(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Set the goal heading whose turn tears the formation apart.

    Every direction is played through, the trackers holding the speed and turn rate that they have:
    the best one moves them farthest from where they stand around the target, and does not lead
    into one of them.
    """
    moment = DART_TURN / (c.target_turn_rate * np.float32(_DART_MOMENTS))
    clear = c.radius + c.radius + _CLEARANCE
    best = np.float32(-1e9)
    for k in range(0, SMART_DIRECTIONS, _DART_STRIDE):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        value = _ZERO
        for i in range(c.num_trackers):
            t = trackers[i]
            hc, hs, tc, ts = w.heading_cos, w.heading_sin, t.heading_cos, t.heading_sin
            moved_x, moved_y = _ZERO, _ZERO  # by how much, seen from the target
            for _ in range(_DART_MOMENTS):
                old_c, old_s = hc, hs
                hc, hs = follow_heading(hc, hs, ux, uy, _DART_TURN_COS, _DART_TURN_SIN)
                dx, dy, tc, ts = arc(tc, ts, t.speed, t.turn_rate, moment)
                moved_x += dx - _HALF * c.target_speed * moment * (old_c + hc)
                moved_y += dy - _HALF * c.target_speed * moment * (old_s + hs)
                x, y = t.x - w.x + moved_x, t.y - w.y + moved_y
                if x * x + y * y < clear * clear:
                    value -= _BLOCKED
            if t.broken_at == NEVER:
                value += np.float32(math.sqrt(moved_x * moved_x + moved_y * moved_y))
        if c.walled:
            value += free_time(c, w, obstacles, ux, uy)
        if value > best:
            best = value
            w.goal_cos, w.goal_sin = ux, uy


@compiled(seldom=True)
def mirror_at_walls(c: Record, w: Record) -> None:
    """Mirror the goal heading at a wall that is near and ahead."""
    inner = max(c.half_arena - _SOFT_WALL, c.half_arena * _HALF)
    if (w.x > inner and w.goal_cos > _ZERO) or (w.x < -inner and w.goal_cos < _ZERO):
        w.goal_cos = -w.goal_cos
    if (w.y > inner and w.goal_sin > _ZERO) or (w.y < -inner and w.goal_sin < _ZERO):
        w.goal_sin = -w.goal_sin


@compiled
def circle_is_free(
    c: Record, obstacles: Records, x: np.float32, y: np.float32, radius: np.float32
) -> bool:
    """Say whether a disc of the target's turning circle, rim included, is clear of everything."""
    room = radius + c.safe_distance
    if abs(x) + room > c.half_arena or abs(y) + room > c.half_arena:
        return False
    for k in range(c.num_obstacles):
        o = obstacles[k]
        reach = room + o.radius
        # The disc may also surround the obstacle, but then the path along its rim is not safe
        # for every obstacle inside; a circle that holds one is not free.
        if (o.x - x) * (o.x - x) + (o.y - y) * (o.y - y) < reach * reach:
            return False
    return True


@compiled
def has_free_circle(
    c: Record,
    obstacles: Records,
    x: np.float32,
    y: np.float32,
    heading_cos: np.float32,
    heading_sin: np.float32,
    side: np.float32,
    allowance: np.float32 = _ZERO,
) -> bool:
    """Say whether the turning circle to one side (+1 left, -1 right) is free, to an allowance."""
    radius = c.target_speed / c.target_turn_rate
    x, y = x - side * radius * heading_sin, y + side * radius * heading_cos
    return circle_is_free(c, obstacles, x, y, radius - allowance)


@compiled(seldom=True)
def safe_turn(c: Record, w: Record, obstacles: Records, turn: np.float32) -> np.float32:
    """Return ``turn`` if a free turning circle remains after it, else the turn along a free one.

    Where there is none, the turn that leads to one.
    """
    dx, dy, hc, hs = w.heading_cos, w.heading_sin, w.heading_cos, w.heading_sin
    x, y = w.x, w.y
    for _ in range(c.physics_steps):
        dx, dy, hc, hs = arc(hc, hs, c.target_speed, turn, c.physics_dt)
        x, y = x + dx, y + dy
    if has_free_circle(c, obstacles, x, y, hc, hs, _ONE):
        return turn
    if has_free_circle(c, obstacles, x, y, hc, hs, -_ONE):
        return turn
    # The circle it follows stays free but for rounding, which must not make it change sides.
    x, y, hc, hs = w.x, w.y, w.heading_cos, w.heading_sin
    left = has_free_circle(c, obstacles, x, y, hc, hs, _ONE, _ROUNDING)
    right = has_free_circle(c, obstacles, x, y, hc, hs, -_ONE, _ROUNDING)
    if left and (turn >= _ZERO or not right):
        side = _ONE
    elif right:
        side = -_ONE
    else:
        side = way_out(c, w, obstacles)
    return np.float32(side * c.target_turn_rate)


@compiled(seldom=True)
def way_out(c: Record, w: Record, obstacles: Records) -> np.float32:
    """Return to which side (+1 left, -1 right) to turn where neither turning circle is free."""
    if w.speed == _ZERO:
        # Blocked in the last step. To and fro it could stay so for ever; turning on the same way,
        # it comes to every heading there is.
        return _ONE if w.turn_rate >= _ZERO else -_ONE
    radius = c.target_speed / c.target_turn_rate
    aside_x, aside_y = -radius * w.heading_sin, radius * w.heading_cos
    left = width_around(c, obstacles, w.x + aside_x, w.y + aside_y)
    right = width_around(c, obstacles, w.x - aside_x, w.y - aside_y)
    return _ONE if left >= right else -_ONE


@compiled
def width_around(c: Record, obstacles: Records, x: np.float32, y: np.float32) -> np.float32:
    """Return how far the nearest obstacle or wall is from a place, m."""
    width = c.half_arena - max(abs(x), abs(y))
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy = o.x - x, o.y - y
        width = min(width, np.float32(math.sqrt(dx * dx + dy * dy)) - o.radius)
    return np.float32(width)
