"""The paper's Distributed Decision Control System (DDCS): three layers, four tasks.

Its layers are :mod:`~posse_baselines.ddcs.monitoring`; target tracking, which is :mod:`~posse_baselines.ddcs.roles` and
:mod:`~posse_baselines.ddcs.motion`; and motor actuation, which is :mod:`~posse_baselines.ddcs.actuation` and
:mod:`posse_baselines.laws.safeguard`. :mod:`~posse_baselines.ddcs.baseline` is where to begin: one control step of one
tracker, in order, and what makes it PNGL + l-φ.
"""

from posse_baselines.ddcs.baseline import DDCS
from posse_baselines.ddcs.settings import CONVERGING, EXCHANGING, FLOCKING, SEARCHING, TASKS, Settings

__all__ = ["CONVERGING", "DDCS", "EXCHANGING", "FLOCKING", "SEARCHING", "TASKS", "Settings"]
