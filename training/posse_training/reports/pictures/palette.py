"""The colours of figures, on light and on dark paper.

The hues start from those of Okabe and Ito. Shades are set such that any two of them differ with
normal vision, deuteranopia, protanopia and tritanopia; a test simulates these.
"""

from __future__ import annotations

from typing import Final

PAPER: Final = "#ffffff"
INK: Final = "#1a1a1a"
NOTE: Final = "#666666"
"""Axes, and notes in figures."""
GRID: Final = "#e5e5e5"
BAND: Final = "#f6f6f6"
"""Every second row of a figure."""
OWN: Final = "#c4c4c4"
"""Marks the value of a setting in its scenario."""

GREY: Final = "#a3a3a3"
BLUE: Final = "#0072b2"
SKY: Final = "#6aaef5"
GREEN: Final = "#00ae6b"
RED: Final = "#d55e00"
ORANGE: Final = "#ee9600"
PINK: Final = "#b0527f"
PURPLE: Final = "#5a2a80"

DARK: Final[dict[str, str]] = {
    PAPER: "#171a1f",
    INK: "#e6e9ee",
    NOTE: "#9aa1ab",
    GRID: "#3a414b",
    BAND: "#1f242a",
    OWN: "#4c535d",
    GREY: "#7a828d",
    BLUE: "#3f7ff0",
    SKY: "#9fc4ff",
    GREEN: "#10c884",
    RED: "#eb7030",
    ORANGE: "#f2c230",
    PINK: "#d880b4",
    PURPLE: "#b23fb8",
}
"""Each colour's counterpart on dark paper."""
CURVES: Final = (INK, GREY, BLUE, SKY, GREEN, RED, ORANGE, PINK, PURPLE)
"""The colours of policies."""
