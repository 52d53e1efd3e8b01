"""Pictures of a world: the window, and frames."""
