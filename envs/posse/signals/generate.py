"""The one generator: compiled functions for the declarations of a scenario, as readable source text.

numba cannot loop over a tuple of functions, since each function has a type of its own. So the functions below are
written out, with one line for each declared function that they call. :func:`posse.kernel_source` returns the text.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import posse.signals.metrics
import posse.signals.own_fields
import posse.signals.reward  # noqa: F401  (declare the built-in metrics, fields and terms)
from posse.declarations import Declarations, Function, field, metric, parameters_of, place_of
from posse.numeric import WIDTH
from posse.scenarios import Scenario, get_scenario
from posse.signals.views import Generated


def generated_for(declarations: Declarations) -> Generated:
    """Return the compiled functions for declarations."""
    module = _Module(declarations)
    scope: dict[str, Any] = {"__name__": __name__, **module.functions}
    exec(compile(module.text, "<posse.kernel_source>", "exec"), scope)
    return Generated(**{name: scope[name] for name in Generated._fields})


def kernel_source(scenario: str | Scenario = "constant", **overrides: Any) -> str:
    """Return the source text of what the kernel of a scenario calls for its declarations.

    It has one function each for the own observation fields, those of a team-mate, the rewards, the target's motion,
    the sensor and the sums of the metrics.
    """
    return _Module(Declarations.of(get_scenario(scenario, **overrides))).text


_HEAD: Final = '''"""Functions that posse compiles for the declarations of a scenario."""

from numpy import float32, int64

from posse.numeric import ZERO, choose, compiled, eight
from posse.rules.senses import add_noise
from posse.rules.state import NEVER
from posse.signals.views import write_block

# The declared functions:'''


class _Module:
    """The module of a set of declarations.

    Attributes:
        text: Its source.
        functions: The declared functions by their names in it, which it finds in its scope. It does not import them,
            since a module may hold another function under this name by now.
    """

    def __init__(self, declarations: Declarations) -> None:
        self.functions: dict[str, Function] = {}
        _, motions, sensors, metrics, terms = declarations
        own = [field for field in declarations.fields if not field.of_neighbour]
        of_mate = [field for field in declarations.fields if field.of_neighbour]
        summed = [metric for metric in metrics if metric.summed]
        functions = {
            "write_own(c, v, rows)": self._columns(own),
            "write_mate(c, v, m, rows)": ["there = m.number >= ZERO", *self._columns(of_mate)],
            "reward(c, w, t, weights, values)": self._reward({f"term_{t.name}": t.function for t in terms}),
            "target_reward(c, w, weights, values)": self._reward({f"target_term_{t.name}": t.of_target for t in terms}),
            "begin_motion(c, w)": [
                *(f"w.{memory} = ZERO" for motion in motions for memory in motion.memory),
                *self._chosen("motion", {f"draw_{each.name}": each.draw for each in motions}, "{}"),
            ],
            "set_goal(c, w, trackers, obstacles, s)": self._chosen(
                "motion", {f"goal_{each.name}": each.function for each in motions}, "{}"
            ),
            "sees(c, w, t, dx, dy, s)": [
                *self._chosen("sensor", {f"sight_{each.name}": each.function for each in sensors}, "return bool({})"),
                "return False",
            ],
            "measure(c, w, number, dx, dy)": [
                *self._chosen(
                    "sensor",
                    {f"measure_{each.name}": each.measure for each in sensors},
                    "x, y = {}",
                    "return float32(x), float32(y)",
                ),
                "return add_noise(c, w, number, dx, dy)",
            ],
            "clear_sums(w)": [*(f"w.{metric.sum_name} = ZERO" for metric in summed), "w.tracker_steps = 0"],
            "add_to_sums(c, w, trackers, slots)": self._sums(summed),
        }
        body = [
            f"own_size = {_size(own)}",
            f"mate_size = {_size(of_mate)}",
            *("\n    ".join([f"\n\n@compiled\ndef {head}:", *lines]) for head, lines in functions.items()),
        ]
        declared = (f"# {name}: {place_of(function)}" for name, function in self.functions.items())
        self.text = "\n".join([_HEAD, *declared, "", *body, ""])

    def _call(self, alias: str, function: Function) -> str:
        """Return the call of a declared function with its parameters as arguments."""
        alias = alias.replace("-", "_")
        while self.functions.setdefault(alias, function) is not function:
            alias += "_"
        return f"{alias}({', '.join(parameters_of(function))})"

    def _columns(self, fields: Iterable[field]) -> Iterator[str]:
        columns: list[str] = []
        size = _size(fields)
        blocks = [*range(0, size - WIDTH, WIDTH), size - WIDTH]  # the last one repeats columns of the one before
        for each in fields:
            mine = [f"column_{each.name}_{q}" for q in range(each.size)]
            yield f"{', '.join(mine)} = {self._call(f'field_{each.name}', each.function)}"
            if "v" not in parameters_of(each.function):  # a constant
                yield from (f"{column} = eight(float32({column}))" for column in mine)
            if each.of_neighbour:
                yield from (f"{column} = choose(there, {column}, float32({each.unknown or 0}))" for column in mine)
            columns += mine
            # As soon as there are eight, so that few have to be kept at a time.
            while blocks and len(columns) >= blocks[0] + WIDTH:
                first = blocks.pop(0)  # written as int64(...), else numba would compile write_block for each number
                yield f"write_block(({', '.join(columns[first : first + WIDTH])}), int64({first}), rows)"

    def _reward(self, terms: Mapping[str, Function | None]) -> Iterator[str]:
        for k, (name, function) in enumerate(terms.items()):
            yield f"values[{k}] = " + ("ZERO" if function is None else self._call(name, function))
        yield "reward = ZERO"
        # From last to first: another order would round differently and change results.
        yield from (f"reward = float32(weights[{k}] * values[{k}] + reward)" for k in reversed(range(len(terms))))
        yield "return reward"

    def _chosen(self, setting: str, functions: Mapping[str, Function | None], *statements: str) -> Iterator[str]:
        """Yield statements with the call of one of several functions, by a number of the scenario."""
        for k, (name, function) in enumerate(functions.items()):
            if function is not None:
                call = self._call(name, function)
                yield from (f"if c.{setting} == {k}:", *(f"    {each.format(call)}" for each in statements))

    def _sums(self, metrics: Iterable[metric]) -> Iterator[str]:
        loop, after = ["t = trackers[i]", "if t.broken_at == NEVER:"], ["w.tracker_steps += w.working"]
        for each in metrics:
            value = self._call(f"metric_{each.name}", each.function)
            if "t" in parameters_of(each.function):
                yield f"total_{each.name} = ZERO"
                loop.append(f"    total_{each.name} += {value}")
                value = f"total_{each.name}"
            after.append(f"w.{each.sum_name} += {value}")
        yield from ("for i in range(c.num_trackers):", *(f"    {line}" for line in loop), *after)


def _size(fields: Iterable[field]) -> int:
    return sum(each.size for each in fields)
