"""One run of a value-based algorithm of BenchMARL, for the comparison of algorithms.

    .venv-recipes/bin/python benchmarks/algorithms_benchmarl.py qmix smart --out result.json

Actions are the discrete ones, inputs and rewards those of the other algorithms. An interrupted run
begins anew. Called by benchmarks/algorithms.py; BenchMARL needs the environment of `make recipes`.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import torch
import tyro
from benchmarl.algorithms import QmixConfig, VdnConfig
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from tensordict import TensorDict, TensorDictBase
from torch import nn
from torchrl.data import Unbounded
from torchrl.envs import ObservationTransform, TransformedEnv

from posse import ObservationLayout, get_scenario
from posse.adapters.actions import MOTIONS
from posse.numeric import FloatArray
from posse_baselines.learned.encoder import Encoder
from posse_baselines.learned.encoding import Encoding
from posse_baselines.policy import BasePolicy, Memory
from posse_training.benchmarl.task import PosseTaskClass
from posse_training.provenance import commit
from posse_training.reports.evaluation import evaluate
from posse_training.reports.statistics import Estimate, mean
from posse_training.runs.defaults import default_settings
from posse_training.runs.validation import VALIDATION_SEED
from posse_training.torchrl.env import TRACKERS

ALGORITHMS: Final = {"qmix": QmixConfig, "vdn": VdnConfig}
ITERATIONS: Final = 200
EVALUATIONS: Final = 20
TEST_SEED: Final = 7
_OBSERVATION: Final = (TRACKERS, "observation")


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    algorithm: Annotated[str, tyro.conf.Positional]
    scenario: Annotated[str, tyro.conf.Positional]
    out: Path
    """File of the result."""
    seed: int = 1
    steps: int = 1_000_000
    """Steps of training; a step is one control step of one tracker."""
    worlds: int = 500
    """Worlds of the split ``test`` that the last policy plays."""


class Encode(ObservationTransform):
    """Observations as the inputs that the other algorithms' networks read."""

    def __init__(self, encoder: Encoder) -> None:
        super().__init__(in_keys=[_OBSERVATION], out_keys=[_OBSERVATION])
        self.encoder = encoder

    def _apply_transform(self, obs: torch.Tensor) -> torch.Tensor:
        rows = self.encoder.encode(obs.numpy())
        return torch.from_numpy(rows).reshape(*obs.shape[:-1], -1)

    def _reset(self, tensordict: TensorDictBase, reset: TensorDictBase) -> TensorDictBase:
        return self._call(reset)

    def transform_observation_spec(self, observation_spec: Any) -> Any:
        """Return the spec of what it puts out."""
        size = self.encoder.encoding.size
        spec = observation_spec[_OBSERVATION]
        observation_spec[_OBSERVATION] = Unbounded((*spec.shape[:-1], size), dtype=torch.float32)
        return observation_spec


class EncodedTask(PosseTaskClass):
    """A task of posse with encoded observations."""

    def get_env_fun(self, *arguments: Any, **named: Any) -> Callable[[], TransformedEnv]:
        """Return a function that makes the worlds."""
        plain = super().get_env_fun(*arguments, **named)

        def make() -> TransformedEnv:
            env = plain()
            layout = env.batch.layout
            return TransformedEnv(env, Encode(Encoder(Encoding.of(layout, "slots"), layout)))

        return make


class Greedy(BasePolicy):
    """The actions of greatest value."""

    def __init__(self, name: str, values: nn.Module) -> None:
        self.name, self.values = name, values

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the encoder, which is all that it keeps."""
        return Encoder(Encoding.of(layout, "slots"), layout)

    @torch.no_grad()
    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions (E, N, 2) for observations (E, N, F), and the memory."""
        worlds, trackers = observations.shape[:2]
        rows = torch.from_numpy(memory.encode(observations)).reshape(worlds, trackers, -1)
        group = TensorDict({"observation": rows}, batch_size=(worlds, trackers))
        found = self.values(TensorDict({TRACKERS: group}, batch_size=(worlds,)))
        return MOTIONS[found[TRACKERS, "action_value"].argmax(-1).numpy()], memory


class Curve(Callback):
    """Plays validation worlds at equal intervals of the training."""

    def __init__(self, settings: Settings, every: int) -> None:
        super().__init__()
        self.settings, self.every = settings, every
        self.points: list[dict[str, float]] = []
        self.started = time.perf_counter()

    def policy(self) -> Greedy:
        """Return the present policy without its exploration."""
        return Greedy(self.settings.algorithm, self.experiment.group_policies[TRACKERS][0])

    def on_batch_collected(self, batch: TensorDictBase) -> None:
        """Evaluate the policy that collected, if it is time."""
        if self.experiment.n_iters_performed % self.every == 0:
            self.add()

    def add(self) -> None:
        """Add a point of the curve."""
        scenario, done = self.settings.scenario, self.experiment.n_iters_performed
        frames = done * self.experiment.config.off_policy_collected_frames_per_batch
        results = evaluate(
            self.policy(),
            scenario,
            default_settings(own=False).evaluate_worlds,
            VALIDATION_SEED,
            split="validation",
            progress=False,
        )
        safe: Estimate = mean(results["safe_score"])
        self.points.append(
            {
                "steps": frames * get_scenario(scenario).num_trackers,
                "seconds": time.perf_counter() - self.started,
                "safe_score": safe.value,
                "low": safe.low,
                "high": safe.high,
                "score": float(results["score"].mean()),
                "contact_free": float(results["contact_free"].mean()),
            }
        )


def main() -> None:
    """Train, evaluate, and write the result."""
    s = tyro.cli(Settings, description=__doc__)
    scenario, learning = get_scenario(s.scenario), default_settings(s.scenario, "td3", own=False)
    task = EncodedTask(
        name=s.scenario.upper().replace("-", "_"),
        config={"scenario": s.scenario, "split": "train", "reward_weights": learning.reward_weights},
    )
    frames = s.steps // scenario.num_trackers
    config = ExperimentConfig.get_from_yaml()
    config.lr = learning.learning_rate
    config.max_n_frames, config.off_policy_collected_frames_per_batch = frames, frames // ITERATIONS
    config.off_policy_n_envs_per_worker = 50
    config.off_policy_n_optimizer_steps = 125  # as many gradients as td3's
    config.evaluation, config.loggers, config.create_json = False, [], False
    config.save_folder = str(s.out.parent)
    curve = Curve(s, ITERATIONS // EVALUATIONS)
    network = MlpConfig(num_cells=list(learning.hidden), activation_class=nn.ReLU, layer_class=nn.Linear)
    experiment = Experiment(
        task, ALGORITHMS[s.algorithm].get_from_yaml(), network, seed=s.seed, config=config, callbacks=[curve]
    )
    experiment.run()
    curve.add()
    results = evaluate(curve.policy(), scenario, s.worlds, TEST_SEED, split="test", progress=False)
    result = {
        "algorithm": s.algorithm,
        "scenario": s.scenario,
        "version": scenario.version,
        "seed": s.seed,
        "steps": frames * scenario.num_trackers,
        "commit": commit(),
        "curve": curve.points,
        "test": {
            "seed": TEST_SEED,
            "worlds": s.worlds,
            "safe_score": mean(results["safe_score"]).to_dict(),
            "score": float(results["score"].mean()),
            "contact_free": float(results["contact_free"].mean()),
        },
    }
    s.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
