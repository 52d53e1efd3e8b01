"""Policies by name, by file, or by the module and class that defines them."""

from __future__ import annotations

import difflib
import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, cast

from posse_baselines.learned import LearnedPolicy
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import Policy, PolicyError
from posse_baselines.tuned import from_file

_FILES: Final[dict[str, Callable[[Path], Policy]]] = {".safetensors": LearnedPolicy.from_file, ".json": from_file}
"""Readers of policy files, by suffix."""
SHIPPED: Final = Path(__file__).parent / "shipped"
"""The folder of the learned policies that come with the package."""
LEARNED: Final = "learned-"
"""Prefix of the names of learned policies."""
_LONGEST: Final = 4096  # characters of a name
_SHOWN: Final = 100  # characters of a name in a message
_MODULE: Final = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def policy_names() -> tuple[str, ...]:
    """Return the names of all policies that come with the package, learned ones last."""
    return (*SCRIPTED, *shipped())


def shipped() -> dict[str, Path]:
    """Return the files of the learned policies that come with the package, by name."""
    return {path.stem: path for path in sorted(SHIPPED.glob(f"{LEARNED}*.safetensors"))}


def load(policy: str | Path) -> Policy:
    """Return a policy by name, from a file, or from ``"package.module:Class"``.

    ``"package.module:Class"`` imports the module and calls the class without arguments: it **runs
    code**, with all rights of the process. Never pass on such a name from a source that you do not
    trust. An attribute that already is a policy is returned as it is. Names and files never run
    code.

    Raises:
        PolicyError: An unknown name (the message has similar ones), a file that is missing, damaged
            or of an unknown kind, a module or class that cannot be found or fails, or one that is
            not a policy, or moves the target.
    """
    found = load_any(policy)
    if getattr(found, "side", "trackers") == "target":
        raise PolicyError(f"{_short(str(policy))} is the policy of a target: give it as target=, or --target")
    return found


def load_any(policy: str | Path) -> Policy:
    """Return a policy as :func:`load` does, also one that moves the target.

    Raises:
        PolicyError: As :func:`load`.
    """
    text = str(policy)
    if not 0 < len(text) <= _LONGEST or "\0" in text:
        raise PolicyError(
            f"{_short(text)} cannot be a policy: a name or path has 1 to {_LONGEST} characters and no NUL"
        )
    if text in SCRIPTED:
        return SCRIPTED[text]()
    learned = shipped()
    if text in learned:
        return _from_file(learned[text])
    path = Path(text)
    if path.suffix in _FILES or is_file(path):
        return _from_file(path)
    if ":" in text:
        return _from_module(text)
    if text.startswith(LEARNED):
        raise PolicyError(
            f"no policy {_short(text)} is shipped; shipped learned ones are: "
            f"{', '.join(learned) or 'none yet'}. Train one with posse train, and pass its file"
        )
    if is_file(path / "best.safetensors"):
        raise PolicyError(f"{text!r} is a run folder: its policy is {path / 'best.safetensors'}")
    near = difflib.get_close_matches(text[:_SHOWN], policy_names(), n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    raise PolicyError(
        f"unknown policy {_short(text)}{hint}; policies are: {', '.join(policy_names())}, a file, "
        'or "package.module:Class"'
    )


def ships_or_is_file(policy: Any) -> bool:
    """Return whether this is the name of a shipped policy or the path of a policy file."""
    if not isinstance(policy, str) or "\0" in policy:
        return False
    return policy in SCRIPTED or policy in shipped() or Path(policy).suffix in _FILES


def is_code(policy: str) -> bool:
    """Return whether :func:`load` would import code: ``"package.module:Class"``."""
    return ":" in policy and not ships_or_is_file(policy) and not is_file(policy)


def _short(text: str) -> str:
    """Return a name as a message shows it."""
    if len(text) <= _SHOWN:
        return repr(text)
    return f"{text[: _SHOWN - 40]!r}... ({len(text):,} characters)"


def is_file(path: str | Path) -> bool:
    """Return whether a path is a file; ``False`` also for a path that no file can have."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _from_file(path: Path) -> Policy:
    if path.suffix not in _FILES:
        raise PolicyError(f"{path} is not a policy file: known suffixes are {', '.join(_FILES)}")
    if not is_file(path):
        raise PolicyError(f"there is no policy file {_short(str(path))}")
    return _FILES[path.suffix](path)


def _from_module(text: str) -> Policy:
    made = from_module(text)
    try:
        complete = isinstance(made, Policy)
    except Exception as error:  # whatever an attribute raises
        raise _cannot_be_created(text, error) from error
    if not complete:
        raise PolicyError(
            f"{_short(text)} is not a policy: it must have name, message_size, reads_state, begin, "
            "act, restart and annotations, as posse_baselines.Policy says"
        )
    if type(made.name) is not str or type(made.message_size) is not int or made.message_size < 0:
        raise PolicyError(
            f"{_short(text)} is not a policy: name={made.name!r:.80} must be a str, and "
            f"message_size={made.message_size!r:.80} an int of at least 0"
        )
    return cast("Policy", made)


def from_module(text: str) -> Any:
    """Return what ``"package.module:Class"`` makes, or an attribute that is no class.

    Raises:
        PolicyError: The module or the attribute cannot be found, or fails.
    """
    if not _MODULE.fullmatch(text):
        raise PolicyError(f"{_short(text)} names no class: write package.module:Class, for example my_policies:Circle")
    module_name, _, attribute = text.partition(":")
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # whatever the module's code raises
        raise PolicyError(f"cannot import {module_name!r} of policy {_short(text)}: {_describe(error)}") from error
    if not hasattr(module, attribute):
        names = [name for name in vars(module) if not name.startswith("_")]
        near = difflib.get_close_matches(attribute, names, n=3)
        hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
        raise PolicyError(f"module {module_name!r} has no {attribute!r}{hint}")
    found: Any = getattr(module, attribute)
    try:
        return found() if isinstance(found, type) else found
    except Exception as error:  # whatever the class raises
        raise _cannot_be_created(text, error) from error


def _cannot_be_created(text: str, error: Exception) -> PolicyError:
    return PolicyError(f"{_short(text)} cannot be created without arguments: {_describe(error)}")


def _describe(error: Exception) -> str:
    return f"{error}" if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
