"""``make algorithms``: what algorithms reach from nothing, with the same budget and inputs.

Writes a row of benchmarks/algorithms.csv for each run. Runs with a row are skipped and interrupted ones resume.

    python benchmarks/algorithms.py --algorithm ppo sac --scenario smart --seed 1

Those of other libraries, ``recurrent-ppo`` of sb3-contrib and ``qmix`` of BenchMARL, need the environment that
``make recipes`` makes: ``.venv-recipes/bin/python benchmarks/algorithms.py --algorithm qmix --safeguard False``.
"""

import csv
import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import tyro
from rich.console import Console

import posse
from posse.numeric import FloatArray
from posse_baselines import Policy, from_function, load
from posse_training.evaluation.evaluation import evaluate
from posse_training.evaluation.statistics import mean
from posse_training.provenance import commit
from posse_training.train.presets import default_settings
from posse_training.train.settings import LAST, TrainSettings
from posse_training.train.train import train
from posse_training.train.worlds import make_env

TABLE: Final = Path(__file__).parent / "algorithms.csv"
ALGORITHMS: Final = ("ppo", "mappo", "sac", "td3")
NAMES: Final = ("algorithm", "safeguard", "scenario", "training_seed")
OFF_POLICY: Final = ("sac", "td3", "qmix")
WIDTHS: Final = (128, 128)
TEST_SEED: Final = 7


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    algorithm: tuple[str, ...] = ALGORITHMS
    safeguard: tuple[bool, ...] = (True, False)
    """Behind the safeguard, and without it."""
    scenario: tuple[str, ...] = ("smart", "radio", "field")
    seed: tuple[int, ...] = (1, 2, 3)
    steps: int = 20_000_000
    """Steps of training; a step is one control step of one tracker."""
    off_policy_steps: int = 1_000_000
    """The same for sac, td3 and qmix, whose steps take longer."""
    worlds: int = 500
    """Worlds of the split ``test`` that the last policy plays."""
    out: Path = Path("runs/algorithms")


def settings_of(s: Settings, algorithm: str, safeguard: bool, scenario: str, seed: int) -> TrainSettings:
    """Return the settings of one run."""
    steps = s.off_policy_steps if algorithm in OFF_POLICY else s.steps
    folder = s.out / f"{algorithm}-{'safe' if safeguard else 'bare'}-{scenario}-{seed}"
    base = default_settings(scenario, "ppo" if algorithm in ("qmix", "recurrent-ppo") else algorithm, preset="nothing")
    run: dict[str, Any] = {"seed": seed, "steps": steps, "evaluate_every": steps // 20, "folder": folder}
    return replace(base, **run, hidden=WIDTHS, safeguard=safeguard)


def trained(algorithm: str, run: TrainSettings) -> Policy:
    """Train; return the last policy."""
    if algorithm == "qmix":
        return qmix(run)
    if algorithm == "recurrent-ppo":
        return recurrent_ppo(run)
    train(run, console=Console())
    return load(str(run.run_folder / LAST))


def recurrent_ppo(run: TrainSettings) -> Policy:
    """Train an LSTM of sb3-contrib in the worlds of ``ppo`` and with its settings, at a constant learning rate."""
    from sb3_contrib import RecurrentPPO

    from posse_training.sb3 import from_sb3

    env = make_env(run)
    network = {"net_arch": list(run.hidden), "lstm_hidden_size": run.hidden[0], "log_std_init": run.log_deviation}
    how: dict[str, Any] = {"n_steps": run.rollout, "batch_size": run.minibatch, "n_epochs": run.epochs}
    how |= {"policy_kwargs": network, "seed": run.seed, "device": "cpu"}
    model = RecurrentPPO("MlpLstmPolicy", env, run.learning_rate, **how).learn(run.steps)
    return from_sb3(model, encoding=env.encoding, safeguard=run.safeguard)


def qmix(run: TrainSettings) -> Policy:
    """Train QMIX with BenchMARL's defaults: it reads plain observations and chooses among discrete motions."""
    import torch
    from benchmarl.algorithms import QmixConfig
    from benchmarl.experiment import Experiment, ExperimentConfig
    from benchmarl.models.mlp import MlpConfig
    from tensordict import TensorDict
    from torchrl.envs.utils import ExplorationType, set_exploration_type

    from posse_training.benchmarl import PosseTask

    config = ExperimentConfig.get_from_yaml()
    config.max_n_frames = run.steps // posse.get_scenario(run.scenario).num_trackers
    config.evaluation, config.loggers = False, []
    task, models = getattr(PosseTask, run.scenario.upper()).get_from_yaml(), MlpConfig.get_from_yaml()
    experiment = Experiment(task, QmixConfig.get_from_yaml(), models, seed=run.seed, config=config)
    experiment.run()

    def best_motions(observations: FloatArray) -> FloatArray:
        data = TensorDict({"agents": {"observation": torch.from_numpy(observations)}}, len(observations))
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            return np.asarray(experiment.policy(data)["agents", "action"])

    return from_function(best_motions, name="qmix", discrete_actions=True)


def main() -> None:
    """Train what has no row yet."""
    s = tyro.cli(Settings, description=__doc__)
    with TABLE.open(newline="", encoding="utf-8") as file:
        done = {tuple(row[name] for name in NAMES) for row in csv.DictReader(file)}
    for seed, scenario, safeguard, algorithm in itertools.product(s.seed, s.scenario, s.safeguard, s.algorithm):
        if (algorithm, str(safeguard), scenario, str(seed)) in done or (algorithm == "qmix" and safeguard):
            continue  # no safeguard carries out its motions
        run = settings_of(s, algorithm, safeguard, scenario, seed)
        results = evaluate(trained(algorithm, run), scenario, s.worlds, TEST_SEED, split="test", progress=False)
        safe = mean(results["safe_score"])
        numbers = (safe.value, safe.low, safe.high, results["score"].mean(), results["contact_free"].mean())
        values = (
            *(algorithm, safeguard, scenario, results.scenario.version, seed, run.steps, s.worlds, TEST_SEED),
            *(f"{number:.6f}" for number in numbers),
            commit(),
        )
        with TABLE.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerow(values)


if __name__ == "__main__":
    main()
