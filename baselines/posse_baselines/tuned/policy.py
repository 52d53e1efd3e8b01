"""Tuned policies: the settings that were tuned for the scenario they are given."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posse import Scenario
from posse_baselines.ddcs import DDCS, Settings
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.tuned.files import read_tuned, tuned_files

TUNED: Final = {"ddcs-tuned": "ddcs-distributed", "pngl-l-phi-tuned": "pngl-l-phi"}
"""The tuned policies that come with the package, and the policies that were tuned."""


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
        """Return the settings tuned for a scenario, or the untuned ones.

        Raises:
            PolicyError: The file of the settings is damaged.
        """
        path = tuned_files(self.name).get(scenario.name)
        return self.settings if path is None else read_tuned(path).settings


class _FromFile(DDCS):
    """The settings of one file, played on every scenario."""

    trained_splits = ("train",)


def from_file(path: Path) -> DDCS:
    """Return the policy of a file of tuned settings; it plays them on every scenario.

    Raises:
        PolicyError: The file is missing or damaged.
    """
    found = read_tuned(path)
    return _FromFile(found.settings, f"{found.policy}-tuned-{found.scenario}")
