"""Declaration of target motions.

A motion sets the goal heading, ``w.goal_cos`` and ``w.goal_sin``, in every control step. One
steering law turns the target to it (:mod:`posse.rules.targets.steering`).
"""

from __future__ import annotations

import keyword
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from posse.registry import METRICS, TARGET_MOTIONS, Bound, Declaration, Function
from posse.rules.state import WORLD_NAMES
from posse.scenarios import Scenario


class Memory(NamedTuple):
    """A state variable of a motion: a float32 of the world's record, 0 at the start.

    It is part of the global state, within its bounds: numbers, or functions of the scenario.
    """

    name: str
    unit: str
    low: Bound
    high: Bound
    meaning: str


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetMotion(Declaration):
    """A motion of the target; its function sets the goal heading. :func:`target_motion` describes the attributes."""

    draw: Function | None = None
    memory: tuple[Memory, ...] = ()
    mirrored: bool = True
    returns: ClassVar[str] = "nothing"
    further: ClassVar = {"draw": (("c", "w"), "nothing")}

    def check(self, scenario: Scenario) -> None:
        """Raise DeclarationError unless the bounds of its memory are finite and in order in a scenario."""
        for each in self.memory:
            TARGET_MOTIONS.bounds_of(self.function, each.low, each.high, scenario, f" of memory {each.name!r}")


def target_motion(
    name: str, *, draw: Function | None = None, memory: Sequence[Memory] = (), mirrored: bool = True
) -> Callable[[Function], Function]:
    """Declare a function as a target motion; its docstring is the meaning.

    The function takes ``(c, w)``, the scenario as kernels read it and the world, and optionally the
    trackers, the obstacles and scratch memory: ``(c, w, trackers, obstacles, s)``. A policy
    controls the target of the built-in motion ``"agent"``, whose function does nothing.

    Args:
        name: What ``target_motion`` of a scenario calls it.
        draw: A function ``(c, w)`` that draws the parameters of an episode.
        memory: Its state variables, fields of ``w``.
        mirrored: Whether the goal is mirrored near walls; not needed by a motion that avoids them.

    Raises:
        DeclarationError: The name, or that of a memory, is taken, the docstring is missing, or an
            argument or the parameters of a function are wrong.
    """
    TARGET_MOTIONS.check_argument(name, '@posse.target_motion("name")')

    def declare(function: Function) -> Function:
        if not isinstance(mirrored, bool):
            raise TARGET_MOTIONS.error(function, f"mirrored={mirrored!r} must be True or False")
        _check_memory(function, memory)
        return TARGET_MOTIONS.declare(
            TargetMotion, function, name=name, draw=draw, memory=tuple(memory), mirrored=mirrored
        )

    return declare


def _check_memory(function: Function, memory: Any) -> None:
    if not isinstance(memory, (list, tuple)) or not all(isinstance(each, Memory) for each in memory):
        raise TARGET_MOTIONS.error(function, f"memory={memory!r} must be a list of posse.Memory")
    taken = {each.name for motion in TARGET_MOTIONS.built_in() for each in motion.memory}
    taken.update(WORLD_NAMES, (f"{name}_sum" for name in METRICS))
    for each in memory:
        if not isinstance(each.name, str) or not each.name.isidentifier() or keyword.iskeyword(each.name):
            raise TARGET_MOTIONS.error(
                function, f"invalid name {each.name!r} of a memory: use a name that Python allows"
            )
        if each.name in taken:
            raise TARGET_MOTIONS.error(function, f"a world has a field {each.name!r}: choose another name")
        taken.add(each.name)
