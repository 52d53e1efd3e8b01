"""One round of play for imitation: the expert labels what either of the two visits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch

import posse
from posse import Scenario
from posse.numeric import FloatArray
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.policy import Policy, begin
from posse_training.runs.settings import TrainSettings
from posse_training.sb3.world_state import StateWriter

_EVERY: Final = 5  # every fifth control step is kept, since successive steps are similar
_SETTLED: Final = 3.0  # discounted horizons before the end from which returns are incomplete


@dataclass
class Round:
    """The data of one round, rows of all worlds and trackers."""

    inputs: FloatArray
    actions: FloatArray
    value_inputs: FloatArray
    returns: FloatArray


def play_round(
    policy: Any,
    settings: TrainSettings,
    encoding: Encoding,
    expert: Policy,
    scenario: Scenario,
    generator: np.random.Generator,
    share: float,
    worlds: int,
    first_world: int,
) -> Round:
    """Play one episode in each world; the expert acts in a share of them, the copy in the rest."""
    parts = 2 + settings.message_size
    longest = max(settings.message_size, expert.message_size)
    batch = posse.Batch(scenario.replace(message_size=longest), worlds, seed=settings.seed, first_world=first_world)
    state = _state_writer(batch, settings)
    encoder = Encoder(encoding, batch.layout)
    size = encoding.size + (state.size if state else 0)
    by_expert = generator.random(worlds) < share
    observations = batch.reset()
    memory = begin(expert, batch)
    trackers = scenario.num_trackers
    inputs, chosen, rewards = [], [], []
    for _ in range(scenario.horizon):
        x = np.empty((worlds * trackers, size), np.float32)
        encoder.encode(observations, x)
        if state:
            state.write(x[:, encoding.size :])
        wanted, memory = expert.act(observations, memory)
        actions = wanted.copy()
        if not by_expert.all():
            with torch.no_grad():
                own = policy._predict(torch.from_numpy(x), deterministic=False).numpy()
            own = own.reshape(worlds, trackers, parts)[~by_expert]
            actions[~by_expert, :, :parts] = np.clip(own, -1, 1)
            # The expert's messages are sent as well: its labels are those of a team of its own.
            sent = expert.message_size
            actions[~by_expert, :, 2 : 2 + sent] = wanted[~by_expert, :, 2 : 2 + sent]
        observations, reward, terminated, truncated, _ = batch.step(actions)
        inputs.append(x)
        chosen.append(wanted[:, :, :parts].reshape(-1, parts))
        rewards.append(reward.reshape(-1))
        if (terminated | truncated).all():
            break
    returns = _returns(rewards, settings.discount)
    complete = int(len(inputs) - _SETTLED / max(1e-3, 1 - settings.discount))
    kept = inputs[::_EVERY]
    known = max(0, -(-complete // _EVERY))
    return Round(
        np.concatenate(kept),
        np.concatenate(chosen[::_EVERY]),
        np.concatenate([*kept[:known], np.empty((0, size), np.float32)]),
        returns[::_EVERY][:known].reshape(-1),
    )


def _state_writer(batch: posse.Batch, settings: TrainSettings) -> StateWriter | None:
    """Return a writer of states of the size that the model's own worlds have; None: not needed."""
    if settings.algorithm != "mappo":
        return None
    return StateWriter(
        batch, max(s.num_trackers for s in settings.scenarios), max(s.num_obstacles for s in settings.scenarios)
    )


def _returns(rewards: list[FloatArray], discount: float) -> npt.NDArray[np.float32]:
    """Return discounted returns (steps, rows) of rewards (rows,) by step."""
    returns = np.zeros((len(rewards), len(rewards[0])), np.float32)
    ahead: npt.NDArray[np.float32] = np.zeros(len(rewards[0]), np.float32)
    for t in reversed(range(len(rewards))):
        ahead = rewards[t] + np.float32(discount) * ahead
        returns[t] = ahead
    return returns
