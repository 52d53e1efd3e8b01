"""What can be set: the scenario, its formation, and the named ones."""

from posse.scenarios.named import get_scenario, scenario_names
from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import ScenarioError, Setting

__all__ = ["Scenario", "ScenarioError", "Setting", "get_scenario", "scenario_names"]
