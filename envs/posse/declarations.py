"""What can be declared: observation fields, reward terms, metrics, target motions, sensors.

A declaration is a function with a name, a unit and a meaning, which is its docstring. Those of
posse's own modules are *built in* and apply to every world. Those of a user's module are available
after its import, and a scenario selects them by name.

The functions take records: ``c`` the scenario (:data:`posse.rules.state.CONFIG`), ``w`` the world, ``t`` a tracker
(:mod:`posse.rules.state`), ``s`` scratch memory, except where a table below says otherwise.
"""

from __future__ import annotations

import copy
import difflib
import dis
import functools
import inspect
import keyword
import math
import os
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from types import FunctionType
from typing import Any, ClassVar, Final, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from posse.numeric import Records, compiled

Function = Callable[..., Any]
Bound = float | Callable[[Any], float]
"""A number, or a function of the scenario that returns one."""


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """Return the message for a name that is none of the known ones, with those most like it."""
    names, text = tuple(known), name if isinstance(name, str) else reprlib.repr(name)
    near = difflib.get_close_matches(text[:100], names, n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    own = ". To use one of your own, import its module first (commands: --import MODULE)"
    more = own if isinstance(known, Registry) else ""
    return f"unknown {kind} {reprlib.repr(name)}{hint}; known: {', '.join(names) or 'none'}{more}"


class DeclarationError(ValueError):
    """An invalid declaration. The message names the function, its file and line."""


def plain(function: Any) -> Any:
    """Return the Python function of a compiled one."""
    return getattr(function, "py_func", function)


@functools.cache  # metrics ask at the end of every episode
def parameters_of(function: Function) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    return tuple(inspect.signature(plain(function)).parameters)


def place_of(function: Function) -> str:
    """Return a function's name, file and line, for messages."""
    code = getattr(plain(function), "__code__", None)
    if code is None:
        return repr(function)
    return f"{plain(function).__name__} ({os.path.relpath(code.co_filename)}:{code.co_firstlineno})"


def is_number(value: Any) -> bool:
    """Return whether a value is a finite number; truth values are none."""
    real = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    return real and (abs(value) <= sys.float_info.max if isinstance(value, int) else math.isfinite(value))


D = TypeVar("D", bound="Declaration")


class Registry(dict[str, D]):
    """Declarations of one kind by name, in order."""

    def of(self, *names: str) -> tuple[D, ...]:
        """Return the built-in declarations, in order, then the named ones, each once; KeyError for an unknown name."""
        built_in = [each for each in self.values() if each.built_in]
        return tuple(dict.fromkeys((*built_in, *(self[name] for name in names))))


class Declaration:
    """A decorator that declares a function, and what it declares.

    Attributes:
        name: Its name; default: that of the function.
        unit: Unit of its value; "-" for rules, which have none.
        function: The function, compiled if kernels call it.
        kind: Name of the kind for messages, such as ``"reward term"``.
        known: All of this kind.
        signatures: The attributes that are functions, each with the parameters that it may have, and what it returns.
            All but ``function`` may be ``None``.
        marks: What a name may hold beside letters and digits.
    """

    name: str
    unit: str
    function: Function
    kind: ClassVar[str]
    known: ClassVar[Registry[Any]]
    signatures: ClassVar[Mapping[str, tuple[str, str]]]
    marks: ClassVar[str] = "_"  # generated source uses the name in Python's names

    def __post_init__(self) -> None:
        if callable(first := next(iter(vars(self).values()))):
            reason = 'the decorator needs arguments: a unit, such as "1", or a name'
            raise DeclarationError(f"{self.kind} {place_of(first)}: {reason}")

    def __repr__(self) -> str:
        return f"<{self.kind} {self.name!r} [{self.unit}]: {self.meaning}>" if "function" in vars(self) else self.kind

    def __call__(self, function: Function) -> Function:
        """Declare a function, and return it, compiled if kernels call it.

        A declaration replaces one that was made on a function of the same module and qualified name.
        """
        made = copy.copy(self)
        made.function, made.name = function, getattr(self, "name", getattr(plain(function), "__name__", ""))
        made._check()
        taken = self.known.get(made.name, made)
        if _home(taken.function) != _home(function):
            raise made.error(f"the name {made.name!r} is taken by {place_of(taken.function)}")
        self.known[made.name] = made
        return made.function

    def _check(self) -> None:
        """Raise DeclarationError for an invalid declaration."""
        for attribute, (allowed, returns) in self.signatures.items():
            function = getattr(self, attribute)
            if attribute == "function" or function is not None:
                setattr(self, attribute, self._checked(function, allowed, returns))
        name: Any = self.name
        unit: Any = self.unit
        if not isinstance(name, str) or not name.replace(self.marks[-1], "_").isidentifier():
            raise self.error(f"invalid name {name!r}: use letters, digits, {' and '.join(self.marks)}")
        if not self.meaning.strip():
            raise self.error("its docstring, which must state its meaning, is missing")
        if not isinstance(unit, str) or not unit:
            raise self.error(f'unit={unit!r} must be a text, such as "m/s", or "1" for a plain number')

    def _checked(self, function: Any, allowed: str, returns: str) -> Function:
        """Return a function, compiled if kernels call it.

        DeclarationError if it has other parameters, or writes to a record though it is to return a value.
        """
        if not isinstance(plain(function), FunctionType):
            raise self.error(f"declare a function, made by def, not a {type(function).__name__}", function)
        signature = inspect.signature(plain(function))
        bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
        given = str(signature.replace(parameters=bare, return_annotation=signature.empty))  # with * and defaults
        if given not in allowed.split(" or "):
            raise self.error(f"its parameters are {given}, not {allowed}", function)
        in_kernels = given.startswith("(c")
        if in_kernels and returns != "nothing" and not self.built_in:
            steps = dis.get_instructions(plain(function))
            if any(step.opname in ("STORE_ATTR", "STORE_SUBSCR") for step in steps):
                raise self.error("it assigns to a field of a record, as motions alone may: return a value", function)
        working: Function = compiled(plain(function)) if in_kernels else function
        return working

    @property
    def meaning(self) -> str:
        """Its docstring."""
        return inspect.getdoc(plain(self.function)) or ""

    @property
    def functions(self) -> dict[Function, str]:
        """The functions for compiled code, and what each returns."""
        functions = ((getattr(self, attribute), returns) for attribute, (_, returns) in self.signatures.items())
        return {function: returns for function, returns in functions if function and parameters_of(function)[0] == "c"}

    @property
    def built_in(self) -> bool:
        """Whether posse itself declares it."""
        return str(plain(self.function).__module__).partition(".")[0] == "posse"

    def error(self, reason: str, function: Any = None) -> DeclarationError:
        """Return the error for an invalid declaration, or for one of its further functions."""
        return DeclarationError(f"{self.kind} {place_of(function or self.function)}: {reason}")


def _home(function: Function) -> tuple[str, str]:
    return plain(function).__module__, plain(function).__qualname__


FIELDS: Final[Registry[field]] = Registry()
METRICS: Final[Registry[metric]] = Registry()
REWARD_TERMS: Final[Registry[reward_term]] = Registry()
SENSORS: Final[Registry[sensor]] = Registry()
TARGET_MOTIONS: Final[Registry[target_motion]] = Registry()

MOST_NUMBERS: Final = 256
"""Most values of one field."""


@dataclass(frozen=True)
class Field:
    """One named part of a scenario's observation."""

    name: str
    size: int
    unit: str
    low: float
    high: float
    meaning: str
    unknown: float | None = None
    """The value for "unknown", or ``None`` if it is always known."""
    of_neighbour: bool = False
    """Whether it is repeated for each place of a team-mate."""


@dataclass(eq=False, repr=False)
class field(Declaration):  # noqa: N801 (used as a function is)
    """Declare a function as an observation field of its name; its docstring is the meaning.

    The parameters of the function determine the field's subject:

    ========== ===================================================================================
    (c)        a setting of the scenario, a constant
    (c, v)     the robot itself or its knowledge of the target (:class:`posse.signals.views.View`)
    (c, v, m)  a team-mate (:class:`posse.signals.views.Mate`), for each of them
    ========== ===================================================================================

    ``v`` and ``m`` hold eight observers, so a formula is written for a block of eight numbers like for one
    (:mod:`posse.numeric`). The function returns a number, or a tuple of ``size`` of them.

    Args:
        unit: Its unit; ``"1"`` for a plain number.
        low: The least value, or a function (scenario) -> least value.
        high: The greatest, likewise.
        unknown: The value for "unknown"; also in empty places of team-mates (default there: 0).
        size: Number of values that the function returns, at most 256; as a tuple if more than one.
        when: A function (scenario) -> whether its observation has the field; default: always.
    """

    kind = "observation field"
    known: ClassVar = FIELDS
    signatures: ClassVar = {"function": ("(c) or (c, v) or (c, v, m)", "numbers")}

    unit: str
    low: Bound
    high: Bound
    unknown: float | None = None
    _: KW_ONLY
    size: int = 1
    when: Callable[[Any], bool] | None = None

    def _check(self) -> None:
        super()._check()
        if self.name in ("sonar", "neighbour_message"):  # whose size depends on the scenario: they are not declared
            raise self.error(f"the name {self.name!r} is taken by posse")
        if type(self.size) is not int or not 1 <= self.size <= MOST_NUMBERS:
            raise self.error(f"size={self.size!r} must be a whole number from 1 to {MOST_NUMBERS}")

    @property
    def of_neighbour(self) -> bool:
        """Whether it describes a team-mate."""
        return "m" in parameters_of(self.function)

    @property
    def functions(self) -> dict[Function, str]:
        """Its function, and what it returns."""
        return {self.function: f"{self.size} numbers" if self.size > 1 else "a number"}

    def of(self, scenario: Any) -> Field:
        """Return the field in a scenario; raise DeclarationError if its bounds or its value for "unknown" are wrong."""
        low, high = self._bound("low", scenario), self._bound("high", scenario)
        if low > high:
            raise self.error(f"low={low:g} is above high={high:g} in {scenario.name!r}")
        empty = 0.0 if self.unknown is None and self.of_neighbour else self.unknown
        if empty is not None and not (is_number(empty) and low <= empty <= high):
            where = f"between low={low:g} and high={high:g} in {scenario.name!r}"
            raise self.error(f"unknown={empty!r} is not a number {where}")
        return Field(self.name, self.size, self.unit, low, high, self.meaning, self.unknown, self.of_neighbour)

    def is_in(self, scenario: Any) -> bool:
        """Return whether a scenario's observation has the field."""
        return self.when is None or bool(self._value("when", scenario))

    def _value(self, name: str, scenario: Any) -> Any:
        value = getattr(self, name)
        try:
            return value(scenario) if callable(value) else value
        except Exception as error:  # a user's function
            raise self.error(f"{name} in {scenario.name!r}: {error!r}") from error

    def _bound(self, name: str, scenario: Any) -> float:
        """Return a bound in a scenario; raise DeclarationError unless it is a finite number."""
        value = self._value(name, scenario)
        if not is_number(value) or abs(value) > float(np.finfo(np.float32).max):
            raise self.error(f"{name}={value!r} in {scenario.name!r} is not a finite number that fits float32")
        return float(value)


@dataclass(eq=False, repr=False)
class reward_term(Declaration):  # noqa: N801
    """Declare a function as a reward term with its name; its docstring is the meaning.

    The function takes ``(c, w, t)``: the records of the scenario, the world and a tracker
    (:mod:`posse.rules.state`) after the step; or ``(c, w)``, for a value of the world that is the
    same for every tracker and for a target that is an agent. It returns a number.

    Args:
        unit: Unit of the term.
        target: The term's formula ``(c, w)`` for a target that is an agent; without one, a term of
            ``(c, w, t)`` is for trackers only.
    """

    kind = "reward term"
    known: ClassVar = REWARD_TERMS
    signatures: ClassVar = {"function": ("(c, w, t) or (c, w)", "a number"), "target": ("(c, w)", "a number")}

    unit: str
    _: KW_ONLY
    target: Function | None = None

    @property
    def of_target(self) -> Function | None:
        """The function for a target that is an agent; ``None``: it has none."""
        return self.function if self.target is None and "t" not in parameters_of(self.function) else self.target


@dataclass(eq=False, repr=False)
class metric(Declaration):  # noqa: N801
    """Declare a function as a metric of an episode with its name; its docstring is the meaning.

    The metric is the mean of its values in an episode, from their sum, the field ``<name>_sum`` of the world's record.
    The parameters of the function determine of what:

    ========================= ========================================================================
    (c, w)                    a value of the world, in each control step
    (c, w, t)                 a value of each working tracker, in each control step
    (c, w, trackers)          a value of the team, in each control step
    (c, w, trackers, slots)   the same, with the slots
    (s, w)                    nothing: called from Python with the scenario and the records of all
                              worlds, it returns the metric of each, (E,)
    ========================= ========================================================================

    ``info`` reports the built-in metrics at the end of every episode, and others if the scenario names
    them. ``nan`` stands for "never happened".

    Args:
        unit: Unit of the metric.
    """

    kind = "metric"
    known: ClassVar = METRICS
    signatures: ClassVar = {
        "function": ("(c, w) or (c, w, t) or (c, w, trackers) or (c, w, trackers, slots) or (s, w)", "a number")
    }

    unit: str

    def _check(self) -> None:
        super()._check()
        if self.name in ("policy", "scenario", "scenario_version", "target", "seed", "split", "world"):
            raise self.error(f"the name {self.name!r} is that of another column of results")

    @property
    def summed(self) -> bool:
        """Whether its function is compiled, and its values are summed over the steps."""
        return parameters_of(self.function)[0] == "c"

    @property
    def sum_name(self) -> str:
        """Name of the field of the world's record that holds the sum."""
        return f"{self.name}_sum"

    def of(self, scenario: Any, worlds: Records) -> npt.NDArray[np.float64]:
        """Return the metric of the current episodes, (E,)."""
        if not self.summed:
            try:
                found = np.asarray(self.function(scenario, worlds), np.float64)
            except Exception as error:  # a user's function
                raise self.error(f"in {scenario.name!r}: {error!r}") from error
            if found.shape != worlds.shape:
                raise self.error(f"it returned an array of shape {found.shape}, not {worlds.shape}, one for each world")
            return found
        steps = worlds["tracker_steps" if "t" in parameters_of(self.function) else "step"]
        mean: npt.NDArray[np.float64] = worlds[self.sum_name] / np.maximum(steps, 1)
        return mean


@dataclass(eq=False, repr=False)
class target_motion(Declaration):  # noqa: N801
    """Declare a function as a target motion; its docstring is the meaning.

    In every control step it sets the goal heading, ``w.goal_cos`` and ``w.goal_sin``, to which one steering law turns
    the target (:mod:`posse.rules.targets.steering`). The function takes ``(c, w)``, the scenario as kernels read it and
    the world, and optionally the trackers, the obstacles and scratch memory: ``(c, w, trackers, obstacles, s)``. A
    policy controls the target of the built-in motion ``"agent"``, whose function does nothing.

    Args:
        name: What ``target_motion`` of a scenario calls it.
        draw: A function ``(c, w)`` that draws the parameters of an episode.
        memory: Names of its state variables, float32 fields of ``w``: 0 at the start, and part of the global state.
        mirrored: Whether the goal is mirrored near walls; not needed by a motion that avoids them.
    """

    kind = "target motion"
    known: ClassVar = TARGET_MOTIONS
    unit = "-"
    marks = "_-"
    signatures: ClassVar = {
        "function": (
            "(c, w) or (c, w, trackers) or (c, w, trackers, obstacles) or (c, w, trackers, obstacles, s)",
            "nothing",
        ),
        "draw": ("(c, w)", "nothing"),
    }

    name: str
    _: KW_ONLY
    draw: Function | None = None
    memory: Sequence[str] = ()
    mirrored: bool = True

    def _check(self) -> None:
        super()._check()
        given: Any = self.memory
        if not isinstance(self.mirrored, bool):
            raise self.error(f"mirrored={self.mirrored!r} must be True or False")
        if not isinstance(given, (list, tuple)):
            raise self.error(f"memory={given!r} must be a list of names")
        for each in given:
            if not isinstance(each, str) or not each.isidentifier() or keyword.iskeyword(each):
                raise self.error(f"invalid name {each!r} of a memory: use a name that Python allows")


@dataclass(eq=False, repr=False)
class sensor(Declaration):  # noqa: N801
    """Declare a function as the sight of a kind of sensor; its docstring is the meaning.

    The function takes the scenario, the world, the tracker, the vector (dx, dy) to the target in
    the common frame, and scratch memory with the obstacles' positions, and returns whether the
    target is in sight. The built-in one is :func:`posse.rules.senses.in_sight`. The result is a
    *fix* (:data:`posse.rules.state.FIX`), of one of these kinds:

    ============ ======================================================================================
    ``position`` position and heading of the target, slot frame; velocity from successive fixes
    ``bearing``  direction of the target; range, heading, frame and velocity stay unknown. Not sent by
                 radio, since the direction depends on the observer
    ============ ======================================================================================

    Args:
        name: What ``sensor`` of a scenario calls it.
        measure: A function of the scenario, the world, the tracker's number and the vector to the target, which returns
            the measured vector. Default: the true one with the scenario's ``range_noise`` and ``bearing_noise``.
        fix: The kind of a fix, ``"position"`` or ``"bearing"``.
    """

    kind = "sensor"
    known: ClassVar = SENSORS
    unit = "-"
    marks = "_-"
    signatures: ClassVar = {
        "function": ("(c, w, t, dx, dy) or (c, w, t, dx, dy, s)", "True or False"),
        "measure": ("(c, w, number, dx, dy)", "2 numbers"),
    }

    name: str
    _: KW_ONLY
    measure: Function | None = None
    fix: str = "position"

    def _check(self) -> None:
        super()._check()
        if self.fix not in ("position", "bearing"):
            raise self.error(f"unknown fix={self.fix!r}; allowed: position, bearing")


class Declarations(NamedTuple):
    """The declarations of a scenario, each kind in order of evaluation: the built-in ones, and those that it names."""

    fields: tuple[field, ...]  # observation fields, except sonar and messages
    motions: tuple[target_motion, ...]
    sensors: tuple[sensor, ...]
    metrics: tuple[metric, ...]
    reward_terms: tuple[reward_term, ...]

    @classmethod
    def of(cls, scenario: Any) -> Declarations:
        """Return the declarations of a scenario."""
        fields = FIELDS.of(*scenario.extra_fields)
        return cls(
            tuple(field for field in fields if field.is_in(scenario)),
            TARGET_MOTIONS.of(scenario.target_motion),
            SENSORS.of(scenario.sensor),
            METRICS.of(*scenario.metrics),
            REWARD_TERMS.of(*dict(scenario.reward_weights), *dict(scenario.target_reward_weights)),
        )

    @property
    def added(self) -> tuple[Declaration, ...]:
        """Those of users' modules."""
        return tuple(each for group in self for each in group if not each.built_in)

    @property
    def modules(self) -> list[str]:
        """Names of these modules, which another process has to import."""
        return _modules_of(self.added)


def users_modules() -> list[str]:
    """Return the names of all modules with declarations of users, which another process has to import."""
    known = (each for kind in (FIELDS, METRICS, REWARD_TERMS, SENSORS, TARGET_MOTIONS) for each in kind.values())
    return _modules_of(each for each in known if not each.built_in)


def _modules_of(declared: Iterable[Declaration]) -> list[str]:
    return sorted({str(plain(each.function).__module__) for each in declared} - {"__main__"})
