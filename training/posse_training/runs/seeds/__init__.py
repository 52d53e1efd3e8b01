"""One training with several seeds, here or on a cluster."""
