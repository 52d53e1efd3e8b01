"""Policies and targets by name, by file, or by the module and class that defines them.

A target is a scripted motion of the scenario, or a policy that moves it: learned, or your own.
"""

import importlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from posse import TARGET_MOTIONS, TargetPolicy
from posse.declarations import unknown
from posse_baselines.learned import LearnedPolicy
from posse_baselines.policies.open_loop import OPEN_LOOP
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import Policy, PolicyError, check_policy
from posse_baselines.tuned import read_tuned

FILES: Final[dict[str, Callable[[Path], Policy]]] = {".safetensors": LearnedPolicy.from_file, ".json": read_tuned}
"""Readers of policy files, by suffix."""
SHIPPED: Final = Path(__file__).parent / "shipped"
"""The folder of the learned policies that come with the package."""
SHIPPED_TARGETS: Final = SHIPPED / "targets"
"""The folder of the learned targets that come with the package."""
AGENT: Final = "agent"
"""The motion of a target that a policy moves."""


@dataclass(frozen=True)
class Target:
    """A target by its name in results: a scripted ``target_motion`` of the scenario, or ``"agent"`` and its policy."""

    name: str
    motion: str
    policy: TargetPolicy | None = None

    @property
    def trained_splits(self) -> tuple[str, ...]:
        """Splits whose worlds it was trained on."""
        return tuple(getattr(self.policy, "trained_splits", ()))


def shipped(folder: Path = SHIPPED) -> dict[str, Path]:
    """Return the files of the learned policies that come with the package, or of the targets, by name."""
    return {path.stem: path for path in sorted(folder.glob("*.safetensors"))}


def _teams() -> dict[str, Callable[[], Any]]:
    """Return what makes each policy that comes with the package."""
    return {**SCRIPTED, **{name: partial(LearnedPolicy.from_file, path) for name, path in shipped().items()}}


def _targets() -> dict[str, Callable[[], Any]]:
    """Return the motions that are declared, the targets that read nothing, and the learned ones."""
    scripted = {name: partial(Target, name, name) for name in TARGET_MOTIONS if name != AGENT}
    blind = {name: partial(Target, name, AGENT, policy) for name, policy in OPEN_LOOP.items()}
    learned = shipped(SHIPPED_TARGETS).items()
    return {**scripted, **blind, **{name: partial(LearnedPolicy.from_file, path) for name, path in learned}}


def policy_names() -> tuple[str, ...]:
    """Return the names of all policies that come with the package, learned ones last."""
    return tuple(_teams())


def target_names() -> tuple[str, ...]:
    """Return the names of all targets."""
    return tuple(_targets())


def load(policy: str | Path | Policy) -> Policy:
    """Return a policy by name, from a file, or from ``"package.module:Class"``; a policy is returned as it is.

    ``"package.module:Class"`` imports the module and calls the class without arguments: it **runs code**, with all
    rights of the process. Never pass on such a name from a source that you do not trust. An attribute that already is a
    policy is returned as it is. Names and files never run code.

    Raises:
        PolicyError: An unknown name (the message has similar ones), a file that is missing, damaged or of an unknown
            kind, a module or class that cannot be found or fails, or one that is no policy of a team.
        TypeError: Something that is neither of these.
    """
    if not isinstance(policy, str | Path):
        check_policy(policy)
        return policy
    text = str(policy)
    found = _found("policy", text, _teams(), FILES)
    if not isinstance(found, Policy):
        raise PolicyError(
            f"{text!r:.120} is not a policy: it must have name, message_size, reads_state, begin, "
            "act, restart and annotations, as posse_baselines.Policy says; from_function makes one of a function"
        )
    check_policy(found)
    return found


def load_target(target: str | Path | Target) -> Target:
    """Return a target by name, from a policy file, or from ``"package.module:Class"``.

    ``"package.module:Class"`` **runs code**, as with :func:`posse_baselines.load`; the object needs the methods of
    :class:`posse.TargetPolicy`. A target is returned as it is.

    Raises:
        PolicyError: As with :func:`posse_baselines.load`; or the policy of a team.
        TypeError: Something else.
    """
    if isinstance(target, Target):
        return target
    if not isinstance(target, str | Path):
        raise TypeError(f"{target!r:.80} is no target: give a name, a file, or Target(name, 'agent', policy)")
    text = str(target)
    found = _found("target", text, _targets(), {".safetensors": LearnedPolicy.from_file})
    if isinstance(found, Target):
        return found
    if getattr(found, "side", "target") != "target":
        raise PolicyError(f"{text!r} is the policy of a team, {found.name!r}, not of a target")
    if not isinstance(found, TargetPolicy):
        raise PolicyError(f"{text!r:.120} is no target's policy: it lacks begin, act or restart (posse.TargetPolicy)")
    return Target(getattr(found, "name", text), AGENT, found)


def _found(kind: str, text: str, known: Mapping[str, Any], readers: Mapping[str, Callable[[Path], Any]]) -> Any:
    """Return what a name, a file or ``"package.module:Class"`` stands for."""
    if text in known:
        return known[text]()
    path = Path(text)
    if path.suffix in readers:
        return readers[path.suffix](path)
    if is_file(path):
        raise PolicyError(f"{path} is not a policy file: known suffixes are {', '.join(readers)}")
    if ":" in text:
        return _from_module(text)
    if is_file(path / "best.safetensors"):
        raise PolicyError(f"{text!r} is a run folder: its policy is {path / 'best.safetensors'}")
    raise PolicyError(f'{unknown(kind, text, known)}, a file, or "package.module:Class"')


def is_code(policy: str) -> bool:
    """Return whether :func:`load` would import code: ``"package.module:Class"``."""
    return ":" in policy and Path(policy).suffix not in FILES and not is_file(policy)


def is_file(path: str | Path) -> bool:
    """Return whether a path is a file; ``False`` also for a path that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 (pathlib raises for those)


def _from_module(text: str) -> Any:
    """Return what ``"package.module:Class"`` makes, or an attribute that is no class."""
    module_name, _, attribute = text.partition(":")
    try:
        module = importlib.import_module(module_name)
        if not hasattr(module, attribute):
            raise AttributeError(unknown("name", attribute, [name for name in vars(module) if name[0] != "_"]))
        found: Any = getattr(module, attribute)
        return found() if isinstance(found, type) else found
    except (Exception, SystemExit) as error:  # whatever the code of the module or the class raises
        raise PolicyError(
            f"{text!r:.120} cannot be imported, or created without arguments: {type(error).__name__}: {error}; write "
            "package.module:Class, for example my_policies:Circle"
        ) from error
