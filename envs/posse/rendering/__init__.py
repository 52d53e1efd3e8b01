"""Rendering of a world: frames and a window."""
