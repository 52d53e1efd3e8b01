"""Limits of all scenarios, including those of float32."""

from __future__ import annotations

from typing import Final

MAX_TRACKERS: Final = 64  # contacts and radio links are bits of one 64-bit word
MAX_OBSTACLES: Final = 60  # the four walls use the last bits

SAFE_MARGIN: Final = 0.1
"""Clearance that a scripted target keeps to obstacles and walls, m."""
START_CLEARANCE: Final = 0.2
"""Minimum clearance between robots, and between a robot and an obstacle, at the start, m."""
OPEN_PLANE_EXTENT: Final = 10.0
"""On the open plane the target starts within this of the origin along each axis, m.

The common frame of the trackers is that of the world: if the target started at the origin, odometry
would reveal its position.
"""

SLACK: Final = 1.001
"""Factor by which bounds of observations and states are widened to allow for float32 rounding."""

# Beyond these, increments and squares would be lost to rounding.
SMALL: Final = 1e-3
WIDE: Final = 1e4
FAR: Final = 1.0e6
"""Value of an unlimited range in the kernels, far beyond any distance of robots, m."""
FARTHEST: Final = 500.0
"""Greatest coordinate of a robot, m: the spacing of float32 there, 3e-5 m, keeps contact exact to 1e-4 m."""
LONGEST_MOVE: Final = 2000.0
"""Greatest square of the distance in a physics step per radius, m: d² <= 2,000 r.

In float32 the squares of the sweep have an error of about 2^-22 d², and hence the contact point of
discs of radius r one of 2^-22 d² / (4 r): 1.2e-4 m at most.
"""
MOST_WEIGHT: Final = 1e6
"""Greatest weight of a reward term; terms are below 1e4, so sums stay far below 3e38."""
