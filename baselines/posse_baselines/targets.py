"""Targets by name, by file, or by the module and class that defines them.

A target is a scripted motion of the scenario, or a policy that moves it: learned, or your own.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posse import TARGET_MOTIONS, Scenario, TargetPolicy
from posse_baselines.learned import LearnedPolicy
from posse_baselines.policy import PolicyError
from posse_baselines.registry import SHIPPED, from_module, is_file

SHIPPED_TARGETS: Final = SHIPPED / "targets"
"""The folder of the learned targets that come with the package."""
AGENT: Final = "agent"
"""The motion of a target that a policy moves."""
_SUFFIX: Final = ".safetensors"


@dataclass(frozen=True)
class Target:
    """A target, however it is moved.

    Attributes:
        name: Its name in results.
        motion: The scenario's ``target_motion``; ``"agent"`` where a policy moves it.
        policy: That policy; ``None`` for a scripted motion.
    """

    name: str
    motion: str
    policy: TargetPolicy | None = None

    @property
    def trained_splits(self) -> tuple[str, ...]:
        """Splits whose worlds it was trained on."""
        return tuple(getattr(self.policy, "trained_splits", ()))

    def fit(self, scenario: Scenario) -> Scenario:
        """Return a scenario with this target.

        Raises:
            ScenarioError: The scenario's settings do not fit the motion.
        """
        return scenario.replace(target_motion=self.motion)


def target_names() -> tuple[str, ...]:
    """Return the names of all targets: the motions that are declared, then the learned ones."""
    return (*(name for name in TARGET_MOTIONS if name != AGENT), *shipped_targets())


def shipped_targets() -> dict[str, Path]:
    """Return the files of the learned targets that come with the package, by name."""
    return {path.stem: path for path in sorted(SHIPPED_TARGETS.glob(f"*{_SUFFIX}"))}


def load_target(target: str | Path | Target) -> Target:
    """Return a target by name, from a policy file, or from ``"package.module:Class"``.

    ``"package.module:Class"`` **runs code**, as with :func:`posse_baselines.load`; the object needs
    the methods of :class:`posse.TargetPolicy`. A target is returned as it is.

    Raises:
        PolicyError: An unknown name (the message has similar ones), a file that is missing, damaged
            or the policy of a team, a module or class that cannot be found, fails or lacks a
            method.
    """
    if isinstance(target, Target):
        return target
    text = str(target)
    names = target_names()
    learned = shipped_targets()
    if text in names and text not in learned:
        return Target(text, text)
    path = learned.get(text, Path(text))
    if path.suffix == _SUFFIX or (is_file(path) and "\0" not in text):
        return _from_file(path, text if text in learned else None)
    if ":" in text:
        return _from_code(text)
    near = difflib.get_close_matches(text[:100], names, n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    raise PolicyError(
        f'unknown target {text!r:.120}{hint}; targets are: {", ".join(names)}, a file, or "package.module:Class"'
    )


def _from_file(path: Path, name: str | None) -> Target:
    if path.suffix != _SUFFIX:
        raise PolicyError(f"{path} is not the file of a target: it must end in {_SUFFIX}")
    policy = LearnedPolicy.from_file(path)
    if policy.side != "target":
        raise PolicyError(f"{path} is the policy of a team, {policy.name!r}, not of a target")
    return Target(name or policy.name, AGENT, policy)


def _from_code(text: str) -> Target:
    made = from_module(text)
    missing = [m for m in ("begin", "act", "restart") if not callable(getattr(made, m, None))]
    if missing:
        raise PolicyError(
            f"{text!r:.120} is not the policy of a target: it lacks {', '.join(missing)}, as posse.TargetPolicy says"
        )
    name = getattr(made, "name", None)
    return Target(name if isinstance(name, str) else text, AGENT, made)
