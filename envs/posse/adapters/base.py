"""What all environments share: a batch, its seeds, and drawing; and what those of one world share."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from posse.adapters.actions import box, single_action_space
from posse.engine.arguments import check_choice, check_count, mask_of, options_of
from posse.engine.batch import Batch, of_batch
from posse.engine.opponent import TargetPolicy, batch
from posse.numeric import FloatArray
from posse.rendering import RENDER_MODES
from posse.scenarios import Scenario, ScenarioError, get_scenario
from posse.signals.layout import ObservationLayout, StateLayout

_POSES: Final = {"tracker_pose": 3, "target_pose": 2}
"""Options of a reset, and how many axes they have where each world has its own."""


def joined(arrays: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Return the arrays of several batches one after another; that of a single one is not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


class BatchEnv:
    """An environment on a batch, or on several side by side.

    Args:
        parts: For each batch its scenario, or the name, and its worlds.
        discrete_actions: Whether actions are numbers of :data:`posse.adapters.actions.MOTIONS`.
        render_mode: ``"human"`` (a window, drawn at each step), ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        first_world: Index of the environment's first world within the seed.
        target_policy: Moves the target (:class:`posse.TargetPolicy`); default: its scripted motion.
        settings: Further arguments of :class:`posse.Batch`, or any field of :class:`posse.Scenario`.

    Attributes:
        batches: The worlds.
        batch: The first batch, which is usually the only one.
        scenario: Its scenario.
        layout: Position of each field in an observation.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}
    closed: bool = False
    _rows: int | slice = slice(None)
    """The robots that an agent moves, as rows of the batch: one, or all."""
    _fit: Callable[..., Scenario] = staticmethod(get_scenario)
    """Returns the scenario of a name, or a scenario, and overrides."""

    def __init__(
        self,
        parts: Iterable[tuple[str | Scenario, range]],
        *,
        discrete_actions: bool = False,
        render_mode: str | None = None,
        seed: int | None = None,
        first_world: int = 0,
        target_policy: TargetPolicy | None = None,
        **settings: Any,
    ) -> None:
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
        first_world, own = check_count("first_world", first_world, 0), of_batch(settings)
        own |= {"seed": 0 if seed is None else seed, "target_policy": target_policy}
        self.batches = [
            self._make(self._fit(scenario, **settings), len(worlds), first_world=first_world + worlds.start, **own)
            for scenario, worlds in parts
        ]
        shapes = {batch.observation_shape[1:] for batch in self.batches}
        if len(shapes) > 1:
            raise ScenarioError(
                f"worlds side by side need observations of one length, not {sorted(shapes)}: take posse/Solo-v0, or "
                "give the family one num_trackers"
            )
        self.batch = self.batches[0]
        self.scenario: Scenario = self.batch.scenario
        self.layout: ObservationLayout = self.batch.layout
        self.render_mode = render_mode
        fps = max(1, round(1 / self.scenario.control_step))  # real time
        self.metadata = {**type(self).metadata, "render_fps": fps}  # type: ignore[misc]
        self._discrete = discrete_actions
        self._seeded = seed is not None
        self._renderers: dict[int, Any] = {}

    def _make(self, scenario: Scenario, num_worlds: int, target_policy: TargetPolicy | None, **settings: Any) -> Batch:
        """Return the worlds."""
        return batch(scenario, num_worlds, target_policy=target_policy, **settings)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderers": {}}

    def _spaces(self) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Return the spaces of an agent's observations and actions."""
        scenario = self.scenario.replace(message_size=self.batch.action_shape[2] - 2)
        low, high = np.stack([batch.layout.bounds() for batch in self.batches], axis=1)  # (batches, F) each
        observation, action = box(low.min(axis=0), high.max(axis=0)), single_action_space(scenario, self._discrete)
        if isinstance(self._rows, int):
            return observation, action
        return batch_space(observation, scenario.num_trackers), batch_space(action, scenario.num_trackers)

    def _start(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start episodes, of an arbitrary seed if none was ever given, and return the observations (E, rows, F)."""
        if seed is None and not self._seeded:
            seed = secrets.randbits(32)
        given = options_of(options)
        masks = self._split(mask_of(given, sum(batch.num_worlds for batch in self.batches)))
        parts = [{**given, "reset_mask": mask} for mask in masks]
        for name, axes in _POSES.items() if len(parts) > 1 else ():
            if np.ndim(given.get(name, 0)) == axes:  # of every world
                for part, poses in zip(parts, self._split(np.asarray(given[name])), strict=True):
                    part[name] = poses
        # Of several batches, which are restored if one refuses; a single one restores itself.
        before = [{**vars(batch), "arrays": batch.arrays.copy()} for batch in self.batches if len(parts) > 1]
        try:
            observations = [
                batch.reset(seed=seed, options=part) for batch, part in zip(self.batches, parts, strict=True)
            ]
        except BaseException:
            for batch, old in zip(self.batches, before, strict=False):
                batch.arrays.write(old.pop("arrays"))
                vars(batch).update(old)
            raise
        self._seeded = True
        self._show()
        return joined(observations)

    def _split(self, values: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """Return each batch's part of values (E, ...) of all worlds."""
        return np.split(values, np.cumsum([batch.num_worlds for batch in self.batches[:-1]]))

    def _show(self) -> None:
        """Draw the first world in the window, in the mode "human"."""
        if self.render_mode == "human":
            self._draw()

    def _draw(self, number: int = 0, world: int = 0) -> npt.NDArray[np.uint8] | None:
        """Draw the current state of a world of a batch: (H, W, 3) uint8 in the mode "rgb_array", or in a window."""
        batch = self.batches[number]
        batch.check_started("render")
        if self.render_mode is None:
            return None
        if number not in self._renderers:
            from posse.rendering.renderer import Renderer  # imports pygame

            self._renderers[number] = Renderer(batch.scenario, self.render_mode)
        picture: npt.NDArray[np.uint8] | None = self._renderers[number].draw(batch, world=world)
        return picture

    def close(self, **kwargs: Any) -> None:
        """Close the window, if there is one; may be called again."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()
        self.closed = True


class WorldEnv(BatchEnv):
    """An environment of one world, but for the interface of its library."""

    def __init__(self, scenario: str | Scenario, **settings: Any) -> None:
        for name in ("autoreset", "num_threads"):
            if name in settings:
                raise TypeError(f"unexpected keyword argument {name!r}: an environment of one world has none")
        super().__init__([(scenario, range(1))], autoreset="disabled", num_threads=1, **settings)
        self._no_info: dict[str, Any] = dict.fromkeys(self.batch._info, 0.0)
        self._rewards = self.batch._rewards
        self._breakable = self.scenario.breaks > 0
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
        """Draw the current state: (H, W, 3) uint8 in the mode "rgb_array", a window in "human"."""
        return self._draw()

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
        if self.render_mode is not None:
            self._show()

    def _common_info(self) -> dict[str, Any]:
        """Return the info of the last step or reset, without reward terms."""
        info = self._no_info.copy()
        info["score"] = self._own.scores.item()
        if self.batch._over:
            info.update((f"metrics/{name}", float(values[0])) for name, values in self.batch.metrics().items())
        return info
