"""The safeguard: the velocity nearest to the wanted one that runs into nothing.

What surrounds a tracker is a list of discs, each with a velocity: team-mates, the target, obstacles.
A velocity is judged by when the tracker would come too near to any of them (the velocity obstacles
of Fiorini and Shiller 1998). The tracker goes on as it does now until it has turned, and only then
takes the new velocity: a unicycle cannot do otherwise.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.compiled import compiled

_DIRECTIONS: Final = 12  # to each side, besides straight on
_SPEEDS: Final = 3
_NEVER: Final = 1e6
_KEEP_RIGHT: Final = 0.03
"""By how much passing on the right is preferred, as a share of the greatest speed."""

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
                ("margin", np.float64),  # free width to keep, m
            ],
            align=True,
        ),
    )
)
"""Something that must not be touched, in axes that have the tracker at the origin."""


@compiled
def put_disc(
    discs: Any, count: int, x: float, y: float, speed_x: float, speed_y: float, reach: float, margin: float
) -> int:
    """Add a disc to a list with ``count`` entries; return the new count. A full list stays as it is."""
    if count >= len(discs):
        return count
    d = discs[count]
    d.x, d.y, d.speed_x, d.speed_y, d.reach, d.margin = x, y, speed_x, speed_y, reach, margin
    return count + 1


@compiled
def put_wall(
    discs: Any, count: int, distance: float, normal_x: float, normal_y: float, radius: float, margin: float
) -> int:
    """Add a wall, ``distance`` away along its outward normal: a disc as large as a planet."""
    reach = 1000.0
    away = distance - radius + reach
    return put_disc(discs, count, normal_x * away, normal_y * away, 0.0, 0.0, reach, margin)


@compiled
def time_to_reach(x: float, y: float, speed_x: float, speed_y: float, reach: float) -> float:
    """Return when (s) something at (x, y), moving at a relative velocity, is within ``reach``.

    0 for what is already there and comes nearer; ``1e6`` for what never comes.
    """
    closing = x * speed_x + y * speed_y
    if closing >= 0.0:
        return _NEVER
    gap = x * x + y * y - reach * reach
    if gap <= 0.0:
        return 0.0
    square = speed_x * speed_x + speed_y * speed_y
    under_root = closing * closing - square * gap
    if under_root <= 0.0:
        return _NEVER
    return (-closing - math.sqrt(under_root)) / square


@compiled
def danger(
    discs: Any,
    count: int,
    own_x: float,
    own_y: float,
    speed_x: float,
    speed_y: float,
    delay: float,
    horizon: float,
) -> float:
    """Return how dangerous a velocity (m/s) is: 0 nothing within the horizon, more the sooner.

    The tracker moves on with its own velocity for ``delay`` seconds, then takes the new one.
    """
    worst = 0.0
    for k in range(count):
        d = discs[k]
        distance2 = d.x * d.x + d.y * d.y
        # How it lies after the delay.
        x = d.x + (d.speed_x - own_x) * delay
        y = d.y + (d.speed_y - own_y) * delay
        ux, uy = d.speed_x - speed_x, d.speed_y - speed_y
        # Within the margin already: what counts is not to come nearer still.
        keep = d.reach + d.margin
        if distance2 < keep * keep:
            keep = max(d.reach + 0.02, math.sqrt(distance2) - 0.02)
        soft = time_to_reach(x, y, ux, uy, keep)
        if soft < horizon:
            hard = time_to_reach(x, y, ux, uy, d.reach + 0.02)
            value = (1.0 - soft / horizon) + 4.0 * max(0.0, 1.0 - hard / horizon)
            worst = max(worst, value)
    return worst


@compiled
def safe_velocity(
    discs: Any,
    count: int,
    theta: float,
    speed: float,
    wanted_x: float,
    wanted_y: float,
    max_speed: float,
    max_omega: float,
    reaction: float,
    horizon: float,
) -> tuple[float, float, bool]:
    """Return the velocity (m/s) to take instead of a wanted one, and whether it is another one.

    ``theta`` (rad) and ``speed`` (m/s) are the tracker's own; ``reaction`` (s) is how long it takes
    to change its speed; ``horizon`` (s) is how far ahead it looks.
    """
    if count == 0:
        return wanted_x, wanted_y, False
    own_x, own_y = speed * math.cos(theta), speed * math.sin(theta)
    wanted = math.hypot(wanted_x, wanted_y)
    heading = math.atan2(wanted_y, wanted_x) if wanted > 1e-6 else theta
    delay = _delay(theta, heading, max_omega, reaction)
    least = danger(discs, count, own_x, own_y, wanted_x, wanted_y, delay, horizon)
    if least <= 0.0:
        return wanted_x, wanted_y, False
    best_x, best_y = wanted_x, wanted_y
    least *= 2.0
    for k in range(-_DIRECTIONS, _DIRECTIONS + 1):
        angle = heading + k * (math.pi / _DIRECTIONS)
        cosine, sine = math.cos(angle), math.sin(angle)
        delay = _delay(theta, angle, max_omega, reaction)
        for level in range(_SPEEDS):
            value = max_speed * level / (_SPEEDS - 1)
            if level == 0 and k != 0:
                continue
            x, y = value * cosine, value * sine
            away = math.hypot(x - wanted_x, y - wanted_y) / max_speed
            if k > 0:
                away += _KEEP_RIGHT
            if 0.5 * away >= least:
                continue
            cost = 0.5 * away + 2.0 * danger(
                discs, count, own_x, own_y, x, y, delay, horizon
            )
            if cost < least:
                least, best_x, best_y = cost, x, y
    return best_x, best_y, True


@compiled
def _delay(theta: float, heading: float, max_omega: float, reaction: float) -> float:
    error = heading - theta
    error -= 2.0 * math.pi * math.floor((error + math.pi) / (2.0 * math.pi))
    return reaction + 0.5 * abs(error) / max_omega
