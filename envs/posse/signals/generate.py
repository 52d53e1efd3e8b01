"""The one generator: compiled functions for the declarations of a scenario, as readable source text.

numba cannot loop over a tuple of functions, since each function has a type of its own. So the
functions below are written out, with one line for each declared function that they call.
:func:`kernel_source` returns the text.
"""

from __future__ import annotations

import functools
import linecache
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

# Imported for their declarations of the built-in fields and metrics.
import posse.signals.metrics
import posse.signals.observation.mate_fields
import posse.signals.observation.own_fields  # noqa: F401
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
from posse.signals.metrics import Metric
from posse.signals.observation.fields import FieldDeclaration
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
    """The generated functions, for compiled code, and the lengths of what they write."""

    write_own: Any
    """(c, v, s, rows): writes the own fields of eight observers."""
    write_mate: Any
    """(c, v, m, s, rows): writes the fields of a team-mate of each."""
    write_empty: Any
    """(o, k): writes an empty place of a team-mate."""
    reward: Any
    """(c, w, t, weights (K,), values (K,)) -> reward of a tracker; writes the terms' values."""
    target_reward: Any
    """(c, w, weights (K,), values (K,)) -> the same of a target that is an agent."""
    draw_motion: Any
    """(c, w): draws the parameters of the target's motion for an episode."""
    set_goal: Any
    """(c, w, trackers, obstacles, s): sets a scripted target's goal heading."""
    sees: Any
    """(c, w, t, dx, dy, s) -> whether the target is in sight of a tracker."""
    measure: Any
    """(c, w, number, dx, dy) -> the measured position."""
    clear_sums: Any
    """(w): sets the sums of the metrics to zero."""
    add_to_sums: Any
    """(c, w, trackers, slots): adds a control step to the sums."""
    width: int
    """Length of the observation before the sonar."""
    mate_width: int
    """Length of a team-mate's part, without its message."""


def declarations_for(scenario: Scenario) -> Declarations:
    """Return the declarations of a scenario: the built-in ones, and those that it names.

    Raises:
        DeclarationError: The bounds of a motion's memory are invalid in this scenario.
    """
    fields = FIELDS.with_added(*scenario.extra_fields)
    TARGET_MOTIONS[scenario.target_motion].check(scenario)
    return Declarations(
        tuple(field for field in fields if field.subject != "mate"),
        tuple(field for field in fields if field.subject == "mate"),
        TARGET_MOTIONS.with_added(scenario.target_motion),
        SENSORS.with_added(scenario.sensor),
        METRICS.with_added(*scenario.metrics),
        terms_for(scenario),
    )


@functools.cache
def generated_for(declarations: Declarations) -> Generated:
    """Return the compiled functions for declarations."""
    module = _Module(declarations)
    file = f"<posse kernel source {id(module):x}>"
    text = module.text()
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # for tracebacks
    # The declared functions themselves, not what their modules hold under these names now.
    scope: dict[str, Any] = {"__name__": __name__, **module.functions}
    exec(compile(module.text(imported=False), file, "exec"), scope)
    return Generated(**{name: scope[name] for name in Generated._fields})


def source_of(declarations: Declarations) -> str:
    """Return the source text of the functions for declarations, a module that can be run."""
    return _Module(declarations).text()


_FEW: Final = 2
"""Number of columns up to which writing single numbers is faster than a transposition."""
_HEAD: Final = '''"""Functions that posse compiles for the declarations of a scenario."""

from numpy import float32

from posse.numeric import compiled, eight
from posse.rules.senses import add_noise
from posse.rules.state import NEVER
from posse.signals.observation.rows import write_block, write_column'''
_TAIL: Final = "\nZERO = float32(0)"


class _Module:
    """The module of a set of declarations: its text, and the declared functions by their names in it."""

    def __init__(self, declarations: Declarations) -> None:
        self.functions: dict[str, Function] = {}
        d = declarations
        self._body = [
            f"width = {sum(field.size for field in d.fields)}",
            f"mate_width = {sum(field.size for field in d.mate_fields)}",
            *self._rows("write_own", "own fields of eight observers", ("c", "v"), d.fields),
            *self._rows("write_mate", "fields of a team-mate of each", ("c", "v", "m"), d.mate_fields),
            *self._empty_place(d.mate_fields),
            *self._rewards(d.reward_terms),
            *self._motions(d.motions),
            *self._sensors(d.sensors),
            *self._sums(d.metrics),
        ]

    def text(self, *, imported: bool = True) -> str:
        """Return the text; without the imports of declared functions, blank lines in their place."""
        imports = self._imports()
        return "\n".join([_HEAD, *(imports if imported else [""] * len(imports)), _TAIL, *self._body]) + "\n"

    def _imports(self) -> list[str]:
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

    def _call(self, prefix: str, name: str, function: Function, *arguments: str) -> str:
        """Return the call of a declared function, by default with its parameters as arguments."""
        alias = f"{prefix}_{name.replace('-', '_')}"
        while self.functions.setdefault(alias, function) is not function:
            alias += "_"
        return f"{alias}({', '.join(arguments or parameters_of(function))})"

    def _rows(
        self, name: str, what: str, parameters: Sequence[str], fields: Sequence[FieldDeclaration]
    ) -> Iterator[str]:
        columns: list[str] = []
        lines: list[str] = []
        width, written = sum(field.size for field in fields), 0
        few = width % WIDTH if width % WIDTH <= _FEW else 0
        for field in fields:
            mine = [f"{field.name}_{q}" for q in range(field.size)]
            lines.append(f"{', '.join(mine)} = {self._call('field', field.name, field.function)}")
            if field.subject == "setting":
                lines += [f"{column} = eight(float32({column}))" for column in mine]
            columns += mine
            # As soon as there are eight, so that few have to be kept at a time.
            while len(columns) - written >= WIDTH or few < width - written == len(columns) - written:
                first = min(written, width - WIDTH)  # the last block repeats columns of the one before
                block = columns[first : first + WIDTH]
                halves = (f"    {', '.join(half)}," for half in (block[: WIDTH // 2], block[WIDTH // 2 :]))
                lines += ["write_block(", *halves, f"    {first}, rows,", ")"]
                written = first + WIDTH
        lines += [f"write_column({columns[q]}, {q}, s, rows)" for q in range(written, width)]
        yield from _function(name, (*parameters, "s", "rows"), f"Write the {what}.", lines)

    def _empty_place(self, fields: Sequence[FieldDeclaration]) -> Iterator[str]:
        values = [float(field.unknown or 0.0) for field in fields for _ in range(field.size)]
        lines = [f"o[k + {q}] = float32({value})" for q, value in enumerate(values)]
        yield from _function("write_empty", ("o", "k"), "Write an empty place of a team-mate.", lines)

    def _rewards(self, terms: Sequence[RewardTerm]) -> Iterator[str]:
        # From last to first: another order would round differently and change results.
        sums = [f"reward = float32(weights[{k}] * values[{k}] + reward)" for k in reversed(range(len(terms)))]
        ending = ["reward = ZERO", *sums, "return reward"]
        lines = [f"values[{k}] = {self._call('term', t.name, t.function)}" for k, t in enumerate(terms)]
        what = "Return the reward of a tracker; write the values of its terms."
        yield from _function("reward", ("c", "w", "t", "weights", "values"), what, [*lines, *ending])
        lines = [
            f"values[{k}] = " + ("ZERO" if t.of_target is None else self._call("target_term", t.name, t.of_target))
            for k, t in enumerate(terms)
        ]
        what = "Return the reward of a target that is an agent; write the values of its terms."
        yield from _function("target_reward", ("c", "w", "weights", "values"), what, [*lines, *ending])

    def _motions(self, motions: Sequence[TargetMotion]) -> Iterator[str]:
        lines = [f"w.{memory.name} = ZERO" for motion in motions for memory in motion.memory]
        for k, motion in enumerate(motions):
            if motion.draw is not None:
                lines += [f"if c.motion == {k}:", f"    {self._call('draw', motion.name, motion.draw)}"]
        yield from _function("draw_motion", ("c", "w"), "Clear the memories, and draw the motion's parameters.", lines)
        lines = []
        for k, motion in enumerate(motions):
            call = self._call("goal", motion.name, motion.function)
            lines += [f"{'elif' if lines else 'if'} c.motion == {k}:", f"    {call}"]
        parameters = ("c", "w", "trackers", "obstacles", "s")
        yield from _function("set_goal", parameters, "Set the goal heading of a scripted target.", lines)

    def _sensors(self, sensors: Sequence[Sensor]) -> Iterator[str]:
        calls = [f"bool({self._call('sight', each.name, each.function)})" for each in sensors]
        lines = [line for k, call in enumerate(calls[:-1]) for line in (f"if c.sensor == {k}:", f"    return {call}")]
        lines.append(f"return {calls[-1]}")
        what = "Return whether the target, (dx, dy) away, is in sight."
        yield from _function("sees", ("c", "w", "t", "dx", "dy", "s"), what, lines)
        lines = []
        for k, each in enumerate(sensors):
            if each.measure is not None:
                call = self._call("measure", each.name, each.measure)
                lines += [f"if c.sensor == {k}:", f"    x, y = {call}", "    return float32(x), float32(y)"]
        lines.append("return add_noise(c, w, number, dx, dy)")
        what = "Return the vector to the target as measured."
        yield from _function("measure", ("c", "w", "number", "dx", "dy"), what, lines)

    def _sums(self, metrics: Sequence[Metric]) -> Iterator[str]:
        summed = [metric for metric in metrics if metric.per is not None]
        lines = [f"w.{metric.sum_name} = ZERO" for metric in summed]
        yield from _function("clear_sums", ("w",), "Set the sums to zero.", [*lines, "w.tracker_steps = ZERO"])
        before, loop, after = [], [], ["w.tracker_steps += float32(w.working)"]
        for metric in summed:
            value = self._call("metric", metric.name, metric.function)
            if "t" in parameters_of(metric.function):
                before.append(f"{metric.name}_total = ZERO")
                loop.append(f"        {metric.name}_total += {value}")
                value = f"{metric.name}_total"
            after.append(f"w.{metric.sum_name} += {value}")
        head = ["for i in range(c.num_trackers):", "    t = trackers[i]", "    if t.broken_at == NEVER:"]
        what = "Add a control step to the sums."
        yield from _function("add_to_sums", ("c", "w", "trackers", "slots"), what, [*before, *head, *loop, *after])


def _function(name: str, parameters: Sequence[str], meaning: str, lines: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a compiled function."""
    yield from ("", "", "@compiled", f"def {name}({', '.join(parameters)}):", f'    """{meaning}"""')
    yield from (f"    {line}" for line in lines)
