"""PettingZoo environments: trackers, and optionally the target, are agents."""

from __future__ import annotations

import functools
import reprlib
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec

from posse.adapters.actions import agent_names, as_motions, box, single_action_space
from posse.adapters.base import WorldEnv, with_horizon
from posse.engine.arguments import in_box, options_of
from posse.numeric import FloatArray
from posse.scenarios import Scenario, get_scenario

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
    [0, 1]; ``"reward/<term>"``, each term, unscaled; ``"metrics/<metric>"``, each metric of the
    episode (``posse.METRICS``), 0 before the step that ends it; ``"working"``, if trackers may break.

    **Start**: drawn from (seed, split, world, episode). ``reset(seed=s)`` starts the first
    world of ``posse.batch(..., seed=s)``; ``reset()`` its next episode.
    ``options={"tracker_pose": (N, 3), "target_pose": (3,)}`` starts from these (x, y, θ).

    **End**: truncation after ``horizon`` steps; termination only with ``terminate_on_contact``.

    **State**: ``env.state()`` is the full state, a float32 vector; ``env.state_layout`` names it.

    Args:
        scenario: Name of a scenario, or a scenario.
        target: ``"agent"`` makes the target an agent; short for ``target_motion="agent"``.
        discrete_actions: Whether actions are ``Discrete``.
        clip_actions: Whether finite actions outside [-1, 1] are clipped instead of refused.
        max_cycles: PettingZoo's name for ``horizon``.
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
        clip_actions: bool = False,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        **overrides: Any,
    ) -> None:
        self._open(
            get_scenario(scenario, target=target, **with_horizon(overrides, "max_cycles", max_cycles)),
            clip_actions=clip_actions,
            render_mode=render_mode,
            seed=seed,
            split=split,
            first_world=first_world,
        )
        self.possible_agents = agent_names(self.scenario)
        self.agents: list[str] = []
        self.observation_spaces = {agent: box(*self.layout.bounds()) for agent in self.possible_agents}
        self.action_spaces = {
            agent: single_action_space(self.scenario, discrete_actions) for agent in self.possible_agents
        }
        self._reader = _Reader(self.possible_agents, self.batch.action_shape[2], discrete_actions, clip_actions)
        self._none_ended = dict.fromkeys(self.possible_agents, False)
        self.np_random = np.random.default_rng(seed)  # for wrappers; no world draws from it

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the observation space of an agent; the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the action space of an agent; the same object at each call."""
        return self.action_spaces[agent]

    @functools.cached_property
    def state_space(self) -> spaces.Box:
        """Space of :meth:`state`."""
        return spaces.Box(-np.inf, np.inf, (self.state_layout.size,), np.float32)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, FloatArray], _Infos]:
        """Start an episode; a bad seed or option is a ValueError that changes nothing."""
        if options is not None:
            # PettingZoo's own tests send {"options": 1}, to see that options are taken.
            options = {key: value for key, value in options_of(options).items() if key != "options"}
        observations = self._start(seed, options)[0]
        self.agents = self.possible_agents.copy()
        if seed is not None:
            self.np_random = np.random.default_rng(seed)
        infos = self._infos_of(self.agents, 0.0, [[0.0] * len(self.batch.term_names)] * len(self.agents))
        return dict(zip(self.agents, observations, strict=True)), infos

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, FloatArray], dict[str, float], dict[str, bool], dict[str, bool], _Infos]:
        """Advance the world by one control step, given an action for every agent.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: An agent is missing or unknown, or its action is out of its space; nothing is changed.
        """
        agents = self.agents
        self.batch.check_running()
        results = self._advance(self._reader.read(actions))
        terminations, truncations = self._none_ended.copy(), self._none_ended.copy()
        if self.batch._over:
            (terminations if results.terminated[0] else truncations).update(dict.fromkeys(agents, True))
            self.agents = []
        # No strict=True below: equal lengths, in the hot path.
        return (
            dict(zip(agents, results.observations.copy())),  # noqa: B905
            dict(zip(agents, results.rewards.tolist())),  # noqa: B905
            terminations,
            truncations,
            self._infos_of(agents, results.scores.item(), results.terms.tolist()),
        )

    def _infos_of(self, agents: list[str], score: float, terms: list[list[float]]) -> _Infos:
        """Return the infos, which differ in the agents' own reward terms (rows, K) only."""
        common, rewards, infos = self._info(score), self._infos.rewards, {}
        for agent, own in zip(agents, terms):  # noqa: B905
            infos[agent] = info = common.copy()
            for key, k in rewards:
                info[key] = own[k]
        if self._breakable:
            for agent, works in zip(agents, [*self.batch.working[0].tolist(), True]):  # noqa: B905
                infos[agent]["working"] = works  # a target never breaks
        return infos


class _Reader:
    """Reads the actions of a dictionary by agent into an array for the kernel, always the same."""

    def __init__(self, agents: list[str], length: int, discrete: bool, clip: bool) -> None:
        self._arguments = agents, length, discrete, clip
        self._array = np.zeros((1, len(agents), length), np.float32)
        self._rows = [(agent, memoryview(row)) for agent, row in zip(agents, self._array[0], strict=True)]

    def __reduce__(self) -> tuple[Any, ...]:
        return _Reader, self._arguments  # so that the rows are views of the new array

    def read(self, actions: Mapping[str, Any]) -> FloatArray:
        """Return the actions, (1, rows, 2 + m); ValueError if one is missing, unknown or out of its space."""
        agents, _, discrete, clip = self._arguments
        # Assignment to a memoryview checks type and shape faster than explicit tests.
        try:
            if discrete or type(actions) is not dict or len(actions) != len(agents):
                raise TypeError
            for agent, row in self._rows:
                row[:] = actions[agent]
        except (KeyError, TypeError, ValueError, BufferError):
            self._read_any(actions)
        return in_box(self._array, clip, self._place)

    def _read_any(self, actions: Mapping[str, Any]) -> None:
        """Read actions of any type, and report which one is invalid."""
        agents, length, discrete, _ = self._arguments
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions must be a dictionary by agent, got {type(actions).__name__}")
        known = f"agents are: {', '.join(agents)}"
        for agent in actions:
            if agent not in agents:
                raise ValueError(f"action for unknown agent {reprlib.repr(agent)}; {known}")
        for agent, row in zip(agents, self._array[0], strict=True):
            if agent not in actions:
                raise ValueError(f"no action for {agent}: every agent needs one; {known}")
            row[...] = as_motions(f"action of {agent}", actions[agent], () if discrete else (length,), discrete)

    def _place(self, _: int, row: int, k: int) -> str:
        parts = ("speed", "turn rate")
        return f"action of {self._arguments[0][row]}: {parts[k] if k < 2 else f'message[{k - 2}]'}"


def parallel_env(scenario: str | Scenario = "constant", **settings: Any) -> TeamParallelEnv:
    """Return a PettingZoo parallel environment: :class:`TeamParallelEnv`."""
    return TeamParallelEnv(scenario, **settings)


def env(scenario: str | Scenario = "constant", **settings: Any) -> AECEnv[str, Any, Any]:
    """Return :class:`TeamParallelEnv` as a PettingZoo AEC environment.

    Once the last agent has acted, all actions are checked and the world advances.
    """
    return parallel_to_aec(TeamParallelEnv(scenario, **settings))
