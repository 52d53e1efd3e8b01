"""Work on many worlds, spread over threads."""
