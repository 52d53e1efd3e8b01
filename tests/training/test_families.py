"""Families of scenarios: what is drawn, what is refused, and all that plays them."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import posse
from posse import ScenarioError
from posse.declarations import FIELDS
from posse_baselines.learned import LearnedPolicy
from posse_training import evaluate
from posse_training.evaluation.statistics import mean

SHORT: dict[str, Any] = {"horizon": 40, "settle_time": 1.0}
MANY = (
    *("tracker_turn_rate", "tracker_acceleration", "actuator_lag", "obstacle_gap", "sensing_range"),
    *("field_of_view", "sonar_range", "radio_range", "forget_after", "outage_time"),
)
OPEN = posse.family("smart", target_speed=(0.3, 0.7), tracker_turn_rate=(1.0, 2.0), **SHORT)


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.integers(0, 10**6), st.sampled_from(["train", "validation", "test"]))
def test_a_draw_is_in_its_ranges_and_depends_on_nothing_else(index: int, seed: int, split: str) -> None:
    family = posse.family("obstacles", num_obstacles=(np.int64(0), np.int64(3)), target_speed=np.array([0.3, 0.5]))
    drawn = family.draw(index, seed, split)
    assert drawn == family.draw(index, seed, split)
    assert drawn.num_obstacles in range(4)
    assert 0.3 <= drawn.target_speed <= 0.5
    changed = drawn.replace(num_obstacles=8, target_speed=0.6)
    assert changed.to_dict() == posse.get_scenario("obstacles", target_speed=0.6).to_dict()


def test_draws_fill_the_ranges_and_differ_by_seed_and_split() -> None:
    speeds = np.array([OPEN.draw(k).target_speed for k in range(400)])
    assert abs(speeds.mean() - 0.5) < 0.02
    assert speeds.min() < 0.31 < 0.69 < speeds.max()
    counts = [posse.family("obstacles", num_obstacles=(0, 3)).draw(k).num_obstacles for k in range(200)]
    assert set(counts) == {0, 1, 2, 3}
    assert len({OPEN.draw(0, seed, split).target_speed for seed in (0, 1) for split in ("train", "test")}) == 4
    with pytest.raises(ScenarioError, match="unknown split 'tests'"):
        OPEN.draw(0, split="tests")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "has no ranges"),
        ({"speed": (0, 1)}, "unknown setting 'speed'"),
        ({"target_speed": (0.7, 0.3)}, "least must not be above the greatest"),
        ({"target_speed": (0.3, 0.4, 0.5)}, "two numbers"),
        ({"target_speed": (0.3, 2.0), **dict.fromkeys(MANY, (1.0, 2.0))}, "below tracker_speed"),
        ({"target_speed": (-1, 0.5)}, "target_speed=-1"),
        ({"num_trackers": (3, 5)}, "need num_neighbours"),
        ({"horizon": (100, 200)}, "cannot vary horizon"),
        ({"target_motion": ("smart", "constant")}, "one number"),
        ({"arena": ((10.0, 20.0), (20.0, 30.0))}, "one number"),
        ({"num_obstacles": (0, 1.5)}, "whole number"),
        ({"sensing_range": (3.0, np.inf)}, "must be finite"),
    ],
)
def test_what_cannot_hold_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        posse.family("smart", **changes)


def test_results_do_not_depend_on_how_worlds_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = evaluate("ddcs-distributed", OPEN, 25, 3, progress=False)
    monkeypatch.setattr("posse_training.evaluation.evaluation.WORLDS", 7)
    parts = evaluate("ddcs-distributed", OPEN, 25, 3, progress=False)
    np.testing.assert_equal(parts.columns, whole.columns)
    alone = evaluate("ddcs-distributed", OPEN.draw(1, 3, "test"), 20, 3, progress=False)
    np.testing.assert_array_equal(whole["score"][10:20], alone["score"][10:20], "worlds 10 to 19 play scenario 1")
    assert whole.estimate("score") == mean(whole["score"], 10) != mean(whole["score"])


def test_teams_of_many_sizes_stand_side_by_side() -> None:
    sizes = posse.family("smart", num_trackers=(3, 7), num_neighbours=2, **SHORT)
    batches = posse.batches(sizes, 64)
    assert sum(batch.num_worlds for batch in batches) == 64
    assert {batch.scenario.num_trackers for batch in batches} == {3, 4, 5, 6, 7}
    assert {batch.layout.size for batch in batches} == {batches[0].layout.size}
    with pytest.raises(ScenarioError, match="scenarios=0 must be a whole number"):
        posse.batches(sizes, 64, scenarios=0)


def test_a_field_that_only_some_scenarios_have_is_refused(request: pytest.FixtureRequest) -> None:
    request.addfinalizer(lambda: FIELDS.pop("crowd"))

    @posse.field("1", 0, 60, when=lambda s: s.num_obstacles > 3)
    def crowd(c: Any) -> Any:
        """Number of obstacles."""
        return c.num_obstacles

    with pytest.raises(posse.ScenarioError, match="a field's when= must be alike for all scenarios"):
        posse.family("obstacles", num_obstacles=(0, 8), extra_fields=("crowd",))


def test_a_policy_is_trained_and_tuned_on_a_family(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from scripts.ship import CHOICE_SEED, Settings, ship

    from posse_training.train.settings import TrainSettings
    from posse_training.train.train import train
    from posse_training.tune import TuneSettings, tune

    few: dict[str, Any] = {"num_worlds": 36, "family_scenarios": 36, "rollout": 8, "minibatch": 32}
    few |= {"evaluate_worlds": 20, "overrides": SHORT, "folder": tmp_path / "run"}
    train(TrainSettings(scenario="family-open", steps=200, **few))
    shipped = LearnedPolicy.from_file(ship(Settings((tmp_path / "run",), "learned-x", 20, 20, tmp_path)))
    played = evaluate(shipped, "family-open", 20, CHOICE_SEED, split="validation", progress=False, **SHORT)
    assert shipped.card["validation_score"] == played["score"].mean(), "in scenarios that it was not trained on"
    assert shipped.card["training_seeds"][0]["score"] == asdict(played.estimate("score"))
    tuned: dict[str, Any] = {"generations": 1, "population": 4, "worlds": 2, "validation_worlds": 2}
    tuned |= {"only": ("gain", "gain"), "out": tmp_path / "tuned"}
    assert tune(TuneSettings(policy="ddcs-distributed", scenario="family-open", **tuned)).is_file()


def test_other_ranges_are_drawn_from_for_a_test() -> None:
    outside, fixed = OPEN.replace(target_speed=(0.75, 0.9)), OPEN.replace(target_speed=0.5)
    assert all(0.75 <= outside.draw(k).target_speed <= 0.9 for k in range(20))
    assert (fixed.draw(3).target_speed, [name for name, _ in fixed.ranges]) == (0.5, ["tracker_turn_rate"])
