"""Calls of a batch's kernel: preparation, arguments and results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.engine.arguments import action_error, as_array, real_numbers, to_float32
from posse.engine.kernels import LOOK, STEP, TO_CLIP, Results, bad_action, kernel_of, tables_of
from posse.engine.recycler import Recycler
from posse.engine.scratch import SCRATCH
from posse.engine.world_views import WorldViews
from posse.numeric import Blocks, BoolArray, FloatArray, direct, run_threads, threads_for
from posse.rules.scratch import new_scratch
from posse.signals.generate import declarations_for
from posse.signals.observation.layout import ObservationLayout


class Stepping(WorldViews):
    """The kernel of a batch, its scratch memory and its output arrays."""

    num_worlds: int
    num_threads: int
    layout: ObservationLayout
    _started: bool
    observation_shape: tuple[int, int, int]
    action_shape: tuple[int, int, int]

    def _prepare(self) -> None:
        """Set the derived attributes, which are not pickled."""
        scenario, (num_worlds, _, size) = self.scenario, self.observation_shape
        rows = scenario.num_agents
        self._declared = declarations_for(scenario)
        self._tables = tables_of(scenario)
        self._observations = Recycler((num_worlds, rows, size))
        self._rewards = Recycler((num_worlds, rows))
        self.term_names = self._declared.term_names
        self._terms = Recycler((num_worlds, rows, len(self.term_names)))
        self._untyped: Callable[..., int] = kernel_of(self._declared)
        self._kernel: Callable[..., int] = direct(self._untyped)
        self._score: FloatArray = self._arrays.world["score"]  # a view, created only once
        self._orders = np.full(num_worlds, STEP, np.uint8)
        threads = threads_for(num_worlds, rows, self.num_threads)
        self._scratch = [new_scratch(SCRATCH) for _ in range(threads)]

    def __getstate__(self) -> dict[str, Any]:
        derived = (
            "_declared",
            "_tables",
            "_observations",
            "_rewards",
            "_terms",
            "_score",
            "_scratch",
            "_orders",
            "_kernel",
            "_untyped",
        )
        state = {k: v for k, v in self.__dict__.items() if k not in derived}
        return {**state, "fingerprints": self._declared.fingerprints()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        declarations_for(state["scenario"]).check_fingerprints(state.pop("fingerprints"))
        self.__dict__.update(state)
        self._prepare()

    def check_actions(self, actions: npt.ArrayLike) -> FloatArray:
        """Return the actions as kernel input, or raise if they are invalid."""
        array = self.cast_actions(actions)
        position = bad_action(array)
        if position >= 0:
            e, i, k = np.unravel_index(position, array.shape)
            raise action_error((int(e), int(i), int(k)), array[e, i, k])
        return np.clip(array, -1, 1) if position == TO_CLIP else array

    def cast_actions(self, actions: npt.ArrayLike) -> FloatArray:
        """Return the actions as contiguous float32, or raise if their type or shape is wrong."""
        array = actions if type(actions) is np.ndarray else as_array("actions", actions)
        if array.dtype != np.float32:
            array = to_float32(real_numbers("actions", array))
        if array.shape != self.action_shape:
            raise ValueError(
                f"actions have shape {array.shape}, wanted {self.action_shape}: (worlds, agents, 2 + message_size)"
            )
        return np.ascontiguousarray(array)

    def _run(self, orders: npt.NDArray[np.uint8], actions: FloatArray, results: Results) -> int:
        """Execute the order of each world in several threads.

        Returns the number of worlds whose episodes are over.
        """
        kernel, scratch = self._kernel, self._scratch
        arguments = (self._tables, self._arrays, actions, results, orders)

        def work(thread: int, blocks: Blocks) -> int:
            return kernel(*arguments, scratch[thread], thread, blocks)

        return sum(run_threads(work, self.num_worlds, len(scratch)))

    def _new_results(self) -> Results:
        """Return output arrays for a pass over the worlds."""
        return Results(self._observations.take(), self._rewards.take(), self._terms.take(), self._new_flags())

    def _new_flags(self) -> BoolArray:
        """Return an output array for the ends of episodes: terminated, truncated, (2, E)."""
        return np.empty((2, self.num_worlds), np.bool_)

    def _start(self, chosen: BoolArray, order: int) -> FloatArray:
        """Start an episode in the chosen worlds; return every world's observations."""
        results = self._new_results()
        orders = np.where(chosen, order, LOOK).astype(np.uint8)
        agents, length = self.scenario.num_agents, 2 + self.scenario.message_size
        actions = np.empty((self.num_worlds, agents, length), np.float32)  # not read
        self._run(orders, actions, results)
        self._kernel = direct(self._untyped)  # now compiled
        if not self._started:
            self.layout.check_added(results.observations)
        return results.observations
