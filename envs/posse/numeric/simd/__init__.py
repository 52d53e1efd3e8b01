"""Eight numbers at a time, and what they compile to."""
