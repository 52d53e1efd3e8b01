"""Gymnasium vector environments: many worlds, stepped by one call; those of a family side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from posse.adapters.actions import as_motions
from posse.adapters.base import BatchEnv
from posse.adapters.gymnasium_env import solo_scenario, team_scenario
from posse.engine.arguments import in_box, options_of, real_numbers
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Family, Scenario, ScenarioError
from posse.scenarios.family import scenario_or_family, shares

_Info = dict[str, Any]
_Rewards = npt.NDArray[np.float64]


class TeamVectorEnv(BatchEnv, VectorEnv[FloatArray, Any, npt.NDArray[Any]]):
    """``posse/Team-v0`` as a vector environment: E worlds, one agent controls the team in each.

    As :class:`posse.adapters.gymnasium_env.TeamEnv`, with a leading axis E.
    World i is world ``first_world + i`` of the seed, so ``reset(seed=s)`` gives E different worlds.
    Infos have the form of ``gymnasium.vector.SyncVectorEnv``: for each entry an array over the
    worlds, and under ``"_" + name`` a mask of the worlds that have it; names and zeros as in
    :class:`TeamEnv`.

    Args:
        scenario: Name of a scenario, or a scenario.
        num_envs: E, at least 1.
        autoreset: Behaviour at the end of an episode, as for :func:`posse.batch`. ``"next_step"``: the
            next step starts a new one and ignores its action; ``"same_step"``: a new one starts at
            once, the last observation is ``info["final_obs"]``, the last info ``info["final_info"]``;
            ``"disabled"``: the caller resets, with ``options={"reset_mask": mask}``.
        num_threads: Threads that step the worlds; never changes a result.
        settings: As for :class:`TeamEnv`.

    Raises:
        ScenarioError: As for :class:`posse.adapters.gymnasium_env.TeamEnv`; or an unknown mode of autoreset.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        **BatchEnv.metadata,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    _fit = staticmethod(team_scenario)

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        num_envs: int = 1,
        *,
        autoreset: str = "next_step",
        num_threads: int | None = None,
        **settings: Any,
    ) -> None:
        super().__init__(scenario, num_envs, autoreset=autoreset, num_threads=num_threads, **settings)
        self.num_envs = self.batch.num_worlds
        self.autoreset_mode = AutoresetMode[self.batch.autoreset.upper()]
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_observation_space, self.single_action_space = self._spaces()
        self.observation_space: spaces.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[FloatArray, _Info]:
        """Start episodes as :meth:`posse.Batch.reset` does, and return the observations and infos of all worlds."""
        observations = self._start(seed, options)
        super().reset(seed=None if seed is None else int(seed))
        mask = options_of(options).get("reset_mask")
        begun = np.ones(self.num_envs, np.bool_) if mask is None else np.array(mask)
        terms = np.zeros((*self.batch.observation_shape[:2], len(self.batch.term_names)), np.float32)
        infos = self._own(self.batch._infos_of(np.zeros(self.num_envs), terms))
        return observations[:, self._rows], _with_masks(_zeroed(infos, begun), begun)

    def step(self, actions: Any) -> tuple[FloatArray, _Rewards, BoolArray, BoolArray, _Info]:
        """Advance every world by one control step.

        Raises:
            ResetNeeded: Before the first reset, or after an end with autoreset ``"disabled"``.
            ValueError: Actions out of their space; nothing is changed.
        """
        observations, rewards, terminated, truncated, found = self.batch.step(self._read(actions))
        self._show()
        ended, last = terminated | truncated, found.pop("final_obs", None)
        infos, more = self._own(found), {}
        if last is not None and ended.any():
            each = np.full(self.num_envs, None, dtype=object)
            for e in np.flatnonzero(ended):
                each[e] = last[e, self._rows].copy()
            final = _with_masks(_zeroed(infos, ended), ended)
            more = _with_masks({"final_obs": each, "final_info": final}, ended)
            infos = _zeroed(infos, ~ended)
            if "working" in infos:
                infos["working"] = self.batch.working[:, self._rows]
        infos = _with_masks(infos, np.ones(self.num_envs, np.bool_)) | more
        own = rewards.mean(axis=1, dtype=np.float64)
        return observations[:, self._rows], own, terminated, truncated, infos

    def _read(self, actions: Any) -> FloatArray:
        """Return actions in the shape of the batch; their range is not checked."""
        motions = as_motions("the array of actions", actions, self.action_space.shape, self._discrete)
        return motions.reshape(self.batch.action_shape)

    def _own(self, infos: _Info) -> _Info:
        """Return the agents' part of a batch's infos, in the types of Gymnasium's own vector environments."""
        parts = {name: values[:, self._rows] if values.ndim == 2 else values for name, values in infos.items()}
        return {k: v.astype(np.float64) if v.ndim == 1 and v.dtype == np.float32 else v for k, v in parts.items()}

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """Draw every world, (H, W, 3) uint8 each; in the mode "human", world 0 in a window."""
        drawn = tuple(self._draw(e) for e in range(1 if self.render_mode == "human" else self.num_envs))
        return tuple(frame for frame in drawn if frame is not None) or None

    def close(self, **kwargs: Any) -> None:
        """Close the window, if there is one; may be called again."""
        BatchEnv.close(self)


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


DRAWN = 16
"""Drawn scenarios of a family that are played side by side, where there are as many worlds."""


class FamilyVectorEnv(VectorEnv[Any, Any, Any]):
    """Vector environments side by side, as one: of each a share of the E worlds.

    Its spaces are the least that hold those of all parts; everything else is as in :class:`TeamVectorEnv`.

    Args:
        parts: The environments, which have observations and actions of equal length.

    Raises:
        ScenarioError: Observations of different lengths, as of teams of different sizes in ``posse/Team-v0``.
    """

    def __init__(self, parts: Sequence[TeamVectorEnv]) -> None:
        self.parts = tuple(parts)
        self.metadata = self.parts[0].metadata
        self.render_mode = self.parts[0].render_mode
        self._sizes = [part.num_envs for part in self.parts]
        self.num_envs = sum(self._sizes)
        self.single_observation_space = _union([part.single_observation_space for part in self.parts])
        self.single_action_space = self.parts[0].single_action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all worlds, or in those of ``options["reset_mask"]``."""
        given = options_of(options)
        mask = given.get("reset_mask")
        mask = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        if mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask has shape {mask.shape}, wanted ({self.num_envs},)")
        parts = zip(self.parts, self._split(mask), strict=True)
        found = [part.reset(seed=seed, options={**given, "reset_mask": chosen}) for part, chosen in parts]
        observations, infos = zip(*found, strict=True)
        return np.concatenate(observations), _joined(infos, self._sizes)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Advance every world by one control step."""
        split = self._split(real_numbers("the array of actions", actions, self.action_space.shape))
        for part, share in zip(self.parts, split, strict=True):  # before any world advances
            part.batch.check_running()
            in_box(part._read(share), part.batch.clip_actions)
        found = [part.step(share) for part, share in zip(self.parts, split, strict=True)]
        *arrays, infos = zip(*found, strict=True)
        observations, rewards, terminated, truncated = map(np.concatenate, arrays)
        return observations, rewards, terminated, truncated, _joined(infos, self._sizes)

    def _split(self, values: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """Return the part of each environment in values of all worlds."""
        return np.split(values, np.cumsum(self._sizes)[:-1])

    def render(self) -> Any:
        """Draw every world; in the mode "human", the first one."""
        shown = self.parts[:1] if self.render_mode == "human" else self.parts
        return tuple(frame for part in shown for frame in part.render() or ()) or None

    def close(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        for part in self.parts:
            part.close(**kwargs)


def team_vector(scenario: str | Scenario | Family = "constant", num_envs: int = 1, **settings: Any) -> VectorEnv:
    """Return ``posse/Team-v0`` as a vector environment, also of a family; see :class:`TeamVectorEnv`."""
    return _vector(TeamVectorEnv, scenario, num_envs, settings)


def solo_vector(scenario: str | Scenario | Family = "constant", num_envs: int = 1, **settings: Any) -> VectorEnv:
    """Return ``posse/Solo-v0`` as a vector environment, also of a family; see :class:`SoloVectorEnv`."""
    return _vector(SoloVectorEnv, scenario, num_envs, settings)


def _vector(
    kind: type[TeamVectorEnv], scenario: str | Scenario | Family, num_envs: int, settings: dict[str, Any]
) -> VectorEnv:
    given = scenario_or_family(scenario)
    if isinstance(given, Scenario):
        return kind(given, num_envs, **settings)
    kind(given.base, num_envs, **settings).close()  # raises what is invalid
    seed, split, first = settings.get("seed"), settings.get("split", "train"), settings.pop("first_world", 0)
    parts = shares(given, num_envs, min(DRAWN, num_envs), seed or 0, split)
    return FamilyVectorEnv([kind(one, len(part), first_world=first + part.start, **settings) for one, part in parts])


def _union(parts: Sequence[spaces.Space[Any]]) -> spaces.Box:
    boxes = [part for part in parts if isinstance(part, spaces.Box)]
    shapes = {box.shape for box in boxes}
    if len(shapes) > 1:
        raise ScenarioError(
            f"worlds side by side need observations of one length, not {sorted(shapes)}: take posse/Solo-v0, or give "
            "the family one num_trackers"
        )
    low, high = np.min([box.low for box in boxes], axis=0), np.max([box.high for box in boxes], axis=0)
    return spaces.Box(low, high, dtype=boxes[0].dtype)


def _joined(infos: Sequence[dict[str, Any]], sizes: Sequence[int]) -> dict[str, Any]:
    """Return infos of all worlds; where a part lacks an entry, its worlds have zeros, or ``None`` as objects."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(name for info in infos for name in info):
        parts = [info.get(name) for info in infos]
        example = next(part for part in parts if part is not None)
        if isinstance(example, dict):
            found[name] = _joined([part or {} for part in parts], sizes)
            continue
        fill = None if example.dtype == object else example.dtype.type(0)
        found[name] = np.concatenate(
            [
                np.full((size, *example.shape[1:]), fill, example.dtype) if part is None else part
                for part, size in zip(parts, sizes, strict=True)
            ]
        )
    return found
