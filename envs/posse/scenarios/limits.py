"""Limits that hold for every scenario, and what float32 can work with."""

from __future__ import annotations

from typing import Final

BREAK_CHOICES: Final = ("nearest", "drawn", "given")

MAX_TRACKERS: Final = 64  # contacts and radio links are bits of one 64-bit word
MAX_OBSTACLES: Final = 60  # the four walls take the last bits of the word

SAFE_MARGIN: Final = 0.1
"""Free width that a scripted target keeps to obstacles and walls, m."""
START_CLEARANCE: Final = 0.2
"""Least free width between robots, and between a robot and an obstacle, at the start, m."""
OPEN_PLANE_EXTENT: Final = 10.0
"""On the open plane the target starts within this of the origin along each axis, m.

The trackers' common frame is the world's; were the target to start at the origin, their odometry
would give its place away.
"""

# Finer or wider than this, steps and squares would be lost to rounding.
SMALL: Final = 1e-3
WIDE: Final = 1e4
FAR: Final = 1.0e6
"""What stands for an unlimited range in the kernels; robots never come nearly as far apart, m."""
FARTHEST: Final = 2000.0
"""Greatest coordinate of a robot, m: up to there float32 lie at most 1.2e-4 m apart."""
LONGEST_MOVE: Final = 2000.0
"""Greatest square of the distance in a physics step per radius, m: d² <= 2,000 r.

In float32 the squares of the sweep are off by about 2^-22 d², and so the place where discs of
radius r meet by 2^-22 d² / (4 r): 1.2e-4 m at most.
"""
LEAST_CHANGE: Final = 16
"""Least change in a physics step, in spacings of float32: rounding costs it at most 1/32."""
MOST_WEIGHT: Final = 1e6
"""Of a reward term. Terms are below 1e4: an episode's sum stays far below float32's 3e38."""
