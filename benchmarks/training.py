"""``make bench-training``: throughput of PPO on ``smart``, and how long it takes to beat the tuned script."""

import csv
import tempfile
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import tyro
from rich.console import Console

from posse_baselines import load
from posse_training.train.presets import default_settings
from posse_training.train.settings import TrainSettings
from posse_training.train.train import train
from posse_training.train.validation import validate


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    steps: int = 1_000_000
    """Agent-steps of plain PPO to measure the throughput of."""
    threads: int = 1
    """Threads of torch; the default of ``posse train`` is 1."""
    beat_steps: int = 20_000_000
    """Agent-steps of a training with the default settings, to beat the tuned script; 0: none."""
    seed: int = 1
    """Training seed of that."""


def curve_of(settings: TrainSettings) -> list[dict[str, float]]:
    """Train, and return the learning curve."""
    with tempfile.TemporaryDirectory() as folder:
        run = replace(settings, folder=Path(folder, "run"), beside=None, tensorboard=False)
        train(run, console=Console(file=StringIO()))
        with Path(folder, "run", "curve.csv").open(newline="", encoding="utf-8") as lines:
            return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(lines)]


def time_to_beat(settings: TrainSettings) -> str:
    """Say when the whole interval of the safe score was above the tuned script's, on the same validation worlds."""
    wanted = validate(settings, load("ddcs-tuned"))["safe_score"]
    curve = curve_of(settings)
    for point in curve:
        if point["low"] > wanted:
            return (
                f"above ddcs-tuned ({wanted:.3f}) after {point['seconds']:.0f} s and {point['steps']:,.0f} steps: "
                f"safe score {point['safe_score']:.3f} [{point['low']:.3f}, {point['high']:.3f}]"
            )
    return f"not above ddcs-tuned ({wanted:.3f}) within {curve[-1]['seconds']:.0f} s"


def main() -> None:
    """Train, and print."""
    s = tyro.cli(Settings, description=__doc__)
    plain = TrainSettings(scenario="smart", algorithm="ppo", steps=s.steps, threads=s.threads, evaluate_every=s.steps)
    last = curve_of(replace(plain, evaluate_worlds=1))[-1]
    print(f"PPO on smart: {last['steps'] / last['seconds']:,.0f} agent-steps/s, {s.threads} threads")
    if s.beat_steps:
        run = replace(default_settings("smart"), steps=s.beat_steps, evaluate_every=s.beat_steps // 10, seed=s.seed)
        print(time_to_beat(replace(run, threads=s.threads)))


if __name__ == "__main__":
    main()
