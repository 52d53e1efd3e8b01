"""Base of the environments of one world: construction, state, rendering, start and end of the episode."""

from __future__ import annotations

import functools
import importlib
import secrets
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.engine.arguments import check_choice, options_of
from posse.engine.infos import Infos
from posse.engine.kernels import Results
from posse.engine.opponent import batch_with
from posse.numeric import FloatArray
from posse.scenarios import Scenario, ScenarioError
from posse.signals.global_state import StateLayout
from posse.signals.layout import ObservationLayout

RENDER_MODES: Final = ("human", "rgb_array")


class WorldEnv:
    """A batch of one world, and the part of an environment that does not depend on its interface.

    Attributes:
        scenario: Scenario of the world.
        batch: The world.
        layout: Position of each field in an observation.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}

    def _open(
        self,
        scenario: Scenario,
        *,
        render_mode: str | None = None,
        seed: int | None = None,
        target_policy: Any = None,
        **settings: Any,
    ) -> None:
        """Create the world; ``settings`` are further arguments of :class:`posse.Batch`."""
        check_render_mode(render_mode)
        first_seed = 0 if seed is None else seed
        self.batch = batch_with(scenario, 1, target_policy, seed=first_seed, num_threads=1, **settings)
        self.scenario: Scenario = self.batch.scenario
        self.layout: ObservationLayout = self.batch.layout
        self.render_mode = render_mode
        fps = max(1, round(1 / scenario.control_step))  # real time
        self.metadata = {**type(self).metadata, "render_fps": fps}  # type: ignore[misc]
        self._seeded = seed is not None
        self._started = self._running = False
        self._renderer: Any = None
        self._infos = Infos(self.scenario, 0.0)
        self._breakable = self.scenario.breaks > 0
        self._prepare()

    def _prepare(self) -> None:
        """Create the arrays that each step overwrites, and views: creating one takes longer than reading it."""
        rows = self.batch.observation_shape[:2]
        shapes = self.batch.observation_shape, rows, (*rows, len(self.batch.term_names))
        observations, rewards, terms = (np.zeros(shape, np.float32) for shape in shapes)
        self._results = Results(observations, rewards, terms, np.zeros((2, 1), np.bool_))
        self._observations, self._rewards, self._terms = observations[0], rewards[0], terms[0]
        self._score: Callable[[], float] = self.batch.worlds["score"].item

    def __getstate__(self) -> dict[str, Any]:
        dropped = {"_results", "_observations", "_rewards", "_terms", "_score", "state_layout"}
        return {**{k: v for k, v in self.__dict__.items() if k not in dropped}, "_renderer": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()

    @functools.cached_property
    def state_layout(self) -> StateLayout:
        """Names, units and ranges of what :meth:`state` returns."""
        return StateLayout(self.scenario)

    def state(self) -> FloatArray:
        """Return the full state of the world, (S,) float32."""
        self._check_started("state")
        state: FloatArray = self.state_layout.vector(self.batch.arrays)[0]
        return state

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the current state: (H, W, 3) uint8 in the mode "rgb_array", a window in "human"."""
        self._check_started("render")
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = new_renderer(self.scenario, self.render_mode)
        picture: npt.NDArray[np.uint8] | None = self._renderer.draw(self.batch)
        return picture

    def close(self) -> None:
        """Close the window, if there is one; may be called again."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start an episode and return the observations (rows, F)."""
        if "reset_mask" in options_of(options):
            raise ValueError("unknown option 'reset_mask': an environment of one world has none")
        if seed is None and not self._seeded:
            seed = secrets.randbits(32)
        observations = self.batch.reset(seed=seed, options=options)
        self._running = self._seeded = self._started = True
        if self.render_mode == "human":
            self.render()
        first: FloatArray = observations[0]
        return first

    def _advance(self, actions: FloatArray) -> tuple[bool, bool]:
        """Perform a control step; return whether the episode is terminated, and truncated.

        The next step overwrites ``_observations`` (rows, F), ``_rewards`` (rows,) and ``_terms`` (rows, K).
        """
        terminated = truncated = False
        if self.batch._advance(actions, self._results):
            terminated, truncated = self._results.flags[:, 0].tolist()
            self._running = False
        if self.render_mode == "human":
            self.render()
        return terminated, truncated

    def _last_metrics(self) -> dict[str, float] | None:
        """Return every metric by name at the end of the episode; before, None."""
        if self._running:
            return None
        return {name: float(value[0]) for name, value in self.batch.metrics().items()}

    def _check_started(self, what: str) -> None:
        if not self._started:
            raise ResetNeeded(f"{what} before reset: call reset() first")

    def _check_running(self) -> None:
        """Raise ResetNeeded before the first reset, or after the end of the episode."""
        if not self._running:
            self._check_started("step")
            raise ResetNeeded("step after the end of the episode: call reset() first")


def new_renderer(scenario: Scenario, render_mode: str) -> Any:
    """Return a renderer; imports pygame lazily."""
    return importlib.import_module("posse.rendering.renderer").Renderer(scenario, render_mode)


def check_render_mode(render_mode: str | None) -> None:
    """Raise ScenarioError for an unknown render mode."""
    if render_mode is not None:
        check_choice("render_mode", render_mode, RENDER_MODES)


def with_horizon(overrides: dict[str, Any], **alias: int | None) -> dict[str, Any]:
    """Return overrides with the episode's length under a library's name for it; ScenarioError for both names."""
    ((name, steps),) = alias.items()
    if steps is None:
        return overrides
    if "horizon" in overrides:
        raise ScenarioError(f"{name} and horizon mean the same: give one of them")
    return {**overrides, "horizon": steps}
