"""Target motions and the steering of a scripted target.

The built-in motions are declared in the order of these imports.
"""

from posse.rules.targets import motions, smart  # noqa: F401
