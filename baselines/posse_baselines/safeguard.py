"""The script's safeguard as an action layer, which any learner can train behind.

An action becomes a wanted velocity, ahead and to the left of the robot, as shares of its greatest speed. The layer
turns it past what stands in its way, makes it safe and carries it out as speed and turn rate; the message behind it
passes unchanged. Of the script only the monitoring of the surroundings, the detours and the safeguard run, with the
settings that ``ddcs-tuned`` has for the scenario: without a wanted velocity a robot stays where it is, but for what it
evades.

Where poses drift, the last five numbers of a message are the layer's own, whatever an action says there: they tell
where the robot sees the target, by which team-mates convert its pose. Without room for them the layer mistakes where
team-mates are. In ``posse/Tracker-v0`` it reads those of the team-mates and sends none.

:func:`Safeguard` puts the layer before an environment; :class:`Guard` is the layer itself.
"""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from posse import Batch, ObservationLayout, Scenario
from posse.adapters.actions import as_motions
from posse.numeric import FloatArray
from posse_baselines.ddcs.baseline import GUARD, decide_all
from posse_baselines.ddcs.memory import Minds
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE
from posse_baselines.policy import PolicyError, split_agents, stack_agents
from posse_baselines.tuned import tuned_settings


class Guard(Minds):
    """The safeguard of R ``robots``, by default all trackers, in each of E worlds, and what it remembers of them.

    Attributes:
        said: How many numbers of a message are the layer's own, the last ones.
    """

    def __init__(self, layout: ObservationLayout, num_worlds: int, robots: int | None = None) -> None:
        scenario = layout.scenario
        super().__init__(layout, tuned_settings("ddcs-tuned", scenario), num_worlds, robots or scenario.num_trackers)
        self.said = MESSAGE_SIZE if scenario.drifts and scenario.message_size >= MESSAGE_SIZE else 0
        if self.said == 0:
            self.team.at["message_size"] = 0  # messages are the learner's own

    def actions(self, observations: FloatArray, wanted: npt.ArrayLike) -> FloatArray:
        """Return the actions (E, R, 2 + m) that carry out wanted velocities (E, R, 2) safely.

        Numbers of a message may follow a velocity. Call it once a control step, with its observations (E, R, F). Longer
        velocities are shortened to the greatest speed. ValueError if the shape is another, or a number is not finite.
        """
        most = 2 + self.layout.scenario.message_size
        shape = (*self.me.shape, min(most, max((2, *np.shape(wanted)[-1:]))))
        given = as_motions("the array of wanted velocities", wanted, shape, discrete=False)
        if not np.isfinite(given).all():
            raise ValueError("a wanted velocity is not a finite number")
        actions = np.zeros((*self.me.shape, most), np.float32)
        actions[..., : shape[-1]] = given
        self.run(decide_all, GUARD, observations, actions)
        return actions


def check_room(scenario: Scenario) -> None:
    """Raise PolicyError where poses drift and messages have no room for those of the safeguard."""
    if scenario.drifts and scenario.num_trackers > 1 and scenario.message_size < MESSAGE_SIZE:
        raise PolicyError(
            f"poses of {scenario.name!r} drift, and message_size={scenario.message_size} has no room for the "
            f"{MESSAGE_SIZE} numbers by which the safeguard finds team-mates: set it to at least that"
        )


def Safeguard(env: Any) -> Any:  # noqa: N802 (used as a wrapper's class is)
    """Return an environment of posse whose actions are wanted velocities, behind the safeguard.

    Args:
        env: A PettingZoo parallel environment, whose trackers are guarded and whose target, if it is an agent, is
            not; or one of ``posse/Team-v0``, ``posse/Solo-v0`` and ``posse/Tracker-v0``.

    Raises:
        PolicyError: Discrete actions, which are no velocities; observations or actions that a wrapper changes; an
            environment that is guarded already; no room for messages where poses drift.
        TypeError: Something else.
    """
    guarded: Any
    if isinstance(env, ParallelEnv) and hasattr(env.unwrapped, "layout"):
        guarded, agent, inner = _GuardedParallelEnv, env.possible_agents[0], env.unwrapped
        space, seen = env.action_space(agent), env.observation_space(agent)
        own = inner.action_space(agent), inner.observation_space(agent)
        twice, layout = hasattr(env, "guard"), inner.layout
    elif isinstance(env, gymnasium.Env) and env.has_wrapper_attr("layout"):
        guarded, space, seen = _GuardedEnv, env.action_space, env.observation_space
        own = env.unwrapped.action_space, env.unwrapped.observation_space
        twice, layout = env.has_wrapper_attr("guard"), env.get_wrapper_attr("layout")
    else:
        raise TypeError(f"{env!r:.80} is neither posse.parallel_env(...) nor a single environment of gymnasium.make")
    if twice:
        raise PolicyError("the environment is behind the safeguard already: guard it once")
    if not isinstance(space, spaces.Box):
        raise PolicyError(f"actions {space} are no velocities: make the environment with discrete_actions=False")
    if (space, seen) != own:
        raise PolicyError("a wrapper changes what the safeguard reads or says: put it round the safeguard instead")
    check_room(layout.scenario)
    return guarded(env)


def _check_running(batch: Batch, guard: Guard | None) -> None:
    batch.check_running()
    if guard is None:
        raise ResetNeeded("step before reset: call reset() of the guarded environment first")


class _GuardedEnv(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """A Gymnasium environment behind the safeguard."""

    guard: Any = None

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)  # so that env.spec makes it again
        super().__init__(env)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._seen = np.array(observation, ndmin=3)
        self.guard = Guard(self.get_wrapper_attr("layout"), 1, self._seen.shape[1])
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Advance by one control step with wanted velocities."""
        _check_running(self.get_wrapper_attr("batch"), self.guard)
        motions = self.guard.actions(self._seen, self.get_wrapper_attr("actions_of")(action))
        shape: Any = self.action_space.shape
        observation, *rest = self.env.step(motions[..., : shape[-1]].reshape(shape))
        self._seen = np.array(observation, ndmin=3)
        return observation, *rest


class _GuardedParallelEnv(BaseParallelWrapper[str, Any, Any]):
    """A PettingZoo environment whose trackers are behind the safeguard."""

    guard: Any = None

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start an episode."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self._seen, self.guard = stack_agents(observations), Guard(self.env.unwrapped.layout, 1)
        return observations, infos

    def step(self, actions: Mapping[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """Advance by one control step with wanted velocities of the trackers."""
        _check_running(self.env.unwrapped.batch, self.guard)
        wanted = self.env.unwrapped.actions_of(actions)[:, : self._seen.shape[1]]
        safe = split_agents(self.guard.actions(self._seen, wanted), actions)
        result: tuple[Any, Any, Any, Any, Any] = self.env.step({**actions, **safe})
        self._seen = stack_agents(result[0])
        return result
