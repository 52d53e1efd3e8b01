"""The paper's Distributed Decision Control System (DDCS): three layers, four tasks.

====================  ===============================================================================================
layer                 where it is
====================  ===============================================================================================
monitoring            :mod:`~posse_baselines.ddcs.monitoring`: an estimate of the target, a table of team-mates
target tracking       :mod:`~posse_baselines.ddcs.roles`: leader and slots; :mod:`~posse_baselines.ddcs.motion`: the
                      four tasks and their laws
motor actuation       :mod:`~posse_baselines.ddcs.actuation`, then :mod:`posse_baselines.laws.safeguard`
====================  ===============================================================================================

:mod:`~posse_baselines.ddcs.baseline` is where to begin: one control step of one tracker, in order, and what makes it
PNGL + l-φ.
"""

from posse_baselines.ddcs.baseline import DDCS
from posse_baselines.ddcs.settings import CONVERGING, EXCHANGING, FLOCKING, SEARCHING, TASKS, Settings

__all__ = ["CONVERGING", "DDCS", "EXCHANGING", "FLOCKING", "SEARCHING", "TASKS", "Settings"]
