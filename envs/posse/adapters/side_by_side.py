"""A vector environment whose worlds are of several scenarios: those of a family."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from posse.adapters.vector_env import SoloVectorEnv, TeamVectorEnv
from posse.engine.arguments import real_numbers
from posse.scenarios import Family, Scenario, ScenarioError
from posse.scenarios.family import scenario_or_family, shares

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
        ends = np.cumsum([part.num_envs for part in self.parts])
        self._slices = [slice(end - part.num_envs, end) for end, part in zip(ends, self.parts, strict=True)]
        self.num_envs = int(ends[-1])
        self.single_observation_space = _union([part.single_observation_space for part in self.parts])
        self.single_action_space = self.parts[0].single_action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all worlds, or in those of ``options["reset_mask"]``."""
        found = [part.reset(seed=seed, options=self._options(options, one)) for one, part in self._each()]
        return np.concatenate([observations for observations, _ in found]), self._infos([infos for _, infos in found])

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Advance every world by one control step."""
        whole = real_numbers("the array of actions", actions, self.action_space.shape)
        found = [part.step(whole[one]) for one, part in self._each()]
        *arrays, infos = zip(*found, strict=True)
        observations, rewards, terminated, truncated = (np.concatenate(each) for each in arrays)
        return observations, rewards, terminated, truncated, self._infos(list(infos))

    def render(self) -> Any:
        """Draw every world; in the mode "human", the first one."""
        shown = self.parts[:1] if self.render_mode == "human" else self.parts
        return tuple(frame for part in shown for frame in part.render() or ()) or None

    def close(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        for part in self.parts:
            part.close(**kwargs)

    def _each(self) -> list[tuple[slice, TeamVectorEnv]]:
        return list(zip(self._slices, self.parts, strict=True))

    def _options(self, options: dict[str, Any] | None, one: slice) -> dict[str, Any] | None:
        if options is None or options.get("reset_mask") is None:
            return options
        mask = np.asarray(options["reset_mask"])
        if mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask has shape {mask.shape}, wanted ({self.num_envs},)")
        return {**options, "reset_mask": mask[one]}

    def _infos(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        return _joined(infos, [part.num_envs for part in self.parts])


def team_vector(scenario: str | Scenario | Family = "constant", num_envs: int = 1, **settings: Any) -> VectorEnv:
    """Return ``posse/Team-v0`` as a vector environment, also of a family; see :class:`TeamVectorEnv`."""
    return _vector(TeamVectorEnv, scenario, num_envs, settings)


def solo_vector(scenario: str | Scenario | Family = "constant", num_envs: int = 1, **settings: Any) -> VectorEnv:
    """Return ``posse/Solo-v0`` as a vector environment, also of a family; see :class:`SoloVectorEnv`."""
    return _vector(SoloVectorEnv, scenario, num_envs, settings)


def _vector(
    kind: type[TeamVectorEnv], scenario: str | Scenario | Family, num_envs: int, settings: dict[str, Any]
) -> VectorEnv:
    given = scenario_or_family(scenario) if isinstance(scenario, (str, Family)) else scenario
    if not isinstance(given, Family):
        return kind(scenario, num_envs, **settings)  # type: ignore[arg-type]
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
