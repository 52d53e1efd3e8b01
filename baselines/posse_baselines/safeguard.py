"""The script's safeguard as an action layer, which any learner can train behind.

An action becomes a wanted velocity, ahead and to the left of the robot, as shares of its greatest speed. The layer
turns it past what stands in its way, makes it safe and carries it out as speed and turn rate; the message behind it
passes unchanged. Of the script only the monitoring of the surroundings, the detours and the safeguard run, with the
settings that ``ddcs-tuned`` has for the scenario: without a wanted velocity a robot stays where it is, but for what it
evades.

:func:`Safeguard` puts the layer before an environment, :class:`Guard` is the layer itself, and :class:`Advice` one with
the whole script, whose velocities a network corrects.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from posse import ObservationLayout
from posse.numeric import BoolArray, FloatArray, OwnArrays
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.baseline import guard_all
from posse_baselines.ddcs.memory import Minds
from posse_baselines.policy import Policy, PolicyError, split_agents, stack_agents
from posse_baselines.tuned import tuned_settings

REACH: Final = np.float32(2.0)
"""Factor of the network's output: spans the whole of [-1, 1] from either end."""
MOTION: Final = 2
"""Numbers of an action that move the tracker; a proposal adds as many inputs."""


class Guard(OwnArrays):
    """The safeguard of R robots in each of E worlds, and what it remembers of their surroundings.

    Args:
        layout: Of the observations.
        num_worlds: E.
        robots: R, the robots that it moves; default: all trackers.
        minds: Memory of the script whose safeguard it is; default: a new one of ``ddcs-tuned``.

    Attributes:
        minds: Memory of the script.
        inputs: (E, R, k): what a network reads of it; here nothing, k = 0.
    """

    def __init__(
        self, layout: ObservationLayout, num_worlds: int, robots: int | None = None, minds: Minds | None = None
    ) -> None:
        scenario = layout.scenario
        robots = scenario.num_trackers if robots is None else robots
        self.minds = minds or Minds(layout, tuned_settings("ddcs-tuned", scenario), num_worlds, robots)
        self._observed = np.zeros((num_worlds, robots, layout.size), np.float32)
        self.inputs = np.zeros((num_worlds, robots, 0), np.float32)

    def follow(self, observations: FloatArray, mask: BoolArray | None = None) -> None:
        """Take the observations (E, R, F) of a control step, in the worlds of a mask (E,) or in all."""
        worlds = ... if mask is None else mask
        self._observed[worlds] = observations[worlds]

    def restart(self, mask: BoolArray) -> None:
        """Forget the surroundings in the worlds of a mask (E,), whose episodes restart."""
        self.minds.restart(mask)

    def actions(self, wanted: npt.ArrayLike) -> FloatArray:
        """Return the actions (E, R, 2 + m) that carry out wanted velocities (E, R, 2 + m) safely.

        Call it once a control step; ValueError if a wanted velocity is not finite.
        """
        actions = np.array(wanted, np.float32, order="C")
        if not np.isfinite(actions).all():
            raise ValueError("a wanted velocity must be finite")
        self.minds.run(guard_all, self._observed, actions)
        return actions

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return what it remembers as arrays (E, ...) by name; views, not copies."""
        return {"observed": self._observed, "inputs": self.inputs, **self.minds.arrays()}


def check_adviser(policy: Policy | None) -> int:
    """Return how many numbers a network reads in addition to its encoding, with an adviser or without.

    PolicyError if the adviser is not a policy of the DDCS.
    """
    if policy is None:
        return 0
    if not isinstance(policy, DDCS):
        raise PolicyError(f"{policy.name!r} cannot be an adviser: use a policy of the DDCS, such as ddcs-tuned")
    return MOTION


class Advice(Guard):
    """The safeguard of a scripted adviser, which carries out the velocities of the script as a network corrects them.

    Residual policy learning: at each step the adviser, a team of the DDCS, proposes the velocity that it wants, the
    network reads the proposal beside its other inputs, and twice its output is added to it, before the safeguard. An
    output of zero reproduces the adviser, and every velocity stays reachable. The adviser's messages are sent
    unchanged. References: Silver et al. 2018, Johannink et al. 2019; Alshiekh et al. 2018 (safeguard).

    Args:
        adviser: A policy of the DDCS.
        layout: Of the observations.
        num_worlds: E; their episodes may begin apart.
    """

    def __init__(self, adviser: Any, layout: ObservationLayout, num_worlds: int) -> None:
        check_adviser(adviser)
        super().__init__(layout, num_worlds, minds=adviser.begin(layout, num_worlds))
        self.inputs = np.zeros((*self.minds.me.shape, MOTION), np.float32)
        self._adviser = adviser

    def follow(self, observations: FloatArray, mask: BoolArray | None = None) -> None:
        """Ask for advice on the observations (E, N, F) of a control step, in the worlds of a mask (E,) or in all."""
        kept = {} if mask is None else {name: array[~mask] for name, array in self.arrays().items()}
        super().follow(observations)
        self.inputs[...], _ = self._adviser.propose(self._observed, self.minds)
        for name, array in self.arrays().items():
            if mask is not None:
                array[~mask] = kept[name]

    def actions(self, wanted: npt.ArrayLike) -> FloatArray:
        """Return the actions (E, N, 2 + m) for the network's outputs (E, N, 2), corrections of what is wanted."""
        outputs = np.asarray(wanted)[..., :MOTION]
        actions, _ = self._adviser.carry_out(self._observed, self.minds, REACH * outputs)
        return np.asarray(actions)


def Safeguard(env: Any) -> Any:  # noqa: N802 (used as a wrapper's class is)
    """Return an environment of posse whose actions are wanted velocities, behind the safeguard.

    Args:
        env: A PettingZoo parallel environment, whose trackers are guarded and whose target, if it is an agent, is
            not; or one of ``posse/Team-v0``, ``posse/Solo-v0`` and ``posse/Tracker-v0``.

    Raises:
        PolicyError: Discrete actions, which are no velocities.
        TypeError: Something else.
    """
    if isinstance(env, ParallelEnv):
        return _GuardedParallelEnv(env)
    if isinstance(env, gymnasium.Env):
        return _GuardedEnv(env)
    raise TypeError(f"{env!r:.80} is neither a parallel environment of PettingZoo nor an environment of Gymnasium")


def _check_continuous(space: spaces.Space[Any]) -> None:
    if not isinstance(space, spaces.Box):
        raise PolicyError(f"actions {space} are no velocities: make the environment with discrete_actions=False")


class _GuardedEnv(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A Gymnasium environment behind the safeguard."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        _check_continuous(env.action_space)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        rows = np.atleast_2d(observation)
        self._guard = Guard(self.get_wrapper_attr("layout"), 1, len(rows))
        self._guard.follow(rows[None])
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Advance by one control step with wanted velocities."""
        wanted = np.asarray(action, np.float32)
        motion = self._guard.actions(np.atleast_2d(wanted)[None])
        observation, *rest = self.env.step(motion.reshape(wanted.shape))
        self._guard.follow(np.atleast_2d(observation)[None])
        return observation, *rest


class _GuardedParallelEnv(BaseParallelWrapper[str, Any, Any]):
    """A PettingZoo environment whose trackers are behind the safeguard."""

    def __init__(self, env: ParallelEnv[str, Any, Any]) -> None:
        super().__init__(env)
        for agent in env.possible_agents:
            _check_continuous(env.action_space(agent))

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start an episode."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self._guard = Guard(self.env.unwrapped.layout, 1)
        self._guard.follow(stack_agents(observations))
        return observations, infos

    def step(self, actions: Mapping[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """Advance by one control step with wanted velocities of the trackers."""
        motions = self._guard.actions(stack_agents(actions))
        result: tuple[Any, Any, Any, Any, Any] = self.env.step({**actions, **split_agents(motions, actions)})
        self._guard.follow(stack_agents(result[0]))
        return result
