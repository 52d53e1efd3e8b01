"""What all environments share: a batch, its seeds, and drawing; and what those of one world share."""

from __future__ import annotations

import importlib
import secrets
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from posse.adapters.actions import Rows
from posse.engine.arguments import check_choice, options_of
from posse.engine.infos import Infos
from posse.engine.kernels import Results
from posse.engine.opponent import batch_with
from posse.numeric import FloatArray
from posse.scenarios import Scenario, ScenarioError
from posse.signals.global_state import StateLayout
from posse.signals.layout import ObservationLayout

RENDER_MODES: Final = ("human", "rgb_array")


def with_horizon(overrides: dict[str, Any], name: str, steps: int | None) -> dict[str, Any]:
    """Return overrides with the episode's length under a library's name for it; ScenarioError for both names."""
    if steps is None:
        return overrides
    if "horizon" in overrides:
        raise ScenarioError(f"{name} and horizon mean the same: give one of them")
    return {**overrides, "horizon": steps}


class BatchEnv:
    """An environment on a batch.

    Attributes:
        scenario: Scenario of the worlds.
        batch: The worlds.
        layout: Position of each field in an observation.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}

    def _open(
        self,
        scenario: Scenario,
        num_worlds: int,
        *,
        render_mode: str | None,
        seed: int | None,
        target_policy: Any = None,
        **settings: Any,
    ) -> None:
        """Create the worlds; ``settings`` are further arguments of :class:`posse.Batch`."""
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
        self.batch = batch_with(scenario, num_worlds, target_policy, seed=0 if seed is None else seed, **settings)
        self.scenario: Scenario = self.batch.scenario
        self.layout: ObservationLayout = self.batch.layout
        self.render_mode = render_mode
        fps = max(1, round(1 / self.scenario.control_step))  # real time
        self.metadata = {**type(self).metadata, "render_fps": fps}  # type: ignore[misc]
        self._seeded = seed is not None
        self._renderer: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start episodes, of an arbitrary seed if none was ever given, and return the observations (E, rows, F)."""
        if seed is None and not self._seeded:
            seed = secrets.randbits(32)
        observations = self.batch.reset(seed=seed, options=options)
        self._seeded = True
        self._show()
        return observations

    def _show(self) -> None:
        """Draw the first world in the window, in the mode "human"."""
        if self.render_mode == "human":
            self._draw(0)

    def _draw(self, world: int) -> npt.NDArray[np.uint8] | None:
        """Draw the current state of a world: (H, W, 3) uint8 in the mode "rgb_array", a window in "human"."""
        self.batch.check_started("render")
        if self.render_mode is None:
            return None
        if self._renderer is None:  # imports pygame
            renderer = importlib.import_module("posse.rendering.renderer").Renderer
            self._renderer = renderer(self.scenario, self.render_mode)
        picture: npt.NDArray[np.uint8] | None = self._renderer.draw(self.batch, world=world)
        return picture

    def close(self) -> None:
        """Close the window, if there is one; may be called again."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class WorldEnv(BatchEnv):
    """An environment of one world, but for the interface of its library."""

    _rows: Rows = slice(None)

    def _open(self, scenario: Scenario, num_worlds: int = 1, **settings: Any) -> None:
        super()._open(scenario, num_worlds, num_threads=1, autoreset="disabled", **settings)
        self._infos = Infos(self.scenario, 0.0)
        self._breakable = self.scenario.breaks > 0

    def __getstate__(self) -> dict[str, Any]:
        return {
            k: v
            for k, v in super().__getstate__().items()
            if not isinstance(getattr(type(self), k, 0), cached_property)
        }

    @cached_property
    def state_layout(self) -> StateLayout:
        """Names, units and ranges of what :meth:`state` returns."""
        return StateLayout(self.scenario)

    @cached_property
    def _results(self) -> Results:
        """The results of a step, which the next one overwrites."""
        return self.batch._new_results()

    @cached_property
    def _own(self) -> Results:
        """The agents' observations (..., F), rewards (rows,) and terms (K, ...) in the results."""
        results, rows = self._results, self._rows
        return results._replace(
            observations=results.observations[0, rows],
            rewards=results.rewards[0, rows, ...].reshape(-1),
            terms=results.terms[0, rows].T,
        )

    def state(self) -> FloatArray:
        """Return the full state of the world, (S,) float32."""
        self.batch.check_started("state")
        state: FloatArray = self.state_layout.vector(self.batch.arrays)[0]
        return state

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the current state: (H, W, 3) uint8 in the mode "rgb_array", a window in "human"."""
        return self._draw(0)

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        if "reset_mask" in options_of(options):
            raise ValueError("unknown option 'reset_mask': an environment of one world has none")
        observations: FloatArray = super()._start(seed, options)[0, self._rows]
        for array in self._results[2:]:
            array[...] = 0
        return observations

    def _advance(self, actions: FloatArray) -> None:
        """Perform a control step by valid actions."""
        self.batch._advance(actions, self._results)
        if self.render_mode == "human":
            self._draw(0)

    def _metrics(self) -> dict[str, float] | None:
        """Return every metric of the episode at its end, ``None`` before."""
        return {name: float(v[0]) for name, v in self.batch.metrics().items()} if self.batch._over else None
