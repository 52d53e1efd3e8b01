"""Training runs: settings, checkpoints, export, shipping."""
