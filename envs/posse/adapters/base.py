"""What all environments share: a batch, its seeds, and drawing; and what those of one world share."""

import secrets
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from posse.adapters.actions import box, single_action_space
from posse.engine.arguments import options_of
from posse.engine.batch import Batch, of_batch
from posse.engine.opponent import TargetPolicy, batch
from posse.numeric import FloatArray
from posse.rendering import RENDER_MODES
from posse.scenarios import Scenario, ScenarioError, get_scenario
from posse.scenarios.setting import check_choice
from posse.signals.layout import ObservationLayout, StateLayout


class BatchEnv:
    """An environment on a batch.

    Args:
        scenario: Name of a scenario, or a scenario.
        num_worlds: E.
        discrete_actions: Whether actions are numbers of :data:`posse.adapters.actions.MOTIONS`.
        render_mode: ``"human"`` (a window, drawn at each step), ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        target_policy: Moves the target (:class:`posse.TargetPolicy`); default: its scripted motion.
        settings: Further arguments of :class:`posse.Batch`, or any field of :class:`posse.Scenario`.

    Attributes:
        batch: The worlds.
        scenario: Their scenario.
        layout: Position of each field in an observation.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}
    _rows: int | slice = slice(None)
    """The robots that an agent moves, as rows of the batch: one, or all."""
    _fit: Callable[..., Scenario] = staticmethod(get_scenario)
    """Returns the scenario of a name, or a scenario, and overrides."""
    _make: Callable[..., Batch] = staticmethod(batch)
    """Returns the worlds."""
    _renderer: Any = None  # here, since gymnasium before 1.3 closes what could not be made

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int,
        *,
        discrete_actions: bool = False,
        render_mode: str | None = None,
        seed: int | None = None,
        target_policy: TargetPolicy | None = None,
        **settings: Any,
    ) -> None:
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
        own = of_batch(settings) | {"seed": 0 if seed is None else seed, "target_policy": target_policy}
        self.batch = self._make(self._fit(scenario, **settings), num_worlds, **own)
        self.scenario: Scenario = self.batch.scenario
        self.layout: ObservationLayout = self.batch.layout
        self.render_mode = render_mode
        fps = max(1, round(1 / self.scenario.control_step))  # real time
        self.metadata = {**type(self).metadata, "render_fps": fps}  # type: ignore[misc]
        self._discrete = discrete_actions
        self._seeded = seed is not None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}

    def _spaces(self) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Return the spaces of an agent's observations and actions."""
        observation = box(*self.layout.bounds())
        action = single_action_space(self.batch.action_shape[2] - 2, self._discrete)
        if isinstance(self._rows, int):
            return observation, action
        return batch_space(observation, self.scenario.num_trackers), batch_space(action, self.scenario.num_trackers)

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start episodes, of an arbitrary seed if none was ever given, and return the observations (E, rows, F)."""
        if seed is None and not self._seeded:
            seed = secrets.randbits(32)
        observations = self.batch.reset(seed=seed, options=options)
        self._seeded = True
        if self.render_mode == "human":
            self._draw()
        return observations

    def _draw(self, world: int = 0) -> npt.NDArray[np.uint8] | None:
        """Draw the current state of a world: (H, W, 3) uint8 in the mode "rgb_array", or in a window."""
        self.batch.check_started("render")
        if self.render_mode is None:
            return None
        if self._renderer is None:
            from posse.rendering.renderer import Renderer  # imports pygame

            self._renderer = Renderer(self.scenario, self.render_mode)
        picture: npt.NDArray[np.uint8] | None = self._renderer.draw(self.batch, world)
        return picture

    def close(self, **kwargs: Any) -> None:
        """Close the window, if there is one; may be called again."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer, self.closed = None, True


class WorldEnv(BatchEnv):
    """An environment of one world; a subclass adds the interface of its library."""

    def __init__(self, scenario: str | Scenario, **settings: Any) -> None:
        for name in ("num_worlds", "autoreset", "num_threads"):
            if name in settings:
                raise ScenarioError(f"{name}= is for many worlds: use posse.batch or gymnasium.make_vec")
        super().__init__(scenario, 1, autoreset="disabled", num_threads=1, **settings)
        self._no_info: dict[str, Any] = dict.fromkeys(self.batch._info, 0.0)
        self.state_layout = StateLayout(self.scenario)
        self._allocate()

    def _allocate(self) -> None:
        """Allocate the results of a step, which the next one overwrites, and find the agents' part of them."""
        self._results, rows = self.batch._new_results(), self._rows
        self._own = self._results._replace(
            observations=self._results.observations[0, rows],  # (..., F)
            rewards=self._results.rewards[0, rows, ...].reshape(-1),  # (rows,)
            terms=self._results.terms[0, rows].T,  # (K, ...)
        )

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._allocate()

    def state(self) -> FloatArray:
        """Return the full state of the world, (S,) float32."""
        self.batch.check_started("state")
        state: FloatArray = self.state_layout.vector(self.batch.arrays)[0]
        return state

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the current state, (H, W, 3) uint8; ``None`` in the mode "human", whose window every step draws."""
        return None if self.render_mode == "human" else self._draw()

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start an episode and return the agents' observations (..., F)."""
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
            self._draw()

    def _common_info(self) -> dict[str, Any]:
        """Return the info of the last step or reset, without reward terms."""
        info = self._no_info.copy()
        info["score"] = self._own.scores.item()
        if self.batch._over:
            info.update((f"metrics/{name}", float(values[0])) for name, values in self.batch.metrics().items())
        return info
