"""The safeguard: the collision-free velocity nearest to the wanted one.

The surroundings of a tracker are a list of discs with velocities: team-mates, the target,
obstacles, walls. A velocity is evaluated by simulating how the robot tracks it within its limits:
the time spent within the margins, whether and when it would touch, and the distance of its final
position from that of the wanted velocity.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.numeric import Record, Records, compiled
from posse_baselines.laws.geometry import clip, length, wrap
from posse_baselines.laws.heading import heading_error, turn_command

LOOK_AHEAD: Final = (0.1, 0.1, 0.1, 0.15, 0.15, 0.2, 0.2, 0.25, 0.25)
"""Time steps of a simulated velocity, s."""

_STEPS: Final = np.array(LOOK_AHEAD)
_HORIZON: Final = sum(LOOK_AHEAD)
_SPEED_LEVELS: Final = np.array((1.0, 0.5))  # shares of the greatest speed
# From straight ahead outwards, alternating left and right; all directions at all speeds.
_DIRECTIONS: Final = 16
_TURNS: Final = np.array(
    [(1 if k % 2 else -1) * ((k + 1) // 2) * 2.0 * math.pi / _DIRECTIONS for k in range(_DIRECTIONS)]
)
_TURN_COS: Final = np.cos(_TURNS)
_TURN_SIN: Final = np.sin(_TURNS)
_PLAYS: Final = _DIRECTIONS * len(_SPEED_LEVELS)
_KEEP_RIGHT: Final = 0.02  # preference for passing on the right
_LIKELY: Final = 0.6  # share of a velocity's difference by which the robot ends elsewhere, at least
_SAME_SPEED: Final = 0.3  # m/s
_SAME_HEADING: Final = math.cos(0.35)  # cosine of the angle between two headings
_GLANCE: Final = 0.15  # m; allowed deviation from the straight path
_STANDSTILL: Final = 1e-6  # m/s
_CONTACT: Final = 0.015  # m; a narrower gap counts as a contact
_CONTACT_COST: Final = 4.0
_INTRUSION_COST: Final = 3.0

DISC: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("x", np.float64),  # from the tracker, m
                ("y", np.float64),
                ("speed_x", np.float64),  # m/s
                ("speed_y", np.float64),
                ("reach", np.float64),  # distance between the centres at contact, m
                ("margin", np.float64),  # clearance, m
            ],
            align=True,
        ),
    )
)
"""An object to avoid, relative to the tracker."""

_BY_DIRECTION: Final = ("error", "omega", "cos", "sin", "middle_cos", "middle_sin", "goal_cos", "goal_sin", "ahead")
_BY_PLAY: Final = ("speed", "x", "y", "danger", "going")
PLAYS: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                *((name, np.float64, (_DIRECTIONS,)) for name in _BY_DIRECTION),
                *((name, np.float64, (_PLAYS,)) for name in _BY_PLAY),
            ],
            align=True,
        ),
    )
)
"""Work record of :func:`play_all`: all directions at the greatest speed, then the next one."""

_PLANET: Final = 1000.0  # radius of the disc that stands for a wall, m


@compiled
def put_disc(
    discs: Records, count: int, x: float, y: float, speed_x: float, speed_y: float, reach: float, margin: float
) -> int:
    """Add a disc to a list of ``count``, unless it is full; return the new count."""
    if count >= len(discs):
        return count
    d = discs[count]
    d.x, d.y, d.speed_x, d.speed_y, d.reach, d.margin = x, y, speed_x, speed_y, reach, margin
    return count + 1


@compiled
def put_wall(
    discs: Records, count: int, distance: float, normal_x: float, normal_y: float, radius: float, margin: float
) -> int:
    """Add a wall at ``distance`` (m) along its outward normal, as a very large disc."""
    away = distance - radius + _PLANET
    return put_disc(discs, count, normal_x * away, normal_y * away, 0.0, 0.0, _PLANET, margin)


@compiled
def wall_normal(k: int) -> tuple[float, float]:
    """Return the outward normal of one of the four walls."""
    return (1.0 if k == 0 else (-1.0 if k == 1 else 0.0), 1.0 if k == 2 else (-1.0 if k == 3 else 0.0))


@compiled
def put_walls(
    discs: Records, count: int, x: float, y: float, extent: float, near: float, radius: float, margin: float
) -> int:
    """Add the walls of an arena, up to ``extent`` (m) from its middle, that are nearer than ``near`` to (x, y)."""
    for k in range(4):
        nx, ny = wall_normal(k)
        away = extent - nx * x - ny * y
        if away < near:
            count = put_wall(discs, count, away, nx, ny, radius, margin)
    return count


@compiled
def turned(body: Record, error: float) -> tuple[float, float]:
    """Return the direction (x, y) of a robot that has turned by an angle (rad)."""
    c, s = math.cos(error), math.sin(error)
    return body.heading_cos * c - body.heading_sin * s, body.heading_sin * c + body.heading_cos * s


@compiled
def half_turn(turn: float) -> tuple[float, float]:
    """Return cosine and sine of half an angle (rad), by short polynomials.

    Half a turn in a step is at most about a quarter of a radian, and low accuracy suffices.
    """
    half = 0.5 * turn
    square = half * half
    return 1.0 - square * (0.5 - square * (1.0 / 24.0)), half * (1.0 - square * (1.0 / 6.0))


@compiled
def cost_of(
    body: Record,
    discs: Records,
    count: int,
    speed: float,
    error: float,
    wanted_x: float,
    wanted_y: float,
    enough: float,
) -> tuple[float, float]:
    """Return (cost, danger) of a velocity; stops above ``enough``.

    The velocity is a speed (m/s) and the angle to its heading from the present one (rad).

    The danger is the mean intrusion into the margins over the look-ahead, as a share of them, and a
    price for a contact, the higher the sooner. The cost adds how far the robot ends from where the
    wanted velocity leads, as a share of the greatest distance.
    """
    x, y, danger, time = 0.0, 0.0, 0.0, 0.0
    v, omega = body.speed, body.omega
    c, s = body.heading_cos, body.heading_sin
    goal_c, goal_s = turned(body, error)
    for k in range(len(_STEPS)):
        step = _STEPS[k]
        change = body.turn_acceleration * step
        omega = clip(turn_command(body, error, step), omega - change, omega + change)
        change = body.acceleration * step
        v = clip(speed * max(0.0, c * goal_c + s * goal_s), v - change, v + change)
        half_c, half_s = half_turn(omega * step)
        middle_c, middle_s = c * half_c - s * half_s, s * half_c + c * half_s
        x += v * step * middle_c
        y += v * step * middle_s
        c, s = middle_c * half_c - middle_s * half_s, middle_s * half_c + middle_c * half_s
        error -= omega * step
        time += step
        weight = _INTRUSION_COST * step / _HORIZON
        for j in range(count):
            d = discs[j]
            dx, dy = d.x + d.speed_x * time - x, d.y + d.speed_y * time - y
            far = d.reach + d.margin
            d2 = dx * dx + dy * dy
            if d2 < far * far:
                gap = math.sqrt(d2) - d.reach
                if gap < _CONTACT:
                    danger += _CONTACT_COST * (1.2 - time / _HORIZON)
                    return danger + 2.0, danger
                danger += weight * (1.0 - gap / d.margin)
        if danger > enough:
            return danger, danger
    scale = 1.0 / (body.max_speed * _HORIZON)
    short_x, short_y = x * scale - wanted_x / body.max_speed, y * scale - wanted_y / body.max_speed
    return danger + length(short_x, short_y), danger


@compiled
def begin_plays(body: Record, error: float, p: Record) -> None:
    """Initialise a :data:`PLAYS` at a body's pose; straight ahead is a turn of ``error`` (rad)."""
    goal_c, goal_s = turned(body, error)
    for k in range(_DIRECTIONS):
        p.error[k], p.omega[k] = wrap(error + _TURNS[k]), body.omega
        p.cos[k], p.sin[k] = body.heading_cos, body.heading_sin
        p.goal_cos[k] = goal_c * _TURN_COS[k] - goal_s * _TURN_SIN[k]
        p.goal_sin[k] = goal_s * _TURN_COS[k] + goal_c * _TURN_SIN[k]
    for m in range(_PLAYS):
        p.speed[m], p.x[m], p.y[m], p.danger[m], p.going[m] = body.speed, 0.0, 0.0, 0.0, 1.0


@compiled
def play_all(body: Record, discs: Records, count: int, p: Record) -> None:
    """Simulate all velocities of a :data:`PLAYS` as :func:`cost_of` does one.

    The loops over the 32 velocities have no branches and are vectorised.
    """
    time = 0.0
    for n in range(len(_STEPS)):
        step = _STEPS[n]
        turn_change, change = body.turn_acceleration * step, body.acceleration * step
        for k in range(_DIRECTIONS):
            c, s, old = p.cos[k], p.sin[k], p.omega[k]
            p.ahead[k] = max(0.0, c * p.goal_cos[k] + s * p.goal_sin[k])
            omega = turn_command(body, p.error[k], step)
            omega = clip(omega, old - turn_change, old + turn_change)
            half_c, half_s = half_turn(omega * step)
            middle_c, middle_s = c * half_c - s * half_s, s * half_c + c * half_s
            p.omega[k], p.middle_cos[k], p.middle_sin[k] = omega, middle_c, middle_s
            p.cos[k] = middle_c * half_c - middle_s * half_s
            p.sin[k] = middle_s * half_c + middle_c * half_s
            p.error[k] -= omega * step
        for level in range(len(_SPEED_LEVELS)):
            goal_speed = body.max_speed * _SPEED_LEVELS[level]
            for k in range(_DIRECTIONS):
                m = level * _DIRECTIONS + k
                old = p.speed[m]
                v = clip(goal_speed * p.ahead[k], old - change, old + change)
                p.speed[m] = v
                p.x[m] += v * step * p.middle_cos[k]
                p.y[m] += v * step * p.middle_sin[k]
        time += step
        weight = _INTRUSION_COST * step / _HORIZON
        contact_cost = _CONTACT_COST * (1.2 - time / _HORIZON)
        for j in range(count):
            d = discs[j]
            disc_x, disc_y = d.x + d.speed_x * time, d.y + d.speed_y * time
            near = d.reach + d.margin
            least = near * near
            hits = 0
            for m in range(_PLAYS):
                dx, dy = disc_x - p.x[m], disc_y - p.y[m]
                hits += dx * dx + dy * dy < least
            if hits == 0:
                continue
            by_margin = 1.0 / max(d.margin, 1e-9)
            for m in range(_PLAYS):
                gap = length(disc_x - p.x[m], disc_y - p.y[m]) - d.reach
                touches = 1.0 if gap < _CONTACT else 0.0
                intrusion = max(0.0, 1.0 - gap * by_margin)
                price = touches * contact_cost + (1.0 - touches) * weight * intrusion
                p.danger[m] += p.going[m] * price
                p.going[m] *= 1.0 - touches


@compiled
def is_clear(body: Record, discs: Records, count: int, speed: float, speed_x: float, speed_y: float) -> bool:
    """Return whether a velocity is trivially safe: near the current one, and nothing ahead.

    Avoids the simulation, which a team in formation rarely needs.
    """
    if abs(speed - body.speed) > _SAME_SPEED:
        return False
    # A zero velocity has no heading.
    ahead = speed_x * body.heading_cos + speed_y * body.heading_sin
    if speed > _STANDSTILL and ahead < _SAME_HEADING * speed:
        return False
    for j in range(count):
        d = discs[j]
        ux, uy = d.speed_x - speed_x, d.speed_y - speed_y
        square = ux * ux + uy * uy
        closest = clip(-(d.x * ux + d.y * uy) / max(square, 1e-9), 0.0, _HORIZON)
        dx, dy = d.x + ux * closest, d.y + uy * closest
        far = d.reach + d.margin + _GLANCE
        if dx * dx + dy * dy < far * far:
            return False
    return True


@compiled
def safe_velocity(
    body: Record, discs: Records, count: int, wanted_x: float, wanted_y: float, plays: Record
) -> tuple[float, float, bool]:
    """Return a safe velocity (m/s), and whether it differs from the wanted one.

    ``plays`` is a work record, :data:`PLAYS`.
    """
    if count == 0:
        return wanted_x, wanted_y, False
    wanted = length(wanted_x, wanted_y)
    if is_clear(body, discs, count, wanted, wanted_x, wanted_y):
        return wanted_x, wanted_y, False
    error = heading_error(body, wanted_x, wanted_y) if wanted > _STANDSTILL else 0.0
    least, danger = cost_of(body, discs, count, wanted, error, wanted_x, wanted_y, 1e9)
    if danger <= 0.0:
        return wanted_x, wanted_y, False
    best_x, best_y = wanted_x, wanted_y
    cost, _ = cost_of(body, discs, count, 0.0, 0.0, wanted_x, wanted_y, least)
    if cost < least:
        least, best_x, best_y = cost, 0.0, 0.0
    begin_plays(body, error, plays)
    play_all(body, discs, count, plays)
    # As shares of the greatest speed and distance.
    top, farthest = body.max_speed, body.max_speed * _HORIZON
    wish_x, wish_y = wanted_x / top, wanted_y / top
    for k in range(_DIRECTIONS):
        for level in range(len(_SPEED_LEVELS)):
            m = level * _DIRECTIONS + k
            share = _SPEED_LEVELS[level]
            x, y = share * plays.goal_cos[k], share * plays.goal_sin[k]
            # A lower limit of the distance from the wanted final position.
            if _LIKELY * length(x - wish_x, y - wish_y) >= least:
                continue
            cost = plays.danger[m] + (_KEEP_RIGHT if k % 2 == 1 else 0.0)
            if plays.going[m] == 0.0:  # it touched something
                cost += 2.0
            else:
                cost += length(plays.x[m] / farthest - wish_x, plays.y[m] / farthest - wish_y)
            if cost < least:
                least, best_x, best_y = cost, top * x, top * y
    return best_x, best_y, True
