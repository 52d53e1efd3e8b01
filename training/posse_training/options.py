"""What the commands share: one word for one thing, in every command.

``--scenario`` names a scenario or several, ``--target`` a target, ``--set`` changes settings of the scenario, ``--out``
is the file or folder that is written to, ``--steps`` and ``--minutes`` say how long something goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from posse import Scenario
from posse.declarations import unknown

_WORDS: Final = {"true": True, "false": False, "none": None}


def value_of(text: str) -> Any:
    """Return the value that a text stands for: a number, true, false, none, a text, or several with commas between."""
    if "," in text:
        return tuple(value_of(part) for part in text.split(",") if part)
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return _WORDS.get(text.lower(), text)


def settings_of(words: Sequence[str]) -> dict[str, Any]:
    """Return the settings that words like ``arena=6,4`` stand for; ValueError without ``=``, or for one set twice."""
    found: dict[str, Any] = {}
    for word in words:
        name, sign, text = word.partition("=")
        if not (name and sign):
            raise ValueError(
                f"{word!r:.80} sets nothing: write KEY=VALUE, such as target_speed=0.5 or arena=6,4, and names of "
                "policies before the options"
            )
        if name in found:
            raise ValueError(f"{name!r:.80} is set twice: leave out one KEY=VALUE")
        found[name] = value_of(text)
    return found


def changes_of(words: Sequence[str]) -> dict[str, Any]:
    """Return :func:`settings_of` for a scenario; ValueError also for a name that is none of its settings."""
    found, known = settings_of(words), Scenario.settings().keys() - {"name", "version", "meaning"}
    for name in found:
        if name not in known:
            raise ValueError(unknown("setting", name, sorted(known)))
    return found


def words_of(settings: Mapping[str, Any]) -> list[str]:
    """Return the words that stand for settings, as :func:`settings_of` reads them."""
    lists = {name: value for name, value in settings.items() if isinstance(value, (tuple, list))}
    texts = {name: ",".join(map(str, value)) + "," * (len(value) == 1) for name, value in lists.items()}
    return [f"{name}={value}" for name, value in {**settings, **texts}.items()]


def _words(
    types: type | tuple[type, ...],
    read: Callable[[list[str]], Any],
    write: Callable[[Any], list[str]],
    metavar: str,
    nargs: Any = "*",  # tyro also takes "+", which its types do not say
) -> PrimitiveConstructorSpec[Any]:
    """Return how an option of some types is read from several words, and written as a default."""
    return PrimitiveConstructorSpec(
        nargs=nargs,
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, types),
        str_from_instance=write,
    )


Pairs = Annotated[dict[str, Any], _words(dict, settings_of, words_of, "KEY=VALUE ...")]
"""Type of an option that takes ``KEY=VALUE ...``."""
Changes = Annotated[dict[str, Any], _words(dict, changes_of, words_of, "KEY=VALUE ..."), tyro.conf.arg(name="set")]
"""Type of the option ``--set``."""
_NAMES: Final = _words(
    (str, type(None)),
    lambda words: None if words == ["None"] else ",".join(words),
    lambda names: str(names).split(","),
    "NAME ...",
    "+",
)
Names = Annotated[str, _NAMES]
"""Type of an option that takes one name or several; in Python a text with commas between."""
MaybeNames = Annotated[str | None, _NAMES]
"""Type of an option that takes one name or several, or none."""


def _address(words: Sequence[str]) -> bool | str:
    """Return the argument ``ray`` of functions: an address, or ``True`` for the cluster of this machine."""
    if len(words) > 1:
        raise ValueError(f"one address at most, not {' '.join(words)!r:.100}: put it after the unnamed arguments")
    return words[0] if words else True


Ray = Annotated[bool | str, _words((bool, str), _address, lambda value: [str(value)], "[ADDRESS]")]
"""Type of the option ``--ray``: with an address or without; ``False``: left out."""


@dataclass(frozen=True, kw_only=True)
class Worlds:
    """Worlds of a scenario, as all commands name them that play one scenario."""

    scenario: str = "smart"
    """Scenario to play."""
    overrides: Changes = field(default_factory=dict)
    """Settings of the scenario to change, such as num_trackers=3 or arena=6,4."""
    seed: int = 7
    """Seed of the worlds."""
    split: str = "test"
    """Split of the worlds: train, validation or test."""


@dataclass(frozen=True, kw_only=True)
class OneWorld(Worlds):
    """One world of a scenario."""

    world: int = 0
    """Index of the world within the seed."""

    @property
    def place(self) -> dict[str, Any]:
        """Seed, index and split."""
        return {"seed": self.seed, "world": self.world, "split": self.split}


@dataclass(frozen=True, kw_only=True)
class Shown(OneWorld):
    """Policies in one world."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Policies: names, files, or package.module:Class."""
    target: str | None = None
    """Target: a motion, a learned target, a file or package.module:Class; default: the scenario's own."""
    seconds: float | None = None
    """Simulated time to show, s; default: to the end of the episode."""
