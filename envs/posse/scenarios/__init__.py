"""What can be set: the scenario, its formation, and the named ones."""

from posse.scenarios.named import get_scenario, scenario_names
from posse.scenarios.scenario import Scenario, ScenarioError

__all__ = ["Scenario", "ScenarioError", "get_scenario", "scenario_names"]
