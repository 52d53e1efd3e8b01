"""``posse train``: from settings to a trained policy, in the order it runs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch
from rich.console import Console

from posse_baselines import PolicyError, load
from posse_training.errors import DivergedError
from posse_training.runs.callback import TrainingCallback
from posse_training.runs.display import Display
from posse_training.runs.imitation import imitate
from posse_training.runs.logs import check_wandb, make_logger
from posse_training.runs.models import make_adviser, make_env, make_model
from posse_training.runs.saved.checkpoint import read_checkpoint
from posse_training.runs.saved.folder import BEST, LAST, SETTINGS, locked_run, open_run
from posse_training.runs.settings import TrainSettings, read_settings
from posse_training.runs.sides import check_opponents, load_own
from posse_training.runs.start import start_from
from posse_training.runs.validation import first_statistics, score_beside
from posse_training.sb3.normalisation import RunningStatistics

_NOT_FINITE = (
    "found invalid values",
    "= nan is not a number",
    "must be finite",
    "can overflow",
    "means must lie within",
)


def train(
    settings: TrainSettings, *, console: Console | None = None, resume: bool = False, num_threads: int | None = None
) -> Path:
    """Train a policy; return the file of the one that scored best on the validation worlds.

    Args:
        settings: All that the result depends on.
        console: Where to show progress.
        resume: Continue from the run folder's checkpoint.
        num_threads: Threads that step the worlds; default: one per core. Never changes the result.

    Raises:
        SettingsError: A package that is not installed.
        PolicyError: An unknown policy, or one that cannot be an adviser.
        RunFolderError: The folder is in use, or already holds a run.
        CheckpointError: A checkpoint cannot be written or read.
        DivergedError: The networks give numbers that are not finite.
    """
    check_before(settings)
    folder = settings.run_folder
    with locked_run(folder), torch_threads(settings.threads), Display(settings, console or Console()) as display:
        saved = open_run(folder, settings, resume)
        env = make_env(settings, num_threads)
        model = make_model(settings, env)
        model.set_logger(make_logger(folder, settings))
        steps = steps_made(settings, env.num_envs)
        if steps != settings.steps:
            display.note(f"rollouts are completed: {steps:,} steps in all")
        statistics = RunningStatistics(env.observation_size)
        display.beside(score_beside(settings, display))
        callback = TrainingCallback(settings, folder, env, model, statistics, display)
        if saved is not None:
            callback.restore(*saved)
        else:
            if settings.start is None:
                first_statistics(settings, env, statistics)
            else:
                start_from(Path(settings.start), model, statistics, settings.log_deviation)
            statistics.apply(model.policy)
            if settings.imitate is not None:
                expert = load(settings.imitate)
                imitate(model, settings, env.encoding, expert, statistics, display.copied)
        display.begin(model.num_timesteps, steps)
        with _divergence(callback):
            model.learn(settings.steps - model.num_timesteps, callback=callback, reset_num_timesteps=saved is None)
            callback.finish()
    return folder / (BEST if (folder / BEST).is_file() else LAST)


def resume(folder: Path, *, console: Console | None = None, steps: int | None = None, trust_code: bool = False) -> Path:
    """Resume the training of a run folder; see :func:`train`.

    Args:
        folder: The run folder.
        console: Where to show progress.
        steps: Total steps to train for, instead of those that the run was started with.
        trust_code: Import policies that the folder's settings name as ``package.module:Class``.

    Raises:
        SettingsError: Not a run folder, or its settings are damaged or name code to import.
        RunFolderError: It is in use.
        CheckpointError: Its checkpoint is damaged.
    """
    settings = read_settings(folder / SETTINGS, trust_code=trust_code)
    settings = replace(settings, folder=folder)
    if steps is not None:
        settings = replace(settings, steps=steps)
    return train(settings, console=console, resume=True)


def check_before(settings: TrainSettings) -> None:
    """Raise what can be known to be wrong before the run folder is made."""
    check_wandb(settings)
    make_adviser(settings)
    check_opponents(settings)
    for policy in (settings.imitate, settings.beside):
        if policy is not None:
            load_own(settings, policy)
    if settings.start is not None:
        read_checkpoint(Path(settings.start))


def steps_made(settings: TrainSettings, num_envs: int) -> int:
    """Return the steps that a run makes: whole rollouts, or whole steps of all worlds."""
    at_once = num_envs * (settings.rollout if settings.on_policy else 1)
    return -(-settings.steps // at_once) * at_once


@contextlib.contextmanager
def _divergence(callback: TrainingCallback) -> Iterator[None]:
    """Name what torch's distributions, and policies that are exported, refuse."""
    try:
        yield
    except (ValueError, PolicyError) as error:
        if not any(text in str(error) for text in _NOT_FINITE):
            raise
        raise DivergedError(callback.divergence()) from error


@contextlib.contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Set torch's number of threads in a block."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
