"""PettingZoo environments: trackers, and optionally the target, are agents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from pettingzoo import ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from posse.adapters.actions import agent_names, single_action_space
from posse.adapters.single_world import shortened
from posse.adapters.spaces import box
from posse.adapters.world_env import WorldEnv
from posse.engine.arguments import options_of
from posse.numeric import FloatArray
from posse.scenarios import Scenario
from posse.shown import shown

_Infos = dict[str, dict[str, Any]]


class TeamParallelEnv(WorldEnv, ParallelEnv[str, Any, Any]):
    """A team of unicycle robots finds, follows and holds formation on one mobile target.

    **Agents**: ``tracker_0`` ... ``tracker_{N-1}``, and ``target_0`` where the target is an agent.
    All act simultaneously until the end of the episode.

    **Observation**: ``Box`` (F,) float32: own sensors, odometry and radio; its fields, in order,
    are ``posse.observation_fields(scenario)``, and ``env.layout.views(observation)`` names them.
    ``target_0`` has the same layout and observes the trackers without error.

    **Action**: ``Box(-1, 1, (2 + message_size,))`` float32: speed (-1 is at rest, 1 the maximum),
    turn rate (1 is the maximum to the left), message. With ``discrete_actions=True``
    ``Discrete(15)``, the rows of :data:`posse.adapters.actions.MOTIONS`.

    **Reward**: the weighted sum of named terms, ``scenario.reward_weights``; for ``target_0``
    ``scenario.target_reward_weights``, by default the negative of the team's score.

    **Info**, for each agent, with the same keys at every reset and step: ``"score"`` of the team in
    [0, 1]; ``"reward_terms"``, each term by name, unscaled; ``"working"``, if trackers may
    break; ``"metrics"``, each metric of the episode by name (``posse.METRICS``): 0 before the step
    that ends the episode.

    **Start**: drawn from (seed, split, world, episode). ``reset(seed=s)`` starts the first
    world of ``posse.batch(..., seed=s)``; ``reset()`` its next episode.
    ``options={"tracker_pose": (N, 3), "target_pose": (3,)}`` starts from these (x, y, θ).

    **End**: truncation after ``horizon`` steps; termination only with ``terminate_on_contact``.

    **State**: ``env.state()`` is the full state, a float32 vector; ``env.state_layout`` names it.

    Args:
        scenario: Name of a scenario, or a scenario.
        target: ``"agent"`` makes the target an agent; short for ``target_motion="agent"``.
        discrete_actions: Whether actions are ``Discrete``.
        max_cycles: Length of an episode in steps; alias of ``horizon``.
        render_mode: ``"human"`` (a window, drawn at each step), ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Index of the world within the seed.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown scenario, or an unknown or invalid setting.
        ValueError: An unknown split or render mode, a negative seed.
    """

    metadata: ClassVar[dict[str, Any]] = {**WorldEnv.metadata, "name": "posse_track_v0", "is_parallelizable": True}

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        *,
        target: str | None = None,
        discrete_actions: bool = False,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        **overrides: Any,
    ) -> None:
        self._open(
            shortened(scenario, max_cycles, {**overrides, "target": target}),
            render_mode=render_mode,
            discrete_actions=discrete_actions,
            seed=seed,
            split=split,
            first_world=first_world,
        )
        self.possible_agents = agent_names(self.scenario)
        self.agents: list[str] = []
        bounds = self.layout.bounds()
        self.observation_spaces = {agent: box(bounds) for agent in self.possible_agents}
        self.action_spaces = {
            agent: single_action_space(self.scenario, discrete_actions) for agent in self.possible_agents
        }
        self._none_ended = dict.fromkeys(self.possible_agents, False)
        self._state_space: spaces.Box | None = None
        self._wrapper_seed = seed
        self._np_random: np.random.Generator | None = None

    @property
    def np_random(self) -> np.random.Generator:
        """Random numbers for wrappers that look for them here; no world draws from it."""
        if self._np_random is None:
            self._np_random = np.random.default_rng(self._wrapper_seed)
        return self._np_random

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the observation space of an agent; the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the action space of an agent; the same object at each call."""
        return self.action_spaces[agent]

    @property
    def state_space(self) -> spaces.Box:
        """Space of :meth:`state`."""
        if self._state_space is None:
            self._state_space = spaces.Box(-np.inf, np.inf, (self.state_layout.size,), np.float32)
        return self._state_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, FloatArray], _Infos]:
        """Start an episode; see the class for seeds and options.

        Returns:
            Observations and infos by agent.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        if options is not None:
            # PettingZoo's own tests send {"options": 1}, to see that options are taken.
            options = {key: value for key, value in options_of(options).items() if key != "options"}
        observations = self._world.reset(seed, options)
        self.agents = self.possible_agents.copy()
        if seed is not None:
            self._wrapper_seed, self._np_random = int(seed), None
        if self.render_mode == "human":
            self.render()
        infos: _Infos = {
            agent: {"score": 0.0, "reward_terms": self._world.no_terms, "metrics": self._world.no_metrics.copy()}
            for agent in self.agents
        }
        if self._breakable:
            self._report_working(infos)
        return dict(zip(self.agents, observations, strict=True)), infos

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, FloatArray], dict[str, float], dict[str, bool], dict[str, bool], _Infos]:
        """Advance the world by one control step.

        Args:
            actions: One for every agent, by name.

        Returns:
            Observations, rewards, terminations, truncations and infos, each by agent.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: An agent is missing or unknown, or its action is of a wrong type or shape,
                not finite, or out of its space; nothing is changed.
        """
        world, agents = self._world, self.agents
        if not world.running:
            world.check_running()
        world.actions.by_agent(actions)
        over = world.advance()
        score, name_terms, metrics = world.score(), world.name_terms, world.no_metrics.copy()
        infos: _Infos = {
            agent: {"score": score, "reward_terms": name_terms(*values), "metrics": metrics}
            # No strict=True: equal lengths, in the hot path.
            for agent, values in zip(agents, world.terms.tolist())  # noqa: B905
        }
        if self._breakable:
            self._report_working(infos)
        terminated, truncated = self._none_ended.copy(), self._none_ended.copy()
        if over:
            was_terminated, metrics = world.end()
            ended = terminated if was_terminated else truncated
            ended.update(dict.fromkeys(agents, True))
            for info in infos.values():
                info["metrics"] = metrics.copy()
            self.agents = []
        if self.render_mode == "human":
            self.render()
        return (
            dict(zip(agents, world.observations.copy())),  # noqa: B905
            dict(zip(agents, world.rewards.tolist())),  # noqa: B905
            terminated,
            truncated,
            infos,
        )

    def _report_working(self, infos: _Infos) -> None:
        working = [*self._world.working().tolist(), True]  # a target never breaks
        for info, works in zip(infos.values(), working, strict=False):
            info["working"] = works

    def check_action(self, agent: str, action: npt.ArrayLike) -> None:
        """Raise if an agent's action is invalid.

        Raises:
            ValueError: Of a wrong type or shape, not finite, or out of its space.
        """
        self._world.actions.one(agent, action)


class _InTurns(parallel_to_aec_wrapper[str, Any, Any]):
    """AEC wrapper that checks an action in its agent's turn, not in that of the last agent."""

    def step(self, action: Any) -> None:
        agent = self.agent_selection
        if not (self.terminations[agent] or self.truncations[agent]):
            self.env.check_action(agent, action)
        elif action is not None:
            raise ValueError(
                f"action of {agent} must be None, as its episode is over, got {shown(action)}: "
                "call step(None) for each agent that is left, or reset()"
            )
        super().step(action)


class TeamAECEnv(OrderEnforcingWrapper[str, Any, Any]):
    """:class:`TeamParallelEnv` as AEC: the world advances once the last agent has acted."""

    def __init__(self, env: TeamParallelEnv) -> None:
        self._has_reset = self._has_updated = False
        super().__init__(_InTurns(env))

    def __getattr__(self, name: str) -> Any:
        if name == "env":  # copy and pickle look it up before initialisation
            raise AttributeError(name)
        return super().__getattr__(name)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Start an episode.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        before = self._has_reset, self._has_updated
        try:
            super().reset(seed=seed, options=options)
        except BaseException:
            self._has_reset, self._has_updated = before
            raise

    def step(self, action: Any) -> None:
        """Take the action of the agent whose turn it is.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: A bad action, or one that is not None for an agent whose episode is over;
                nothing is changed, and it is still that agent's turn.
        """
        if not self._has_reset:
            raise ResetNeeded("step before reset: call reset() first")
        if not self.agents:
            raise ResetNeeded("step after the end of the episode: call reset() first")
        super().step(action)


def parallel_env(scenario: str | Scenario = "constant", **settings: Any) -> TeamParallelEnv:
    """Return a PettingZoo parallel environment: :class:`TeamParallelEnv`."""
    return TeamParallelEnv(scenario, **settings)


def env(scenario: str | Scenario = "constant", **settings: Any) -> TeamAECEnv:
    """Return a PettingZoo AEC environment: :class:`TeamAECEnv`."""
    return TeamAECEnv(TeamParallelEnv(scenario, **settings))
