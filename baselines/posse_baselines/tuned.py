"""Scripted teams with settings that a search found, by scenario (``posse tune``).

Their files are JSON, checked when read; they never run code.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from posse import Scenario
from posse_baselines.ddcs import DDCS, Settings
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import tunables
from posse_baselines.files import read_json
from posse_baselines.policy import PolicyError

TUNED: Final = {"ddcs-tuned": "ddcs-distributed", "pngl-l-phi-tuned": "pngl-l-phi"}
"""The tuned policies that come with the package, and the policies that were tuned."""
SHIPPED_TUNED: Final = Path(__file__).parent / "shipped" / "tuned"
"""The folder of the tuned settings that come with the package: POLICY/SCENARIO.json."""
FORMAT: Final = "posse-tuned-1"


class TunedDDCS(DDCS):
    """A DDCS policy that plays the settings tuned for the scenario that it is given.

    On a scenario without a file of its own it plays the policy that was tuned, unchanged. Which
    file is played depends on the scenario's name alone, whatever else is overridden.

    Args:
        name: One of :data:`TUNED`.
    """

    trained_splits = ("train",)

    def __init__(self, name: str) -> None:
        super().__init__(FAMILY[TUNED[name]], name)

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return :func:`tuned_settings`."""
        return tuned_settings(self.name, scenario)


class TunedFile(DDCS):
    """A DDCS policy that plays the settings of one file on every scenario.

    Attributes:
        card: Everything that the file says: the ``policy`` whose settings were tuned, the ``scenario`` that they were
            tuned for, and more.
    """

    trained_splits = ("train",)

    def __init__(self, settings: Settings, card: Mapping[str, Any]) -> None:
        super().__init__(settings, f"{card['policy']}-tuned-{card['scenario']}")
        self.card = card


def tuned_settings(name: str, scenario: Scenario) -> Settings:
    """Return the settings of a tuned policy, one of :data:`TUNED`, on a scenario: the untuned ones where no file is."""
    path = tuned_files(name).get(scenario.name)
    return FAMILY[TUNED[name]] if path is None else read_tuned(path).settings


def tuned_files(name: str) -> dict[str, Path]:
    """Return the shipped files of a tuned policy, by scenario."""
    return {path.stem: path for path in sorted((SHIPPED_TUNED / name).glob("*.json"))}


def read_tuned(path: Path) -> TunedFile:
    """Return the policy of a file of tuned settings.

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
    policy, scenario, values = card.get("policy"), card.get("scenario"), card.get("settings")
    if not isinstance(policy, str) or policy not in FAMILY:
        raise PolicyError(
            f"{path} has settings of policy={policy!r:.80}; policies with settings are: {', '.join(FAMILY)}"
        )
    if not isinstance(scenario, str) or not isinstance(values, dict):
        raise PolicyError(f"{path} is damaged: it must have the name of a scenario, and settings by name")
    known = [tunable.name for tunable in tunables(FAMILY[policy])]
    for name in values:
        if name not in known:
            raise PolicyError(
                f"{path} has a setting {name!r:.80} that is not a tunable one of {policy}; these "
                f"are: {', '.join(known)}"
            )
    try:
        settings = FAMILY[policy].replace(**{name: float(value) for name, value in values.items()})
    except (TypeError, ValueError, OverflowError) as error:
        raise PolicyError(f"{path} has impossible settings: {error}") from error
    return TunedFile(settings, card)
