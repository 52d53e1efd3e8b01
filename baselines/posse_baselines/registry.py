"""Policies by name, by file, or by where their class is."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from posse_baselines.learned import LearnedPolicy
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import Policy, PolicyError

_FILES: Final[dict[str, Callable[[Path], Policy]]] = {".safetensors": LearnedPolicy.from_file}
"""Readers of policy files, by suffix: whoever brings a kind of file adds its reader here."""
SHIPPED: Final = Path(__file__).parent / "shipped"
"""The folder of the learned policies that come with the package."""
LEARNED: Final = "learned-"
"""What the names of learned policies begin with."""


def policy_names() -> tuple[str, ...]:
    """Return the names of all policies that come with the package, learned ones last."""
    return (*SCRIPTED, *shipped())


def shipped() -> dict[str, Path]:
    """Return the files of the learned policies that come with the package, by name."""
    found = (path for path in SHIPPED.glob(f"{LEARNED}*") if path.suffix in _FILES)
    return {path.stem: path for path in sorted(found)}


def load(policy: str | Path) -> Policy:
    """Return a policy by name, from a file, or from ``"package.module:Class"``.

    A class is called without arguments; an object that is a policy already is taken as it is.

    Raises:
        PolicyError: Nothing of that name (the message has near ones), a file that is missing or of
            an unknown kind, a module or class that cannot be found, or one that is no policy.
    """
    text = str(policy)
    if text in SCRIPTED:
        return SCRIPTED[text]()
    learned = shipped()
    if text in learned:
        return _from_file(learned[text])
    path = Path(text)
    if path.suffix in _FILES or path.is_file():
        return _from_file(path)
    if ":" in text:
        return _from_module(text)
    if text.startswith(LEARNED):
        raise PolicyError(
            f"no policy {text!r} is shipped; shipped learned ones are: "
            f"{', '.join(learned) or 'none yet'}. Train one with posse train, and name its file"
        )
    if (path / "best.safetensors").is_file():
        raise PolicyError(f"{text!r} is a run's folder: its policy is {path / 'best.safetensors'}")
    near = difflib.get_close_matches(text, policy_names(), n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    raise PolicyError(
        f"unknown policy {text!r}{hint}; policies are: {', '.join(policy_names())}, a file, or "
        '"package.module:Class"'
    )


def _from_file(path: Path) -> Policy:
    if path.suffix not in _FILES:
        known = ", ".join(_FILES) or "none yet"
        raise PolicyError(f"{path} is no policy file: known kinds are {known}")
    if not path.is_file():
        raise PolicyError(f"there is no policy file {path}")
    return _FILES[path.suffix](path)


def _from_module(text: str) -> Policy:
    module_name, _, attribute = text.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise PolicyError(f"cannot import {module_name!r} of policy {text!r}: {error}") from error
    if not hasattr(module, attribute):
        names = [name for name in vars(module) if not name.startswith("_")]
        near = difflib.get_close_matches(attribute, names, n=3)
        hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
        raise PolicyError(f"module {module_name!r} has no {attribute!r}{hint}")
    found: Any = getattr(module, attribute)
    try:
        made = found() if isinstance(found, type) else found
    except TypeError as error:
        raise PolicyError(f"{text!r} cannot be made without arguments: {error}") from error
    if not isinstance(made, Policy):
        raise PolicyError(
            f"{text!r} is no policy: it must have name, message_size, reads_state, begin, act, "
            "restart and annotations, as posse_baselines.Policy says"
        )
    return made
