"""The options that commands share: what is written behind them, and what it becomes."""

from pathlib import Path

from posse_training.cli import main
from posse_training.options import settings_of, words_of
from posse_training.train.presets import default_settings
from posse_training.train.settings import read_settings


def test_settings_are_read_and_written_alike() -> None:
    words = ["arena=6,4", "target_speed=0.5", "horizon=40", "terminate_on_contact=True", "extra_fields=own,"]
    values = {"arena": (6, 4), "target_speed": 0.5, "horizon": 40, "terminate_on_contact": True}
    assert settings_of(words) == {**values, "extra_fields": ("own",)}
    assert words_of(settings_of(words)) == words
    assert settings_of(["num_neighbours=none", "arena=inf"]) == {"num_neighbours": None, "arena": float("inf")}


def test_several_scenarios_and_targets_of_a_training(tmp_path: Path) -> None:
    small = "--steps 1 --num-worlds 4 --rollout 8 --evaluate-worlds 1 --beside None --no-tensorboard --seed 3"
    named = "--scenario constant accelerating --target smart constant --set arena=30,20 --reward-weights slot=0.2"
    assert main(["train", *named.split(), *small.split(), "--out", str(tmp_path / "run")]) == 0
    found = read_settings(tmp_path / "run" / "settings.json")
    assert (found.scenario, found.opponents) == ("constant,accelerating", {"smart": 1, "constant": 1})
    assert found.reward_weights == {**default_settings().reward_weights, "slot": 0.2}
    assert [given.to_dict()["arena"] for given in found.given] == [(30, 20), (30, 20)]
