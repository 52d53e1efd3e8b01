"""Shared base of the single-world environments: seeds, end of episode, state, rendering."""

from __future__ import annotations

import importlib
import secrets
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.adapters.actions import ActionReader, agent_names
from posse.engine.arguments import options_of
from posse.engine.batch import Batch
from posse.engine.paired_batch import TargetPolicy, batch_for
from posse.numeric import FloatArray
from posse.rules.state import NEVER
from posse.scenarios import Scenario, get_scenario
from posse.scenarios.setting import is_one_of
from posse.shown import shown
from posse.signals.global_state import StateLayout
from posse.signals.reward import namer

RENDER_MODES: Final = ("human", "rgb_array")
_OPTIONS: Final = ("tracker_pose", "target_pose")


class SingleWorld:
    """A batch of one world, for an environment of one world.

    Args:
        scenario: Scenario of the world.
        discrete_actions: Whether actions are ``Discrete``.
        seed: Seed of all random draws; ``None``: from the system's entropy, at the first reset.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Index of the world within the seed.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
        target_policy: Moves the target, where that is an agent; it then is none of the agents here.

    Attributes:
        running: Whether a step is possible: after a reset, and before the end.
        actions: Reader of the actions for :attr:`advance`.
        advance: Performs a control step with the last actions read; returns 1 at the end of the
            episode, after which :meth:`end` must be called.
        score: Returns the score of the current step.
        observations: (rows, F) of the last step; the next one overwrites them.
        rewards: (rows,) of the last step, likewise.
        no_metrics: Every metric by name, all 0: those of a step that does not end the episode.
            Set by the first reset; to be copied.
        terms: (rows, K) reward terms of the last step, likewise.

    Raises:
        ValueError: An unknown split or render mode, a negative seed or number of the world.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        discrete_actions: bool = False,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        render_mode: str | None = None,
        target_policy: TargetPolicy | None = None,
    ) -> None:
        check_render_mode(render_mode)
        self.scenario = scenario
        self.batch: Batch = batch_for(
            scenario,
            1,
            target_policy,
            seed=0 if seed is None else seed,
            split=split,
            first_world=first_world,
            autoreset="next_step",  # not used: the end is handled here
            num_threads=1,
        )
        self.render_mode = render_mode
        self.running = False
        self.no_metrics: dict[str, float] = {}
        self._discrete = discrete_actions
        self._seeded = seed is not None
        self._started = False
        self._state_layout: StateLayout | None = None
        self._renderer: Any = None
        self._prepare()

    def _prepare(self) -> None:
        # Created once: creating a view takes longer than reading it.
        self.score: Callable[[], float] = self.batch.worlds["score"].item
        self.name_terms = namer(self.batch.term_names)
        rows = self.batch.observation_shape[:2]
        acting = agent_names(self.scenario)[: rows[1]]
        self.actions = ActionReader(self.scenario, self._discrete, acting)
        self._written: tuple[FloatArray, ...] = tuple(
            np.zeros(shape, np.float32)
            for shape in (self.batch.observation_shape, rows, (*rows, len(self.batch.term_names)))
        )
        self.observations, self.rewards, self.terms = (array[0] for array in self._written)
        self._make_ready()

    def _make_ready(self) -> None:
        self.advance = self.batch.stepper(self.actions.read, *self._written)

    def __getstate__(self) -> dict[str, Any]:
        derived = ("score", "name_terms", "actions", "_written", "observations", "rewards", "terms", "advance")
        kept = {k: v for k, v in self.__dict__.items() if k not in derived}
        return {**kept, "_renderer": None, "_state_layout": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()

    @property
    def no_terms(self) -> dict[str, float]:
        """Reward terms by name, all 0: those of a reset."""
        return dict.fromkeys(self.batch.term_names, 0.0)

    @property
    def state_layout(self) -> StateLayout:
        """Layout of :meth:`state`."""
        if self._state_layout is None:
            self._state_layout = StateLayout(self.scenario)
        return self._state_layout

    def reset(self, seed: int | None, options: Mapping[str, Any] | None) -> FloatArray:
        """Start an episode and return the observations (rows, F).

        Args:
            seed: Start over from episode 0 of this seed; ``None``: the next episode.
            options: ``"tracker_pose"`` (N, 3) and ``"target_pose"`` (3,): start from these.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        options = options_of(options)
        for key in options:
            if key not in _OPTIONS:
                raise ValueError(f"unknown option {shown(key)}; options are: {', '.join(_OPTIONS)}")
        if seed is None and not self._seeded:
            seed = secrets.randbits(32)
        observations = self.batch.reset(seed=seed, options=options)
        self._make_ready()
        if not self._started:
            self.no_metrics = dict.fromkeys(self.batch.metrics(), 0.0)
        self.running = self._seeded = self._started = True
        first: FloatArray = observations[0]
        return first

    def check_running(self) -> None:
        """Raise if no step is possible.

        Raises:
            ResetNeeded: Before the first reset, or after the end of the episode.
        """
        if not self.running:
            when = "after the end of the episode" if self._started else "before reset"
            raise ResetNeeded(f"step {when}: call reset() first")

    def end(self) -> tuple[bool, dict[str, float]]:
        """Mark the episode as over.

        Returns:
            Whether it was terminated, rather than truncated, and every metric by name.
        """
        self.running = False
        metrics = {name: float(value[0]) for name, value in self.batch.metrics().items()}
        return bool(self.batch.worlds["terminated"][0]), metrics

    def working(self) -> npt.NDArray[np.bool_]:
        """Return which trackers work, (N,)."""
        working: npt.NDArray[np.bool_] = self.batch.arrays.tracker["broken_at"][0] == NEVER
        return working

    def state(self) -> FloatArray:
        """Return the full state of the world, (S,) float32.

        Raises:
            ResetNeeded: Before the first reset.
        """
        if not self._started:
            raise ResetNeeded("state before reset: call reset() first")
        state: FloatArray = self.state_layout.vector(self.batch.arrays)[0]
        return state

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the world: an image (H, W, 3) in the mode "rgb_array", a window in "human".

        Raises:
            ResetNeeded: Before the first reset.
        """
        if not self._started:
            raise ResetNeeded("render before reset: call reset() first")
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


def new_renderer(scenario: Scenario, render_mode: str) -> Any:
    """Return a renderer; imports pygame lazily."""
    return importlib.import_module("posse.rendering.renderer").Renderer(scenario, render_mode)


def check_render_mode(render_mode: str | None) -> None:
    """Raise ValueError for an unknown render mode."""
    if render_mode is not None and not is_one_of(RENDER_MODES, render_mode):
        raise ValueError(f"unknown render_mode {shown(render_mode)}; modes are: {', '.join(RENDER_MODES)}, None")


def frames_per_second(scenario: Scenario) -> int:
    """Return the frame rate that shows the world in real time."""
    return max(1, round(1 / scenario.control_step))


def shortened(scenario: str | Scenario, horizon: int | None, overrides: Mapping[str, Any]) -> Scenario:
    """Return a scenario with overrides, and ``horizon`` steps per episode unless that is None.

    For ``max_cycles`` (PettingZoo) and ``max_episode_steps`` (Gymnasium).
    """
    changed = overrides if horizon is None else {**overrides, "horizon": horizon}
    return get_scenario(scenario, **changed)
