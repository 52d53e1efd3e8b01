"""A warm start: the policy begins as a copy of another one.

Dataset aggregation (Ross, Gordon and Bagnell, 2011): in the first round the expert acts and is
copied; in later rounds the copy acts in more and more of the worlds, labelled with the expert's
actions. The copy is thus right in the states that *it* visits. At the end the value function is
fitted to the copy's returns; otherwise the first updates would undo the copy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

import posse
from posse import Scenario
from posse.numeric import FloatArray
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.policy import Policy, begin
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.networks import RunningStatistics
from posse_training.train.settings import TrainSettings
from posse_training.train.world_state import StateWriter

WORLDS: Final = 64
"""Worlds played in a round, over all scenarios."""
FIRST_WORLD: Final = 1_000_000
"""Index of the first of them, beyond the worlds that training begins with."""
_GRADIENTS: Final = 300  # in each round, at least
_MINIBATCH: Final = 4096
_LEARNING_RATE: Final = 1e-3
_EVERY: Final = 5  # every fifth control step is kept, since successive steps are similar
_SETTLED: Final = 3.0  # discounted horizons before the end from which returns are incomplete


def imitate(
    model: BaseAlgorithm,
    settings: TrainSettings,
    encoding: Encoding,
    expert: Policy,
    statistics: RunningStatistics,
    report: Callable[[int, int, float], object] = lambda done, rounds, error: None,
) -> None:
    """Make a PPO model's policy a copy of the expert.

    Args:
        model: A stable-baselines3 model; its networks and normaliser are changed, its optimiser is
            not.
        settings: Of the training.
        encoding: Which inputs the model reads from an observation.
        expert: The policy to copy.
        statistics: Input statistics; those of the first round are added.
        report: Called after each round with its number, the number of rounds and the mean squared
            error.
    """
    policy: Any = model.policy
    generator = np.random.default_rng(settings.seed)
    optimiser = torch.optim.Adam(policy.parameters(), lr=_LEARNING_RATE)
    rounds = []
    total = settings.imitate_rounds
    for k in range(total):
        share = 1.0 - k / max(1, total - 1)
        scenarios = settings.scenarios
        worlds = max(1, WORLDS // len(scenarios))
        played = [
            _play_round(
                policy,
                settings,
                encoding,
                expert,
                scenario,
                generator,
                share,
                worlds,
                FIRST_WORLD + (k * len(scenarios) + s) * worlds,
            )
            for s, scenario in enumerate(scenarios)
        ]
        rounds += played
        if k == 0:
            for part in played:
                statistics.add(part.inputs)
            statistics.apply(policy)
        inputs = torch.from_numpy(np.concatenate([r.inputs for r in rounds]))
        actions = torch.from_numpy(np.concatenate([r.actions for r in rounds]))
        error = 0.0
        for _ in range(_passes(len(inputs))):
            error = _fit(policy, optimiser, generator, inputs, actions, _action_error)
        report(k + 1, total, error)
    inputs = torch.from_numpy(np.concatenate([r.value_inputs for r in played]))
    returns = torch.from_numpy(np.concatenate([r.returns for r in played]))
    if len(inputs):
        for _ in range(_passes(len(inputs))):
            _fit(policy, optimiser, generator, inputs, returns, _value_error)


def _passes(rows: int) -> int:
    """Return the number of passes over a round's data."""
    return -(-_GRADIENTS // -(-rows // _MINIBATCH))


def _fit(
    policy: Any,
    optimiser: torch.optim.Optimizer,
    generator: np.random.Generator,
    inputs: torch.Tensor,
    targets: torch.Tensor,
    error_of: Callable[[Any, torch.Tensor, torch.Tensor], torch.Tensor],
) -> float:
    """Make one pass over the data in random order; return the mean error."""
    order = torch.from_numpy(generator.permutation(len(inputs)))
    total = 0.0
    for rows in torch.split(order, _MINIBATCH):
        error = error_of(policy, inputs[rows], targets[rows])
        optimiser.zero_grad()
        error.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimiser.step()
        total += error.item() * len(rows)
    return total / len(inputs)


def _action_error(policy: Any, inputs: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
    mean = policy.get_distribution(inputs).distribution.mean
    return torch.nn.functional.mse_loss(mean, actions)


def _value_error(policy: Any, inputs: torch.Tensor, returns: torch.Tensor) -> torch.Tensor:
    return torch.nn.functional.mse_loss(policy.predict_values(inputs).flatten(), returns)


@dataclass
class _Round:
    """The data of one round, rows of all worlds and trackers."""

    inputs: FloatArray
    actions: FloatArray
    value_inputs: FloatArray
    returns: FloatArray


def _play_round(
    policy: Any,
    settings: TrainSettings,
    encoding: Encoding,
    expert: Policy,
    scenario: Scenario,
    generator: np.random.Generator,
    share: float,
    worlds: int,
    first_world: int,
) -> _Round:
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
    return _Round(
        np.concatenate(kept),
        np.concatenate(chosen[::_EVERY]),
        np.concatenate([*kept[:known], np.empty((0, size), np.float32)]),
        returns[::_EVERY][:known].reshape(-1),
    )


def _state_writer(batch: posse.Batch, settings: TrainSettings) -> StateWriter | None:
    """Return a writer of states of the size that the model's own worlds have; None: not needed."""
    if not ALGORITHMS[settings.algorithm].reads_state:
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
