"""Target motions and the steering of a scripted target.

The built-in motions are declared in the order of these imports.
"""

from posse.rules.targets import motions, smart  # noqa: F401
from posse.rules.targets.declaration import Memory, TargetMotion, target_motion

__all__ = ["Memory", "TargetMotion", "target_motion"]
