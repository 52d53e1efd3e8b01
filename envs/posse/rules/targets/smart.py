"""The smart motion: evasion with full knowledge of the state.

The target escapes through the widest gap until the team keeps station or a tracker comes too near.
Then it darts: it takes the turn that disrupts the formation most, and holds it.
"""

import math
from typing import Final

import numpy as np

from posse.declarations import target_motion
from posse.numeric import HALF, ONE, TINY, WIDTH, ZERO, Record, Records, compiled
from posse.numeric.lanes import choose, eight, lesser, load, root, store
from posse.rules.kinematics import arc, follow_heading
from posse.rules.state import NEVER, NO_BITS

SMART_REPLAN: Final = 5
"""Control steps between decisions."""
PATIENCE: Final = np.float32(3.0)
"""Time of station keeping by the whole team that triggers a dart, s."""

_STATION_MARGIN: Final = np.float32(1.0)  # m; beyond the outermost slot, counts as near
_STATION_SPEED: Final = np.float32(0.9)  # relative speed, as a share of V - v_t, that counts
_DANGER: Final = np.float32(0.6)  # times formation_distance; a nearer tracker triggers a dart
_ALARM: Final = np.float32(1e3)
DART_TURN: Final = np.float32(1.3 * math.pi)
"""A dart ends at the second decision after the time of a turn by this angle, rad."""
SMART_DIRECTIONS: Final = 2 * WIDTH
"""Number of candidate directions."""

_FORESIGHT: Final = np.float32(0.5)  # s; positions of trackers are predicted by this time
_LOYALTY: Final = np.float32(0.5)  # s; reversing a choice must gain twice this
_LOOKOUT: Final = np.float32(4.0)  # s; obstacles and walls farther ahead are ignored
_DART_MOMENTS: Final = 6  # time samples of a simulated dart
_DART_TURNS: Final = np.float32(4.0)  # times the target's turn rate at most: arc() errs by 1e-4 there
_DART_TURN_COS: Final = np.float32(math.cos(1.3 * math.pi / _DART_MOMENTS))  # between two of them
_DART_TURN_SIN: Final = np.float32(math.sin(1.3 * math.pi / _DART_MOMENTS))
_DART_STRIDE: Final = 2  # every second direction is simulated
_CLEARANCE: Final = np.float32(0.3)  # m between the rims of the target and a tracker
_FAR: Final = np.float32(1e3)  # for an unblocked direction
_BLOCKED: Final = np.float32(100.0)  # m; penalty of a dart for a collision

_ANGLES: Final = 2 * np.pi * np.arange(SMART_DIRECTIONS) / SMART_DIRECTIONS
_SIDES: Final = (ONE, -ONE)
_DIRECTION_COS: Final = np.cos(_ANGLES).astype(np.float32)
_DIRECTION_SIN: Final = np.sin(_ANGLES).astype(np.float32)


@target_motion("smart", memory=("pressed",), mirrored=False)  # s, time that the team has kept station; < 0: dart
def smart(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Escapes through the widest gap, and darts when the team keeps station (paper, section 2)."""
    if w.step % SMART_REPLAN != 0:
        return
    past = np.float32(SMART_REPLAN) * c.control_step
    if w.touching != NO_BITS:
        # Blocked by contact: leave in a free direction.
        w.pressed = ZERO
        plan_escape(c, w, trackers, obstacles, s)
        return
    if w.pressed < ZERO:
        w.pressed = min(ZERO, w.pressed + past)
        return
    pressure = team_pressure(c, w, trackers)
    w.pressed = max(ZERO, w.pressed + pressure * past)
    if w.pressed >= PATIENCE:
        w.pressed = -DART_TURN / c.target_turn_rate
        plan_dart(c, w, trackers, obstacles)
    else:
        plan_escape(c, w, trackers, obstacles, s)


@compiled
def team_pressure(c: Record, w: Record, trackers: Records) -> np.float32:
    """Return the commitment of the team: -1, no tracker keeps station, to 1, all do.

    A tracker keeps station if it is about as near as a slot and moves as the target does. A tracker
    much nearer than any slot triggers a dart at once.
    """
    near = c.slots_reach + _STATION_MARGIN
    danger = max(_DANGER * c.formation_distance, c.robot_radius + c.robot_radius)
    vx, vy = c.target_speed * w.heading_cos, c.target_speed * w.heading_sin
    committed = ZERO
    for t in trackers:
        if t.broken_at != NEVER:
            continue
        slow = _STATION_SPEED * (t.max_speed - c.target_speed)
        dx, dy = t.x - w.x, t.y - w.y
        d2 = dx * dx + dy * dy
        if d2 < danger * danger:
            return _ALARM
        ux, uy = t.speed * t.heading_cos - vx, t.speed * t.heading_sin - vy
        if d2 < near * near and ux * ux + uy * uy < slow * slow:
            committed += ONE
    return (committed + committed) / np.float32(w.working) - ONE


@compiled
def plan_escape(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading through the widest gap that the team leaves.

    For every direction u, the earliest interception by any tracker moving straight at full speed is
    the least root t of |p - u v t| = V t, with predicted positions of the trackers. The target
    takes the direction with the latest interception, with hysteresis against oscillation.
    """
    v, most = c.target_speed, c.fastest
    a = most * most - v * v
    per_a = ONE / a
    clear = c.robot_radius + c.robot_radius + _CLEARANCE
    # No hysteresis for the initial heading, nor for a choice that ended in contact.
    loyalty = _LOYALTY if w.step > 0 and w.touching == NO_BITS else ZERO
    for side in range(2):  # half the directions, then the opposite ones
        ux, uy = _SIDES[side] * load(_DIRECTION_COS, 0), _SIDES[side] * load(_DIRECTION_SIN, 0)
        latest = eight(_FAR)
        for t in trackers:
            if t.broken_at != NEVER:
                # A broken tracker is only an obstacle.
                px, py = t.x - w.x, t.y - w.y
                along, across = px * ux + py * uy, px * uy - py * ux
                met = (across < clear) & (across > -clear) & (along > ZERO)
                latest = lesser(latest, choose(met, along * (a / v), _FAR))
            else:
                px = t.x + _FORESIGHT * t.speed * t.heading_cos - w.x
                py = t.y + _FORESIGHT * t.speed * t.heading_sin - w.y
                b = v * (px * ux + py * uy)
                latest = lesser(latest, root(b * b + a * (px * px + py * py)) - b)
        store(s.worth, WIDTH * side, latest * per_a + loyalty * (ux * w.goal_cos + uy * w.goal_sin))
    best = np.float32(-1e9)
    for k in range(WIDTH):
        for side in range(2):
            ux, uy = _SIDES[side] * _DIRECTION_COS[k], _SIDES[side] * _DIRECTION_SIN[k]
            value = s.worth[WIDTH * side + k]
            if c.walled and value + _LOOKOUT > best:
                value += free_time(c, w, obstacles, ux, uy)
            if value > best:
                best = value
                w.goal_cos, w.goal_sin = ux, uy


@compiled
def free_time(c: Record, w: Record, obstacles: Records, ux: np.float32, uy: np.float32) -> np.float32:
    """Return for how long, at most ``_LOOKOUT``, a direction is free, s; negative too near a wall."""
    far = c.target_speed * _LOOKOUT
    inner = c.half_width - c.safe_distance
    if abs(ux) > TINY:
        far = min(far, (inner - w.x) / ux if ux > ZERO else (-inner - w.x) / ux)
    inner = c.half_height - c.safe_distance
    if abs(uy) > TINY:
        far = min(far, (inner - w.y) / uy if uy > ZERO else (-inner - w.y) / uy)
    for o in obstacles:
        ox, oy = o.x - w.x, o.y - w.y
        along, across = ox * ux + oy * uy, ox * uy - oy * ux
        reach = o.radius + c.safe_distance
        if along > ZERO and abs(across) < reach:
            far = min(far, max(ZERO, along - reach))
    return np.float32(far / c.target_speed)


@compiled
def plan_dart(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Set the goal heading whose turn disrupts the formation most.

    Candidate directions are simulated with the trackers holding speed and turn rate: the best one
    displaces them farthest from their places around the target, without a collision.
    """
    moment = DART_TURN / (c.target_turn_rate * np.float32(_DART_MOMENTS))
    fastest_turn = _DART_TURNS * c.target_turn_rate
    clear = c.robot_radius + c.robot_radius + _CLEARANCE
    best = np.float32(-1e9)
    for k in range(0, SMART_DIRECTIONS, _DART_STRIDE):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        value = ZERO
        for t in trackers:
            hc, hs, tc, ts = w.heading_cos, w.heading_sin, t.heading_cos, t.heading_sin
            moved_x, moved_y = ZERO, ZERO  # displacement relative to the target
            turn_rate = min(max(t.turn_rate, -fastest_turn), fastest_turn)
            for _ in range(_DART_MOMENTS):
                old_c, old_s = hc, hs
                hc, hs = follow_heading(hc, hs, ux, uy, _DART_TURN_COS, _DART_TURN_SIN)
                dx, dy, tc, ts = arc(tc, ts, t.speed, turn_rate, moment)
                moved_x += dx - HALF * c.target_speed * moment * (old_c + hc)
                moved_y += dy - HALF * c.target_speed * moment * (old_s + hs)
                x, y = t.x - w.x + moved_x, t.y - w.y + moved_y
                if x * x + y * y < clear * clear:
                    value -= _BLOCKED
            if t.broken_at == NEVER:
                value += root(moved_x * moved_x + moved_y * moved_y)
        if c.walled:
            value += free_time(c, w, obstacles, ux, uy)
        if value > best:
            best = value
            w.goal_cos, w.goal_sin = ux, uy
