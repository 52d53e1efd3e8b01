"""Simulation of many worlds together.

The environments, training and evaluation are built on :class:`Batch`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.engine.arguments import check_array, check_count, check_mask, check_seed, check_settings, options_of
from posse.engine.copies import check_fit, write_copies
from posse.engine.kernels import LOOK, START, START_FROM_POSES, Results, first_over
from posse.engine.start_poses import check_overlap, check_room_to_turn, poses_of, write_poses
from posse.engine.stepping import Stepping
from posse.numeric import BoolArray, FloatArray, divide
from posse.rules.state import SPLITS, WorldArrays
from posse.scenarios import Scenario, ScenarioError
from posse.shown import shown
from posse.signals.observation.layout import ObservationLayout
from posse.signals.reward import TermsByName

_OPTIONS: Final = ("reset_mask", "tracker_pose", "target_pose")


@dataclass(frozen=True)
class Snapshot:
    """A saved state of a batch: :meth:`Batch.save`, :meth:`Batch.restore`."""

    scenario: Scenario
    arrays: WorldArrays
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    """Hashes of the declarations of users' modules that the scenario names."""


class Batch(Stepping):
    """A batch of E worlds of one scenario, N trackers each.

    Args:
        scenario: Settings of the worlds.
        num_worlds: E, at least 1.
        seed: Seed of all random draws, in [0, 2**63). World i of a seed is the same world in every
            batch.
        split: ``"train"``, ``"validation"`` or ``"test"``: part of the key of every draw, so that
            the splits have no world in common.
        first_world: Index of the batch's first world; that of the last must be below 2**63.
            ``first_world=17, num_worlds=1`` replays world 17 alone.
        autoreset: Behaviour at the end of an episode. ``"next_step"``: the following step starts
            the next episode and ignores its action; ``"same_step"``: the next episode starts at
            once and the last observation is ``infos["final_obs"]``; ``"disabled"``: the caller
            resets, with ``options={"reset_mask": mask}``.
        num_threads: Threads that step the worlds; default: one per core. Never changes a result.

    Attributes:
        layout: Position of each field in an observation.
        term_names: Names of the reward terms, in the order in which they are reported.
        observation_shape: (E, rows, F); rows = N, plus one if the target is an agent.
        action_shape: (E, rows, 2 + message_size).

    Raises:
        ScenarioError: ``num_worlds`` below 1, a negative seed, an unknown split or autoreset mode.
    """

    def __init__(
        self,
        scenario: Scenario,
        num_worlds: int,
        *,
        seed: int = 0,
        split: str = "train",
        first_world: int = 0,
        autoreset: str = "next_step",
        num_threads: int | None = None,
    ) -> None:
        check_settings(num_worlds, first_world, split, autoreset, num_threads)
        self.scenario = scenario
        self.num_worlds = int(num_worlds)
        self.seed = check_seed(seed)
        self.split = split
        self.first_world = int(first_world)
        self.autoreset = autoreset
        self.num_threads = num_threads or os.cpu_count() or 1
        self.layout = ObservationLayout(scenario)
        rows = scenario.num_agents
        self.observation_shape = (num_worlds, rows, self.layout.size)
        self.action_shape = (num_worlds, rows, 2 + scenario.message_size)
        try:
            self._arrays = WorldArrays.allocate(scenario, num_worlds)
        except (MemoryError, ValueError, OverflowError):
            each = WorldArrays.allocate(scenario, 1).bytes_per_world
            raise ScenarioError(
                f"num_worlds={num_worlds} of {each} bytes each are more than there is memory for: lower it"
            ) from None
        self._started = False
        self._prepare()

    def save(self) -> Snapshot:
        """Return the current state of the worlds, for :meth:`restore`.

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
        """
        self._check_started("save")
        return Snapshot(self.scenario, self._arrays.copy(), self._declared.fingerprints())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Restore a snapshot and return its observations.

        Raises:
            ValueError: Not a snapshot, or one of another scenario or number of worlds; nothing is
                changed.
            DeclarationError: A declaration that the scenario names has changed.
        """
        if not isinstance(snapshot, Snapshot):
            raise ValueError(f"restore takes what save() returned, got {shown(snapshot)}")
        if snapshot.scenario != self.scenario or len(snapshot.arrays.world) != self.num_worlds:
            raise ValueError(
                f"a snapshot of {len(snapshot.arrays.world)} worlds of "
                f"{snapshot.scenario.name!r} does not fit a batch of {self.num_worlds} worlds of "
                f"{self.scenario.name!r}: scenario and number of worlds must be equal"
            )
        self._declared.check_fingerprints(snapshot.fingerprints)
        self._arrays.write(snapshot.arrays)
        self._started = True
        return self._start(np.zeros(self.num_worlds, np.bool_), LOOK)

    def observe(self) -> FloatArray:
        """Return the current observations of the worlds, (E, rows, F).

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
        """
        self._check_started("observe")
        return self._start(np.zeros(self.num_worlds, np.bool_), LOOK)

    def copies(self, count: int, *, seed: int = 0, alike: bool = False, into: Batch | None = None) -> Batch:
        """Return ``count`` copies of the current state of every world, for planning ahead.

        Copy j of world e is world ``e * count + j`` of the returned batch. A copy has the present
        state of its original but another key, so its future noise, losses and faults differ. They
        are determined by the original's key and step, ``seed`` and j. The originals do not change.
        If the episode of a copy ends, the next one belongs to no world of a batch.

        Args:
            count: Copies of each world, at least 1.
            seed: Seed of the random draws of the copies.
            alike: Whether all copies of a world have equal draws, for comparing actions.
            into: A batch of this scenario with ``num_worlds * count`` worlds to overwrite and
                return, which takes much less time than creating one.

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
            ScenarioError: ``count`` below 1, or a negative seed.
            ValueError: ``into`` is this batch, or one of another scenario or number of worlds.
        """
        check_count("count", count, 1)
        seed = check_seed(seed)
        self._check_started("copies")
        if into is None:
            into = Batch(
                self.scenario, self.num_worlds * count, seed=self.seed, split=self.split, num_threads=self.num_threads
            )
        elif type(into) is not Batch or into is self:
            raise ValueError(f"copies go into another Batch, got {shown(into)}")
        else:
            check_fit(self.scenario, self.num_worlds, count, into.scenario, into.num_worlds)
        into._declared.check_fingerprints(self._declared.fingerprints())
        write_copies(self._tables.config, self.arrays, into.arrays, count, seed, alike)
        into._started = True
        return into

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> FloatArray:
        """Start an episode in every world and return the observations (E, rows, F).

        Args:
            seed: Start over from episode 0 of this seed; ``None``: each world's next episode.
            options: ``"reset_mask"`` (E,) bool: only these worlds, possibly none;
                ``"tracker_pose"`` (N, 3) or (E, N, 3) and ``"target_pose"`` (3,) or (E, 3):
                start from these (x, y, θ).

        Raises:
            ValueError: An unknown option, or one of a wrong shape or not finite; start poses in
                which robots overlap each other, an obstacle or a wall, or a scripted target has no
                room to turn. Nothing is changed.
        """
        options = options_of(options)
        chosen = self.check_reset(seed, options)
        poses = poses_of(options, self.scenario, self.num_worlds)
        before = self._arrays.copy() if poses else None
        world = self._arrays.world
        new_seed = self.seed if seed is None else int(seed)
        if seed is not None or not self._started:
            world["seed"][chosen] = new_seed
            world["split"] = SPLITS.index(self.split)
            world["index"] = self.first_world + np.arange(self.num_worlds)
            world["episode"][chosen] = 0
        else:
            world["episode"][chosen] += 1
        observations = self._start(chosen, START)
        if poses:
            for name, pose in poses.items():
                write_poses(self._arrays.tracker if name == "tracker_pose" else world, pose, chosen)
            try:
                check_overlap(self.scenario, self._arrays, chosen)
                if "target_pose" in poses:
                    check_room_to_turn(self.scenario, self._arrays, chosen)
                observations = self._start(chosen, START_FROM_POSES)
            except BaseException:
                if before is not None:
                    self._arrays.write(before)
                raise
        self.seed, self._started = new_seed, True
        return observations

    def check_reset(self, seed: int | None, options: Mapping[str, Any]) -> BoolArray:
        """Return which worlds a reset starts, (E,); raise if its arguments are invalid.

        Start poses are checked later.
        """
        for key in options:
            if key not in _OPTIONS:
                raise ValueError(f"unknown option {shown(key)}; options are: {', '.join(_OPTIONS)}")
        if seed is not None:
            check_seed(seed)
        chosen = check_mask(options.get("reset_mask"), self.num_worlds)
        if not self._started and not chosen.all():
            raise ResetNeeded("the first reset starts every world: call it without reset_mask")
        return chosen

    def step(self, actions: npt.ArrayLike) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step.

        Args:
            actions: (E, rows, 2 + message_size) numbers in [-1, 1]: the speed (-1 is 0, 1 the
                greatest), the turn rate (1 is the greatest to the left), the message. Numbers up
                to 1e-6 outside, which may result from rounding, are clipped.

        Returns:
            observations (E, rows, F), rewards (E, rows), terminated (E,), truncated (E,), infos.
            ``infos["score"]`` (E,) is the score of the step; ``infos["reward_terms"]`` maps each
            term to (E, rows); when episodes end, ``infos["metrics"]`` maps each metric to (E,),
            valid where ``infos["_metrics"]`` (E,) is true. Arrays are never overwritten later.

        Raises:
            ResetNeeded: Before the first :meth:`reset`, or after an end with autoreset disabled.
            ValueError: Actions of a wrong type or shape, not finite, or outside [-1, 1]. Nothing is
                changed.
        """
        self._check_running()
        return self._step_checked(self.check_actions(actions))

    def _step_checked(self, checked: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by the actions of all agents (E, num_agents, 2 + m)."""
        results = self._new_results()
        over = self._run(self._orders, checked, results)
        observations, rewards, terms, (terminated, truncated) = results
        infos: dict[str, Any] = {"score": self._score.copy(), "reward_terms": TermsByName(self.term_names, terms)}
        if over:
            observations = self._end(observations, terminated | truncated, infos)
        return observations, rewards, terminated, truncated, infos

    def stepper(
        self, actions: FloatArray, observations: FloatArray, rewards: FloatArray, terms: FloatArray
    ) -> Callable[[], int]:
        """Return a function that advances every world by one control step, without other overhead.

        This is for environments of one world, where :meth:`step` spends more time on arguments and
        results than on the simulation. Each call reads the actions, writes to the other arrays and
        returns the number of worlds whose episodes are over. It runs on the calling thread, starts
        no episode in the mode "same_step", and checks nothing: the worlds must have been reset, and
        the actions must be valid as for :meth:`check_actions`. A stepper created before the first
        :meth:`reset` is slower. The arrays are float32, contiguous, writable and do not overlap.

        Args:
            actions: Input array of the actions, (E, rows, 2 + message_size).
            observations: Output array of the observations, (E, rows, F).
            rewards: Output array of the rewards, (E, rows).
            terms: Output array of the reward terms, (E, rows, K) in the order of ``term_names``.

        Raises:
            ValueError: An array of another type, shape or layout.
        """
        rows = self.observation_shape[:2]
        for name, array, shape in (
            ("actions", actions, self.action_shape),
            ("observations", observations, self.observation_shape),
            ("rewards", rewards, rows),
            ("terms", terms, (*rows, len(self.term_names))),
        ):
            check_array(name, array, shape)
        return self._stepper(actions, observations, rewards, terms)

    def _stepper(
        self, actions: FloatArray, observations: FloatArray, rewards: FloatArray, terms: FloatArray
    ) -> Callable[[], int]:
        """Return the function of :meth:`stepper`; the arrays have a row for every agent."""
        arguments = (
            self._tables,
            self._arrays,
            actions,
            Results(observations, rewards, terms, self._new_flags()),
            self._orders,
            self._scratch[0],
            0,
            divide(self.num_worlds, 1),
        )
        kernel = self._kernel
        return lambda: kernel(*arguments)

    def _check_started(self, what: str) -> None:
        if not self._started:
            raise ResetNeeded(f"{what} before reset: call reset() first")

    def _check_running(self) -> None:
        """Raise if a step is not possible now."""
        self._check_started("step")
        if self.autoreset == "disabled" and first_over(self._arrays.world) >= 0:
            over = np.flatnonzero(self._arrays.world["over"])
            raise ResetNeeded(
                f"step after the end of world {over[0]}"
                + (f" and {len(over) - 1} more" if len(over) > 1 else "")
                + ': call reset(options={"reset_mask": mask}) first'
            )

    def _end(self, observations: FloatArray, ended: BoolArray, infos: dict[str, Any]) -> FloatArray:
        """Report the episodes that ended; in the mode "same_step", start the next ones."""
        infos["metrics"], infos["_metrics"] = self.metrics(), ended
        if self.autoreset != "same_step":
            return observations
        infos["final_obs"], infos["_final_obs"] = observations, ended
        infos["final_info"] = {k: infos[k] for k in ("score", "metrics", "_metrics")}
        infos["_final_info"] = ended
        self._arrays.world["episode"][ended] += 1
        return self._start(ended, START)
