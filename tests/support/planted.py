"""A policy in a module that nothing may import because a file names it."""

from __future__ import annotations

from posse_baselines.policies.simple import Idle


class Planted(Idle):
    name = "planted"
