"""Gymnasium environments: one agent controls the team, or a single tracker."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from posse.adapters.actions import MOTIONS, single_action_space
from posse.adapters.single_world import shortened
from posse.adapters.spaces import box
from posse.adapters.world_env import OneAgentEnv
from posse.engine.arguments import options_of, real_numbers
from posse.engine.paired_batch import TargetPolicy, with_agent
from posse.numeric import FloatArray
from posse.scenarios import Scenario, ScenarioError, get_scenario
from posse.shown import shown
from posse.signals.observation.layout import ObservationLayout


class TeamEnv(OneAgentEnv):
    """``posse/Team-v0``: one agent controls the whole team.

    **Observation**: ``Box`` (N, F) float32, the observation of each tracker; its fields are
    ``posse.observation_fields(scenario)``, and ``env.layout.views(observation)`` names them.

    **Action**: ``Box(-1, 1, (N, 2 + message_size))`` float32: for each tracker its speed (-1 is at
    rest, 1 the maximum), turn rate (1 is the maximum to the left) and message. With
    ``discrete_actions=True`` ``MultiDiscrete([15] * N)``, rows of
    :data:`posse.adapters.actions.MOTIONS`.

    **Reward**: the mean over the trackers of the weighted sum of named terms.

    **Info**, with the same keys at every reset and step: ``"score"`` in [0, 1];
    ``"reward_terms"``, each term by name, unscaled, (N,); ``"working"`` (N,), if trackers may
    break; ``"metrics"``, each metric of the episode by name (``posse.METRICS``): 0 before the step
    that ends the episode.

    **Start**: drawn from (seed, split, world, episode). ``reset(seed=s)`` starts the first
    world of ``posse.batch(..., seed=s)``; ``reset()`` its next episode.
    ``options={"tracker_pose": (N, 3), "target_pose": (3,)}`` starts from these (x, y, θ).

    **End**: truncation after ``horizon`` steps; termination only with ``terminate_on_contact``.

    Args:
        scenario: Name of a scenario, or a scenario.
        discrete_actions: Whether actions are discrete.
        render_mode: ``"human"`` (a window, drawn at each step), ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Index of the world within the seed.
        target_policy: Moves the target (:class:`posse.TargetPolicy`); default: its scripted motion.
        flat_infos: Whether infos are without nested dictionaries: ``info["metrics/score"]`` for
            ``info["metrics"]["score"]``.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown scenario, or an unknown or invalid setting.
        ValueError: An unknown split or render mode, a negative seed.
        TypeError: ``target_policy`` is not the policy of a target.
    """

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        *,
        discrete_actions: bool = False,
        render_mode: str | None = None,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        target_policy: TargetPolicy | None = None,
        flat_infos: bool = False,
        **overrides: Any,
    ) -> None:
        self._flat_infos = flat_infos
        fitting = with_agent(self.fitting_scenario(scenario, None, overrides), target_policy)
        self._open(
            fitting,
            render_mode=render_mode,
            discrete_actions=discrete_actions,
            seed=seed,
            split=split,
            first_world=first_world,
            target_policy=target_policy,
        )
        self.observation_space, self.action_space = self.spaces_of(self.scenario, discrete_actions)

    @classmethod
    def fitting_scenario(cls, scenario: str | Scenario, horizon: int | None, overrides: dict[str, Any]) -> Scenario:
        """Return the scenario with overrides and ``horizon`` steps per episode.

        Raises:
            ScenarioError: It is invalid, or not suited to an environment of one agent.
        """
        return _with_scripted_target(scenario, horizon, overrides)

    @classmethod
    def spaces_of(cls, scenario: Scenario, discrete_actions: bool) -> tuple[spaces.Box, spaces.Space[Any]]:
        """Return the spaces of observations and actions."""
        n = scenario.num_trackers
        low, high = ObservationLayout(scenario).bounds()
        observation_space = box((np.tile(low, (n, 1)), np.tile(high, (n, 1))))
        single = single_action_space(scenario, discrete_actions)
        if discrete_actions:
            return observation_space, spaces.MultiDiscrete([len(MOTIONS)] * n)
        assert single.shape is not None
        return observation_space, spaces.Box(-1.0, 1.0, (n, *single.shape), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; see the class for seeds and options.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        observations = self._begin(seed, options)
        info: dict[str, Any] = {
            "score": 0.0,
            "reward_terms": self._no_terms(),
            "metrics": self._world.no_metrics.copy(),
        }
        if self._breakable:
            info["working"] = self._world.working()
        return observations, self._told(info)

    def _no_terms(self) -> dict[str, Any]:
        n = self.scenario.num_trackers
        return {name: np.zeros(n, np.float32) for name in self._world.batch.term_names}

    def step(self, action: Any) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Advance the world by one control step.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: An action of a wrong type or shape, not finite, or out of its space;
                nothing is changed.
        """
        world = self._world
        if not world.running:
            world.check_running()
        world.actions.by_row(action)
        over = world.advance()
        info: dict[str, Any] = {
            "score": world.score(),
            # An array by rows already; name_terms(*rows) would take longer.
            "reward_terms": dict(zip(world.batch.term_names, world.terms.T.copy())),  # noqa: B905
            "metrics": world.no_metrics.copy(),
        }
        if self._breakable:
            info["working"] = world.working()
        terminated = truncated = False
        if over or self._flat_infos or self.render_mode is not None:
            terminated, truncated, info = self._end(over, info)
        rewards = world.rewards.tolist()
        return world.observations.copy(), sum(rewards) / len(rewards), terminated, truncated, info


class SoloEnv(TeamEnv):
    """``posse/Solo-v0``: one tracker, one target.

    As :class:`TeamEnv` with a team of one, without the team axis: **observation** ``Box`` (F,),
    **action** ``Box(-1, 1, (2 + message_size,))`` or ``Discrete(15)``, reward terms scalars.
    ``options["tracker_pose"]`` may be (3,).

    Raises:
        ScenarioError: As :class:`TeamEnv`, and where the team is not one tracker.
    """

    @classmethod
    def fitting_scenario(cls, scenario: str | Scenario, horizon: int | None, overrides: dict[str, Any]) -> Scenario:
        """Return the scenario with one tracker.

        Raises:
            ScenarioError: It is invalid, has more than one tracker, or one that breaks.
        """
        if not np.array_equal(overrides.get("num_trackers", 1), 1):
            raise ScenarioError(
                f"num_trackers={shown(overrides['num_trackers'])} does not fit posse/Solo-v0, "
                "which has one: use posse/Team-v0"
            )
        whole = get_scenario(scenario)
        if whole.breaks > 0 and "breaks" not in overrides:
            raise ScenarioError(
                f"scenario {whole.name!r} does not fit posse/Solo-v0: in it breaks={whole.breaks} "
                "of the trackers break down, and a team of one would be left with none. Pass "
                "breaks=0, or use posse/Team-v0"
            )
        return _with_scripted_target(scenario, horizon, {**overrides, "num_trackers": 1})

    @classmethod
    def spaces_of(cls, scenario: Scenario, discrete_actions: bool) -> tuple[spaces.Box, spaces.Space[Any]]:
        """Return the spaces of observations and actions."""
        bounds = ObservationLayout(scenario).bounds()
        return box(bounds), single_action_space(scenario, discrete_actions)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; see :class:`TeamEnv`."""
        observations, info = super().reset(seed=seed, options=solo_options(options))
        return observations[0], info

    def _no_terms(self) -> dict[str, Any]:
        return self._world.no_terms

    def step(self, action: Any) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Advance the world by one control step; see :class:`TeamEnv`."""
        world = self._world
        if not world.running:
            world.check_running()
        world.actions.by_agent({"tracker_0": action})
        over = world.advance()
        info: dict[str, Any] = {
            "score": world.score(),
            "reward_terms": world.name_terms(*world.terms[0].tolist()),
            "metrics": world.no_metrics.copy(),
        }
        terminated, truncated, info = self._end(over, info)
        return world.observations[0].copy(), world.rewards.item(), terminated, truncated, info


def solo_options(options: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return the options with a tracker's pose (3,) as a team's, (1, 3)."""
    found = options_of(options)
    if found.get("tracker_pose") is not None:
        pose = real_numbers("tracker_pose", found["tracker_pose"])
        found["tracker_pose"] = pose[None] if pose.ndim == 1 else pose
    return found


def _with_scripted_target(scenario: str | Scenario, horizon: int | None, overrides: dict[str, Any]) -> Scenario:
    settings = dict(overrides)
    if settings.pop("target", None) is not None:
        raise ScenarioError(_NO_PLACE.format(f"target={shown(overrides['target'])}"))
    found = shortened(scenario, horizon, settings)
    if found.target_motion == "agent":
        raise ScenarioError(_NO_PLACE.format("target_motion='agent'"))
    return found


_NO_PLACE = (
    "{} is not possible in an environment of one agent: use posse.parallel_env(..., "
    "target='agent'), a scripted target_motion, or target_policy="
)
