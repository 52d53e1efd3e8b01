"""The planner: a reference that reads the state and plays ahead in copies of the worlds."""

from posse_baselines.policies.planner.policy import Planner, PlannerSettings

__all__ = ["Planner", "PlannerSettings"]
