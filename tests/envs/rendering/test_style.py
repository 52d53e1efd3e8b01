"""The colours are distinguishable with every colour vision, on light and on dark."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from tests.support.colour_vision import LEAST, VISIONS, contrast, distance, seen

from posse.rendering.style import (
    CONTACT,
    DARK,
    DARK_PLAYERS,
    DARK_TASK_COLOURS,
    GROUND,
    INK,
    PAPER,
    PLAYERS,
    TARGET,
    TASK_COLOURS,
    TRACKER,
    Colour,
)

ROBOTS = (TRACKER, *TASK_COLOURS, TARGET, CONTACT)
DARK_ROBOTS = (DARK["TRACKER"], *DARK_TASK_COLOURS, DARK["TARGET"], DARK["CONTACT"])


def test_the_simulation_takes_red_and_green_for_alike() -> None:
    red, green = (170, 90, 60), (115, 110, 60)
    apart = {v: distance(red, green, v) for v in VISIONS}
    assert apart["deuteranopia"] < 0.5 * apart["normal"]
    # A grey is grey to everyone.
    for vision in VISIONS:
        np.testing.assert_allclose(seen((128, 128, 128), vision)[1:], 0, atol=1.0)


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("group", [ROBOTS, DARK_ROBOTS, PLAYERS, DARK_PLAYERS])
def test_colours_that_stand_side_by_side_are_told_apart(group: tuple[Colour, ...], vision: str) -> None:
    for one, other in itertools.combinations(group, 2):
        assert distance(one, other, vision) >= LEAST, (one, other)


@pytest.mark.parametrize(("curves", "paper"), [(PLAYERS, PAPER), (DARK_PLAYERS, DARK["PAPER"])], ids=["light", "dark"])
def test_curves_stand_out_from_the_paper(curves: tuple[Colour, ...], paper: Colour) -> None:
    assert min(contrast(colour, paper) for colour in curves) >= 3


def test_what_is_written_is_legible() -> None:
    assert contrast(INK, PAPER) >= 7
    assert contrast(DARK["INK"], DARK["PAPER"]) >= 7
    for ground, target in ((GROUND, TARGET), (DARK["GROUND"], DARK["TARGET"])):
        assert contrast(target, ground) >= 3
