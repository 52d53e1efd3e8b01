"""Training every team that ships: in order, once, and on from where it stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import assert_equal, numbers, quiet, small

from posse_training.errors import SettingsError
from posse_training.runs import TrainSettings, default_settings
from posse_training.runs import callback as module
from posse_training.runs.saved import checkpoint
from posse_training.runs.train import train
from posse_training.shipping import train_all
from posse_training.shipping.train_all import ALGORITHMS, Settings, all_runs, left_of, train_left


def test_every_scenario_has_its_own_settings() -> None:
    runs = all_runs(Settings(folder=Path("x")))
    assert [run.run_folder for run in runs] == [
        Path("x", f"{name}-{seed}")
        for seed in (1, 2, 3, 4, 5)
        for name in ALGORITHMS
        if seed <= 3 or name in ("smart", "field")
    ]
    chosen = all_runs(Settings(seeds=(7,), only=("radio",)))
    assert [(run.scenario, run.seed) for run in chosen] == [("radio", 7)]
    for run in runs:
        # The corrections of a tuned team, before its safeguard, with a bound on contact.
        assert (run.advise, run.correction, run.encoding) == ("ddcs-tuned", "velocity", "belief")
        assert run.contact_bound is not None
        assert run.algorithm == ALGORITHMS[run.scenario]
    with pytest.raises(SettingsError, match="only='duel' has no learned team of its own"):
        all_runs(Settings(only=("duel",)))


def test_what_is_finished_is_skipped_and_what_is_not_is_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tiny(scenario: str, algorithm: str) -> TrainSettings:
        assert default_settings(scenario, algorithm).scenario == scenario
        return small(tmp_path)

    monkeypatch.setattr(train_all, "default_settings", tiny)
    settings = Settings(seeds=(3, 4), only=("smart",), folder=tmp_path / "all")
    write, count = checkpoint.write_checkpoint, 0

    def cut(*arguments: Any) -> None:
        nonlocal count
        write(*arguments)
        count += 1
        if count == 8:  # in the second run
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "write_checkpoint", cut)
    with pytest.raises(KeyboardInterrupt):
        list(train_left(settings, quiet()))
    monkeypatch.setattr(module, "write_checkpoint", write)
    runs = all_runs(settings)
    assert left_of(runs) == runs[1:]
    done = (tmp_path / "all" / "smart-3" / "last.safetensors").stat().st_mtime_ns
    assert list(train_left(settings, quiet())) == [tmp_path / "all" / "smart-4"]
    assert (tmp_path / "all" / "smart-3" / "last.safetensors").stat().st_mtime_ns == done
    assert left_of(runs) == []
    train(small(tmp_path / "whole", seed=4), console=quiet())
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "all" / "smart-4"))
