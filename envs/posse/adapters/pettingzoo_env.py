"""PettingZoo environments: trackers, and optionally the target, are agents."""

import reprlib
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec

from posse.adapters.actions import agent_names, as_motions, box, single_action_space
from posse.adapters.base import WorldEnv
from posse.engine.arguments import in_box, options_of
from posse.numeric import FloatArray
from posse.scenarios import Scenario

_AgentInfos = dict[str, dict[str, Any]]


class TeamParallelEnv(WorldEnv, ParallelEnv[str, Any, Any]):
    """A team of unicycle robots finds, follows and holds formation on one mobile target.

    **Agents**: ``tracker_0`` ... ``tracker_{N-1}``, and ``target_0`` where the target is an agent.
    All act simultaneously until the end of the episode.

    **Observation**: ``Box`` (F,) float32: own sensors, odometry and radio; its fields, in order,
    are ``posse.observation_fields(scenario)``, and ``env.layout.views(observation)`` names them.
    ``target_0`` has the same layout and observes the nearest ``num_neighbours`` trackers without error; by default all
    but the farthest, at most eight.

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
        settings: ``target_motion="agent"`` makes the target an agent; further arguments of
            :class:`posse.adapters.base.BatchEnv`, or any field of :class:`posse.Scenario`.
    """

    metadata: ClassVar[dict[str, Any]] = {**WorldEnv.metadata, "name": "posse_track_v0", "is_parallelizable": True}

    def __init__(self, scenario: str | Scenario = "constant", **settings: Any) -> None:
        super().__init__(scenario, **settings)
        self.possible_agents = agent_names(self.batch)
        self.observation_spaces = {agent: box(*self.layout.bounds()) for agent in self.possible_agents}
        self.action_spaces = {
            a: single_action_space(self.scenario.message_size, self._discrete) for a in self.possible_agents
        }
        self._goes_on = dict.fromkeys(self.possible_agents, False)  # each step copies it, faster than making it
        self.state_space = spaces.Box(-np.inf, np.inf, (self.state_layout.size,), np.float32)
        self.np_random = np.random.default_rng(settings.get("seed"))  # that of SuperSuit's frame_skip_v0; no world's

    @property
    def agents(self) -> list[str]:
        """The agents of the running episode; none before the first reset and after the end."""
        return self.possible_agents.copy() if self.batch._started and not self.batch._over else []

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the observation space of an agent; the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the action space of an agent; the same object at each call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, FloatArray], _AgentInfos]:
        """Start an episode; a bad seed or option is a ValueError that changes nothing."""
        # PettingZoo's own tests send {"options": 1}, to see that options are taken.
        observations = self._start(seed, {key: v for key, v in options_of(options).items() if key != "options"})
        if seed is not None:
            self.np_random = np.random.default_rng(seed)
        return dict(zip(self.possible_agents, observations, strict=True)), self._infos_of(self.possible_agents)

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, FloatArray], dict[str, float], dict[str, bool], dict[str, bool], _AgentInfos]:
        """Advance the world by one control step, given an action for every agent.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: An agent is missing or unknown, or its action is out of its space; nothing is changed.
        """
        agents, batch, own = self.possible_agents, self.batch, self._own
        batch.check_running()
        self._advance(self.actions_of(actions))
        terminations, truncations = self._goes_on.copy(), self._goes_on.copy()
        if batch._over:
            (terminations if own.terminated.item() else truncations).update(dict.fromkeys(agents, True))
        return (
            dict(zip(agents, own.observations.copy())),  # noqa: B905  equal lengths, in the hot path
            dict(zip(agents, own.rewards.tolist())),  # noqa: B905
            terminations,
            truncations,
            self._infos_of(agents),
        )

    def actions_of(self, actions: Mapping[str, Any]) -> FloatArray:
        """Return the actions of a step as an array (1, agents, 2 + m) in [-1, 1]; ValueError as for :meth:`step`."""
        return in_box(self._read(actions), self.batch.clip_actions, self._place)

    def _infos_of(self, agents: list[str]) -> _AgentInfos:
        """Return the infos of the last step or reset."""
        common, rewards, infos = self._common_info(), self.batch._rewards, {}
        for agent, own in zip(agents, self._own.terms.T.tolist()):  # noqa: B905  equal lengths, in the hot path
            infos[agent] = info = common.copy()
            for key, k in rewards:  # faster than dict.update(zip(...)), which creates tuples
                info[key] = own[k]
        if self.scenario.breaks:
            for agent, works in zip(agents, [*self.batch.working[0].tolist(), True]):  # noqa: B905
                infos[agent]["working"] = works  # a target never breaks
        return infos

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "_action_of": None}  # memoryviews cannot be pickled

    def _allocate(self) -> None:
        super()._allocate()
        self._actions = np.zeros(self.batch.action_shape, np.float32)
        # Assignment to a memoryview checks type and shape fastest.
        self._action_of = [memoryview(row) for row in self._actions[0]]

    def _read(self, actions: Mapping[str, Any]) -> FloatArray:
        """Return actions by agent as an array, whose range is not checked; ValueError names a wrong one."""
        agents = self.possible_agents
        try:
            if self._discrete or type(actions) is not dict or len(actions) != len(agents):
                raise TypeError
            for agent, row in zip(agents, self._action_of):  # noqa: B905  equal lengths, in the hot path
                row[:] = actions[agent]
            return self._actions
        except (KeyError, TypeError, ValueError, BufferError):  # of another type, or invalid
            pass
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions must be a dictionary by agent, got {type(actions).__name__}")
        known = f"agents are: {', '.join(agents)}"
        for agent in actions:
            if agent not in agents:
                raise ValueError(f"action for unknown agent {reprlib.repr(agent)}; {known}")
        for agent, row in zip(agents, self._actions[0], strict=True):
            if agent not in actions:
                raise ValueError(f"no action for {agent}: every agent needs one; {known}")
            shape = self.action_spaces[agent].shape
            row[...] = as_motions(f"action of {agent}", actions[agent], shape, self._discrete)
        return self._actions

    def _place(self, _: int, row: int, k: int) -> str:
        return f"action of {self.possible_agents[row]}: {('speed', 'turn rate')[k] if k < 2 else f'message[{k - 2}]'}"


def parallel_env(scenario: str | Scenario = "constant", **settings: Any) -> TeamParallelEnv:
    """Return a PettingZoo parallel environment: :class:`TeamParallelEnv`."""
    return TeamParallelEnv(scenario, **settings)


def env(scenario: str | Scenario = "constant", **settings: Any) -> AECEnv[str, Any, Any]:
    """Return :class:`TeamParallelEnv` as a PettingZoo AEC environment.

    Once the last agent has acted, all actions are checked and the world advances; after an error only a reset helps.
    """
    return parallel_to_aec(TeamParallelEnv(scenario, **settings))
