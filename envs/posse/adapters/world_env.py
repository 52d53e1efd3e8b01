"""Bases of the environments of one world: construction, state, rendering, end of the episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt

from posse.adapters.infos import flattened
from posse.adapters.single_world import RENDER_MODES, SingleWorld, frames_per_second
from posse.numeric import FloatArray
from posse.scenarios import Scenario
from posse.signals.observation.layout import ObservationLayout


class WorldEnv:
    """The part of an environment of one world that does not depend on its interface.

    Attributes:
        scenario: Scenario of the world.
        layout: Position of each field in an observation.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}

    def _open(self, scenario: Scenario, *, render_mode: str | None, **settings: Any) -> None:
        """Create the world; ``settings`` are the other arguments of :class:`SingleWorld`."""
        self.scenario = scenario
        self._world = SingleWorld(scenario, render_mode=render_mode, **settings)
        self.metadata = {  # type: ignore[misc]
            **type(self).metadata,
            "render_fps": frames_per_second(scenario),
        }
        self.render_mode = render_mode
        self.layout: ObservationLayout = self._world.batch.layout
        self._breakable = scenario.breaks > 0

    @property
    def state_layout(self) -> Any:
        """Names, units and ranges of what :meth:`state` returns."""
        return self._world.state_layout

    def state(self) -> FloatArray:
        """Return the full state of the world, (S,) float32.

        Raises:
            ResetNeeded: Before the first reset.
        """
        return self._world.state()

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the current state: (H, W, 3) uint8 in the mode "rgb_array".

        Raises:
            ResetNeeded: Before the first reset.
        """
        return self._world.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._world.close()


class OneAgentEnv(WorldEnv, gymnasium.Env[Any, Any]):
    """A Gymnasium environment of one world."""

    _flat_infos: bool

    def _begin(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start an episode and return the observations (rows, F)."""
        observations = self._world.reset(seed, options)
        gymnasium.Env.reset(self, seed=None if seed is None else int(seed))
        if self.render_mode == "human":
            self.render()
        return observations

    def _told(self, info: dict[str, Any]) -> dict[str, Any]:
        return flattened(info) if self._flat_infos else info

    def _end(self, over: int, info: dict[str, Any]) -> tuple[bool, bool, dict[str, Any]]:
        """Complete a step: add the metrics to ``info`` at the end of the episode, and draw.

        Returns:
            Whether the episode is terminated, whether it is truncated, and the info.
        """
        terminated = truncated = False
        if over:
            terminated, info["metrics"] = self._world.end()
            truncated = not terminated
        if self.render_mode == "human":
            self.render()
        return terminated, truncated, self._told(info)
