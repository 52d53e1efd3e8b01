"""Files of tuned settings: JSON, checked when read; they never run code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from posse_baselines.ddcs import Settings
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import tunables
from posse_baselines.files import read_json
from posse_baselines.policy import PolicyError

SHIPPED_TUNED: Final = Path(__file__).parents[1] / "shipped" / "tuned"
"""The folder of the tuned settings that come with the package: POLICY/SCENARIO.json."""
FORMAT: Final = "posse-tuned-1"


@dataclass(frozen=True)
class TunedFile:
    """What ``posse tune`` found.

    Attributes:
        policy: The policy whose settings were tuned.
        scenario: Name of the scenario that they were tuned for.
        settings: All settings of the tuned policy.
        card: Everything that the file says.
    """

    policy: str
    scenario: str
    settings: Settings
    card: Mapping[str, Any] = field(repr=False)


def tuned_files(name: str) -> dict[str, Path]:
    """Return the shipped files of a tuned policy, by scenario."""
    return {path.stem: path for path in sorted((SHIPPED_TUNED / name).glob("*.json"))}


def read_tuned(path: Path) -> TunedFile:
    """Return a file of tuned settings.

    Raises:
        PolicyError: It is missing, damaged, of an unknown policy, or has a setting that is not
            tunable or out of its range.
    """
    try:
        card = read_json(path)
    except FileNotFoundError:
        raise PolicyError(f"there is no policy file {path}") from None
    except (OSError, ValueError) as error:
        raise PolicyError(f"{path} is damaged or cannot be read: {error}") from error
    if not isinstance(card, dict) or card.get("format") != FORMAT:
        raise PolicyError(f"{path} holds no tuned settings: it must have format={FORMAT!r}")
    policy, scenario = card.get("policy"), card.get("scenario")
    if not isinstance(policy, str) or policy not in FAMILY:
        raise PolicyError(
            f"{path} has settings of policy={policy!r:.80}; policies with settings are: {', '.join(FAMILY)}"
        )
    if not isinstance(scenario, str) or not 1 <= len(scenario) <= 100 or not scenario.isprintable():
        raise PolicyError(f"{path} has scenario={scenario!r:.80}: it must be a text of 1 to 100 printable characters")
    values = _checked(path, policy, card.get("settings"))
    try:
        settings = FAMILY[policy].replace(**values)
    except ValueError as error:  # settings that exclude each other
        raise PolicyError(f"{path} has impossible settings: {error}") from error
    return TunedFile(policy, scenario, settings, card)


def _checked(path: Path, policy: str, values: Any) -> dict[str, float]:
    """Return the settings of a file, each a finite number in its range."""
    if not isinstance(values, dict):
        raise PolicyError(f"{path} has settings={values!r:.80}: they must map names to numbers")
    known = {t.name: t for t in tunables(FAMILY[policy])}
    for name, value in values.items():
        if name not in known:
            raise PolicyError(
                f"{path} has a setting {name!r:.80} that is not a tunable one of {policy}; these "
                f"are: {', '.join(known)}"
            )
        t = known[name]
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not t.low <= value <= t.high:
            unit = f" {t.unit}" if t.unit else ""
            raise PolicyError(f"{path} has {name}={value!r:.80}: it must be a number in [{t.low:g}, {t.high:g}]{unit}")
    return {name: float(value) for name, value in values.items()}
