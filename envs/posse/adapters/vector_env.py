"""Gymnasium vector environments: many worlds, stepped by one call."""

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from posse.adapters.actions import as_motions
from posse.adapters.base import BatchEnv
from posse.adapters.gymnasium_env import solo_scenario, team_scenario
from posse.engine.arguments import mask_of
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Scenario, ScenarioError
from posse.scenarios.setting import check_count

_Info = dict[str, Any]


class TeamVectorEnv(BatchEnv, VectorEnv[FloatArray, Any, npt.NDArray[Any]]):
    """``posse/Team-v0`` as a vector environment: E worlds, one agent controls the team in each.

    As :class:`posse.adapters.gymnasium_env.TeamEnv`, with a leading axis E. World i is world ``first_world + i`` of the
    seed, so ``reset(seed=s)`` gives E different worlds. Infos have the form of ``gymnasium.vector.SyncVectorEnv``: for
    each entry an array over the worlds, and under ``"_" + name`` a mask of the worlds that have it; names and zeros as
    in :class:`TeamEnv`.

    Args:
        scenario: Name of a scenario, or a scenario.
        num_envs: E, at least 1.
        autoreset: Behaviour at the end of an episode: a mode of Gymnasium, or a name as for :func:`posse.batch`.
            ``"next_step"``: the next step starts a new one and ignores its action; ``"same_step"``: a new one starts
            at once, the last observation is ``info["final_obs"]``, the last info ``info["final_info"]``;
            ``"disabled"``: the caller resets, with ``options={"reset_mask": mask}``.
        settings: As for :class:`TeamEnv`.
    """

    metadata = BatchEnv.metadata | {"autoreset_mode": AutoresetMode.NEXT_STEP}  # type: ignore[misc]
    _fit = staticmethod(team_scenario)

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        num_envs: int = 1,
        *,
        autoreset: str | AutoresetMode = "next_step",
        **settings: Any,
    ) -> None:
        for name, here in (("num_worlds", "num_envs"), ("max_episode_steps", "horizon")):
            if name in settings:
                raise ScenarioError(f"{name}= is not known here: it is {here}=")
        self.num_envs = check_count("num_envs", num_envs, 1)
        mode = autoreset.name.lower() if isinstance(autoreset, AutoresetMode) else autoreset
        super().__init__(scenario, self.num_envs, autoreset=mode, **settings)
        self.autoreset_mode = AutoresetMode[self.batch.autoreset.upper()]
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_observation_space, self.single_action_space = self._spaces()
        self.observation_space: spaces.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[FloatArray, _Info]:
        """Start episodes as :meth:`posse.Batch.reset` does, and return the observations and infos of all worlds."""
        observations = self._start(seed, options)
        super().reset(seed=None if seed is None else int(seed))
        begun = mask_of(options or {}, self.num_envs).copy()
        terms = np.zeros((*self.batch.observation_shape[:2], len(self.batch.term_names)), np.float32)
        infos = self._own(self.batch._infos_of(np.zeros(self.num_envs), terms))
        return observations[:, self._rows], _with_masks(_zeroed(infos, begun), begun)

    def step(self, actions: Any) -> tuple[FloatArray, npt.NDArray[np.float64], BoolArray, BoolArray, _Info]:
        """Advance every world by one control step; errors are those of :meth:`posse.Batch.step`."""
        motions = as_motions("the array of actions", actions, self.action_space.shape, self._discrete)
        observations, rewards, terminated, truncated, infos = self.batch.step(motions.reshape(self.batch.action_shape))
        if self.render_mode == "human":
            self._draw()
        last, final = infos.pop("final_obs", None), {}
        infos, ended = self._own(infos), terminated | truncated
        if last is not None and ended.any():  # new episodes have begun at once
            rows = np.full(self.num_envs, None, dtype=object)
            for e in np.flatnonzero(ended):
                rows[e] = last[e, self._rows].copy()
            infos_then = _with_masks(_zeroed(infos, ended), ended)
            final = _with_masks({"final_obs": rows, "final_info": infos_then}, ended)
            infos = _zeroed(infos, ~ended)
            if "working" in infos:
                infos["working"] = self.batch.working[:, self._rows]
        infos = _with_masks(infos, np.ones(self.num_envs, np.bool_)) | final
        return observations[:, self._rows], rewards.mean(axis=1, dtype=np.float64), terminated, truncated, infos

    def _own(self, infos: _Info) -> _Info:
        """Return the agents' part of the batch's infos, in the types of Gymnasium's own vector environments."""
        found = {}
        for name, values in infos.items():
            values = values[:, self._rows] if values.ndim == 2 else values
            found[name] = values.astype(np.float64) if values.ndim == 1 and values.dtype == np.float32 else values
        return found

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """Draw every world, (H, W, 3) uint8 each; ``None`` in the mode "human", whose window every step draws."""
        drawn = [] if self.render_mode == "human" else [self._draw(world) for world in range(self.num_envs)]
        return tuple(frame for frame in drawn if frame is not None) or None


class SoloVectorEnv(TeamVectorEnv):
    """``posse/Solo-v0`` as a vector environment; see :class:`TeamVectorEnv` and `SoloEnv`."""

    _rows = 0
    _fit = staticmethod(solo_scenario)


def _zeroed(infos: _Info, mask: BoolArray) -> _Info:
    """Return infos with zeros where a mask is false."""
    return {name: np.where(mask, values.T, values.dtype.type(0)).T for name, values in infos.items()}


def _with_masks(infos: _Info, mask: BoolArray) -> _Info:
    """Return infos, each with a mask."""
    return infos | {f"_{name}": mask for name in infos}
