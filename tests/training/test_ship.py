"""Shipping: the best of several training seeds, with the scores of all."""

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tyro
from scripts.ship import CHOICE_SEED, Settings, replay, ship
from tests.support.runs import quiet, small

from posse_baselines.learned import LearnedPolicy
from posse_training import evaluate
from posse_training.leaderboard import SEED
from posse_training.train import TrainSettings, default_settings
from posse_training.train.train import train

SETTINGS = small(Path(), steps=640, team_sizes=(2, 3), hidden=(8,), evaluate_every=320, evaluate_worlds=2)


def test_the_best_seed_is_shipped_and_all_are_on_record(tmp_path: Path) -> None:
    runs = tuple(tmp_path / "runs" / str(seed) for seed in (1, 2, 3))
    for seed, folder in enumerate(runs, start=1):
        train(replace(SETTINGS, seed=seed, folder=folder), console=quiet())
    path = ship(Settings(runs, "learned-trial", worlds=10, test_worlds=60, out=tmp_path))
    shipped = LearnedPolicy.from_file(path)
    assert shipped.name == "learned-trial"
    short: dict[str, Any] = {"split": "validation", "horizon": 40, "settle_time": 1.0, "progress": False}
    scores = []  # computed separately
    for run in runs:
        file = str(run / "best.safetensors")
        played = [evaluate(file, "constant", 10, CHOICE_SEED, num_trackers=size, **short) for size in (2, 3)]
        scores.append(sum(each["safe_score"].mean() for each in played) / 2)
    tested = [evaluate(file, "constant", 60, SEED, num_trackers=size, **{**short, "split": "test"}) for size in (2, 3)]
    free = sum(each["contact_free"].mean() for each in tested) / 2
    assert 0 < free < 1
    assert shipped.card["training_seeds"][-1]["test"]["contact_free"]["value"] == pytest.approx(free)
    recorded = [run["safe_score"]["value"] for run in shipped.card["training_seeds"]]
    assert recorded == pytest.approx(scores)
    assert shipped.card["validation_safe_score"] == pytest.approx(max(scores))
    best = max(range(3), key=lambda k: scores[k])
    assert [run["seed"] for run in shipped.card["training_seeds"]] == [1, 2, 3]
    assert shipped.card["seed"] == best + 1
    chosen = LearnedPolicy.from_file(runs[best] / "best.safetensors")
    assert (shipped.network.weights[0] == chosen.network.weights[0]).all()
    check = shipped.card["check"]
    assert [play["settings"]["num_trackers"] for play in check["plays"]] == [2, 3]
    assert all(play["settings"]["horizon"] == 40 for play in check["plays"])
    assert replay(shipped, check) == [play["score"] for play in check["plays"]]
    assert str(runs[0].parent) not in json.dumps(shipped.card)
    default, words = default_settings("constant", "ppo"), shlex.split(shipped.card["command"])[2:]
    assert tyro.cli(TrainSettings, default=default, args=words) == replace(SETTINGS, seed=best + 1, folder=None)
