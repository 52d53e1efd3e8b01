"""Targets become part of the package if they cost the reference team enough."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.runs import HORIZON, quiet, small

from posse_baselines import load_target
from posse_training.errors import SettingsError
from posse_training.runs.train import train
from posse_training.shipping.ship_target import Settings, ship_target


def test_a_target_ships_only_if_it_costs_enough(tmp_path: Path) -> None:
    run = tmp_path / "run"
    settings = small(
        run,
        side="target",
        encoding="plain",
        against="idle",
        scenario="smart",
        team_sizes=(),
        steps=80,
        evaluate_every=80,
        overrides={"horizon": HORIZON, "settle_time": 1.0},
        reward_weights={"team": -1.0},
    )
    train(settings, console=quiet())
    asked = Settings(run, "mine", "idle", worlds=4, out=tmp_path / "out")
    with pytest.raises(SettingsError, match=r"costs idle .* more than 'smart': at least 0.1"):
        ship_target(asked)
    assert not (tmp_path / "out").exists()
    path = ship_target(Settings(run, "mine", "idle", least=-1.0, worlds=4, out=tmp_path / "out"))
    target = load_target(path)
    assert target.name == "mine"
    card = target.policy.card  # type: ignore[union-attr]
    assert card["settings"]["folder"] is None
    assert str(tmp_path) not in str(card)
    assert card["comparison"]["cost"]["count"] == 4
    assert card["check"]["score"] >= 0
    train(small(tmp_path / "team", steps=80), console=quiet())
    with pytest.raises(SettingsError, match="run of a team"):
        ship_target(Settings(tmp_path / "team", "mine", out=tmp_path))
