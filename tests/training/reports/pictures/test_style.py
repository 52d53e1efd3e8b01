"""Policies are told apart in figures without colour."""

from __future__ import annotations

from posse_baselines import policy_names
from posse_training.reports.comparing.sweeps import BOUND
from posse_training.reports.pictures.palette import CURVES
from posse_training.reports.pictures.style import STYLES, looks_of


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
