"""How the target moves."""
