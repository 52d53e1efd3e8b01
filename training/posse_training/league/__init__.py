"""Self-play: trackers and targets that are trained in turns against the other side's past."""
