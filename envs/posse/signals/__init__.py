"""Observations, rewards, metrics and the global state of worlds."""
