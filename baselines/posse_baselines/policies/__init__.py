"""Policies without a decision system: simple ones, pursuit, the planner."""
