"""``posse train``: from settings to a policy that ships. It reads in the order it runs."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import io
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from rich.console import Console
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, configure
from stable_baselines3.common.noise import NormalActionNoise
from torch import nn

import posse
from posse_baselines import load
from posse_baselines.learned.advice import Adviser, check_adviser
from posse_baselines.learned import Encoding
from posse_baselines.learned import LearnedPolicy
from posse_baselines.policy import PolicyError
from posse_training.reports.evaluation import evaluate
from posse_training.reports.statistics import mean
from posse_training.runs.checkpoint import (
    SETTINGS,
    Arrays,
    CheckpointError,
    RunFolderError,
    locked,
    model_state,
    random_state,
    read_checkpoint,
    restore_model,
    restore_random_state,
    write_atomically,
    write_checkpoint,
)
from posse_training.runs.display import Display
from posse_training.runs.export import export, make_card
from posse_training.runs.settings import SettingsError, TrainSettings, read_settings
from posse_training.sb3.centralized_critic import CentralizedCriticPolicy
from posse_training.sb3.imitation import imitate
from posse_training.sb3.normalisation import Normaliser, RunningStatistics
from posse_training.sb3.rollout_buffer import FlatRolloutBuffer
from posse_training.sb3.tanh import QuickTanh
from posse_training.sb3.team_ppo import TeamPPO
from posse_training.sb3.vec_env import TeamVecEnv

VALIDATION_SEED: Final = 0
BEST: Final = "best.safetensors"
LAST: Final = "last.safetensors"
CURVE: Final = "curve.csv"
_ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": QuickTanh, "relu": nn.ReLU}
_ADAM_EPSILON: Final = 1e-5  # what stable-baselines3's PPO takes unless told otherwise
_WARM_WORLDS: Final = 32
_WARM_REACH: Final = 0.1  # of random answers to an adviser
_EXPLORATION: Final = 0.1  # deviation of the noise that td3 adds to its actions
_STATISTICS_EVERY: Final = 8  # rows of a rollout that statistics are made from: one of so many


def train(settings: TrainSettings, *, console: Console | None = None, resume: bool = False) -> Path:
    """Train a policy; return the file of the one that did best on validation worlds.

    Args:
        settings: All that the result is a function of.
        console: Where to show progress.
        resume: Go on where the run folder's checkpoint was written.

    Raises:
        RunFolderError: The folder is in use, or holds a run already.
        CheckpointError: A checkpoint cannot be written or read.
    """
    folder = settings.run_folder
    with (
        locked(folder),
        torch_threads(settings.threads),
        Display(settings, console or Console()) as display,
    ):
        saved = open_run(folder, settings, resume)
        env = make_env(settings)
        model = make_model(settings, env)
        model.set_logger(make_logger(folder, settings))
        steps = steps_made(settings, env.num_envs)
        if steps != settings.steps:
            display.note(f"rollouts are whole, so that {steps:,} steps will be made")
        statistics = RunningStatistics(env.observation_size)
        display.beside(score_beside(settings, display))
        training = Training(settings, folder, env, model, statistics, display)
        if saved is not None:
            training.restore(*saved)
        else:
            first_statistics(settings, env, statistics)
            statistics.apply(model.policy)
            if settings.imitate is not None:
                display.note(f"copying {settings.imitate}")
                expert = load(settings.imitate)
                imitate(model, settings, env.encoding, expert, statistics, copy_report(display))
        display.begin(model.num_timesteps, training.curve)
        model.learn(
            settings.steps - model.num_timesteps,
            callback=training,
            reset_num_timesteps=saved is None,
        )
        training.finish()
    return folder / (BEST if (folder / BEST).is_file() else LAST)


def steps_made(settings: TrainSettings, num_envs: int) -> int:
    """Return how many steps a training makes, which is whole rollouts, or steps of all worlds."""
    at_once = num_envs * (settings.rollout if settings.on_policy else 1)
    return -(-settings.steps // at_once) * at_once


def resume(folder: Path, *, console: Console | None = None, steps: int | None = None) -> Path:
    """Go on with the training of a run folder; as :func:`train`.

    Args:
        folder: The run folder.
        console: Where to show progress.
        steps: Train for so many steps in all, instead of what the run was begun with.

    Raises:
        SettingsError: The folder is none of a run.
        RunFolderError: It is in use.
        CheckpointError: Its checkpoint is damaged.
    """
    settings = replace(read_settings(folder / SETTINGS), folder=folder)
    if steps is not None:
        settings = replace(settings, steps=steps)
    return train(settings, console=console, resume=True)


def open_run(
    folder: Path, settings: TrainSettings, resume: bool
) -> tuple[Arrays, dict[str, Any]] | None:
    """Prepare a run folder; return its checkpoint, or ``None`` where there is none to go on from.

    Raises:
        RunFolderError: It holds a run, and is not to be gone on with; or it cannot be written to.
        CheckpointError: Its checkpoint is damaged.
    """
    if resume:
        # Killed before the first checkpoint: the same settings lead to the same place.
        has_checkpoint = (folder / "checkpoint.safetensors").exists()
        saved = read_checkpoint(folder) if has_checkpoint else None
    elif (folder / SETTINGS).exists():
        raise RunFolderError(
            f"{folder} holds a run already: go on with it (posse train --resume {folder}), remove "
            "it, or choose another --folder"
        )
    else:
        saved = None
    text = json.dumps({**settings.to_dict(), "folder": None}, indent=2) + "\n"
    try:
        write_atomically(folder / SETTINGS, text.encode())
    except OSError as error:
        raise RunFolderError(f"cannot write to run folder {folder}: {error}") from error
    return saved


@contextlib.contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Have torch use so many threads meanwhile."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def make_env(settings: TrainSettings) -> TeamVecEnv:
    """Return the worlds to train in, of the split ``"train"``."""
    scenarios = settings.scenarios
    edges = [settings.num_worlds * k // len(scenarios) for k in range(len(scenarios) + 1)]
    batches = [
        posse.Batch(
            scenario, last - first, seed=settings.seed, first_world=first, autoreset="disabled"
        )
        for scenario, first, last in zip(scenarios, edges[:-1], edges[1:], strict=True)
    ]
    largest = max(batches, key=lambda batch: batch.layout.neighbours)
    encoding = Encoding.of(largest.layout, settings.encoding, settings.num_neighbours)
    return TeamVecEnv(
        batches, encoding, adviser=make_adviser(settings), see_state=settings.algorithm == "mappo"
    )


def make_adviser(settings: TrainSettings) -> Adviser | None:
    """Return the policy whose proposals are given to the learner, if any."""
    return (
        None if settings.advise is None else check_adviser(settings.advise, load(settings.advise))
    )


def make_model(settings: TrainSettings, env: TeamVecEnv) -> BaseAlgorithm:
    """Return an untrained model."""
    s = settings

    def learning_rate(remaining: float) -> float:
        # Whole rollouts are made, so that the last may end after the steps that were asked for.
        left = max(0.0, remaining)
        return s.final_learning_rate + left * (s.learning_rate - s.final_learning_rate)

    network: dict[str, Any] = {
        "activation_fn": _ACTIVATIONS[s.activation],
        "features_extractor_class": Normaliser,
        "optimizer_kwargs": {"fused": True},
    }
    if not s.on_policy:
        shape = env.action_shape
        noise = NormalActionNoise(np.zeros(shape), np.full(shape, _EXPLORATION))
        return (SAC if s.algorithm == "sac" else TD3)(
            "MlpPolicy",
            env,
            learning_rate=learning_rate,
            buffer_size=s.replay,
            learning_starts=s.learning_starts,
            batch_size=s.minibatch,
            gamma=s.discount,
            gradient_steps=s.gradients,
            action_noise=noise if s.algorithm == "td3" else None,
            policy_kwargs={**network, "net_arch": list(s.hidden)},
            seed=s.seed,
            device="cpu",
        )
    network["optimizer_kwargs"]["eps"] = _ADAM_EPSILON
    if s.algorithm == "mappo":
        network |= {"private_size": env.private_size, "hidden": s.hidden}
    else:
        network |= {"net_arch": list(s.hidden)}
    return TeamPPO(
        CentralizedCriticPolicy if s.algorithm == "mappo" else "MlpPolicy",
        env,
        learning_rate=learning_rate,
        n_steps=s.rollout,
        batch_size=even_minibatch(s.rollout * env.num_envs, s.minibatch),
        n_epochs=s.epochs,
        gamma=s.discount,
        gae_lambda=s.gae_lambda,
        clip_range=s.clip,
        ent_coef=s.entropy,
        vf_coef=s.value_weight,
        rollout_buffer_class=FlatRolloutBuffer,
        policy_kwargs={**network, "log_std_init": s.log_deviation},
        stats_window_size=500,
        seed=s.seed,
        device="cpu",
    )


def even_minibatch(rows: int, wanted: int) -> int:
    """Return the size nearest to ``wanted``, in proportion, that rows fall into evenly."""
    sizes = [d for k in range(1, int(rows**0.5) + 1) if rows % k == 0 for d in (k, rows // k)]
    return min(sizes, key=lambda size: max(size / wanted, wanted / size))


def make_logger(folder: Path, settings: TrainSettings) -> Logger:
    """Return stable-baselines3's logger: TensorBoard's files, if it is installed."""
    if settings.wandb is not None:
        start_wandb(folder, settings)
    there = importlib.util.find_spec("tensorboard") is not None
    return configure(str(folder), ["tensorboard"] if settings.tensorboard and there else [])


def start_wandb(folder: Path, settings: TrainSettings) -> None:
    """Begin a Weights & Biases run that copies TensorBoard's logs.

    Raises:
        SettingsError: The library is not installed.
    """
    if importlib.util.find_spec("wandb") is None:
        raise SettingsError(
            f"wandb={settings.wandb!r} needs Weights & Biases: pip install wandb, or leave it out"
        )
    wandb: Any = importlib.import_module("wandb")
    wandb.init(
        project=settings.wandb, name=folder.name, dir=folder, config=settings.to_dict(),
        sync_tensorboard=True, resume="allow",
    )  # fmt: skip


def first_statistics(
    settings: TrainSettings, env: TeamVecEnv, statistics: RunningStatistics
) -> None:
    """Gather statistics of the inputs from one episode of random play in a few worlds.

    A direction is held for some time, or nobody would get anywhere.
    """
    few = replace(settings, num_worlds=max(_WARM_WORLDS, len(settings.scenarios)))
    warm = make_env(few)
    generator = np.random.default_rng(settings.seed)
    statistics.add(warm.reset())
    shape = (warm.num_envs, *warm.action_shape)
    reach = 1.0 if settings.advise is None else _WARM_REACH
    for step in range(max(batch.scenario.horizon for batch in warm.batches)):
        if step % 20 == 0:
            actions = generator.uniform(-reach, reach, shape).astype(np.float32)
        statistics.add(np.asarray(warm.step(actions)[0]))


def score_beside(settings: TrainSettings, display: Display) -> float | None:
    """Return another policy's score on the validation worlds; ``None``: no such policy."""
    if settings.beside is None:
        return None
    display.note(f"playing {settings.beside} on the validation worlds")
    try:
        return validate(settings, load(settings.beside))["score"]
    except PolicyError as error:
        display.note(f"no score beside it: {error}")
        return None


def validate(settings: TrainSettings, policy: Any) -> dict[str, float]:
    """Return a policy's mean score on the validation worlds, with its 95 % interval."""
    scores = np.concatenate(
        [
            evaluate(
                policy, scenario, settings.evaluate_worlds, VALIDATION_SEED,
                split="validation", progress=False,
            )["score"]
            for scenario in settings.scenarios
        ]
    )  # fmt: skip
    estimate = mean(scores)
    return {"score": estimate.value, "low": estimate.low, "high": estimate.high}


def copy_report(display: Display) -> Callable[[int, int, float], None]:
    """Return what tells of the rounds of imitation."""
    return lambda done, rounds, error: display.note(
        f"copying: round {done} of {rounds}, squared error {error:.4f}"
    )


class Training(BaseCallback):
    """What happens beside learning: statistics, a look at validation worlds, checkpoints.

    All of it happens between two rollouts, where a training can be cut and gone on with.
    """

    def __init__(
        self,
        settings: TrainSettings,
        folder: Path,
        env: TeamVecEnv,
        model: BaseAlgorithm,
        statistics: RunningStatistics,
        display: Display,
    ) -> None:
        super().__init__()
        self.settings = settings
        self.folder = folder
        self.env = env
        self.model = model
        self.statistics = statistics
        self.display = display
        self.curve: list[dict[str, float]] = []
        self._seconds_before = 0.0
        self._started = time.monotonic()
        # A copy, or an adviser by itself, may be better than what a short run makes of it.
        begins_with_something = settings.imitate is not None or settings.advise is not None
        self._next_evaluation = 0 if begins_with_something else settings.evaluate_every
        self._next_checkpoint = 0
        self._rollouts = 0

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        buffer = getattr(self.model, "rollout_buffer", None)
        if buffer is not None:
            self.statistics.add(buffer.observations[::_STATISTICS_EVERY])
        elif self._rollouts % _STATISTICS_EVERY == 0:
            self.statistics.add(np.asarray(self.model._last_obs))
        self._rollouts += 1

    def _on_rollout_start(self) -> None:
        if self.settings.on_policy or self._rollouts % 100 == 0:
            self.statistics.apply(self.model.policy)
        steps = self.model.num_timesteps
        if steps >= self._next_evaluation:
            self._next_evaluation = steps - steps % self.settings.evaluate_every
            self._next_evaluation += self.settings.evaluate_every
            self._evaluate()
        if steps >= self._next_checkpoint:
            self._next_checkpoint = steps + self.settings.checkpoint_every
            self._checkpoint()
        self.display.progress(steps, self._training_score())

    def _training_score(self) -> float | None:
        episodes = self.model.ep_info_buffer or ()
        return float(np.mean([e["score"] for e in episodes])) if episodes else None

    def _policy(self) -> LearnedPolicy:
        card = make_card(
            self.settings, self.env.encoding, steps=self.model.num_timesteps, curve=self.curve
        )
        return export(self.model, self.env.encoding, card, make_adviser(self.settings))

    def _evaluate(self) -> None:
        """Play the validation worlds; keep the policy if it is the best so far."""
        point = {
            "steps": float(self.model.num_timesteps),
            "seconds": self._seconds_before + time.monotonic() - self._started,
            **validate(self.settings, self._policy()),
        }
        best = max((p["score"] for p in self.curve), default=-1.0)
        self.curve.append(point)
        self._write(BEST if point["score"] > best else None)
        self.model.logger.record("validation/score", point["score"])
        self.display.progress(self.model.num_timesteps, self._training_score())
        self.display.evaluated(point)

    def _write(self, name: str | None) -> None:
        text = io.StringIO()
        writer = csv.DictWriter(text, ["steps", "seconds", "score", "low", "high"])
        writer.writeheader()
        writer.writerows(self.curve)
        try:
            write_atomically(self.folder / CURVE, text.getvalue().encode())
            if name is not None:
                self._policy().save(self.folder / name)
        except OSError as error:
            raise CheckpointError(
                f"cannot write to {self.folder}: {error.strerror or error}. Make room, then go on "
                f"with: posse train --resume {self.folder}"
            ) from error

    def _checkpoint(self) -> None:
        arrays: Arrays = {}
        state: dict[str, Any] = {
            "curve": self.curve,
            "seconds": self._seconds_before + time.monotonic() - self._started,
            "next_evaluation": self._next_evaluation,
            "next_checkpoint": self._next_checkpoint,
            "rollouts": self._rollouts,
        }
        for name, (part, values) in {
            "model": model_state(self.model),
            "random": random_state(),
            "worlds": (self.env.save(), {}),
            "statistics": (self.statistics.save(), {}),
        }.items():
            state[name] = values
            arrays |= {f"{name}/{key}": array for key, array in part.items()}
        write_checkpoint(self.folder, arrays, state)

    def restore(self, arrays: Arrays, state: dict[str, Any]) -> None:
        """Take up where :meth:`_checkpoint` was.

        Raises:
            CheckpointError: The checkpoint is of other settings.
        """

        def part(name: str) -> Arrays:
            start = f"{name}/"
            return {k.removeprefix(start): a for k, a in arrays.items() if k.startswith(start)}

        try:
            self.env.restore(part("worlds"))
            self.statistics.restore(part("statistics"))
            restore_model(self.model, part("model"), state["model"])
        except (KeyError, ValueError, RuntimeError) as error:
            raise CheckpointError(
                f"the checkpoint in {self.folder} does not fit its settings: {error}"
            ) from error
        restore_random_state(part("random"), state["random"])
        self.curve = state["curve"]
        self._seconds_before = state["seconds"]
        self._next_evaluation = state["next_evaluation"]
        self._next_checkpoint = state["next_checkpoint"]
        self._rollouts = state["rollouts"]

    def finish(self) -> None:
        """Look at the validation worlds once more, and write the last policy and checkpoint."""
        self.statistics.apply(self.model.policy)
        if not self.curve or self.curve[-1]["steps"] < self.model.num_timesteps:
            self._evaluate()
        self._write(LAST)
        self._checkpoint()
