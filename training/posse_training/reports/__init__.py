"""The paper's experiments, and films."""
