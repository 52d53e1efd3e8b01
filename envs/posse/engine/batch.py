"""The engine: many worlds stepped together.

Everything else (PettingZoo, Gymnasium, training, evaluation) stands on :class:`Batch`.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.engine.arguments import (
    MOST,
    as_array,
    check_count,
    check_seed,
    options_of,
    real_numbers,
    to_float32,
)
from posse.engine.copies import write_copies
from posse.engine.kernels import (
    LOOK,
    START,
    START_FROM_POSES,
    STEP,
    TO_CLIP,
    Results,
    bad_action,
    first_over,
    kernel_of,
    own_kernel,
    tables_of,
)
from posse.engine.scratch import SCRATCH
from posse.engine.user_parts import check_fields, explain
from posse.numeric import (
    Blocks,
    BoolArray,
    FloatArray,
    Records,
    direct,
    divide,
    run_threads,
    threads_for,
)
from posse.rules.scratch import new_scratch
from posse.rules.state import (
    SPLITS,
    WorldArrays,
)
from posse.scenarios import Scenario, ScenarioError
from posse.scenarios.limits import SAFE_MARGIN
from posse.scenarios.setting import is_one_of
from posse.scenarios.shown import shown
from posse.signals.layout import ObservationLayout
from posse.signals.metrics import episode_metrics
from posse.signals.parts import parts_for
from posse.signals.reward import TermsByName

AUTORESET_MODES: Final = ("next_step", "same_step", "disabled")
_RECYCLED_FROM: Final = 1 << 16
"""Bytes from which an array's memory is worth keeping for the next step."""
_ROUNDING: Final = 1e-3
"""By how much a turning circle may be too wide for its room, m: float32 has rounded the pose."""
_FLOAT32: Final = np.dtype(np.float32)
_OPTIONS: Final = ("reset_mask", "tracker_pose", "target_pose")


@dataclass(frozen=True)
class Snapshot:
    """A batch in mid-episode, to go back to: :meth:`Batch.save`, :meth:`Batch.restore`."""

    scenario: Scenario
    arrays: WorldArrays


class _Recycler:
    """Gives out arrays of one shape; takes the memory back once nobody else refers to it.

    What was returned is never overwritten while anyone holds it (a view, a tensor made from it):
    each of these is a reference to the array that owns the memory. Fresh memory for every step
    would cost as much as the step: the system hands it out page by page.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._shape = shape
        self._recycle = math.prod(shape) * 4 >= _RECYCLED_FROM
        self._arrays: list[FloatArray] = []

    def take(self) -> FloatArray:
        if not self._recycle:
            return np.empty(self._shape, _FLOAT32)
        for k in range(len(self._arrays)):
            # Two references: this list's, and the argument's of the call itself.
            if sys.getrefcount(self._arrays[k]) == 2:
                return self._arrays[k]
        array = np.empty(self._shape, np.float32)
        if len(self._arrays) < 4:
            self._arrays.append(array)
        return array


class Batch:
    """A batch of E worlds of one scenario, N trackers each.

    Args:
        scenario: What the worlds are like.
        num_worlds: E, at least 1.
        seed: Of every random draw, in [0, 2**63). World i of a seed is the same world in every
            batch.
        split: ``"train"``, ``"validation"`` or ``"test"``: part of the key of every draw, so that
            no world of one is ever a world of another.
        first_world: Index of the batch's first world; the last one's is below 2**63.
            ``first_world=17, num_worlds=1`` replays world 17 alone.
        autoreset: What happens when an episode ends. ``"next_step"``: the following step starts
            the next episode and ignores its action; ``"same_step"``: the next episode starts at
            once and the last observation is ``infos["final_obs"]``; ``"disabled"``: the caller
            resets, with ``options={"reset_mask": mask}``.
        num_threads: Threads that step the worlds; default: as many as cores. Never changes a
            result.
        own_kernel: Whether to step by a kernel that is compiled for this scenario alone: about a
            third faster, and never another result. It takes as long to compile as the kernel for
            all scenarios, once for each scenario, and is kept on disk.

    Attributes:
        layout: Where each field lies in an observation.
        term_names: Names of the reward terms, in the order in which they are reported.
        observation_shape: (E, rows, F); rows = N, and one more where the target is an agent.
        action_shape: (E, rows, 2 + message_size).

    Raises:
        ScenarioError: ``num_worlds`` below 1, a negative seed, an unknown split or autoreset mode,
            an ``own_kernel`` that is no truth value.
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
        own_kernel: bool = False,
    ) -> None:
        num_worlds = check_count("num_worlds", num_worlds, 1)
        first_world = check_count("first_world", first_world, 0)
        if first_world + num_worlds > MOST:
            raise ScenarioError(
                f"first_world={first_world} and num_worlds={num_worlds} go beyond world 2**63 - 1: "
                "lower first_world"
            )
        if num_threads is not None:
            check_count("num_threads", num_threads, 1)
        if not isinstance(own_kernel, bool):
            raise ScenarioError(
                f"own_kernel={shown(own_kernel)} is not possible: it is True or False"
            )
        if not is_one_of(SPLITS, split):
            raise ScenarioError(f"unknown split {shown(split)}; splits are: {', '.join(SPLITS)}")
        if not is_one_of(AUTORESET_MODES, autoreset):
            raise ScenarioError(
                f"unknown autoreset mode {shown(autoreset)}; modes are: "
                + ", ".join(AUTORESET_MODES)
            )
        self.scenario = scenario
        self.num_worlds = num_worlds
        self.seed = check_seed(seed)
        self.split = split
        self.first_world = first_world
        self.autoreset = autoreset
        self.num_threads = num_threads or os.cpu_count() or 1
        self.own_kernel = own_kernel
        self.layout = ObservationLayout(scenario)
        rows = scenario.num_agents
        self.observation_shape = (num_worlds, rows, self.layout.size)
        self.action_shape = (num_worlds, rows, 2 + scenario.message_size)
        try:
            self._arrays = WorldArrays.allocate(scenario, num_worlds)
        except (MemoryError, ValueError, OverflowError):
            each = WorldArrays.allocate(scenario, 1).bytes_per_world
            raise ScenarioError(
                f"num_worlds={num_worlds} of {each} bytes each are more than there is memory for: "
                "lower it"
            ) from None
        self._started = False
        self._prepare()

    def _prepare(self) -> None:
        """Set what follows from the rest, and is not pickled."""
        scenario, (num_worlds, rows, size) = self.scenario, self.observation_shape
        parts = parts_for(scenario)
        check_fields(parts, self._arrays)
        self._tables = tables_of(scenario)
        self._observations = _Recycler((num_worlds, rows, size))
        self._rewards = _Recycler((num_worlds, rows))
        self.term_names = parts.term_names
        self._terms = _Recycler((num_worlds, rows, len(self.term_names)))
        self._untyped: Callable[..., int] = (
            own_kernel(scenario) if self.own_kernel else kernel_of(parts)
        )
        self._kernel: Callable[..., int] = direct(self._untyped)
        self._score: FloatArray = self._arrays.world["score"]  # a view, made once
        self._orders = np.full(num_worlds, STEP, np.uint8)
        threads = threads_for(num_worlds, rows, self.num_threads)
        self._scratch = [new_scratch(SCRATCH) for _ in range(threads)]

    def __getstate__(self) -> dict[str, Any]:
        derived = (
            "_tables", "_observations", "_rewards", "_terms", "_score",
            "_scratch", "_orders", "_kernel", "_untyped",
        )  # fmt: skip
        return {k: v for k, v in self.__dict__.items() if k not in derived}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()

    @property
    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Every state array by name, as read-only views that follow the worlds.

        Names are ``<array>_<field>``, e.g. ``"tracker_x"`` (E, N) or ``"world_step"`` (E,);
        :mod:`posse.rules.state` documents every field.
        """
        names = self._arrays.by_name()
        for view in names.values():
            view.flags.writeable = False
        return names

    @property
    def worlds(self) -> Records:
        """The worlds' records, (E,) :func:`posse.rules.state.world_record`."""
        return self._arrays.world

    @property
    def score(self) -> FloatArray:
        """(E,) the score of the present step; 0 at the start."""
        return self._score.copy()

    @property
    def terminated(self) -> BoolArray:
        """(E,) whether the last step or reset left the world's episode terminated."""
        return np.asarray(self._arrays.world["terminated"] != 0)

    @property
    def truncated(self) -> BoolArray:
        """(E,) whether the last step or reset left the world's episode truncated."""
        return np.asarray(self._arrays.world["over"] != 0) & ~self.terminated

    @property
    def arrays(self) -> WorldArrays:
        """The arrays themselves; whoever writes to them changes the worlds."""
        return self._arrays

    @property
    def bytes_per_world(self) -> int:
        """Memory that the state of one world takes, in bytes."""
        return self._arrays.bytes_per_world

    def metrics(self) -> dict[str, npt.NDArray[np.float64]]:
        """Return every metric by name, (E,), of the episodes as they stand."""
        return episode_metrics(self.scenario, self._arrays.world)

    def save(self) -> Snapshot:
        """Return the worlds as they stand, for :meth:`restore`.

        Raises:
            ResetNeeded: Before the first :meth:`reset`, when there are no worlds to save.
        """
        self._check_started("save")
        return Snapshot(self.scenario, self._arrays.copy())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Go back to a snapshot and return its observations.

        Raises:
            ValueError: No snapshot, or one of another scenario or number of worlds; nothing is
                changed.
        """
        if not isinstance(snapshot, Snapshot):
            raise ValueError(f"restore takes what save() returned, got {shown(snapshot)}")
        if snapshot.scenario != self.scenario or len(snapshot.arrays.world) != self.num_worlds:
            raise ValueError(
                f"a snapshot of {len(snapshot.arrays.world)} worlds of "
                f"{snapshot.scenario.name!r} does not fit a batch of {self.num_worlds} worlds of "
                f"{self.scenario.name!r}: scenario and number of worlds must be equal"
            )
        self._arrays.write(snapshot.arrays)
        self._started = True
        return self._start(np.zeros(self.num_worlds, np.bool_), LOOK)

    def observe(self) -> FloatArray:
        """Return the observations (E, rows, F) of the worlds as they stand.

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
        """
        self._check_started("observe")
        return self._start(np.zeros(self.num_worlds, np.bool_), LOOK)

    def copies(
        self, count: int, *, seed: int = 0, alike: bool = False, into: Batch | None = None
    ) -> Batch:
        """Return ``count`` copies of every world as it stands, to play ahead in.

        Copy j of world e is world ``e * count + j`` of the returned batch. Copies go on from the
        present of their original, under keys of their own: they draw other noise, losses and faults
        than it will. What they draw follows from the original's key and step, ``seed`` and j. The
        originals do not change. A copy whose episode ends begins an episode that is no world's.

        Args:
            count: Copies of each world, at least 1.
            seed: Of what the copies draw.
            alike: Whether all copies of a world draw the same, to compare what is done in them.
            into: A batch of this scenario with ``num_worlds * count`` worlds to overwrite and
                return, instead of making one: a small part of the time of a step.

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
            ScenarioError: ``count`` below 1, or a negative seed.
            ValueError: ``into`` is this batch, or one of another scenario or number of worlds.
        """
        check_count("count", count, 1)
        seed = check_seed(seed)
        self._check_started("copies")
        wanted = self.num_worlds * count
        if into is None:
            into = Batch(
                self.scenario, wanted, seed=self.seed, split=self.split,
                num_threads=self.num_threads,
            )  # fmt: skip
        elif type(into) is not Batch or into is self:
            raise ValueError(f"copies go into another Batch on the CPU, got {shown(into)}")
        elif into.scenario != self.scenario or into.num_worlds != wanted:
            raise ValueError(
                f"{count} copies of {self.num_worlds} worlds of {self.scenario.name!r} do not fit "
                f"{into.num_worlds} worlds of {into.scenario.name!r}: scenario and number of "
                "worlds must be equal"
            )
        write_copies(self._tables.config, self.arrays, into.arrays, count, seed, alike)
        into._started = True
        return into

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> FloatArray:
        """Start an episode in every world and return the observations (E, rows, F).

        Args:
            seed: Start over from episode 0 of this seed; ``None``: each world's next episode.
            options: ``"reset_mask"`` (E,) bool: only these worlds, maybe none;
                ``"tracker_pose"`` (N, 3) or (E, N, 3) and ``"target_pose"`` (3,) or (E, 3):
                start from these (x, y, θ).

        Raises:
            ValueError: An unknown option, or one of a wrong shape, not finite, or that puts robots
                inside each other, an obstacle or a wall, or leaves a scripted target no room to
                turn. Nothing is changed.
        """
        options = options_of(options)
        chosen = self.check_reset(seed, options)
        poses = self._check_poses(options)
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
                _write_poses(
                    self._arrays.tracker if name == "tracker_pose" else world, pose, chosen
                )
            try:
                self._check_overlap(chosen)
                if "target_pose" in poses:
                    self._check_room_to_turn(chosen)
                observations = self._start(chosen, START_FROM_POSES)
            except BaseException:
                if before is not None:
                    self._arrays.write(before)
                raise
        self.seed, self._started = new_seed, True
        return observations

    def check_reset(self, seed: int | None, options: Mapping[str, Any]) -> BoolArray:
        """Return which worlds a reset starts, (E,), or raise what is wrong with its arguments.

        Start poses are looked at later.
        """
        for key in options:
            if key not in _OPTIONS:
                raise ValueError(f"unknown option {shown(key)}; options are: {', '.join(_OPTIONS)}")
        if seed is not None:
            check_seed(seed)
        chosen = self._check_mask(options.get("reset_mask"))
        if not self._started and not chosen.all():
            raise ResetNeeded("the first reset starts every world: call it without reset_mask")
        return chosen

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step.

        Args:
            actions: (E, rows, 2 + message_size) numbers in [-1, 1]: the speed (-1 is 0, 1 the
                greatest), the turn rate (1 is the greatest to the left), the message. Up to 1e-6
                outside, as rounding may carry them, they are taken for the bound.

        Returns:
            observations (E, rows, F), rewards (E, rows), terminated (E,), truncated (E,), infos.
            ``infos["score"]`` (E,) is the present step's score; ``infos["reward_terms"]`` maps each
            term to (E, rows); when episodes end, ``infos["metrics"]`` maps each metric to (E,),
            valid where ``infos["_metrics"]`` (E,) is true. Arrays are never overwritten later.

        Raises:
            ResetNeeded: Before the first :meth:`reset`, or after an end with autoreset disabled.
            ValueError: Actions of a wrong type or shape, not finite, or outside [-1, 1]. Nothing is
                changed.
        """
        self._check_running()
        checked = self.check_actions(actions)
        results = self._new_results()
        over = self._run(self._orders, checked, results)
        observations, rewards, terms, (terminated, truncated) = results
        infos: dict[str, Any] = {
            "score": self._score.copy(),
            "reward_terms": TermsByName(self.term_names, terms),
        }
        if over:
            observations = self._end(observations, terminated | truncated, infos)
        return observations, rewards, terminated, truncated, infos

    def stepper(
        self,
        actions: FloatArray,
        observations: FloatArray,
        rewards: FloatArray,
        terms: FloatArray,
    ) -> Callable[[], int]:
        """Return a function that advances every world by one control step, and packs up nothing.

        For the environments of one world, where to look up what a step needs, and to pack up what
        it gives, would take longer than the step. Each call reads the actions anew, writes to the
        other arrays, and returns how many worlds' episodes are over. It works on the calling
        thread alone, starts no episode in the mode "same_step", and checks nothing: the worlds
        must have been reset, and the actions been through as good a check as
        :meth:`check_actions`. Made before the first :meth:`reset` it is slower than afterwards.
        All four arrays are float32, contiguous and writable, and no two overlap.

        Args:
            actions: Where to read the actions from, (E, rows, 2 + message_size).
            observations: Where to write the observations, (E, rows, F).
            rewards: Where to write the rewards, (E, rows).
            terms: Where to write the reward terms, (E, rows, K) in the order of ``term_names``.

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
            _check_array(name, array, shape)
        arguments = (
            self._tables, self._arrays, actions,
            Results(observations, rewards, terms, self._new_flags()), self._orders,
            self._scratch[0], 0, divide(self.num_worlds, 1),
        )  # fmt: skip
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

    def check_actions(self, actions: npt.ArrayLike) -> FloatArray:
        """Return the actions as the kernels take them, or raise what is wrong with them."""
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
                f"actions have shape {array.shape}, wanted {self.action_shape}: "
                "(worlds, agents, 2 + message_size)"
            )
        return np.ascontiguousarray(array)

    def _run(self, orders: npt.NDArray[np.uint8], actions: FloatArray, results: Results) -> int:
        """Have the kernel do what each world is ordered to, spread over the threads.

        Returns how many worlds' episodes are over.
        """
        kernel, scratch = self._kernel, self._scratch
        arguments = (self._tables, self._arrays, actions, results, orders)

        def work(thread: int, blocks: Blocks) -> int:
            return kernel(*arguments, scratch[thread], thread, blocks)

        return sum(run_threads(work, self.num_worlds, len(scratch)))

    def _new_results(self) -> Results:
        """Return room for what a pass over the worlds writes."""
        return Results(
            self._observations.take(), self._rewards.take(), self._terms.take(), self._new_flags()
        )

    def _new_flags(self) -> BoolArray:
        """Return room for what a step says of episodes' ends: terminated, truncated, (2, E)."""
        return np.empty((2, self.num_worlds), np.bool_)

    def _start(self, chosen: BoolArray, order: int) -> FloatArray:
        """Start an episode in the chosen worlds; return every world's observations."""
        results = self._new_results()
        orders = np.where(chosen, order, LOOK).astype(np.uint8)
        actions = np.empty(self.action_shape, np.float32)  # not read
        try:
            self._run(orders, actions, results)
        except Exception:
            explain(parts_for(self.scenario), self._tables, self._arrays, self._scratch[0])
            raise
        self._kernel = direct(self._untyped)  # by now there is one
        return results.observations

    def _check_mask(self, mask: npt.ArrayLike | None) -> BoolArray:
        if mask is None:
            return np.ones(self.num_worlds, np.bool_)
        array = as_array("reset_mask", mask)
        if array.dtype != np.bool_ or array.shape != (self.num_worlds,):
            raise ValueError(
                f"reset_mask must be a bool array of shape ({self.num_worlds},), got "
                f"{array.dtype} of shape {array.shape}"
            )
        return array

    def _check_poses(self, options: Mapping[str, Any]) -> dict[str, npt.NDArray[np.float64]]:
        poses = {}
        for name, shape in (
            ("tracker_pose", (self.scenario.num_trackers, 3)),
            ("target_pose", (3,)),
        ):
            if options.get(name) is None:
                continue
            full = (self.num_worlds, *shape)
            array = real_numbers(name, options[name]).astype(np.float64)
            if array.shape not in (shape, full):
                raise ValueError(
                    f"{name} has shape {array.shape}, wanted {shape} or {full}: (x, y, θ) each"
                )
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
            most = self.scenario.start_extent
            if np.abs(array[..., :2]).max(initial=0) > most:
                raise ValueError(
                    f"{name} lies up to {np.abs(array[..., :2]).max():.4g} m from the origin, "
                    f"starts of {self.scenario.name!r} lie within ±{most:g} m along each axis"
                )
            poses[name] = np.broadcast_to(array, full)
        return poses

    def _check_overlap(self, chosen: BoolArray) -> None:
        """Raise if robots stand inside each other, an obstacle or a wall."""
        s, world, tracker = self.scenario, self._arrays.world, self._arrays.tracker
        robots = np.stack(
            [np.concatenate([tracker[k], world[k][:, None]], axis=1)[chosen] for k in ("x", "y")],
            axis=-1,
        ).astype(np.float64)
        names = [*(f"tracker_{i}" for i in range(s.num_trackers)), "the target"]
        apart = np.linalg.norm(robots[:, :, None] - robots[:, None], axis=-1)
        apart[:, np.arange(len(names)), np.arange(len(names))] = np.inf
        if apart.size and apart.min() <= 2 * s.robot_radius:
            _, i, j = np.unravel_index(apart.argmin(), apart.shape)
            raise ValueError(
                f"{names[i]} and {names[j]} would start {apart.min():.3g} m apart, discs of "
                f"robot_radius={s.robot_radius:g} overlap: move one"
            )
        if math.isfinite(s.arena) and chosen.any():
            room = s.arena / 2 - s.robot_radius - np.abs(robots).max(axis=(0, 2))
            if room.min() <= 0:
                raise ValueError(f"{names[int(room.argmin())]} would start in a wall: move it")
        obstacle = self._arrays.obstacle[chosen]
        for i, name in enumerate(names):
            dx = obstacle["x"] - robots[:, i, :1]
            dy = obstacle["y"] - robots[:, i, 1:]
            if (np.hypot(dx, dy) <= obstacle["radius"] + s.robot_radius).any():
                raise ValueError(f"{name} would start in an obstacle: move it")

    def _check_room_to_turn(self, chosen: BoolArray) -> None:
        """Raise if neither turning circle of a scripted target is free."""
        s, world, obstacle = self.scenario, self._arrays.world[chosen], self._arrays.obstacle
        if (
            math.isinf(s.arena)
            or s.target_motion == "agent"
            or s.target_speed == 0
            or not len(world)
        ):
            return
        radius = s.target_speed / s.target_turn_rate
        needed = radius + s.robot_radius + SAFE_MARGIN
        x, y = world["x"].astype(np.float64), world["y"].astype(np.float64)
        room = np.full(len(world), -np.inf)
        for side in (radius, -radius):
            centre_x, centre_y = x - side * world["heading_sin"], y + side * world["heading_cos"]
            free = s.arena / 2 - np.maximum(np.abs(centre_x), np.abs(centre_y))
            for o in obstacle[chosen].T:
                away = np.hypot(o["x"] - centre_x, o["y"] - centre_y) - o["radius"]
                free = np.minimum(free, away)
            room = np.maximum(room, free)
        if (room < needed - _ROUNDING).any():
            e = int(room.argmin())
            heading = math.atan2(world["heading_sin"][e], world["heading_cos"][e])
            raise ValueError(
                f"target_pose ({x[e]:.4g}, {y[e]:.4g}, {heading:.4g}) leaves the target no room to "
                f"turn: a disc of {needed:.3g} m about the centre of its left or right turning "
                f"circle must be clear of obstacles and walls, {max(0.0, room[e]):.3g} m are: move "
                "it or turn it"
            )


def _write_poses(records: Records, poses: npt.NDArray[np.float64], chosen: BoolArray) -> None:
    records["x"][chosen] = poses[chosen][..., 0]
    records["y"][chosen] = poses[chosen][..., 1]
    records["heading_cos"][chosen] = np.cos(poses[chosen][..., 2])
    records["heading_sin"][chosen] = np.sin(poses[chosen][..., 2])


def action_error(index: tuple[int, int, int], value: np.float32) -> ValueError:
    """Return what is raised for actions[index]."""
    e, i, k = index
    return ValueError(
        f"actions[{e}, {i}, {k}] = {value} is not a number in [-1, 1]: scale or "
        "clip the policy's output first"
    )


def _check_array(name: str, array: object, shape: tuple[int, ...]) -> None:
    """Raise if an array is not what compiled code takes it for without looking."""
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{name} must be a numpy array, got {type(array).__name__}")
    if array.dtype != np.float32 or array.shape != shape or not array.flags.carray:
        raise ValueError(
            f"{name} must be a contiguous, writable float32 array of shape {shape}, got "
            f"{array.dtype} of shape {array.shape} with strides {array.strides}"
            + ("" if array.flags.writeable else ", not writable")
        )
