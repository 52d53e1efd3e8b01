"""Heading regulation: tracking a wanted velocity within a robot's limits (section 3.3).

The intact law holds for every sign of θ - σ and in every quadrant: a heading that does not obey it
yet is turned by the shorter turn, at the limit, and then turns with the law.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.numeric import Record, compiled
from posse_baselines.laws.geometry import clip, length

_BRAKING_SHARE: Final = 0.8
_STANDSTILL: Final = 1e-3  # m/s

BODY: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("heading_cos", np.float64),
                ("heading_sin", np.float64),
                ("speed", np.float64),  # m/s
                ("omega", np.float64),  # turn rate, rad/s
                ("max_speed", np.float64),
                ("max_omega", np.float64),
                ("acceleration", np.float64),  # greatest change of the speed, m/s²
                ("turn_acceleration", np.float64),  # greatest change of the turn rate, rad/s²
                ("dt", np.float64),  # control step, s
            ],
            align=True,
        ),
    )
)
"""A robot's present motion and its limits."""


@compiled
def heading_error(body: Record, x: float, y: float) -> float:
    """Return the angle (rad) by which a robot has to turn to head along a vector."""
    c, s = body.heading_cos, body.heading_sin
    return math.atan2(c * y - s * x, c * x + s * y)


@compiled
def turn_command(body: Record, error: float, time: float) -> float:
    """Return the turn rate (rad/s) that ends a heading error (rad) without overshooting."""
    most = math.sqrt(2.0 * _BRAKING_SHARE * body.turn_acceleration * abs(error))
    return clip(error / time, -min(most, body.max_omega), min(most, body.max_omega))


@compiled
def regulate(body: Record, speed_x: float, speed_y: float, rate: float) -> tuple[float, float]:
    """Return the command (V, ω) of a robot that tracks a velocity (m/s) within its limits.

    V is the part of the velocity that lies ahead, and 0 while it points backwards: the robot turns
    on the spot instead of reversing. The wanted velocity itself turns at ``rate`` (rad/s)::

        ω = clip(rate + wrap(θ_wanted - θ) / dt, -ω_max, ω_max)

    A velocity near zero keeps the heading.
    """
    if length(speed_x, speed_y) < _STANDSTILL:
        return 0.0, 0.0
    ahead = clip(speed_x * body.heading_cos + speed_y * body.heading_sin, 0.0, body.max_speed)
    error = heading_error(body, speed_x, speed_y)
    omega = turn_command(body, error, body.dt) + rate
    return ahead, clip(omega, -body.max_omega, body.max_omega)
