"""The scenario: settings, validation, formation slots, named scenarios."""

from posse.scenarios.named import get_scenario, scenario_names
from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import ScenarioError, Setting

__all__ = ["Scenario", "ScenarioError", "Setting", "get_scenario", "scenario_names"]
