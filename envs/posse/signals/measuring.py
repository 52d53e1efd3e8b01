"""Declaration of metrics, and generation of the code that updates their sums.

A metric is declared on the function whose value is added to a running sum in each control step. The
sum is the field ``<name>_sum`` of the world's record, and is divided at the end of the episode. The
parameters of the function determine what is summed:

========================= ========================================================================
(c, w)                    a value of the world
(c, w, t)                 a value of each working tracker
(c, w, trackers)          a value of the team
(c, w, trackers, slots)   a value of the team, with the slots
========================= ========================================================================

A metric without a sum is declared on a function of the worlds' records.
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

_PARAMETERS: Final = (("c", "w"), ("c", "w", "t"), ("c", "w", "trackers"), ("c", "w", "trackers", "slots"))
_STEPS: Final[dict[str, str | None]] = {"step": "step", "tracker_step": "tracker_steps", "episode": None}


@dataclass(frozen=True, eq=False)
class Metric:
    """One metric of an episode."""

    name: str
    unit: str
    meaning: str
    function: Figure
    """(scenario, worlds) -> (E,)."""
    each_step: Function | None = None
    """Returns the value added to the sum in a control step; None: there is no sum."""
    sum_type: type = np.float64

    @property
    def sum_name(self) -> str:
        """Name of the field of the world's record that holds the sum."""
        return f"{self.name}_sum"

    @property
    def fields(self) -> tuple[tuple[str, type], ...]:
        """Fields that the metric adds to the world's record."""
        return () if self.each_step is None else ((self.sum_name, self.sum_type),)

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """The compiled functions of the metric, and what each returns."""
        return () if self.each_step is None else ((self.each_step, "number"),)


def metric(unit: str, *, per: str = "step", sum_type: type = np.float64) -> Callable[[Function], Function]:
    """Declare a metric with the function's name; the function's docstring is the meaning.

    Args:
        unit: Unit of the metric.
        per: Divisor of the sum: ``"step"``: control steps of the episode; ``"tracker_step"``:
            control steps of all working trackers; ``"episode"``: 1.
        sum_type: Type of the sum.

    Raises:
        DeclarationError: The name is taken, the docstring is missing, the parameters are not among
            those above, or ``per`` is unknown.
    """

    def declare(function: Function) -> Function:
        names = tuple(inspect.signature(function).parameters)
        if names not in _PARAMETERS:
            allowed = " or ".join(f"({', '.join(each)})" for each in _PARAMETERS)
            raise METRICS.error(function, f"its parameters are ({', '.join(names)}), not {allowed}")
        if per not in _STEPS:
            raise METRICS.error(function, f"unknown per={per!r}; allowed: {', '.join(_STEPS)}")
        name = function.__name__
        if f"{name}_sum" in WORLD_NAMES:
            raise METRICS.error(function, f"a world has a field '{name}_sum': choose another name")
        each_step, meaning = compiled(function), inspect.getdoc(function) or ""
        figure = _divided(f"{name}_sum", _STEPS[per])
        METRICS.add(name, Metric(name, unit, meaning, figure, each_step, sum_type), each_step)
        return each_step

    return declare


def figure(unit: str) -> Callable[[Figure], Figure]:
    """Declare a function (scenario, worlds (E,)) -> (E,) as a metric with its name."""

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
    head = ["for i in range(c.num_trackers):", "    t = trackers[i]", "    if t.broken_at == NEVER:"]
    lines = [*before, *head, *(loop or ["        pass"]), *after]
    return written("add_to_sums", ("c", "w", "trackers", "slots"), lines, functions)
