"""Scripted teams with settings that a search found, by scenario (``posse tune``).

Their files are JSON, checked when read; they never run code.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from posse import Scenario
from posse.declarations import unknown
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
    """A DDCS policy whose settings a search found: those of a file, or those that ship for the scenario it is given.

    Which shipped file is played depends on the scenario's name alone, whatever else is overridden.

    Args:
        name: Its name; one of :data:`TUNED` if no settings are given.
        settings: Of the file; default: those that ship.
        card: Everything that the file says.
    """

    trained_splits = ("train",)

    def __init__(self, name: str, settings: Settings | None = None, card: Mapping[str, Any] | None = None) -> None:
        super().__init__(settings or FAMILY[TUNED[name]], name)
        self.card: Mapping[str, Any] = card or {}

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return the settings that are played on a scenario; PolicyError if what was changed does not go with them."""
        try:
            return replace(self.settings if self.card else tuned_settings(self.name, scenario), **self._changes)
        except ValueError as error:
            raise PolicyError(f"settings of {self.name!r} on {scenario.name!r}: {error}") from error


def tuned_settings(name: str, scenario: Scenario) -> Settings:
    """Return the settings of a tuned policy, one of :data:`TUNED`, on a scenario: the untuned ones where no file is."""
    path = tuned_files(name).get(scenario.name)
    return FAMILY[TUNED[name]] if path is None else read_tuned(path).settings


def tuned_files(name: str) -> dict[str, Path]:
    """Return the shipped files of a tuned policy, by scenario."""
    return {path.stem: path for path in sorted((SHIPPED_TUNED / name).glob("*.json"))}


def read_tuned(path: Path) -> "TunedDDCS":
    """Return the policy of a file of tuned settings; PolicyError if it is missing, damaged or not such a file."""
    try:
        card = read_json(path)
        policy, scenario, values = card["policy"], card["scenario"], card["settings"]
        if card["format"] != FORMAT:
            raise ValueError(f"it must have format={FORMAT!r}")
        if policy not in FAMILY:
            own = "; a policy of your own has them by with_settings(**settings)"
            raise ValueError(unknown("policy with settings", policy, FAMILY) + own)
        known = [tunable.name for tunable in tunables(FAMILY[policy])]
        for name in values:
            if name not in known:
                raise ValueError(unknown(f"tunable setting of {policy}", name, known))
        team = DDCS(FAMILY[policy]).with_settings(**{name: float(value) for name, value in values.items()})
    except (OSError, LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise PolicyError(f"{path} holds no tuned settings: {type(error).__name__}: {error!s:.1000}") from error
    return TunedDDCS(f"{policy}-tuned-{scenario}", team.settings, card)
