"""Rendering of a world: frames and a window."""

from typing import Final

RENDER_MODES: Final = ("human", "rgb_array")
"""In a window, or as frames (H, W, 3) uint8."""
