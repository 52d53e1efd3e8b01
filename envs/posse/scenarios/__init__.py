"""The scenario: settings, validation, formation slots, named scenarios."""

from posse.scenarios.family import Family, family, family_names
from posse.scenarios.named import get_scenario, scenario_names
from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import ScenarioError, Setting

__all__ = ["Family", "Scenario", "ScenarioError", "Setting", "family", "family_names", "get_scenario", "scenario_names"]
