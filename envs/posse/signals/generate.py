"""The one generator: compiled functions for the declarations of a scenario, as readable source text.

numba cannot loop over a tuple of functions, since each function has a type of its own. So the
functions below are written out, with one line for each declared function that they call.
:func:`posse.kernel_source` returns the text.
"""

from __future__ import annotations

import functools
import linecache
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import posse.signals.own_fields  # noqa: F401  (declares the built-in fields)
from posse.numeric import WIDTH
from posse.registry import (
    FIELDS,
    METRICS,
    REWARD_TERMS,
    SENSORS,
    TARGET_MOTIONS,
    Declaration,
    DeclarationError,
    Function,
    Registry,
    parameters_of,
    place_of,
    plain,
)
from posse.rules.senses import Sensor
from posse.rules.targets import TargetMotion
from posse.scenarios import Scenario
from posse.signals.fields import FieldDeclaration, limited
from posse.signals.metrics import Metric
from posse.signals.reward import RewardTerm, terms_for


class Declarations(NamedTuple):
    """The declarations of a scenario, each kind in order of evaluation."""

    fields: tuple[FieldDeclaration, ...]
    """Observation fields, except sonar and team-mates."""
    mate_fields: tuple[FieldDeclaration, ...]
    """Fields of a team-mate, except its message."""
    motions: tuple[TargetMotion, ...]
    sensors: tuple[Sensor, ...]
    metrics: tuple[Metric, ...]
    reward_terms: tuple[RewardTerm, ...]

    @property
    def term_names(self) -> tuple[str, ...]:
        """Names of the reward terms."""
        return tuple(term.name for term in self.reward_terms)

    def added(self) -> Iterator[tuple[Registry[Any], Declaration]]:
        """Yield the declarations of users' modules, each with its registry."""
        kinds = (FIELDS, FIELDS, TARGET_MOTIONS, SENSORS, METRICS, REWARD_TERMS)
        for registry, group in zip(kinds, self, strict=True):
            yield from ((registry, each) for each in group if not each.built_in)

    def fingerprints(self) -> dict[str, str]:
        """Return a hash of each declaration of a user's module, by kind and name."""
        return {f"{registry.kind} {each.name!r}": each.fingerprint() for registry, each in self.added()}

    def check_fingerprints(self, others: Mapping[str, str]) -> None:
        """Check that saved worlds were made with these declarations.

        Raises:
            DeclarationError: One was another then.
        """
        for name, mine in self.fingerprints().items():
            if others.get(name, mine) != mine:
                raise DeclarationError(
                    f"{name} is not the one that these worlds were saved with, as its code or what it uses "
                    "has changed: declare it as it was, or start the worlds anew"
                )


class Generated(NamedTuple):
    """The generated functions, for compiled code (:data:`_FUNCTIONS`), and the lengths of what they write."""

    write_own: Any
    write_mate: Any
    write_empty: Any
    reward: Any
    target_reward: Any
    draw_motion: Any
    set_goal: Any
    sees: Any
    measure: Any
    clear_sums: Any
    add_to_sums: Any
    width: int
    """Length of the observation before the sonar."""
    mate_width: int
    """Length of a team-mate's part, without its message."""


_FUNCTIONS: Final = {
    "write_own": ("c, v, s, rows", "Write the own fields of eight observers."),
    "write_mate": ("c, v, m, s, rows", "Write the fields of a team-mate of each of eight observers."),
    "write_empty": ("o, k", "Write an empty place of a team-mate to an observation, from number k on."),
    "reward": ("c, w, t, weights, values", "Return the reward of a tracker; write the values of its terms, (K,)."),
    "target_reward": ("c, w, weights, values", "Return the same of a target that is an agent."),
    "draw_motion": ("c, w", "Clear the memories of the target's motion, and draw its parameters for an episode."),
    "set_goal": ("c, w, trackers, obstacles, s", "Set the goal heading of a scripted target."),
    "sees": ("c, w, t, dx, dy, s", "Return whether the target, (dx, dy) away, is in sight of a tracker."),
    "measure": ("c, w, number, dx, dy", "Return the vector to the target as measured."),
    "clear_sums": ("w", "Set the sums of the metrics to zero."),
    "add_to_sums": ("c, w, trackers, slots", "Add a control step to the sums of the metrics."),
}
"""Parameters and meaning of the generated functions."""


def declarations_for(scenario: Scenario) -> Declarations:
    """Return the declarations of a scenario: the built-in ones, and those that it names.

    Raises:
        DeclarationError: The bounds of a motion's memory are invalid in this scenario.
    """
    fields = FIELDS.with_added(*scenario.extra_fields)
    TARGET_MOTIONS[scenario.target_motion].check(scenario)
    return Declarations(
        tuple(field for field in fields if not field.of_mate),
        tuple(field for field in fields if field.of_mate),
        TARGET_MOTIONS.with_added(scenario.target_motion),
        SENSORS.with_added(scenario.sensor),
        METRICS.with_added(*scenario.metrics),
        terms_for(scenario),
    )


@functools.cache
def generated_for(declarations: Declarations) -> Generated:
    """Return the compiled functions for declarations."""
    module = _Module(declarations)
    text = module.text()
    file = f"<posse kernel source {id(module):x}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # for tracebacks
    # The declared functions themselves, not what their modules hold under these names now.
    scope: dict[str, Any] = {"__name__": __name__, **module.functions}
    exec(compile(text, file, "exec"), scope)
    return Generated(**{name: scope[name] for name in Generated._fields})


def source_of(declarations: Declarations) -> str:
    """Return the source text of the functions for declarations, a module that can be run."""
    module = _Module(declarations)
    return module.text(module.imports())


_FEW: Final = 2
"""Number of columns up to which writing single numbers is faster than a transposition."""
_HEAD: Final = '''"""Functions that posse compiles for the declarations of a scenario."""

from numpy import float32

from posse.numeric import ZERO, compiled, eight
from posse.rules.senses import add_noise
from posse.rules.state import NEVER
from posse.signals.rows import write_block, write_column'''


class _Module:
    """The module of a set of declarations: its text, and the declared functions by their names in it."""

    def __init__(self, declarations: Declarations) -> None:
        self.functions: dict[str, Function] = {}
        d, summed = declarations, [metric for metric in declarations.metrics if metric.per]
        self._body = [
            "",
            f"width = {sum(field.size for field in d.fields)}",
            f"mate_width = {sum(field.size for field in d.mate_fields)}",
            *_function("write_own", self._rows(d.fields)),
            *_function("write_mate", self._rows(d.mate_fields)),
            *_function("write_empty", self._empty_place(d.mate_fields)),
            *_function("reward", self._reward("term", {t.name: t.function for t in d.reward_terms})),
            *_function("target_reward", self._reward("target_term", {t.name: t.of_target for t in d.reward_terms})),
            *_function("draw_motion", self._draw(d.motions)),
            *_function("set_goal", self._goal(d.motions)),
            *_function("sees", self._sight(d.sensors)),
            *_function("measure", self._measure(d.sensors)),
            *_function("clear_sums", [*(f"w.{metric.sum_name} = ZERO" for metric in summed), "w.tracker_steps = ZERO"]),
            *_function("add_to_sums", self._sums(summed)),
        ]

    def text(self, imports: Iterable[str] = ()) -> str:
        """Return the text, with lines that import the declared functions."""
        return "\n".join([_HEAD, *imports, *self._body]) + "\n"

    def imports(self) -> list[str]:
        """Return lines that import the declared functions, and compile those that their modules hold plain."""
        modules: dict[str, list[str]] = {}
        after = []
        for name, function in self.functions.items():
            module, called = plain(function).__module__, plain(function).__qualname__
            there = getattr(sys.modules.get(module), called, None)
            if plain(there) is not plain(function):
                after.append(f"# {name} is {place_of(function)}, which cannot be imported.")
                continue
            modules.setdefault(module, []).append(f"    {called} as {name},")
            if there is not function:
                after.append(f"{name} = compiled({name})")
        groups = [[f"from {module} import (", *lines, ")"] for module, lines in modules.items()]
        return [*(line for group in groups for line in group), *after]

    def _call(self, alias: str, function: Function, *arguments: str) -> str:
        """Return the call of a declared function, by default with its parameters as arguments."""
        alias = alias.replace("-", "_")
        while self.functions.setdefault(alias, function) is not function:
            alias += "_"
        return f"{alias}({', '.join(arguments or parameters_of(function))})"

    def _rows(self, fields: Sequence[FieldDeclaration]) -> Iterator[str]:
        columns: list[str] = []
        width, written = sum(field.size for field in fields), 0
        few = width % WIDTH if width % WIDTH <= _FEW else 0
        for field in fields:
            mine = [f"{field.name}_{q}" for q in range(field.size)]
            if field.function is limited:
                yield f"{mine[0]} = {self._call('limited', limited, f'c.{field.name}')}"
            else:
                yield f"{', '.join(mine)} = {self._call(f'field_{field.name}', field.function)}"
            if "v" not in field.parameters:  # a constant
                yield from (f"{column} = eight(float32({column}))" for column in mine)
            columns += mine
            # As soon as there are eight, so that few have to be kept at a time.
            while len(columns) - written >= WIDTH or few < width - written == len(columns) - written:
                first = min(written, width - WIDTH)  # the last block repeats columns of the one before
                block = columns[first : first + WIDTH]
                halves = (f"    {', '.join(half)}," for half in (block[: WIDTH // 2], block[WIDTH // 2 :]))
                yield from ("write_block(", *halves, f"    {first}, rows,", ")")
                written = first + WIDTH
        yield from (f"write_column({columns[q]}, {q}, s, rows)" for q in range(written, width))

    def _empty_place(self, fields: Sequence[FieldDeclaration]) -> Iterator[str]:
        values = [float(field.unknown or 0.0) for field in fields for _ in range(field.size)]
        yield from (f"o[k + {q}] = float32({value})" for q, value in enumerate(values))

    def _reward(self, prefix: str, terms: Mapping[str, Function | None]) -> Iterator[str]:
        for k, (name, function) in enumerate(terms.items()):
            yield f"values[{k}] = " + ("ZERO" if function is None else self._call(f"{prefix}_{name}", function))
        yield "reward = ZERO"
        # From last to first: another order would round differently and change results.
        yield from (f"reward = float32(weights[{k}] * values[{k}] + reward)" for k in reversed(range(len(terms))))
        yield "return reward"

    def _draw(self, motions: Sequence[TargetMotion]) -> Iterator[str]:
        yield from (f"w.{memory.name} = ZERO" for motion in motions for memory in motion.memory)
        for k, motion in enumerate(motions):
            if motion.draw is not None:
                yield from (f"if c.motion == {k}:", f"    {self._call(f'draw_{motion.name}', motion.draw)}")

    def _goal(self, motions: Sequence[TargetMotion]) -> Iterator[str]:
        for k, motion in enumerate(motions):
            yield from (f"if c.motion == {k}:", f"    {self._call(f'goal_{motion.name}', motion.function)}")

    def _sight(self, sensors: Sequence[Sensor]) -> Iterator[str]:
        for k, sensor in enumerate(sensors):
            call = self._call(f"sight_{sensor.name}", sensor.function)
            yield from (f"if c.sensor == {k}:", f"    return bool({call})")
        yield "return False"

    def _measure(self, sensors: Sequence[Sensor]) -> Iterator[str]:
        for k, sensor in enumerate(sensors):
            if sensor.measure is not None:
                call = self._call(f"measure_{sensor.name}", sensor.measure)
                yield from (f"if c.sensor == {k}:", f"    x, y = {call}", "    return float32(x), float32(y)")
        yield "return add_noise(c, w, number, dx, dy)"

    def _sums(self, metrics: Sequence[Metric]) -> Iterator[str]:
        loop, after = ["t = trackers[i]", "if t.broken_at == NEVER:"], ["w.tracker_steps += float32(w.working)"]
        for metric in metrics:
            value = self._call(f"metric_{metric.name}", metric.function)
            if "t" in metric.parameters:
                yield f"{metric.name}_total = ZERO"
                loop.append(f"    {metric.name}_total += {value}")
                value = f"{metric.name}_total"
            after.append(f"w.{metric.sum_name} += {value}")
        yield from ("for i in range(c.num_trackers):", *(f"    {line}" for line in loop), *after)


def _function(name: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines of a compiled function."""
    parameters, meaning = _FUNCTIONS[name]
    yield from ("", "", "@compiled", f"def {name}({parameters}):", f'    """{meaning}"""')
    yield from (f"    {line}" for line in lines)
