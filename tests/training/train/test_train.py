"""Training: what is exported, the best policy is kept, and a resumed run is bit-identical to an uninterrupted one."""

import csv
import json
import os
import time
import zipfile
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
import torch
from numpy.testing import assert_equal
from stable_baselines3 import PPO
from tests.support.runs import AGAINST, GUARDED, TARGET, killed_at, numbers, quiet, resume, small, steps_saved

from posse_baselines import load
from posse_baselines.learned import LearnedPolicy
from posse_training.commands.train import train_all
from posse_training.errors import RunFolderError
from posse_training.evaluation import evaluate
from posse_training.files import locked
from posse_training.train import checkpoint
from posse_training.train import train as module
from posse_training.train.algorithms import ALGORITHMS, even_minibatch
from posse_training.train.settings import BEST
from posse_training.train.train import Run, steps_made, train
from posse_training.train.worlds import make_env


def test_a_training_exports_what_it_played(tmp_path: Path) -> None:
    file = train(small(tmp_path / "run", **GUARDED), console=quiet())
    policy = load(file)
    assert isinstance(policy, LearnedPolicy)
    assert policy.safeguard
    scenario = small(tmp_path, **GUARDED).given[0]
    results = evaluate(policy, scenario, 3, 0, split="validation", progress=False)
    for name in ("safe_score", "score", "contact_free"):
        assert results[name].mean() == pytest.approx(policy.card[f"validation_{name}"], abs=1e-12)
    again = results["safe_score"].mean()
    curve = csv.DictReader((file.parent / "curve.csv").read_text().splitlines())
    assert again == pytest.approx(max(float(row["safe_score"]) for row in curve), abs=1e-12)


SAFE = (0.2, 0.9, 0.4)


def test_the_best_policy_is_kept_not_the_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The score alone would choose the first.
    found = iter([{"safe_score": safe, "score": 1 - safe, "low": 0, "high": 1, "contact_free": 1} for safe in SAFE])
    monkeypatch.setattr(module, "validate", lambda *_: next(found))
    best = train(small(tmp_path, steps=1920), console=quiet())
    assert LearnedPolicy.from_file(best).card["steps"] == 1280
    assert LearnedPolicy.from_file(best).card["validation_safe_score"] == 0.9


def test_a_last_rollout_beyond_the_steps_asked_for_does_not_learn_backwards(tmp_path: Path) -> None:
    """Rollouts are complete, so the number of remaining steps may be negative."""
    settings = small(tmp_path, steps=100, learning_rate=1e-3, final_learning_rate=1e-4)
    env = make_env(settings)
    schedule = ALGORITHMS[settings.algorithm].make(settings, env).lr_schedule
    assert schedule(1.0) == pytest.approx(1e-3)
    assert schedule(0.5) == pytest.approx(5.5e-4)
    assert schedule(0.0) == pytest.approx(schedule(-7.0)) == pytest.approx(1e-4)
    assert steps_made(settings, env.num_envs) == env.num_envs * settings.rollout > 100
    assert [even_minibatch(rows, 2) for rows in (7, 12, 15)] == [7, 2, 3]


def test_what_was_good_before_a_divergence_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = PPO.train

    def diverge(self: PPO) -> None:
        usual(self)
        if self.num_timesteps > 800 and self.seed == 3:
            with torch.no_grad():
                next(self.policy.parameters()).fill_(float("inf"))

    monkeypatch.setattr(PPO, "train", diverge)
    with pytest.raises(RunFolderError, match=r"seed 3: .* diverged at 960 steps"):
        train_all([small(tmp_path / "run", steps=2560), replace(small(tmp_path / "next"), seed=4)], ray=False)
    assert (tmp_path / "next" / BEST).is_file(), "another seed is trained"
    monkeypatch.undo()
    assert steps_saved(tmp_path / "run") == 640
    resume(tmp_path / "run")
    assert steps_saved(tmp_path / "run") == 2560


def test_the_deviation_of_actions_falls_to_its_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    deviations = []
    usual = PPO.train

    def note(self: PPO) -> None:
        deviations.append(self.policy.log_std.max().item())
        usual(self)

    monkeypatch.setattr(PPO, "train", note)
    threads = torch.get_num_threads()
    train(small(tmp_path, log_deviation=-1.0, final_log_deviation=-3.0, threads=threads + 1), console=quiet())
    assert torch.get_num_threads() == threads, "as before"
    assert len(deviations) == 8
    for k, deviation in enumerate(deviations):
        assert deviation == pytest.approx(-1.0 - 2.0 * k / 8, abs=0.02)


def test_the_log_has_every_validation_at_its_step(tmp_path: Path) -> None:
    accumulators = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    train(small(tmp_path, tensorboard=True), console=quiet())
    log = accumulators.EventAccumulator(str(tmp_path)).Reload()
    curve = list(csv.DictReader((tmp_path / "curve.csv").read_text().splitlines()))
    for name in ("safe_score", "score", "contact_free"):
        logged = [(event.step, event.value) for event in log.Scalars(f"validation/{name}")]
        wanted = [(int(float(row["steps"])), float(row[name])) for row in curve]
        assert [step for step, _ in logged] == [step for step, _ in wanted] == [640, 1280]
        assert [v for _, v in logged] == pytest.approx([v for _, v in wanted], rel=1e-5, abs=1e-6)
    assert {"reward/slot", "reward/contact", "training/score", "rollout/success_rate"} <= set(log.Tags()["scalars"])


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        ("ppo", {}),
        *(pytest.param(name, {}, marks=pytest.mark.long) for name in ("mappo", "sac", "td3")),
        ("ppo", GUARDED),
        ("ppo", {"imitate": "pursuit", "imitate_rounds": 2}),
        ("ppo", TARGET),
        ("ppo", AGAINST),
    ],
)
def test_an_interrupted_training_ends_as_an_uninterrupted_one(
    tmp_path: Path, algorithm: str, changes: dict[str, Any]
) -> None:
    train(small(tmp_path / "whole", algorithm, **changes), console=quiet())
    with killed_at(checkpoint, "write_checkpoint", 4):
        train(small(tmp_path / "cut", algorithm, **changes), console=quiet())
    assert 0 < steps_saved(tmp_path / "cut") < steps_saved(tmp_path / "whole")
    if not changes:
        with killed_at(Run, "_checkpoint", 2):  # the last one
            resume(tmp_path / "cut")
        assert not (tmp_path / "cut/last.safetensors").exists(), "a league takes it for the end"
    resume(tmp_path / "cut")
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


@pytest.mark.long
def test_kill_9_loses_nothing_that_was_saved(tmp_path: Path) -> None:
    settings = small(tmp_path / "whole", steps=12_000, evaluate_every=6000, checkpoint_every=800)
    train(settings, console=quiet())
    settings, folder = replace(settings, folder=tmp_path / "killed"), tmp_path / "killed"
    for target in (800, 4000):
        running, reached = get_context("spawn").Process(target=train, args=(settings,)), 0
        running.start()
        while reached < target:
            assert running.is_alive()
            time.sleep(0.01)
            reached = steps_saved(folder) if (folder / "checkpoint.pt").exists() else 0
        running.kill()
        running.join()
        assert reached <= steps_saved(folder) < settings.steps
    train(settings, console=quiet())
    assert_equal(numbers(tmp_path / "whole"), numbers(folder))


def test_a_checkpoint_that_is_damaged_or_of_other_settings_is_named(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    settings = json.loads((tmp_path / "settings.json").read_text())
    (tmp_path / "settings.json").write_text(json.dumps({**settings, "versions": [0]}))
    with pytest.raises(RunFolderError, match=r"holds a run with versions=\[0\], not \[\d+\]"):
        train(small(tmp_path), console=quiet())
    (tmp_path / "settings.json").write_text(json.dumps({**settings, "hidden": [8, 8]}))
    with pytest.raises(RunFolderError, match="does not fit"):
        resume(tmp_path)
    path = tmp_path / "checkpoint.pt"
    tensors = (part for part in zipfile.ZipFile(path).infolist() if "/data/" in part.filename)
    largest = max(tensors, key=lambda part: part.file_size)
    whole = bytearray(path.read_bytes())
    whole[largest.header_offset + largest.file_size // 2] ^= 1
    for damaged in (whole, whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(RunFolderError, match=r"checkpoint\.pt is damaged"):
            resume(tmp_path)
    (tmp_path / "settings.json").unlink()
    with pytest.raises(RunFolderError, match=r"has best\.safetensors, but no settings\.json of a run"):
        train(small(tmp_path), console=quiet())


def test_a_folder_in_use(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(RunFolderError, match=f"process {os.getpid()} uses"):
        train(small(tmp_path), console=quiet())
    assert not [*tmp_path.iterdir()], "no lock, either"
