"""The safeguard: the collision-free velocity nearest to the wanted one.

The surroundings of a tracker are a list of discs with velocities: team-mates, the target,
obstacles, walls. A velocity is evaluated by simulating how the robot tracks it within its limits:
the time spent within the margins, whether and when it would touch, and the distance of its final
position from that of the wanted velocity.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import Record, Records, compiled, record_type
from posse_baselines.laws.geometry import clip, dot, length, scaled, vector, wrap
from posse_baselines.laws.guidance import heading_error, turn_command

NEAR: Final = 3.0
"""m. Objects farther away are no danger yet."""
WALLS: Final = np.array((1.0, -1.0, 1.0j, -1.0j))
"""Outward normals of the walls."""

_STEPS: Final = np.array((0.1, 0.1, 0.1, 0.15, 0.15, 0.2, 0.2, 0.25, 0.25))  # of a simulated velocity, s
_HORIZON: Final = sum(_STEPS.tolist())
_SPEED_LEVELS: Final = np.array((1.0, 0.5))  # shares of the greatest speed, each tried in all directions
# From the wanted direction outwards, alternating right and left.
_DIRECTIONS: Final = 16
_TURNS: Final = np.array(
    [(1 if k % 2 else -1) * ((k + 1) // 2) * 2.0 * math.pi / _DIRECTIONS for k in range(_DIRECTIONS)]
)
_TURNED: Final = np.cos(_TURNS) + 1j * np.sin(_TURNS)
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
_PLANET: Final = 1000.0  # radius of the disc that stands for a wall, m

DISC: Final = record_type(
    ("place", np.complex128),  # from the tracker, m
    ("velocity", np.complex128),  # m/s
    ("reach", np.float64),  # distance between the centres at contact, m
    ("margin", np.float64),  # clearance, m
)
"""An object to avoid, relative to the tracker."""

_OF_DIRECTION: Final = ("error", "omega", "cos", "sin", "middle_cos", "middle_sin", "goal_cos", "goal_sin", "ahead")
_OF_PLAY: Final = ("speed", "x", "y", "danger", "going")
PLAYS: Final = record_type(
    *((name, np.float64, (_DIRECTIONS,)) for name in _OF_DIRECTION),
    *((name, np.float64, (_PLAYS,)) for name in _OF_PLAY),
)
"""What :func:`play_all` works in: all directions at the first speed, then at the next one. Floats by component, since
the loops over them are vectorised."""


@compiled
def put_disc(discs: Records, count: int, place: complex, velocity: complex, reach: float, margin: float) -> int:
    """Add a disc to a list of ``count``, unless it is full; return the new count."""
    if count >= len(discs):
        return count
    d = discs[count]
    d.place, d.velocity, d.reach, d.margin = place, velocity, reach, margin
    return count + 1


@compiled
def to_wall(arena: Record, k: int, position: complex) -> float:
    """Return the distance (m) from a position to wall k of :data:`WALLS`.

    ``arena`` is any record with ``half_width`` and ``half_height``.
    """
    return float((arena.half_width if k < 2 else arena.half_height) - dot(WALLS[k], position))


@compiled
def put_walls(discs: Records, count: int, arena: Record, position: complex, radius: float, margin: float) -> int:
    """Add those walls of an arena (:func:`to_wall`) that are near, as very large discs; return the new count."""
    for k in range(4):
        away = to_wall(arena, k, position)
        if away < NEAR:
            place = scaled(WALLS[k], away - radius + _PLANET)
            count = put_disc(discs, count, place, 0j, _PLANET, margin)
    return count


@compiled
def half_turn(turn: float) -> complex:
    """Return the unit vector at half an angle (rad), by short polynomials.

    Half a turn in a step is at most about a quarter of a radian, and low accuracy suffices.
    """
    half = 0.5 * turn
    square = half * half
    return complex(1.0 - square * (0.5 - square * (1.0 / 24.0)), half * (1.0 - square * (1.0 / 6.0)))


@compiled
def cost_of(
    body: Record, discs: Records, speed: float, error: float, wanted: complex, enough: float
) -> tuple[float, float]:
    """Return (cost, danger) of a velocity; stops above ``enough``.

    The velocity is a speed (m/s) and the angle to its heading from the present one (rad).

    The danger is the mean intrusion into the margins over the look-ahead, as a share of them, and a
    price for a contact, the higher the sooner. The cost adds how far the robot ends from where the
    wanted velocity leads, as a share of the greatest distance.
    """
    place, danger, time = 0j, 0.0, 0.0
    v, omega, heading = body.speed, body.omega, body.heading
    goal = heading * vector(1.0, error)
    for k in range(len(_STEPS)):
        step = _STEPS[k]
        turn_change, change = body.turn_acceleration * step, body.acceleration * step
        omega = clip(turn_command(body, error, step), omega - turn_change, omega + turn_change)
        v = clip(speed * max(0.0, dot(heading, goal)), v - change, v + change)
        half = half_turn(omega * step)
        place += scaled(heading * half, v * step)
        heading = heading * half * half
        error -= omega * step
        time += step
        weight = _INTRUSION_COST * step / _HORIZON
        for j in range(len(discs)):
            d = discs[j]
            way, far = d.place + scaled(d.velocity, time) - place, d.reach + d.margin
            square = dot(way, way)
            if square < far * far:
                gap = math.sqrt(square) - d.reach
                if gap < _CONTACT:
                    danger += _CONTACT_COST * (1.2 - time / _HORIZON)
                    return danger + 2.0, danger
                danger += weight * (1.0 - gap / d.margin)
        if danger > enough:
            return danger, danger
    top = body.max_speed
    short = scaled(place, 1.0 / (top * _HORIZON)) - complex(wanted.real / top, wanted.imag / top)
    return danger + length(short), danger


@compiled
def play_all(body: Record, discs: Records, error: float, p: Record) -> None:
    """Simulate all velocities of a :data:`PLAYS` as :func:`cost_of` does one; straight ahead is a turn of ``error``.

    The loops over the 32 velocities have no branches and are vectorised.
    """
    goal = body.heading * vector(1.0, error)
    for k in range(_DIRECTIONS):
        p.error[k], p.omega[k] = wrap(error + _TURNS[k]), body.omega
        p.cos[k], p.sin[k] = body.heading.real, body.heading.imag
        turned = goal * _TURNED[k]
        p.goal_cos[k], p.goal_sin[k] = turned.real, turned.imag
    for m in range(_PLAYS):
        p.speed[m], p.x[m], p.y[m], p.danger[m], p.going[m] = body.speed, 0.0, 0.0, 0.0, 1.0
    time = 0.0
    for n in range(len(_STEPS)):
        step = _STEPS[n]
        turn_change, change = body.turn_acceleration * step, body.acceleration * step
        for k in range(_DIRECTIONS):
            c, s, old = p.cos[k], p.sin[k], p.omega[k]
            p.ahead[k] = max(0.0, c * p.goal_cos[k] + s * p.goal_sin[k])
            omega = clip(turn_command(body, p.error[k], step), old - turn_change, old + turn_change)
            half = half_turn(omega * step)
            middle_c, middle_s = c * half.real - s * half.imag, s * half.real + c * half.imag
            p.omega[k], p.middle_cos[k], p.middle_sin[k] = omega, middle_c, middle_s
            p.cos[k] = middle_c * half.real - middle_s * half.imag
            p.sin[k] = middle_s * half.real + middle_c * half.imag
            p.error[k] -= omega * step
        for level in range(len(_SPEED_LEVELS)):
            goal_speed = body.max_speed * _SPEED_LEVELS[level]
            for k in range(_DIRECTIONS):
                m = level * _DIRECTIONS + k
                v = clip(goal_speed * p.ahead[k], p.speed[m] - change, p.speed[m] + change)
                p.speed[m] = v
                p.x[m] += v * step * p.middle_cos[k]
                p.y[m] += v * step * p.middle_sin[k]
        time += step
        weight = _INTRUSION_COST * step / _HORIZON
        contact_cost = _CONTACT_COST * (1.2 - time / _HORIZON)
        for j in range(len(discs)):
            d = discs[j]
            place = d.place + scaled(d.velocity, time)
            x, y, near, hits = place.real, place.imag, d.reach + d.margin, 0
            for m in range(_PLAYS):
                dx, dy = x - p.x[m], y - p.y[m]
                hits += dx * dx + dy * dy < near * near
            if hits == 0:
                continue
            by_margin = 1.0 / max(d.margin, 1e-9)
            for m in range(_PLAYS):
                dx, dy = x - p.x[m], y - p.y[m]
                gap = math.sqrt(dx * dx + dy * dy) - d.reach
                touches = 1.0 if gap < _CONTACT else 0.0
                intrusion = max(0.0, 1.0 - gap * by_margin)
                p.danger[m] += p.going[m] * (touches * contact_cost + (1.0 - touches) * weight * intrusion)
                p.going[m] *= 1.0 - touches


@compiled
def is_clear(body: Record, discs: Records, wanted: complex) -> bool:
    """Return whether a velocity is trivially safe: near the current one, and nothing ahead.

    Avoids the simulation, which a team in formation rarely needs.
    """
    speed = length(wanted)
    if abs(speed - body.speed) > _SAME_SPEED:
        return False
    # A zero velocity has no heading.
    if speed > _STANDSTILL and dot(wanted, body.heading) < _SAME_HEADING * speed:
        return False
    for j in range(len(discs)):
        d = discs[j]
        u = d.velocity - wanted
        closest = clip(-dot(d.place, u) / max(dot(u, u), 1e-9), 0.0, _HORIZON)
        gap = d.place + scaled(u, closest)
        far = d.reach + d.margin + _GLANCE
        if dot(gap, gap) < far * far:
            return False
    return True


@compiled
def safe_velocity(body: Record, discs: Records, wanted: complex, plays: Record) -> tuple[complex, bool]:
    """Return a safe velocity (m/s), and whether it differs from the wanted one.

    ``plays`` is a work record, :data:`PLAYS`.
    """
    if len(discs) == 0 or is_clear(body, discs, wanted):
        return wanted, False
    speed = length(wanted)
    error = heading_error(body, wanted) if speed > _STANDSTILL else 0.0
    least, danger = cost_of(body, discs, speed, error, wanted, 1e9)
    if danger <= 0.0:
        return wanted, False
    best = wanted
    cost, _ = cost_of(body, discs, 0.0, 0.0, wanted, least)
    if cost < least:
        least, best = cost, 0j
    play_all(body, discs, error, plays)
    # As shares of the greatest speed and distance.
    top, farthest = body.max_speed, body.max_speed * _HORIZON
    wish = complex(wanted.real / top, wanted.imag / top)
    for k in range(_DIRECTIONS):
        for level in range(len(_SPEED_LEVELS)):
            m = level * _DIRECTIONS + k
            share = scaled(complex(plays.goal_cos[k], plays.goal_sin[k]), _SPEED_LEVELS[level])
            # A lower limit of the distance from the wanted final position.
            if _LIKELY * length(share - wish) >= least:
                continue
            cost = plays.danger[m] + (_KEEP_RIGHT if k % 2 == 1 else 0.0)
            if plays.going[m] == 0.0:  # it touched something
                cost += 2.0
            else:
                cost += length(complex(plays.x[m] / farthest, plays.y[m] / farthest) - wish)
            if cost < least:
                least, best = cost, scaled(share, top)
    return best, True
