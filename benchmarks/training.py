"""``make bench-training``: throughput of PPO training on ``smart``, and its time shares.

And how long, from nothing, until the safe score is above that of the tuned script.
"""

from __future__ import annotations

import csv
import functools
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

import machine
import tyro
from rich.console import Console
from rich.table import Table
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy

from posse_baselines import load
from posse_training.runs.defaults import default_settings
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import train
from posse_training.runs.validation import validate
from posse_training.sb3.vec_env import TeamVecEnv


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    steps: int = 1_000_000
    """Agent-steps to train for."""
    threads: int = 1
    """Threads of torch; the default of ``posse train`` is 1."""
    beat_steps: int = 2_000_000
    """Agent-steps of a training with the default settings, to beat the tuned script; 0: none."""
    seed: int = 1
    """Training seed of that."""


PARTS: dict[str, tuple[type, str]] = {
    "torch: updates": (PPO, "train"),
    "torch: actions and values": (ActorCriticPolicy, "forward"),
    "worlds and their encoding": (TeamVecEnv, "step_wait"),
}


@contextmanager
def timed(seconds: dict[str, float]) -> Iterator[None]:
    """Accumulate the time of each part."""

    def wrap(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def call(*arguments: Any, **settings: Any) -> Any:
            started = time.perf_counter()
            try:
                return function(*arguments, **settings)
            finally:
                seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - started

        return call

    before = {name: getattr(owner, method) for name, (owner, method) in PARTS.items()}
    for name, (owner, method) in PARTS.items():
        setattr(owner, method, wrap(name, before[name]))
    try:
        yield
    finally:
        for name, (owner, method) in PARTS.items():
            setattr(owner, method, before[name])


def time_to_beat(steps: int, seed: int, threads: int) -> str:
    """Train with the default settings; say when the safe score was above the tuned script's.

    By the whole of its 95 % interval, on the 128 validation worlds of the training.
    """
    with tempfile.TemporaryDirectory() as folder:
        settings = replace(
            default_settings("smart"),
            steps=steps,
            seed=seed,
            threads=threads,
            beside=None,
            folder=Path(folder, "run"),
            evaluate_every=steps // 10,
            tensorboard=False,
        )
        wanted = validate(settings, load("ddcs-tuned"))["safe_score"]
        train(settings, console=Console(file=StringIO()))
        with Path(folder, "run", "curve.csv").open(newline="") as lines:
            curve = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(lines)]
    for point in curve:
        if point["low"] > wanted:
            return (
                f"above ddcs-tuned ({wanted:.3f}) after {point['seconds']:.0f} s and "
                f"{point['steps']:,.0f} steps: safe score {point['safe_score']:.3f} "
                f"[{point['low']:.3f}, {point['high']:.3f}]"
            )
    return f"not above ddcs-tuned ({wanted:.3f}) within {curve[-1]['seconds']:.0f} s"


def main() -> None:
    """Train, and print throughput and time shares."""
    s = tyro.cli(Settings)
    others, own = machine.OtherWork(), time.process_time()
    seconds: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder, timed(seconds):
        settings = TrainSettings(
            scenario="smart",
            algorithm="ppo",
            steps=s.steps,
            threads=s.threads,
            beside=None,
            folder=Path(folder, "run"),
            evaluate_every=10 * s.steps,
            tensorboard=False,
            checkpoint_every=10 * s.steps,
            evaluate_worlds=1,
        )
        learn = PPO.learn
        whole: list[float] = []

        def learn_timed(*arguments: Any, **options: Any) -> Any:
            started = time.perf_counter()
            result = learn(*arguments, **options)
            whole.append(time.perf_counter() - started)
            return result

        PPO.learn = learn_timed  # type: ignore[method-assign]
        try:
            train(settings, console=Console(file=StringIO()))
        finally:
            PPO.learn = learn  # type: ignore[method-assign]
    total = whole[0]
    table = Table(title=f"PPO on smart: {s.steps / total:,.0f} agent-steps/s, {s.threads} threads")
    table.add_column("part")
    table.add_column("share", justify="right")
    for name, part in seconds.items():
        table.add_row(name, f"{100 * part / total:.1f} %")
    rest = total - sum(seconds.values())
    table.add_row("stable-baselines3's rollout and buffer", f"{100 * rest / total:.1f} %")
    console = Console()
    console.print(table)
    busy = others.cores(time.process_time() - own)
    console.print(f"cores used by other processes meanwhile: {busy:.2f}")
    if s.beat_steps:
        console.print(time_to_beat(s.beat_steps, s.seed, s.threads))


if __name__ == "__main__":
    main()
