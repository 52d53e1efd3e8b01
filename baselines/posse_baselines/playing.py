"""Play a policy in a batch, or beside a PettingZoo environment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Batch, Scenario
from posse.numeric import BoolArray, FloatArray
from posse_baselines.match import Match
from posse_baselines.policy import Memory, Policy, PolicyError, begin


@dataclass(frozen=True)
class Played:
    """One control step."""

    actions: FloatArray
    """(E, N, 2 + m), of the policy."""
    observations: FloatArray
    """(E, N, F), after the step."""
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    infos: dict[str, Any]
    memory: Memory
    """The policy's memory, before it acts on ``observations``."""


def check_moves_all(policy: Policy, scenario: Scenario) -> None:
    """Raise if the target of a scenario is an agent that the policy does not move.

    Raises:
        PolicyError: The message says how to pair the policy with one of a target.
    """
    if scenario.num_agents != scenario.num_trackers and not isinstance(policy, Match):
        raise PolicyError(
            f"the target of {scenario.name!r} is an agent, and policy {policy.name!r} drives "
            "trackers only: give a target too, target=, or play it with posse play"
        )


def rollout(batch: Batch, policy: Policy, *, seed: int | None = None) -> Iterator[Played]:
    """Reset a batch and yield one :class:`Played` for each control step, without end.

    With autoreset disabled it ends when every world has ended; otherwise the caller stops.

    Raises:
        PolicyError: The policy does not fit the batch, or the target is an agent that it does not
            move.
    """
    if batch.observation_shape[1] == batch.scenario.num_agents:
        check_moves_all(policy, batch.scenario)
    memory = begin(policy, batch)
    observations = batch.reset(seed=seed)
    begins = np.zeros(batch.num_worlds, np.bool_)
    while True:
        actions, memory = policy.act(observations, memory)
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        ended = terminated | truncated
        # In the mode "next_step", the step after the end begins the next episode.
        begins = begins if batch.autoreset == "next_step" else ended
        if begins.any():
            memory = policy.restart(memory, begins)
        begins = ended
        yield Played(actions, observations, rewards, terminated, truncated, infos, memory)
        if batch.autoreset == "disabled" and ended.any():
            if not ended.all():
                raise PolicyError("episodes of this batch end at different steps: play it with an autoreset mode")
            return


def play(batch: Batch, policy: Policy, *, seed: int | None = None) -> dict[str, npt.NDArray[np.float64]]:
    """Play one episode in every world and return its metrics by name, (E,) each.

    Raises:
        PolicyError: The policy does not fit the batch.
    """
    metrics: dict[str, npt.NDArray[np.float64]] = {}
    waiting = np.ones(batch.num_worlds, np.bool_)
    for step in rollout(batch, policy, seed=seed):
        ended = waiting & (step.terminated | step.truncated)
        if not ended.any():
            continue
        for name in batch.metrics():
            column = metrics.setdefault(name, np.full(batch.num_worlds, np.nan))
            column[ended] = step.infos[f"metrics/{name}"][ended]
        waiting &= ~ended
        if not waiting.any():
            break
    return metrics


def stack_agents(observations: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the trackers' observations of a parallel environment as a batch of one, (1, N, F).

    Trackers are sorted by number, ``tracker_0`` first; a target that is an agent is left out.

    Raises:
        PolicyError: There are no trackers, or one is missing.
    """
    names = [name for name in observations if name.startswith("tracker_")]
    wanted = [f"tracker_{i}" for i in range(len(names))]
    if not names or set(names) != set(wanted):
        raise PolicyError(
            f"observations of {sorted(observations)} are not those of a team: tracker_0, tracker_1, ... without a gap"
        )
    return np.stack([np.asarray(observations[name], np.float32) for name in wanted])[None]


def split_agents(actions: FloatArray, agents: Sequence[str] | Mapping[str, Any]) -> dict[str, FloatArray]:
    """Return actions (1, N, 2 + m) by name, for the trackers among ``agents``."""
    return {name: actions[0, int(name.removeprefix("tracker_"))] for name in agents if name.startswith("tracker_")}
