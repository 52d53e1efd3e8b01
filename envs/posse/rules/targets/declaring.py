"""Declaration of target motions, and their dispatch in a kernel.

A motion sets the goal heading, ``w.goal_cos`` and ``w.goal_sin``, in every control step. One
steering law turns the target to it (:mod:`posse.rules.targets.steering`).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from posse.numeric import compiled, written
from posse.registry import METRICS, TARGET_MOTIONS, Function
from posse.rules.state import WORLD_NAMES
from posse.scenarios import Scenario

_ZERO: Final = np.float32(0.0)

Bound = float | Callable[[Scenario], float]

GOAL_PARAMETERS: Final = ("c", "w", "trackers", "obstacles", "s")
"""Scenario, world, trackers, obstacles, scratch memory; a motion takes the first two or more."""


class Memory(NamedTuple):
    """A state variable of a motion: a float32 of the world's record, 0 at the start.

    It is part of the global state, within its bounds: numbers, or functions of the scenario.
    """

    name: str
    unit: str
    low: Bound
    high: Bound
    meaning: str

    def bound(self, name: str, scenario: Scenario) -> float:
        """Return the bound ``"low"`` or ``"high"`` in a scenario."""
        bound: Any = getattr(self, name)
        return float(bound(scenario) if callable(bound) else bound)


@dataclass(frozen=True, eq=False)
class TargetMotion:
    """A motion of the target."""

    name: str
    meaning: str
    goal: Function
    """Sets the goal heading; takes the first of :data:`GOAL_PARAMETERS`."""
    draw: Function | None
    """(c, w): draws the parameters of an episode, from the stream TARGET."""
    memory: tuple[Memory, ...]
    mirrored: bool
    """Whether the goal heading is mirrored near walls."""
    agent: bool
    """Whether a policy controls the target instead."""

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """Its functions, and their kinds of return value."""
        draw = () if self.draw is None else ((self.draw, "nothing"),)
        return (self.goal, "nothing"), *draw


def target_motion(
    name: str,
    *,
    draw: Function | None = None,
    memory: Sequence[Memory] = (),
    mirrored: bool = True,
    agent: bool = False,
) -> Callable[[Function], Function]:
    """Declare a function as a target motion; its docstring is the meaning.

    The function takes ``(c, w)``, the scenario as kernels read it
    (:data:`posse.rules.state.CONFIG`) and the world's record, and, where it needs them,
    ``trackers``, ``obstacles`` and scratch memory. It sets ``w.goal_cos`` and ``w.goal_sin``, a
    unit vector in the common frame; they hold what it set last, at first the target's heading.

    Args:
        name: What ``target_motion`` of a scenario calls it.
        draw: A function ``(c, w)`` that draws the parameters of an episode.
        memory: Its state variables, fields of ``w``.
        mirrored: Whether the goal is mirrored near walls; not needed by a motion that avoids them.
        agent: Whether a policy controls the target: the function is not called.

    Raises:
        DeclarationError: The name, or that of a memory, is taken, the docstring is missing, or the
            parameters are wrong.
    """

    def declare(function: Function) -> Function:
        TARGET_MOTIONS.check_parameters(function, GOAL_PARAMETERS, least=2)
        if draw is not None:
            TARGET_MOTIONS.check_parameters(draw, GOAL_PARAMETERS[:2])
        _check_memory(function, memory)
        meaning = inspect.getdoc(function) or ""
        goal = compiled(function)
        drawing = None if draw is None else compiled(draw)
        TARGET_MOTIONS.add(name, TargetMotion(name, meaning, goal, drawing, tuple(memory), mirrored, agent), goal)
        return goal

    return declare


def _check_memory(function: Function, memory: Sequence[Memory]) -> None:
    taken = {each.name for motion in TARGET_MOTIONS.built_in() for each in motion.memory}
    taken.update(WORLD_NAMES, (f"{name}_sum" for name in METRICS))
    for each in memory:
        if each.name in taken:
            raise TARGET_MOTIONS.error(
                function, f"a world has a field {each.name!r}: choose another name for the memory"
            )
        if not each.name.isidentifier():
            raise TARGET_MOTIONS.error(function, f"invalid name {each.name!r} of a memory")
        taken.add(each.name)


def drawing(motions: Sequence[TargetMotion]) -> Any:
    """Return (c, w): clears the memories, and draws the parameters of the motion of ``c``."""
    lines = [f"w.{each.name} = ZERO" for motion in motions for each in motion.memory]
    functions: dict[str, Any] = {"ZERO": _ZERO}
    for k, motion in enumerate(motions):
        if motion.draw is not None:
            functions[f"draw_{k}"] = motion.draw
            lines += [f"if c.motion == {k}:", f"    draw_{k}(c, w)"]
    return written("draw_motion", ("c", "w"), lines, functions)


def setting_goals(motions: Sequence[TargetMotion]) -> Any:
    """Return (c, w, trackers, obstacles, s): sets the goal heading by the motion of ``c``."""
    lines: list[str] = []
    functions: dict[str, Any] = {}
    for k, motion in enumerate(motions):
        if not motion.agent:
            functions[f"goal_{k}"] = motion.goal
            arguments = tuple(inspect.signature(motion.goal).parameters)
            otherwise = "el" if lines else ""
            lines += [f"{otherwise}if c.motion == {k}:", f"    goal_{k}({', '.join(arguments)})"]
    return written("set_goal", GOAL_PARAMETERS, lines, functions)
