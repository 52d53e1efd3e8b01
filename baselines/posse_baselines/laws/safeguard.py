"""The safeguard: the collision-free velocity nearest to the wanted one.

The surroundings of a tracker are a list of discs with velocities: team-mates, the target, obstacles, walls. A velocity
is evaluated by simulating how the robot tracks it within its limits: the time spent within the margins, whether and
when it would touch, and how far it ends from where the wanted velocity leads.
"""

import math
from typing import Final

import numpy as np

from posse.numeric import Record, Records, compiled, record_type
from posse_baselines.laws.geometry import angle_of, clip, cross, dot, length, scaled, vector, wrap
from posse_baselines.laws.guidance import heading_error, turn_command

_NEAR: Final = 2.7
"""m. What is farther from a contact is no danger yet."""
WALLS: Final = np.array((1.0, -1.0, 1.0j, -1.0j))
"""Outward normals of the walls."""

MOST_TURN: Final = 2.0
"""rad. Farther round is no way past a disc."""

_STEPS: Final = np.array((0.1, 0.1, 0.1, 0.15, 0.15, 0.2, 0.2, 0.25, 0.25))  # of a simulated velocity, s
_HORIZON: Final = sum(_STEPS.tolist())
_SPEED_LEVELS: Final = np.array((1.0, 0.5))  # shares of the greatest speed, each tried in all directions
# From the wanted direction outwards, alternating right and left.
_DIRECTIONS: Final = 16
_TURNS: Final = np.array(
    [(1 if k % 2 else -1) * ((k + 1) // 2) * 2.0 * math.pi / _DIRECTIONS for k in range(_DIRECTIONS)]
)
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
_LARGEST: Final = 2.0  # m; reach of a disc that is passed by a detour; walls are larger
_ROUNDS: Final = 6  # discs that a detour passes on one side, at most

DISC: Final = record_type(
    ("place", np.complex128),  # from the tracker, m
    ("velocity", np.complex128),  # m/s
    ("reach", np.float64),  # distance between the centres at contact, m
    ("margin", np.float64),  # clearance, m
    ("turn", np.float64),  # of its velocity, rad/s
)
"""An object to avoid, relative to the tracker."""


@compiled
def put_disc(discs: Records, count: int, place: complex, velocity: complex, reach: float, margin: float) -> int:
    """Add a disc to a list of ``count`` if it is near, unless the list is full; return the new count."""
    near = _NEAR + reach
    if count >= len(discs) or dot(place, place) >= near * near:
        return count
    d = discs[count]
    d.place, d.velocity, d.reach, d.margin, d.turn = place, velocity, reach, margin, 0.0
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
        place = scaled(WALLS[k], to_wall(arena, k, position) - radius + _PLANET)
        count = put_disc(discs, count, place, 0j, _PLANET, margin)
    return count


@compiled
def moved(disc: Record, time: float) -> complex:
    """Return by what a disc moves in a time (s), m: along an arc, if its velocity turns."""
    if disc.turn == 0.0:
        return scaled(disc.velocity, time)
    half = 0.5 * disc.turn * time
    return scaled(disc.velocity * vector(1.0, half), time * math.sin(half) / half)


@compiled
def cost_of(
    body: Record, discs: Records, speed: float, error: float, wanted: complex, enough: float
) -> tuple[float, float]:
    """Return (cost, danger) of a velocity, a speed (m/s) and the angle to its heading (rad); stops above ``enough``.

    The danger is the mean intrusion into the margins over the look-ahead, as a share of them, and a price for a
    contact, the higher the sooner. The cost adds how far the robot ends from where the wanted velocity leads, as a
    share of the greatest distance.
    """
    place, danger, time = 0j, 0.0, 0.0
    v, omega, heading = body.speed, body.omega, body.heading
    goal = heading * vector(1.0, error)
    for k in range(len(_STEPS)):
        step = _STEPS[k]
        turn_change, change = body.turn_acceleration * step, body.acceleration * step
        omega = clip(turn_command(body, error, step), omega - turn_change, omega + turn_change)
        v = clip(speed * max(0.0, dot(heading, goal)), v - change, v + change)
        half = vector(1.0, 0.5 * omega * step)
        place += scaled(heading * half, v * step)
        heading = heading * half * half
        error -= omega * step
        time += step
        weight = _INTRUSION_COST * step / _HORIZON
        for j in range(len(discs)):
            d = discs[j]
            way, far = d.place + moved(d, time) - place, d.reach + d.margin
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
        if d.turn != 0.0:  # what follows holds for straight courses
            return False
        u = d.velocity - wanted
        closest = clip(-dot(d.place, u) / max(dot(u, u), 1e-9), 0.0, _HORIZON)
        gap = d.place + scaled(u, closest)
        far = d.reach + d.margin + _GLANCE
        if dot(gap, gap) < far * far:
            return False
    return True


@compiled
def safe_velocity(body: Record, discs: Records, wanted: complex) -> tuple[complex, bool]:
    """Return a safe velocity (m/s), and whether it differs from the wanted one."""
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
    ahead = body.heading * vector(1.0, error)
    for k in range(_DIRECTIONS):
        for level in range(len(_SPEED_LEVELS)):
            speed = body.max_speed * _SPEED_LEVELS[level]
            velocity = scaled(ahead * vector(1.0, _TURNS[k]), speed)
            # A lower limit of the distance from the wanted final position.
            if _LIKELY * length(velocity - wanted) >= least * body.max_speed:
                continue
            cost, _ = cost_of(body, discs, speed, wrap(error + _TURNS[k]), wanted, least)
            cost += _KEEP_RIGHT if k % 2 == 1 else 0.0
            if cost < least:
                least, best = cost, velocity
    return best, True


@compiled
def turn_past(discs: Records, clearance: float, wanted: complex, side: float) -> float:
    """Return the turn (rad, left positive) from a unit vector to a clear direction on a side (1: left, -1: right).

    Standing discs are in the way, not walls. ``2 * MOST_TURN`` if there is none within ``MOST_TURN``.
    """
    turn, ahead = 0.0, wanted
    for _ in range(_ROUNDS):
        least, nearest = 1e9, -1
        for k in range(len(discs)):
            disc = discs[k]
            if disc.velocity != 0j or disc.reach > _LARGEST or dot(disc.place, ahead) <= 0.0:
                continue
            # A little less than the tangent's clearance, or the tangent itself would be blocked.
            if abs(cross(disc.place, ahead)) < 0.98 * (disc.reach + clearance) and length(disc.place) < least:
                least, nearest = length(disc.place), k
        if nearest < 0:
            return turn
        disc = discs[nearest]
        half = math.asin(min(1.0, (disc.reach + clearance) / max(least, 1e-6)))
        # From the wanted direction to the disc's centre, then to its edge.
        turn = angle_of(disc.place * wanted.conjugate()) + side * half
        if abs(turn) > MOST_TURN:
            return 2.0 * MOST_TURN
        ahead = wanted * vector(1.0, turn)
    return 2.0 * MOST_TURN
