"""How colours are seen with every kind of colour vision.

Dichromacy is simulated as by Machado, Oliveira and Fernandes (2009), severity 1; distances are
Euclidean in CIE L*a*b* (about 2.3 is just noticeable).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from posse.rendering.style import Colour

Floats = npt.NDArray[np.float64]

VISIONS: Final[dict[str, Floats]] = {
    "normal": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
_TO_XYZ: Final = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE: Final = np.array([0.95047, 1.0, 1.08883])
LEAST: Final = 11.0
"""Smallest distance of two colours that are used side by side."""


def linear(colour: Colour) -> Floats:
    share = np.array(colour) / 255
    return np.asarray(np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4))


def seen(colour: Colour, vision: str) -> Floats:
    """Return L*, a*, b* of a perceived colour."""
    t = _TO_XYZ @ np.clip(VISIONS[vision] @ linear(colour), 0, 1) / _WHITE
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(colour: Colour, ground: Colour) -> float:
    """Return the contrast ratio of WCAG 2."""
    bright = sorted(float(_TO_XYZ[1] @ linear(c)) for c in (colour, ground))
    return (bright[1] + 0.05) / (bright[0] + 0.05)


def distance(one: Colour, other: Colour, vision: str) -> float:
    """Return how far apart two colours are as perceived."""
    return float(np.linalg.norm(seen(one, vision) - seen(other, vision)))
