"""Target motions, one file each, and avoidance of walls and obstacles.

The built-in motions are declared in the order of these imports.
"""

from posse.rules.targets import constant, accelerating, smart, agent  # noqa: F401, I001

from posse.rules.targets.declaring import Memory, TargetMotion, target_motion

__all__ = ["Memory", "TargetMotion", "target_motion"]
