"""A policy with one setting whose best value is known, and tunings of seconds."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from posse.numeric import FloatArray
from posse_baselines import Memory
from posse_baselines.ddcs import DDCS
from posse_baselines.fields import tuned
from posse_training.tune import TuneSettings

BEST = 0.35


@dataclass(frozen=True)
class Bias:
    """Two settings, of which one does nothing."""

    bias: float = tuned(0.8, "", 0.0, 1.0)
    idle: float = tuned(0.5, "s", 0.1, 1.0)


class Biased(DDCS):
    """``ddcs-distributed`` with a turn command that is off unless ``bias`` is ``BEST``."""

    def __init__(self, settings: Bias | None = None) -> None:
        super().__init__(name="biased")
        self.bias = settings or Bias()
        self._settings, self.settings = self.settings, self.bias  # type: ignore[assignment]

    def settings_for(self, scenario: Any) -> Any:
        return self._settings

    def with_settings(self, **values: Any) -> "Biased":
        return Biased(dataclasses.replace(self.bias, **values))

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        actions, memory = super().act(observations, memory)
        actions[..., 1] = np.clip(actions[..., 1] + 2.0 * (self.bias.bias - BEST), -1.0, 1.0)
        return actions, memory


POLICY = "tests.support.tunable:Biased"


def small(out: Path, **changes: Any) -> TuneSettings:
    """Settings of a tuning that takes a second."""
    values: dict[str, Any] = {
        "policy": POLICY,
        "scenario": "paper-distributed",
        "seed": 3,
        "out": out,
        "generations": 5,
        "population": 6,
        "worlds": 4,
        "validation_worlds": 6,
        "every": 2,
    }
    return TuneSettings(**(values | changes))
