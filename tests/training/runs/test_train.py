"""Training: the same from the same seed, cut and gone on with, and exported as it is."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rich.console import Console
from safetensors.numpy import load_file
from stable_baselines3 import PPO

import posse
from posse_baselines import BasePolicy, PolicyError, load
from posse_baselines.learned import LearnedPolicy
from posse_training.reports.evaluation import evaluate
from posse_training.runs import checkpoint
from posse_training.runs import train as module
from posse_training.runs.checkpoint import CheckpointError, RunFolderError, locked, read_checkpoint
from posse_training.runs.export import export
from posse_training.runs.settings import SettingsError, TrainSettings
from posse_training.runs.train import (
    even_minibatch,
    make_env,
    make_model,
    resume,
    steps_made,
    train,
)
from posse_training.sb3.imitation import imitate
from posse_training.sb3.normalisation import Normaliser, RunningStatistics

HORIZON = 40
ALGORITHMS = ("ppo", "mappo", "sac", "td3")


def small(folder: Path, algorithm: str = "ppo", **changes: Any) -> TrainSettings:
    """Settings of a training that takes a second."""
    settings = TrainSettings(
        scenario="constant",
        algorithm=algorithm,  # type: ignore[arg-type]
        steps=1280,
        seed=3,
        folder=folder,
        num_worlds=4,
        team_sizes=(2,),
        overrides={"horizon": HORIZON, "settle_time": 1.0},
        hidden=(16, 16),
        minibatch=64,
        rollout=20,
        epochs=2,
        replay=2000,
        learning_starts=80,
        gradients=1,
        evaluate_every=640,
        evaluate_worlds=3,
        beside=None,
        checkpoint_every=320,
        tensorboard=False,
    )
    return replace(settings, **changes)


def quiet() -> Console:
    return Console(file=StringIO())


def numbers(folder: Path) -> dict[str, Any]:
    """Everything that a finished training leaves, but the time it took."""
    arrays, state = read_checkpoint(folder)
    state.pop("seconds")
    for point in state["curve"]:
        point.pop("seconds")
    return {"arrays": arrays, "state": state, "last": load_file(folder / "last.safetensors")}


def assert_equal(mine: dict[str, Any], theirs: dict[str, Any]) -> None:
    assert mine["state"] == theirs["state"]
    for part in ("arrays", "last"):
        assert set(mine[part]) == set(theirs[part])
        for name, array in mine[part].items():
            assert array.tobytes() == theirs[part][name].tobytes(), name


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_two_trainings_from_one_seed_agree_exactly(tmp_path: Path, algorithm: str) -> None:
    for name in "ab":
        train(small(tmp_path / name, algorithm), console=quiet())
    assert_equal(numbers(tmp_path / "a"), numbers(tmp_path / "b"))
    train(small(tmp_path / "c", algorithm, seed=4), console=quiet())
    mine, other = numbers(tmp_path / "a")["last"], numbers(tmp_path / "c")["last"]
    assert not np.array_equal(mine["layers.0.weight"], other["layers.0.weight"])


ADVISED: dict[str, Any] = {
    "scenario": "field",
    "advise": "ddcs-distributed",
    "overrides": {"horizon": HORIZON, "settle_time": 1.0},
}


@pytest.mark.parametrize(
    ("algorithm", "changes"), [*((name, {}) for name in ALGORITHMS), ("mappo", ADVISED)]
)
def test_a_training_that_was_cut_ends_where_it_would_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, algorithm: str, changes: dict[str, Any]
) -> None:
    train(small(tmp_path / "whole", algorithm, **changes), console=quiet())
    write, count = checkpoint.write_checkpoint, 0

    def cut(*arguments: Any) -> None:
        nonlocal count
        write(*arguments)
        count += 1
        if count == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "write_checkpoint", cut)
    with pytest.raises(KeyboardInterrupt):
        train(small(tmp_path / "cut", algorithm, **changes), console=quiet())
    monkeypatch.undo()
    steps = read_checkpoint(tmp_path / "cut")[1]["model"]["num_timesteps"]
    assert 0 < steps < 1280
    resume(tmp_path / "cut", console=quiet())
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


SCRIPT = """
import sys
from io import StringIO
from pathlib import Path
from rich.console import Console
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import resume, train
import json
console = Console(file=StringIO())
if sys.argv[1] == "train":
    train(TrainSettings.from_dict(json.loads(sys.argv[3])), console=console)
else:
    resume(Path(sys.argv[2]), console=console)
"""


def start(action: str, folder: Path, settings: TrainSettings) -> subprocess.Popen[bytes]:
    told = json.dumps({**settings.to_dict(), "folder": str(folder)})
    return subprocess.Popen([sys.executable, "-c", SCRIPT, action, str(folder), told])


@pytest.mark.slow
def test_kill_9_loses_at_most_one_interval(tmp_path: Path) -> None:
    settings = small(tmp_path / "x", steps=16_000, evaluate_every=8000, checkpoint_every=800)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert start("train", whole, settings).wait() == 0
    running = start("train", killed, settings)
    kills = 0
    for target in (800, 8000):
        reached = -1
        while running.poll() is None and reached < target:
            time.sleep(0.01)
            if (killed / "checkpoint.safetensors").exists():
                reached = read_checkpoint(killed)[1]["model"]["num_timesteps"]
        if running.poll() is not None:
            break
        os.kill(running.pid, signal.SIGKILL)
        assert running.wait() == -signal.SIGKILL
        kills += 1
        kept = read_checkpoint(killed)[1]["model"]["num_timesteps"]
        assert kept >= reached  # what was kept stays kept
        running = start("resume", killed, settings)
    assert kills >= 1
    assert running.wait() == 0
    assert_equal(numbers(whole), numbers(killed))


def test_an_advised_training_exports_what_it_played(tmp_path: Path) -> None:
    file = train(small(tmp_path / "run", **ADVISED), console=quiet())
    policy = load(file)
    assert isinstance(policy, LearnedPolicy)
    assert policy.adviser is not None
    scenario = small(tmp_path, **ADVISED).scenarios[0]
    again = evaluate(policy, scenario, 3, 0, split="validation", progress=False)["score"].mean()
    assert again == pytest.approx(policy.card["validation_score"], abs=1e-12)
    with (file.parent / "curve.csv").open(newline="") as lines:
        curve = list(csv.DictReader(lines))
    assert float(curve[0]["steps"]) == 0, "what it begins with is scored, too"
    assert again == pytest.approx(max(float(row["score"]) for row in curve), abs=1e-12)
    with pytest.raises(SettingsError, match="neither imitate nor message_size"):
        small(tmp_path, advise="ddcs-distributed", message_size=1)


def test_killed_before_the_first_checkpoint_it_starts_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "write_checkpoint", killed)
    with pytest.raises(KeyboardInterrupt):
        train(small(tmp_path / "cut"), console=quiet())
    monkeypatch.undo()
    resume(tmp_path / "cut", console=quiet())
    train(small(tmp_path / "whole"), console=quiet())
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


def test_checkpoints_are_no_further_apart_than_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    write = checkpoint.write_checkpoint

    def note(folder: Path, arrays: Any, state: Any) -> None:
        seen.append(state["model"]["num_timesteps"])
        write(folder, arrays, state)

    monkeypatch.setattr(module, "write_checkpoint", note)
    train(small(tmp_path / "run"), console=quiet())
    assert seen == [0, 320, 640, 960, 1280]


def test_a_finished_training_can_be_gone_on_with_for_longer(tmp_path: Path) -> None:
    train(small(tmp_path / "run"), console=quiet())
    resume(tmp_path / "run", console=quiet(), steps=1920)
    assert read_checkpoint(tmp_path / "run")[1]["model"]["num_timesteps"] == 1920


class TestTrouble:
    def test_a_full_disk(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = tmp_path / "run"
        fsync, count = os.fsync, 0

        def full(file: int) -> None:
            nonlocal count
            count += 1
            if count > 3:
                raise OSError(28, "No space left on device")
            fsync(file)

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(CheckpointError, match=r"No space left.*--resume"):
            train(small(folder), console=quiet())
        monkeypatch.undo()
        assert not list(folder.glob(".*partial"))
        assert read_checkpoint(folder)[1]["model"]["num_timesteps"] >= 0
        resume(folder, console=quiet())
        train(small(tmp_path / "whole"), console=quiet())
        assert_equal(numbers(folder), numbers(tmp_path / "whole"))

    @pytest.mark.parametrize("where", [0.001, 0.3, 0.9])
    def test_a_damaged_checkpoint(self, tmp_path: Path, where: float) -> None:
        folder = tmp_path / "run"
        train(small(folder), console=quiet())
        path = folder / "checkpoint.safetensors"
        content = bytearray(path.read_bytes())
        content[int(where * len(content))] ^= 4
        path.write_bytes(content)
        with pytest.raises(CheckpointError, match=r"checkpoint\.safetensors is damaged"):
            resume(folder, console=quiet())
        path.write_bytes(content[: len(content) // 2])
        with pytest.raises(CheckpointError, match="damaged"):
            resume(folder, console=quiet())

    def test_a_folder_in_use(self, tmp_path: Path) -> None:
        code = (
            "import sys, time; from pathlib import Path;"
            "from posse_training.runs.checkpoint import locked\n"
            f"with locked(Path({str(tmp_path)!r})): print('held', flush=True); time.sleep(60)"
        )
        holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
        try:
            assert holder.stdout is not None
            assert holder.stdout.readline() == b"held\n"
            with pytest.raises(RunFolderError, match=f"in use by process {holder.pid}"):
                train(small(tmp_path), console=quiet())
            assert not (tmp_path / "settings.json").exists()
        finally:
            holder.kill()
            holder.wait()
            if holder.stdout is not None:
                holder.stdout.close()
        with locked(tmp_path):  # the lock ended with its holder
            pass

    def test_a_folder_that_holds_a_run(self, tmp_path: Path) -> None:
        train(small(tmp_path), console=quiet())
        before = (tmp_path / "checkpoint.safetensors").read_bytes()
        with pytest.raises(RunFolderError, match="--resume"):
            train(small(tmp_path), console=quiet())
        assert (tmp_path / "checkpoint.safetensors").read_bytes() == before

    def test_no_run_to_go_on_with(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match="no run folder"):
            resume(tmp_path, console=quiet())

    def test_a_checkpoint_of_other_settings(self, tmp_path: Path) -> None:
        train(small(tmp_path), console=quiet())
        settings = json.loads((tmp_path / "settings.json").read_text())
        settings["hidden"] = [8, 8]
        (tmp_path / "settings.json").write_text(json.dumps(settings))
        with pytest.raises(CheckpointError, match="does not fit"):
            resume(tmp_path, console=quiet())

    def test_damaged_settings(self, tmp_path: Path) -> None:
        (tmp_path / "settings.json").write_text("{")
        with pytest.raises(SettingsError, match=r"settings\.json is damaged"):
            resume(tmp_path, console=quiet())


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_is_exported_acts_as_the_model_does(tmp_path: Path, algorithm: str) -> None:
    settings = small(tmp_path, algorithm)
    train(settings, console=quiet())
    env = make_env(settings)
    model = make_model(settings, env)
    arrays, state = read_checkpoint(tmp_path)
    part = {k.removeprefix("model/"): a for k, a in arrays.items() if k.startswith("model/")}
    checkpoint.restore_model(model, part, state["model"])
    policy = LearnedPolicy.from_file(tmp_path / "last.safetensors")
    batch = posse.Batch(settings.scenarios[0], 4, seed=3)
    actions, _ = policy.act(batch.reset(), policy.begin(batch.layout, 4))
    expected, _ = model.predict(env.reset(), deterministic=True)
    np.testing.assert_allclose(actions.reshape(8, 2), expected, atol=1e-5)
    assert np.ptp(expected) > 1e-3


def test_the_card_says_what_it_is(tmp_path: Path) -> None:
    best = train(small(tmp_path), console=quiet())
    card = json.loads(best.with_suffix(".json").read_text())
    assert card["scenarios"][0]["name"] == "constant"
    assert card["scenarios"][0]["num_trackers"] == 2
    assert card["trained_splits"] == ["train"]
    assert card["seed"] == 3
    policy = LearnedPolicy.from_file(best)
    assert card["encoding_hash"] == policy.encoding.digest
    curve = json.loads((tmp_path / "last.json").read_text())["curve"]
    assert [point["steps"] for point in curve] == [640, 1280]
    assert card["validation_score"] == max(p["score"] for p in curve)
    table = (tmp_path / "curve.csv").read_text().splitlines()
    assert len(table) == 3


def test_the_best_policy_is_kept_not_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = iter([0.2, 0.9, 0.4])
    monkeypatch.setattr(
        module, "validate", lambda *_: {"score": next(scores), "low": 0.0, "high": 1.0}
    )
    best = train(small(tmp_path, steps=1920), console=quiet())
    assert LearnedPolicy.from_file(best).card["steps"] == 1280
    assert LearnedPolicy.from_file(best).card["validation_score"] == 0.9


class TestMappo:
    def test_the_actor_reads_its_own_observation_alone(self, tmp_path: Path) -> None:
        settings = small(tmp_path, "mappo")
        env = make_env(settings)
        model = make_model(settings, env)
        rows = torch.from_numpy(env.reset())
        other = rows.clone()
        other[:, env.private_size :] += 5.0
        policy: Any = model.policy
        with torch.no_grad():
            a, b = (policy.get_distribution(x).distribution.mean for x in (rows, other))
            u, v = policy.predict_values(rows), policy.predict_values(other)
        assert torch.equal(a, b)
        assert (u - v).abs().max() > 1e-4
        own = rows.clone()
        own[:, : env.private_size] += 5.0
        with torch.no_grad():
            assert not torch.equal(policy.get_distribution(own).distribution.mean, a)

    def test_no_gradient_leads_from_an_action_to_the_state(self, tmp_path: Path) -> None:
        settings = small(tmp_path, "mappo")
        env = make_env(settings)
        policy: Any = make_model(settings, env).policy
        rows = torch.from_numpy(env.reset()).requires_grad_()
        policy.get_distribution(rows).distribution.mean.sum().backward()
        assert not rows.grad[:, env.private_size :].any()  # type: ignore[index]
        assert rows.grad[:, : env.private_size].any()  # type: ignore[index]


class _Circle(BasePolicy):
    """An expert that is easy to copy, and says a word that the copy is not given."""

    name = "circle"
    message_size = 1

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        side = memory.views(observations)["target_bearing"][..., 1]
        actions = np.stack([np.full_like(side, 0.5), 0.8 * side, np.ones_like(side)], axis=-1)
        return actions.astype(np.float32), memory


def test_imitation_copies(tmp_path: Path) -> None:
    settings = small(tmp_path, imitate="circle", imitate_rounds=4, encoding="plain")
    env = make_env(settings)
    model = make_model(settings, env)
    errors: list[float] = []
    statistics = RunningStatistics(env.private_size)
    imitate(model, settings, env.encoding, _Circle(), statistics, lambda k, n, e: errors.append(e))
    assert len(errors) == 4
    assert errors[-1] < 0.02
    policy = export(model, env.encoding, {})
    batch = posse.batch("constant", 20, num_trackers=2, horizon=HORIZON, settle_time=1.0, seed=99)
    observations = batch.reset()
    mine, _ = policy.act(observations, policy.begin(batch.layout, 20))
    side = batch.layout.views(observations)["target_bearing"][..., 1]
    assert np.abs(mine[..., 1] - 0.8 * side).mean() < 0.15
    # The statistics are those of what the expert saw.
    normaliser = next(m for m in model.policy.modules() if isinstance(m, Normaliser))
    np.testing.assert_allclose(normaliser.mean, statistics.mean, rtol=1e-5, atol=1e-6)


def test_a_training_can_begin_with_a_copy(tmp_path: Path) -> None:
    for name in "ab":
        train(small(tmp_path / name, imitate="pursuit", imitate_rounds=2), console=quiet())
    assert_equal(numbers(tmp_path / "a"), numbers(tmp_path / "b"))
    with pytest.raises(PolicyError, match="unknown policy"):
        train(small(tmp_path / "c", imitate="nobody"), console=quiet())


class TestStatistics:
    def test_adding_in_parts_is_adding_at_once(self) -> None:
        rows = np.random.default_rng(0).normal(3, 2, (500, 4)).astype(np.float32)
        statistics = RunningStatistics(4)
        for part in np.split(rows, [1, 50, 300]):
            statistics.add(part)
        np.testing.assert_allclose(statistics.mean, rows.mean(axis=0), rtol=1e-5)
        np.testing.assert_allclose(statistics.variance, rows.var(axis=0), rtol=1e-5)
        np.testing.assert_allclose(statistics.scale, 1 / rows.std(axis=0), rtol=1e-5)

    def test_what_never_varies_says_nothing(self) -> None:
        statistics = RunningStatistics(1)
        statistics.add(np.full((10, 1), 7.0, np.float32))
        assert statistics.scale == 0

    def test_a_rollout_is_learned_from_with_the_numbers_it_was_played_with(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        means: list[Any] = []
        ratios: list[Any] = []
        original = PPO.train

        def look(self: PPO) -> None:
            normaliser = next(m for m in self.policy.modules() if isinstance(m, Normaliser))
            means.append(normaliser.mean.numpy().copy())
            buffer = self.rollout_buffer
            with torch.no_grad():
                _, log_prob, _ = self.policy.evaluate_actions(
                    torch.as_tensor(buffer.observations[0]), torch.as_tensor(buffer.actions[0])
                )
            ratios.append(np.abs(log_prob.numpy() - buffer.log_probs[0]).max())
            original(self)

        monkeypatch.setattr(PPO, "train", look)
        train(small(tmp_path), console=quiet())
        assert max(ratios) < 1e-5
        assert not np.array_equal(means[0], means[-1])


def test_a_last_rollout_beyond_the_steps_asked_for_does_not_learn_backwards(
    tmp_path: Path,
) -> None:
    """Whole rollouts are made: what is left of the steps may be less than nothing."""
    settings = small(tmp_path, steps=100, learning_rate=1e-3, final_learning_rate=1e-4)
    env = make_env(settings)
    schedule = make_model(settings, env).lr_schedule
    assert schedule(1.0) == pytest.approx(1e-3)
    assert schedule(0.5) == pytest.approx(5.5e-4)
    assert schedule(0.0) == schedule(-7.0) == pytest.approx(1e-4)
    at_once = env.num_envs * settings.rollout
    assert steps_made(settings, env.num_envs) == -(-100 // at_once) * at_once
    assert steps_made(replace(settings, steps=3 * at_once), env.num_envs) == 3 * at_once


@pytest.mark.parametrize(
    ("rows", "wanted", "size"), [(81920, 8192, 8192), (100, 40, 50), (7, 3, 7), (6, 100, 6)]
)
def test_minibatches_are_even(rows: int, wanted: int, size: int) -> None:
    assert even_minibatch(rows, wanted) == size
