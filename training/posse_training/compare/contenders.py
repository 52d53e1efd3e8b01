"""Contenders of a comparison: one policy, or one policy for each of several training seeds."""

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from posse import Family, Scenario
from posse_baselines import Policy, PolicyError, load
from posse_baselines.registry import is_code, is_file
from posse_training.errors import PlayError
from posse_training.evaluation.evaluation import played_errors
from posse_training.evaluation.results import Results
from posse_training.parallel import apart

PLANNER: Final = "planner"
"""The reference that is shown with every team."""
LOADING: Final = 60.0
"""Time that code may take until it is a policy, s, at most."""


@dataclass(frozen=True)
class Contender:
    """A policy under its label in reports, or one policy for each training seed.

    Attributes:
        label: The label.
        policies: Loaded policies; a string is ``package.module:Class``, loaded in the process that plays it.
    """

    label: str
    policies: tuple[Policy | str, ...]


def read_contenders(texts: Sequence[str]) -> tuple[Contender, ...]:
    """Return the contenders of names, files, ``package.module:Class`` or ``LABEL=FILE,FILE,...``.

    The label of a file is the name on its card, unless another contender has it. Code is loaded in a process of its
    own, and code that fails there fails later, where it is to play.

    Raises:
        PolicyError: No contender, a policy that cannot be loaded, a group without files or with one twice, one that is
            given twice without labels, or a label that two contenders share, that is the planner's, or no UTF-8.
    """
    if not texts:
        raise PolicyError("No policies given. Pass at least one; the first is the baseline.")
    found: list[Contender] = []
    stated, alone = {text.partition("=")[0] for text in texts}, set[str]()
    for text in texts:
        label, sign, members = (text, "", "") if is_file(text) else text.partition("=")
        if sign and not (label and all(members.split(","))):
            raise PolicyError(f"{text!r:.120} is not a group of policies: write LABEL=FILE,FILE,...")
        taken = {other.label for other in found}
        if label in taken or (sign and label == PLANNER):
            who = "the reference and another policy" if label == PLANNER else "two policies"
            raise PolicyError(f"{who} have the label {label!r:.120}: give one another label, LABEL=...")
        names = members.split(",") if sign else [text]
        places = {os.path.realpath(name) if is_file(name) else name for name in names}
        if len(places) < len(names):
            raise PolicyError(f"{text!r:.120} names a policy twice: give each training seed once")
        if not sign and places & alone:
            raise PolicyError(f"{text!r:.120} is given twice: leave it out once, or give it a label, LABEL=...")
        alone |= set() if sign else places
        policies = tuple(name if is_code(name) else load(name) for name in names)
        for name in filter(is_code, names):
            with contextlib.suppress(PlayError):
                check_code(name)
        if not sign and not isinstance(policies[0], str) and is_file(text):
            name = policies[0].name
            label = name if name not in taken | stated | {PLANNER} else label
        if label.encode(errors="replace").decode() != label:  # figures cannot show it
            raise PolicyError(f"the label {label!r:.120} is no UTF-8: give another one, LABEL=...")
        found.append(Contender(label, policies))
    return tuple(found)


def check_code(name: str, read: Callable[[str], object] = load) -> None:
    """Load ``package.module:Class``, a policy or a target, in a process of its own.

    PolicyError if it is none, PlayError if that took longer than :data:`LOADING` or the process died.
    """
    apart(LOADING, _load, name, read)


def _load(name: str, read: Callable[[str], object]) -> None:
    with played_errors():
        read(name)


@dataclass(frozen=True)
class Plays:
    """The results of a contender in a number of worlds, one for each training seed."""

    label: str
    results: tuple[Results, ...]

    @property
    def scenario(self) -> Scenario | Family:
        """The scenario or family."""
        return self.results[0].scenario

    def __getitem__(self, metric: str) -> npt.NDArray[np.float64]:
        """Return a metric, (S, W): training seeds by worlds."""
        return np.stack([result[metric] for result in self.results])

    def paired(self, other: "Plays") -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the safe scores of both, (S, W) each, in the worlds that both played."""
        mine, theirs = self["safe_score"], other["safe_score"]
        both = min(mine.shape[1], theirs.shape[1])
        return mine[:, :both], theirs[:, :both]
