"""Sweeps vary one setting, and their points are plain scores at it."""

from __future__ import annotations

import pytest

from posse_training import evaluate
from posse_training.reports.comparing.contenders import Contender, play, read_contenders
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.sweeps import BOUND, SWEEPS, Sweep, play_sweeps


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_value_is_possible_and_the_own_one_is_among_them(sweep: Sweep) -> None:
    for value in sweep.values:
        assert getattr(sweep.at(value), sweep.setting) == value
    assert sweep.own in sweep.values
    assert sweep.at(sweep.values[0]) != sweep.at(sweep.values[-1])


def test_points_are_scores_at_their_settings() -> None:
    sweep = Sweep("size", "constant", "num_trackers", (3, 12), "trackers")

    def attempt(contender: Contender, of: Sweep, value: float) -> Plays | None:
        if contender.label == "random":
            return None
        return play(contender, of.at(value), 4, 5, "validation", progress=False)

    points = play_sweeps(read_contenders(("idle", "random", "pursuit")), attempt, (sweep,))
    assert [(p.value, p.policy) for p in points] == [
        (size, policy) for size in (3, 12) for policy in ("idle", "pursuit", BOUND)
    ]
    alone = evaluate("pursuit", "constant", 4, 5, split="validation", num_trackers=12, progress=False)
    assert points[4].score.value == pytest.approx(alone["safe_score"].mean())
    assert points[5].score.value == pytest.approx(alone["bound"].mean())
