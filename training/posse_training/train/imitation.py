"""A warm start: the policy begins as a copy of another one.

Dataset aggregation (Ross, Gordon and Bagnell, 2011): in the first round the expert acts and is copied; in later rounds
the copy acts in more and more of the worlds, labelled with the expert's actions; behind the safeguard, with the
velocities that the expert wants. The copy is thus right in the states that *it* visits. At the end the value function
is fitted to the copy's returns; otherwise the first updates would undo the copy.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch.nn.functional import mse_loss

from posse import Batch, Scenario
from posse.numeric import FloatArray
from posse.scenarios.family import BLOCK, blocks
from posse_baselines import batch_for
from posse_baselines.learned import Encoding
from posse_baselines.policy import Policy, begin
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.networks import RunningStatistics
from posse_training.train.settings import TrainSettings
from posse_training.train.vec_env import SlotGroup
from posse_training.train.worlds import pairings

WORLDS: Final = 64
"""Worlds played in a round, over all scenarios."""
FIRST_WORLD: Final = 1_000_000
"""Index of the first of them, beyond the worlds that training begins with."""
_GRADIENTS: Final = 300  # in each round, at least
_MINIBATCH: Final = 4096
_LEARNING_RATE: Final = 1e-3
_EVERY: Final = 5  # every fifth control step is kept, since successive steps are similar
_SETTLED: Final = 3.0  # discounted horizons before the end from which returns are incomplete; at most half an episode

Rows = tuple[FloatArray, FloatArray, FloatArray]
"""Inputs, the expert's actions, and returns (NaN where incomplete): a row for each world, tracker and kept step."""


def imitate(
    model: BaseAlgorithm,
    settings: TrainSettings,
    encoding: Encoding,
    expert: Policy,
    statistics: RunningStatistics,
    report: Callable[[str], object],
) -> None:
    """Make a PPO model's policy a copy of the expert, against the targets of the training.

    The model's networks and normaliser are changed, its optimiser is not; the first round is added to the input
    statistics. ``report`` is called after each round with a line that says how far it is, and the mean squared error.
    """
    policy: Any = model.policy
    generator = np.random.default_rng(settings.seed)
    optimiser = torch.optim.Adam(policy.parameters(), lr=_LEARNING_RATE)

    def fit(predict: Callable[[torch.Tensor], torch.Tensor], inputs: torch.Tensor, targets: torch.Tensor) -> float:
        """Pass over the rows in random order until there were enough gradients; return the last pass's mean error."""
        rows = len(inputs)
        for _ in range(-(-_GRADIENTS // -(-rows // _MINIBATCH))):
            total = 0.0
            for chosen in torch.split(torch.from_numpy(generator.permutation(rows)), _MINIBATCH):
                error = mse_loss(predict(inputs[chosen]), targets[chosen])
                optimiser.zero_grad()
                error.backward()  # type: ignore[no-untyped-call]
                torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
                optimiser.step()
                total += error.item() * len(chosen)
        return total / rows

    drawn, pairs = settings.family_scenarios, pairings(settings)
    parts = [(blocks(pair.scenario, range(drawn * BLOCK), settings.seed, "train"), pair.opponent) for pair in pairs]
    plays: list[tuple[Scenario, Any]] = [(scenario, target) for part, target in parts for scenario, _ in part]
    worlds = max(1, WORLDS // len(plays))
    seen = [scenario for scenario, _ in plays] if ALGORITHMS[settings.algorithm].reads_state else []
    first_world = FIRST_WORLD
    rounds = settings.imitate_rounds
    every: list[Rows] = []
    for k in range(rounds):
        played: list[Rows] = []
        for scenario, target in plays:
            by_expert = generator.random(worlds) < 1.0 - k / max(1, rounds - 1)
            batch = batch_for(expert, scenario, worlds, target, seed=settings.seed, first_world=first_world)
            slots = SlotGroup(batch, encoding, seen, settings.safeguard)
            played.append(_play_round(policy, settings, slots, expert, batch, by_expert))
            first_world += worlds
        every += played
        if k == 0:
            for rows, *_ in played:
                statistics.add(rows)
            statistics.apply(policy)
        inputs, actions, _ = _together(every)
        error = fit(lambda x: policy.get_distribution(x).distribution.mean, inputs, actions)
        report(f"copying {settings.imitate}: {k + 1} of {rounds} rounds, squared error {error:.4f}")
    inputs, _, returns = _together(played)
    known = ~returns.isnan()
    fit(lambda x: policy.predict_values(x).flatten(), inputs[known], returns[known])


def _together(parts: list[Rows]) -> tuple[torch.Tensor, ...]:
    return tuple(torch.from_numpy(np.concatenate(column)) for column in zip(*parts, strict=True))


def _play_round(
    policy: Any, settings: TrainSettings, slots: SlotGroup, expert: Any, batch: Batch, by_expert: Any
) -> Rows:
    """Play one episode in each world; the expert acts where ``by_expert`` (E,) says so, the copy in the rest."""
    parts, trackers = 2 + settings.message_size, batch.scenario.num_trackers
    observations = batch.reset()
    memory = begin(expert, batch)
    inputs, chosen, rewards, goes_on = [], [], [], []
    for _ in range(batch.scenario.horizon):
        x = slots.encode(observations)
        if slots.guard is None:
            wanted, memory = expert.act(observations, memory)
            actions = wanted.copy()
        else:  # copied is what it wants, before its own safeguard
            velocities, memory = expert.propose(observations, memory)
            actions, memory = expert.carry_out(observations, memory, np.zeros_like(velocities))
            wanted = np.concatenate([velocities, actions[..., 2:]], axis=2)
        chosen.append(wanted[:, :, :parts].reshape(-1, parts))
        own = wanted
        if not by_expert.all():
            with torch.no_grad():
                own = policy._predict(torch.from_numpy(x), deterministic=False).numpy()
            own = np.clip(own, -1, 1).reshape(-1, trackers, parts)
        if slots.guard is not None:  # the inputs read its memory, from the first round on
            own = slots.guard.actions(observations, own)
        # The messages are the expert's: its labels are those of a team of its own.
        actions[~by_expert, :, :2] = own[~by_expert, :, :2]
        observations, reward, terminated, truncated, _ = batch.step(actions)
        inputs.append(x)
        rewards.append(reward.reshape(-1))
        touching = settings.end_on_contact & batch.arrays.tracker["touching"].any(axis=1)
        over = terminated | truncated
        goes_on.append(np.repeat(~(touching | over), trackers))
        if over.all():
            break
        if over.any():
            observations = batch.reset(options={"reset_mask": over})
            memory = expert.restart(memory, over)
            slots.restart(over)
    returns = np.array(rewards, np.float32)  # (steps, rows), discounted
    for t in reversed(range(len(rewards) - 1)):
        returns[t] += np.float32(settings.discount) * returns[t + 1] * goes_on[t]
    settled = len(inputs) - min(_SETTLED / max(1e-3, 1 - settings.discount), len(inputs) / 2)
    returns[max(1, int(settled)) :] = np.nan
    return np.concatenate(inputs[::_EVERY]), np.concatenate(chosen[::_EVERY]), returns[::_EVERY].reshape(-1)
