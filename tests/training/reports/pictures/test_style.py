"""Policies are told apart in figures with every colour vision, and without colour."""

from __future__ import annotations

import itertools

import pytest
from tests.support.colour_vision import LEAST, VISIONS, contrast, distance

from posse.rendering.style import Colour
from posse_baselines import policy_names
from posse_training.reports.comparing.sweeps import BOUND
from posse_training.reports.pictures.palette import CURVES, DARK, INK, NOTE, PAPER
from posse_training.reports.pictures.style import STYLES, looks_of


def rgb(colour: str) -> Colour:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_any_two_colours_differ(vision: str, dark: bool) -> None:
    shown = [DARK[colour] if dark else colour for colour in CURVES]
    for one, other in itertools.combinations(shown, 2):
        assert distance(rgb(one), rgb(other), vision) >= LEAST, (one, other)


def test_curves_and_text_stand_out_from_the_paper() -> None:
    for paper, of in ((PAPER, {c: c for c in DARK}), (DARK[PAPER], DARK)):
        assert min(contrast(rgb(of[colour]), rgb(paper)) for colour in CURVES) >= 2.2
        assert contrast(rgb(of[INK]), rgb(paper)) >= 7
        assert contrast(rgb(of[NOTE]), rgb(paper)) >= 4.5


def test_every_policy_has_a_marker_of_its_own() -> None:
    assert {name for name in policy_names() if not name.startswith("learned-")} <= set(STYLES)
    assert {style.colour for style in STYLES.values()} <= set(CURVES)
    own = [f"mine-{k}" for k in range(8)]
    looks = looks_of([*policy_names(), *own])
    assert len({style.marker for style in looks.values()}) == len(policy_names()) + len(own) + 1
    many = looks_of([*own, *(f"yours-{k}" for k in range(20))])
    assert len({(style.colour, style.marker) for style in many.values()}) == 29


def test_a_policy_that_ships_looks_the_same_whoever_else_is_there() -> None:
    assert looks_of(["mine", "pursuit", "planner"])["pursuit"] == looks_of(["pursuit"])["pursuit"]
    assert looks_of(["mine"])["mine"] == looks_of(["mine", "pursuit"])["mine"]
    assert looks_of([])[BOUND] == STYLES[BOUND]
