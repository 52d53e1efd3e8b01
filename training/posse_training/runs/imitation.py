"""A warm start: the policy begins as a copy of another one.

Dataset aggregation (Ross, Gordon and Bagnell, 2011): in the first round the expert acts and is
copied; in later rounds the copy acts in more and more of the worlds, labelled with the expert's
actions. The copy is thus right in the states that *it* visits. At the end the value function is
fitted to the copy's returns; otherwise the first updates would undo the copy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from posse_baselines.learned import Encoding
from posse_baselines.policy import Policy
from posse_training.runs.expert_play import play_round
from posse_training.runs.settings import TrainSettings
from posse_training.sb3.normalisation import RunningStatistics

WORLDS: Final = 64
"""Worlds played in a round, over all scenarios."""
FIRST_WORLD: Final = 1_000_000
"""Index of the first of them, beyond the worlds that training begins with."""
_GRADIENTS: Final = 300  # in each round, at least
_MINIBATCH: Final = 4096
_LEARNING_RATE: Final = 1e-3


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
            play_round(
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
