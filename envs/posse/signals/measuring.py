"""How a metric is declared, and how the declared ones become part of a kernel.

A metric is declared on what it adds to a running sum in each control step. The sum is a field of
the world's record, ``<name>_sum``; at the end of the episode it becomes the figure. The parameters
of the function say of what it is a sum:

========================= ========================================================================
(c, w)                    of a number of the world
(c, w, t)                 over the trackers that work
(c, w, trackers)          of a number of the team; (c, w, trackers, slots) likewise
========================= ========================================================================

What has no sum of its own is declared on the figure, as a function of the worlds' records.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Records, compiled, written
from posse.registry import METRICS, Function
from posse.rules.state import NEVER, WORLD_NAMES
from posse.scenarios import Scenario

Column = npt.NDArray[np.float64]
Figure = Callable[[Scenario, Records], Column]

_PARAMETERS: Final = (
    ("c", "w"), ("c", "w", "t"), ("c", "w", "trackers"), ("c", "w", "trackers", "slots"),
)  # fmt: skip
_STEPS: Final[dict[str, str | None]] = {
    "step": "step", "tracker_step": "tracker_steps", "episode": None,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Metric:
    """One figure of an episode."""

    name: str
    unit: str
    meaning: str
    function: Figure
    """(scenario, worlds) -> (E,)."""
    each_step: Function | None = None
    """What is added to its sum in a control step; None: it has none."""
    sum_type: type = np.float64

    @property
    def sum_name(self) -> str:
        """The field of the world's record that holds its sum."""
        return f"{self.name}_sum"

    @property
    def fields(self) -> tuple[tuple[str, type], ...]:
        """What it needs in the world's record."""
        return () if self.each_step is None else ((self.sum_name, self.sum_type),)

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """The functions of it that are compiled, and what each returns."""
        return () if self.each_step is None else ((self.each_step, "number"),)


def metric(
    unit: str, *, per: str = "step", sum_type: type = np.float64
) -> Callable[[Function], Function]:
    """Declare what a metric of the function's name adds up; the docstring is the meaning.

    Args:
        unit: Of the figure.
        per: What the sum is divided by: ``"step"``, by the control steps of the episode;
            ``"tracker_step"``, by the control steps of all trackers that work; ``"episode"``, by
            nothing.
        sum_type: Of the sum.

    Raises:
        DeclarationError: The name is taken, the docstring is missing, the parameters are none of
            those above, or there is no such ``per``.
    """

    def declare(function: Function) -> Function:
        names = tuple(inspect.signature(function).parameters)
        if names not in _PARAMETERS:
            allowed = " or ".join(f"({', '.join(each)})" for each in _PARAMETERS)
            raise METRICS.error(function, f"its parameters are ({', '.join(names)}), not {allowed}")
        if per not in _STEPS:
            raise METRICS.error(function, f"per={per!r} is none of: {', '.join(_STEPS)}")
        name = function.__name__
        if f"{name}_sum" in WORLD_NAMES:
            raise METRICS.error(function, f"a world has a field '{name}_sum': choose another name")
        each_step, meaning = compiled(function), inspect.getdoc(function) or ""
        figure = _divided(f"{name}_sum", _STEPS[per])
        METRICS.add(name, Metric(name, unit, meaning, figure, each_step, sum_type), each_step)
        return each_step

    return declare


def figure(unit: str) -> Callable[[Figure], Figure]:
    """Declare a function (scenario, worlds (E,)) -> (E,) as a metric of its name."""

    def declare(function: Figure) -> Figure:
        name = function.__name__
        METRICS.add(name, Metric(name, unit, inspect.getdoc(function) or "", function), function)
        return function

    return declare


def _divided(sums: str, by: str | None) -> Figure:
    def read(scenario: Scenario, worlds: Records) -> Column:
        total: Column = np.asarray(worlds[sums], np.float64)
        return total if by is None else total / np.maximum(worlds[by], 1)

    return read


def clearing(metrics: Sequence[Metric]) -> Any:
    """Return (w): sets the sums to zero."""
    lines = [f"w.{m.sum_name} = ZERO" for m in metrics if m.each_step is not None]
    lines.append("w.tracker_steps = ZERO")
    return written("clear_sums", ("w",), lines, {"ZERO": np.float32(0)})


def adding(metrics: Sequence[Metric]) -> Any:
    """Return (c, w, trackers, slots): adds a control step to the sums."""
    functions: dict[str, Any] = {"F": np.float32, "ZERO": np.float32(0), "NEVER": NEVER}
    before, loop = [], []
    after = ["w.tracker_steps += F(w.working)"]
    for k, m in enumerate(metrics):
        if m.each_step is None:
            continue
        names = tuple(inspect.signature(m.each_step).parameters)
        functions[f"metric_{k}"] = m.each_step
        value = f"metric_{k}({', '.join(names)})"
        if "t" in names:
            before.append(f"total_{k} = ZERO")
            loop.append(f"        total_{k} += {value}")
            value = f"total_{k}"
        after.append(f"w.{m.sum_name} += {value}")
    head = [
        "for i in range(c.num_trackers):",
        "    t = trackers[i]",
        "    if t.broken_at == NEVER:",
    ]
    lines = [*before, *head, *(loop or ["        pass"]), *after]
    return written("add_to_sums", ("c", "w", "trackers", "slots"), lines, functions)
