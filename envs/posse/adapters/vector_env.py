"""Gymnasium vector environments: many worlds, stepped by one call."""

from __future__ import annotations

import secrets
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from posse.adapters.actions import MOTIONS
from posse.adapters.gymnasium_env import SoloEnv, TeamEnv, solo_options
from posse.adapters.infos import flattened
from posse.adapters.single_world import RENDER_MODES, check_render_mode, frames_per_second, new_renderer
from posse.engine.arguments import as_array, options_of
from posse.engine.paired_batch import TargetPolicy, batch_for, with_agent
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Scenario
from posse.scenarios.setting import is_one_of
from posse.shown import shown
from posse.signals.observation.layout import ObservationLayout

_MODES: Final = {
    AutoresetMode.NEXT_STEP: "next_step",
    AutoresetMode.SAME_STEP: "same_step",
    AutoresetMode.DISABLED: "disabled",
}
_Info = dict[str, Any]
_Rewards = npt.NDArray[np.float64]


class TeamVectorEnv(VectorEnv[FloatArray, Any, npt.NDArray[Any]]):
    """``posse/Team-v0`` as a vector environment: E worlds, one agent controls the team in each.

    As :class:`posse.adapters.gymnasium_env.TeamEnv`, with a leading axis E.
    World i is world ``first_world + i`` of the seed, so ``reset(seed=s)`` gives E different worlds.
    Infos have the form of ``gymnasium.vector.SyncVectorEnv``: for each entry an array over the
    worlds, and under ``"_" + name`` a mask of the worlds that have it; names and zeros as in
    :class:`TeamEnv`.

    Args:
        scenario: Name of a scenario, or a scenario.
        num_envs: E, at least 1.
        autoreset: Behaviour at the end of an episode, as for :func:`posse.batch`. ``"next_step"``:
            the next step starts a new one and ignores its action; ``"same_step"``: a new one starts
            at once, the last observation is ``info["final_obs"]``; ``"disabled"``: the caller
            resets, with ``options={"reset_mask": mask}``.
        autoreset_mode: The same in Gymnasium's words, a ``gymnasium.vector.AutoresetMode`` or its
            value; give one of the two.
        max_episode_steps: Length of an episode; alias of ``horizon``.
        discrete_actions: Whether actions are discrete.
        render_mode: ``"human"`` (a window with world 0), ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Index of the first world.
        num_threads: Threads that step the worlds; never changes a result.
        target_policy: Moves the target (:class:`posse.TargetPolicy`); default: its scripted motion.
        flat_infos: Whether infos are without nested dictionaries: ``info["metrics/score"]`` for
            ``info["metrics"]["score"]``.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown scenario, or an unknown or invalid setting.
        ValueError: Any other invalid argument; the message states the valid range.
    """

    single_env: ClassVar[type[TeamEnv]] = TeamEnv
    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        num_envs: int = 1,
        *,
        autoreset: str | None = None,
        autoreset_mode: AutoresetMode | str | None = None,
        max_episode_steps: int | None = None,
        discrete_actions: bool = False,
        render_mode: str | None = None,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        num_threads: int | None = None,
        target_policy: TargetPolicy | None = None,
        flat_infos: bool = False,
        **overrides: Any,
    ) -> None:
        check_render_mode(render_mode)
        self.autoreset_mode = _check_mode(autoreset, autoreset_mode)
        self.scenario = with_agent(self._fitting(scenario, max_episode_steps, overrides), target_policy)
        self.single_observation_space, self.single_action_space = self._spaces(discrete_actions)
        self.batch = batch_for(
            self.scenario,
            num_envs,
            target_policy,
            seed=0 if seed is None else seed,
            split=split,
            first_world=first_world,
            autoreset=_MODES[self.autoreset_mode],
            num_threads=num_threads,
        )
        self._seeded = seed is not None
        self.num_envs = num_envs
        self.observation_space: spaces.Space[Any] = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.layout: ObservationLayout = self.batch.layout
        self.render_mode = render_mode
        self.metadata = {  # type: ignore[misc]
            **type(self).metadata,
            "render_fps": frames_per_second(self.scenario),
            "autoreset_mode": self.autoreset_mode,
        }
        self._discrete = discrete_actions
        self._flat_infos = flat_infos
        self._works_at = self.layout.offsets["working"]
        self._renderer: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[FloatArray, _Info]:
        """Start episodes, and return the observations of all worlds.

        Args:
            seed: One number: restart from episode 0 of this seed; ``None``: each world's next
                episode.
            options: ``"reset_mask"`` (E,) bool: only these worlds; ``"tracker_pose"`` and
                ``"target_pose"``: start from these, as in :meth:`posse.Batch.reset`.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        if isinstance(seed, (list, tuple)):
            raise ValueError(
                "seed must be one number, from which the seeds of all worlds are derived; got a "
                f"{type(seed).__name__} of {len(seed)}"
            )
        fresh = seed
        if seed is None and not self._seeded:
            fresh = secrets.randbits(32)
        observations = self.batch.reset(seed=fresh, options=self._options(options))
        self._seeded = True
        super().reset(seed=None if seed is None else int(seed))
        self._no_metrics = dict.fromkeys(self.batch.metrics(), 0.0)
        if self.render_mode == "human":
            self.render()
        given = options_of(options).get("reset_mask")
        mask = np.ones(self.num_envs, np.bool_) if given is None else np.array(given, np.bool_)
        infos = self._told(_zeroed(self._entries(observations), mask), mask)
        self._keep(observations)
        return self._observed(observations), infos

    def step(self, actions: Any) -> tuple[FloatArray, _Rewards, BoolArray, BoolArray, _Info]:
        """Advance every world by one control step.

        Args:
            actions: In ``action_space``.

        Returns:
            observations (E, ...), rewards (E,), terminated (E,), truncated (E,), infos.

        Raises:
            ResetNeeded: Before the first reset, or after an end with ``DISABLED``.
            ValueError: Actions of a wrong type or shape, not finite, or out of their space; nothing
                is changed.
        """
        observations, rewards, terminated, truncated, batch_infos = self.batch.step(self._motions(actions))
        infos = self._infos(observations, terminated | truncated, batch_infos)
        self._keep(observations)
        if self.render_mode == "human":
            self.render()
        return self._observed(observations), self._rewarded(rewards), terminated, truncated, infos

    def _motions(self, actions: Any) -> npt.NDArray[Any]:
        """Return actions as the batch takes them, (E, N, 2 + m)."""
        array = as_array("actions", actions)
        if array.shape != self.action_space.shape:
            raise ValueError(f"actions have shape {array.shape}, wanted {self.action_space.shape}")
        if not self._discrete:
            return array.reshape(self._shape_of_motions())
        if array.dtype.kind not in "iu":
            raise ValueError(f"actions must be whole numbers, got an array of {array.dtype}")
        outside = (array < 0) | (array >= len(MOTIONS))
        if outside.any():
            where = tuple(int(k) for k in np.argwhere(outside)[0])
            raise ValueError(f"actions{list(where)} = {array[where]} lies outside 0 to {len(MOTIONS) - 1}")
        motions: FloatArray = MOTIONS[array].reshape(self._shape_of_motions())
        return motions

    def _infos(self, observations: FloatArray, ended: BoolArray, found: _Info) -> _Info:
        """Bring the batch's infos to the form of Gymnasium's own vector environments."""
        same_step = self.autoreset_mode == AutoresetMode.SAME_STEP
        everywhere = np.ones(self.num_envs, np.bool_)
        # Worlds that have just been reset have the info of a reset.
        stepped = ~ended if same_step else self.batch.worlds["step"] > 0
        entries = self._entries(observations, found)
        infos = _zeroed(entries, stepped)
        if self.tells_working:
            infos["working"] = entries["working"]
        if "metrics" in found and not same_step:
            infos["metrics"] = _zeroed(found["metrics"], ended)
        infos = self._told(infos, everywhere)
        if same_step and "final_obs" in found:
            last = found["final_obs"]
            final = {**self._entries(last, found), "metrics": found["metrics"]}
            kept = np.full(self.num_envs, None, dtype=object)
            for e in np.flatnonzero(ended):
                kept[e] = self._observed(last[e : e + 1])[0]
            infos["final_obs"], infos["_final_obs"] = kept, ended.copy()
            infos["final_info"] = self._told(_zeroed(final, ended), ended)
            infos["_final_info"] = ended.copy()
        return infos

    def _told(self, entries: _Info, mask: BoolArray) -> _Info:
        return _masked(flattened(entries) if self._flat_infos else entries, mask)

    def _entries(self, observations: FloatArray, found: _Info | None = None) -> _Info:
        """Return the infos of a step that ends no episode, or without ``found`` of a reset."""
        worlds = self.num_envs
        if found is None:
            rows = (worlds, self.scenario.num_trackers)
            score = np.zeros(worlds)
            terms = {name: np.zeros(rows, np.float32) for name in self.batch.term_names}
        else:
            score = found["score"].astype(np.float64)
            terms = found["reward_terms"]
        entries: _Info = {
            "score": score,
            "reward_terms": {k: self._of_agents(v) for k, v in terms.items()},
            "metrics": {name: np.zeros(worlds) for name in self._no_metrics},
        }
        if self.tells_working:
            entries["working"] = self._working(observations[:, :, self._works_at] != 0)
        return entries

    # Overridden for a single tracker.

    def _fitting(self, scenario: str | Scenario, horizon: int | None, overrides: dict[str, Any]) -> Scenario:
        return self.single_env.fitting_scenario(scenario, horizon, overrides)

    def _spaces(self, discrete_actions: bool) -> tuple[spaces.Box, spaces.Space[Any]]:
        return self.single_env.spaces_of(self.scenario, discrete_actions)

    def _shape_of_motions(self) -> tuple[int, ...]:
        return self.batch.action_shape

    def _keep(self, observations: FloatArray) -> None:
        """Take note of the observations (E, N, F) that the next actions answer."""

    @property
    def tells_working(self) -> bool:
        """Whether infos say which trackers work: where some may break."""
        return self.scenario.breaks > 0

    def _working(self, working: BoolArray) -> BoolArray:
        return working

    def _options(self, options: dict[str, Any] | None) -> dict[str, Any] | None:
        return options

    def _observed(self, observations: FloatArray) -> FloatArray:
        return observations

    def _rewarded(self, rewards: FloatArray) -> _Rewards:
        mean: _Rewards = rewards.mean(axis=1, dtype=np.float64)
        return mean

    def _of_agents(self, values: FloatArray) -> npt.NDArray[Any]:
        return values

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """Draw every world, (H, W, 3) uint8 each; in the mode "human", world 0 in a window."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = new_renderer(self.scenario, self.render_mode)
        if self.render_mode == "human":
            self._renderer.draw(self.batch)
            return None
        return tuple(self._renderer.draw(self.batch, world=e) for e in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class SoloVectorEnv(TeamVectorEnv):
    """``posse/Solo-v0`` as a vector environment; see :class:`TeamVectorEnv` and `SoloEnv`."""

    single_env: ClassVar[type[TeamEnv]] = SoloEnv

    def _options(self, options: dict[str, Any] | None) -> dict[str, Any] | None:
        return solo_options(options)

    def _observed(self, observations: FloatArray) -> FloatArray:
        return observations[:, 0]

    def _rewarded(self, rewards: FloatArray) -> _Rewards:
        return rewards[:, 0].astype(np.float64)

    def _of_agents(self, values: FloatArray) -> npt.NDArray[Any]:
        return values[:, 0].astype(np.float64)


def _zeroed(entries: _Info, mask: BoolArray) -> _Info:
    """Return entries, nested or not, with zeros where the mask is false."""
    if mask.all():
        return entries
    zeroed: _Info = {}
    for name, value in entries.items():
        if isinstance(value, dict):
            zeroed[name] = _zeroed(value, mask)
        else:
            wide = mask.reshape(-1, *[1] * (value.ndim - 1))
            zeroed[name] = np.where(wide, value, np.zeros((), value.dtype))
    return zeroed


def _masked(entries: _Info, mask: BoolArray) -> _Info:
    """Return entries, nested or not, each with its mask."""
    infos: _Info = {}
    for name, value in entries.items():
        infos[name] = _masked(value, mask) if isinstance(value, dict) else value
        infos[f"_{name}"] = mask.copy()
    return infos


def _check_mode(autoreset: str | None, mode: AutoresetMode | str | None) -> AutoresetMode:
    """Return Gymnasium's name of an autoreset mode that is given in either way.

    Raises:
        ValueError: There is no such mode, or both are given.
    """
    if autoreset is not None and mode is not None:
        raise ValueError(f"autoreset={shown(autoreset)} and autoreset_mode={shown(mode)} mean the same: give one")
    if mode is None:
        known = ", ".join(map(repr, _MODES.values()))
        for found, name in _MODES.items():
            if is_one_of((name,), "next_step" if autoreset is None else autoreset):
                return found
        raise ValueError(f"unknown autoreset mode {shown(autoreset)}; modes are: {known}")
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = ", ".join(repr(each.value) for each in AutoresetMode)
        raise ValueError(f"unknown autoreset_mode {shown(mode)}; modes are: {known}") from None
