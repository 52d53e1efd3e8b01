"""What is told of a world: observations, rewards, metrics, the global state."""
