"""What all environments share: a batch, its seeds, and drawing; and what those of one world share."""

from __future__ import annotations

import functools
import importlib
import secrets
from collections.abc import Mapping
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

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

    def _of_team(self, motions: FloatArray) -> FloatArray:
        """Return the actions of all trackers (E, N, 2 + m), given those of the agents."""
        return motions.reshape(self.batch.action_shape)

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

    def _open(self, scenario: Scenario, num_worlds: int = 1, **settings: Any) -> None:
        super()._open(scenario, num_worlds, num_threads=1, autoreset="disabled", **settings)
        self._infos = Infos(self.scenario, 0.0)
        self._breakable = self.scenario.breaks > 0
        self._results: tuple[Results, Results] | None = None

    def __getstate__(self) -> dict[str, Any]:
        state = {**super().__getstate__(), "_results": None}
        state.pop("state_layout", None)
        return state

    @functools.cached_property
    def state_layout(self) -> StateLayout:
        """Names, units and ranges of what :meth:`state` returns."""
        return StateLayout(self.scenario)

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
        return super()._start(seed, options)

    def _advance(self, actions: FloatArray) -> Results:
        """Perform a control step by valid actions; return its results, which the next step overwrites.

        Observations are (rows, F), rewards (rows,) and terms (rows, K), the others as of a batch.
        """
        if self._results is None:
            new = self.batch._new_results()
            first = new.observations[0], new.rewards[0], new.terms[0]
            self._results = new, Results(*first, new.scores, new.terminated, new.truncated)
        results, own = self._results
        self.batch._advance(actions, results)
        if self.render_mode == "human":
            self._draw(0)
        return own

    def _info(self, score: float, terms: Any = None) -> dict[str, Any]:
        """Return an info, with every metric at the end of the episode."""
        if not self.batch._over:
            return self._infos.build(score, terms)
        return self._infos.build(score, terms, {name: float(v[0]) for name, v in self.batch.metrics().items()})
