"""Simulation of many worlds together.

The environments, training and evaluation are built on :class:`Batch`.
"""

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.declarations import DeclarationError, Declarations
from posse.engine.arguments import as_float32, in_box, mask_of, options_of, poses_of
from posse.engine.kernels import (
    LOOK,
    START,
    START_FROM_POSES,
    STEP,
    Orders,
    Results,
    direct,
    draw_anew,
    first_bad_start,
    fixed_for,
    kernel_of,
)
from posse.numeric import MOST_THREADS, BoolArray, FloatArray, OwnArrays, Records, over_worlds
from posse.numeric.threads import threads_for
from posse.rules.start import check_drawn
from posse.rules.state import NEVER, WorldArrays, world_record
from posse.scenarios import Scenario, ScenarioError, get_scenario
from posse.scenarios.setting import SPLITS, check_choice, check_count
from posse.signals.layout import ObservationLayout
from posse.signals.reward import check_terms

_OPTIONS: Final = ("reset_mask", "tracker_pose", "target_pose")
_CHANGED: Final = "the declarations have changed since these worlds were made: make a new batch"
# A list, since looking for them in __dict__ would make Python 3.11 read all attributes of a batch five times slower.
_DERIVED: Final = frozenset(("_declared", "_own_terms", "_own_rules", "_kernel", "_orders", "_fixed", "_info"))


@dataclass(frozen=True)
class Snapshot(OwnArrays):
    """A saved state of a batch: :meth:`Batch.save`, :meth:`Batch.restore`."""

    scenario: Scenario
    arrays: WorldArrays = field(repr=False)


class Batch(OwnArrays):
    """A batch of E worlds of one scenario, N trackers each.

    Args:
        scenario: Settings of the worlds, or their name.
        num_worlds: E, at least 1.
        seed: Seed of all random draws, in [0, 2**63). World i of a seed is the same world in every batch.
        split: ``"train"``, ``"validation"`` or ``"test"``: part of the key of every draw, so that
            the splits have no world in common.
        first_world: Index of the batch's first world; that of the last must be below 2**63.
            ``first_world=17, num_worlds=1`` replays world 17 alone.
        autoreset: Behaviour at the end of an episode. ``"next_step"``: the following step starts the next episode and
            ignores its action; ``"same_step"``: the next episode starts at once, and the last observation is in
            ``infos["final_obs"]``; ``"disabled"``: the caller resets, with ``options={"reset_mask": mask}``.
        num_threads: Threads that step the worlds; default: one per core. Never changes a result.
        clip_actions: Whether finite actions outside [-1, 1] are clipped instead of refused.

    Attributes:
        arrays: The state of the worlds; writing to it changes them (poses: by options of :meth:`reset`).
        layout: Position of each field in an observation.
        term_names: Names of the reward terms, in the order in which they are reported.
        observation_shape: (E, rows, F); rows = N, plus one if the target is an agent.
        action_shape: (E, rows, 2 + message_size).
    """

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int,
        *,
        seed: int = 0,
        split: str = "train",
        first_world: int = 0,
        autoreset: str = "next_step",
        num_threads: int | None = None,
        clip_actions: bool = False,
    ) -> None:
        self.scenario = scenario = get_scenario(scenario)
        self.num_worlds = check_count("num_worlds", num_worlds, 1)
        self.first_world = check_count("first_world", first_world, 0)
        check_count("first_world + num_worlds - 1", self.first_world + self.num_worlds - 1, 0)
        self.seed = check_count("seed", seed, 0)
        self.split = check_choice("split", split, SPLITS)
        self.autoreset = check_choice("autoreset mode", autoreset, ("next_step", "same_step", "disabled"))
        self.num_threads = MOST_THREADS if num_threads is None else check_count("num_threads", num_threads, 1)
        if not isinstance(clip_actions, bool):
            raise ScenarioError(f"clip_actions={reprlib.repr(clip_actions)} must be True or False")
        self.clip_actions = clip_actions
        self.layout = ObservationLayout(scenario)
        self.term_names = tuple(term.name for term in Declarations.of(scenario).reward_terms)
        self._rewards = tuple((f"reward/{name}", k) for k, name in enumerate(self.term_names))
        self.observation_shape = (self.num_worlds, scenario.num_agents, self.layout.size)
        self.action_shape = (self.num_worlds, scenario.num_agents, 2 + scenario.message_size)
        try:
            self.arrays = WorldArrays.allocate(scenario, self.num_worlds)
        except (MemoryError, ValueError, OverflowError):
            each = sum(array.nbytes for array in WorldArrays.allocate(scenario, 1))
            raise ScenarioError(
                f"num_worlds={num_worlds} of {each} bytes each are more than there is memory for: lower it"
            ) from None
        self._started = False
        self._over = 0  # episodes that are over
        self._prepare()

    def _prepare(self) -> None:
        """Set the attributes that are not pickled (:data:`_DERIVED`)."""
        self._declared = Declarations.of(self.scenario)
        self._own_terms = not all(term.built_in for term in self._declared.reward_terms)
        observed = (*self._declared.motions, *self._declared.sensors, *self._declared.fields)
        self._own_rules = not all(each.built_in for each in observed)
        self._kernel = direct(kernel_of(self._declared))
        self._orders = np.full(self.num_worlds, STEP, np.uint8)
        threads = threads_for(self.num_worlds, self.scenario.num_agents, self.num_threads)
        self._fixed = fixed_for(self.scenario, self._declared.reward_terms, self.arrays, threads)
        zeros = np.zeros(self.num_worlds)
        zeros.flags.writeable = False
        metrics = (f"metrics/{metric.name}" for metric in self._declared.metrics)
        self._info = dict.fromkeys(("score", *(key for key, _ in self._rewards), *metrics), zeros)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in _DERIVED}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        now, record = ObservationLayout(self.scenario), world_record(Declarations.of(self.scenario))
        if (now.size, now.offsets, record) != (self.layout.size, self.layout.offsets, self.arrays.world.dtype):
            raise DeclarationError(_CHANGED)
        self._prepare()

    # The state of the worlds.

    @property
    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Every state array by name, as read-only views that follow the worlds.

        Names are ``<array>_<field>``, e.g. ``"tracker_x"`` (E, N) or ``"world_step"`` (E,);
        :mod:`posse.rules.state` documents every field.
        """
        names = self.arrays.by_name()
        for view in names.values():
            view.flags.writeable = False
        return names

    @property
    def working(self) -> BoolArray:
        """(E, N) whether each tracker works."""
        return np.asarray(self.arrays.tracker["broken_at"] == NEVER)

    def metrics(self) -> dict[str, npt.NDArray[np.float64]]:
        """Return the metrics of the current episodes by name, (E,) each; ResetNeeded before the first :meth:`reset`."""
        self.check_started("metrics")
        return {each.name: each.of(self.scenario, self.arrays.world) for each in self._declared.metrics}

    def save(self) -> Snapshot:
        """Return the current state of the worlds, for :meth:`restore`; ResetNeeded before the first :meth:`reset`."""
        self.check_started("save")
        return Snapshot(self.scenario, self.arrays.copy())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Restore a snapshot of this scenario and number of worlds, or raise ValueError; return its observations."""
        if not isinstance(snapshot, Snapshot):
            raise ValueError(f"restore takes what save() returned, got {reprlib.repr(snapshot)}")
        self._check_fit("a snapshot", snapshot.arrays.world, snapshot.scenario, self.num_worlds)
        self.arrays.write(snapshot.arrays)
        self._started = True
        return self.observe()

    def observe(self) -> FloatArray:
        """Return the current observations of the worlds, (E, rows, F); ResetNeeded before the first :meth:`reset`."""
        self.check_started("observe")
        return self._execute(LOOK)

    def copies(self, count: int, *, seed: int = 0, alike: bool = False, into: "Batch | None" = None) -> "Batch":
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
        """
        count, seed = check_count("count", count, 1), check_count("seed", seed, 0)
        self.check_started("copies")
        if into is None:
            into = Batch(
                self.scenario,
                self.num_worlds * count,
                seed=self.seed,
                split=self.split,
                num_threads=self.num_threads,
                clip_actions=self.clip_actions,
            )
        elif type(into) is not Batch or into is self:
            raise ValueError(f"copies go into another Batch, got {reprlib.repr(into)}")
        self._check_fit("a batch for the copies", into.arrays.world, into.scenario, self.num_worlds * count)
        for mine, theirs in zip(self.arrays, into.arrays, strict=True):
            by_world = mine.view(np.uint8).reshape(self.num_worlds, 1, -1)  # plain bytes, which are copied fastest
            theirs.view(np.uint8).reshape(self.num_worlds, count, -1)[...] = by_world
        draw_anew(self._fixed.config, into.arrays.world, into.arrays.tracker, count, seed, alike)
        into._started, into._over = True, count * self._over
        return into

    def _check_fit(self, what: str, worlds: Records, scenario: Scenario, wanted: int) -> None:
        if scenario != self.scenario or len(worlds) != wanted:
            raise ValueError(
                f"{what} of {len(worlds)} worlds of {scenario.name!r} does not fit {wanted} worlds of "
                f"{self.scenario.name!r}: scenario and number of worlds must be equal"
            )
        if worlds.dtype != self.arrays.world.dtype:
            raise DeclarationError(_CHANGED)

    # The start of episodes.

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> FloatArray:
        """Start an episode in every world and return the observations (E, rows, F).

        Args:
            seed: Start over from episode 0 of this seed; ``None``: each world's next episode.
            options: ``"reset_mask"`` (E,) bool: only these worlds, possibly none;
                ``"tracker_pose"`` (N, 3) or (E, N, 3) and ``"target_pose"`` (3,) or (E, 3):
                start from these (x, y, θ). Poses that are not given are drawn as without them.

        Raises:
            ResetNeeded: A mask at the first reset.
            ValueError: An unknown option, or one of a wrong shape or not finite; start poses in which robots overlap
                each other, an obstacle or a wall, or a scripted target has no room to turn. Nothing is changed.
            ScenarioError: The scenario is too tight for a start to be drawn. Nothing is changed.
        """
        given = options_of(options)
        for key in given:
            if key not in _OPTIONS:
                raise ValueError(f"unknown option {reprlib.repr(key)}; options are: {', '.join(_OPTIONS)}")
        new_seed = self.seed if seed is None else check_count("seed", seed, 0)
        chosen = mask_of(given, self.num_worlds)
        if not self._started and not chosen.all():
            raise ResetNeeded("the first reset starts every world: call it without reset_mask")
        poses = poses_of(given, self.scenario, self.num_worlds)
        before, world = self.arrays.copy(), self.arrays.world
        if seed is not None or not self._started:
            world["seed"][chosen] = new_seed
            world["split"][chosen] = SPLITS.index(self.split)
            world["index"][chosen] = self.first_world + np.flatnonzero(chosen)
            world["episode"][chosen] = 0
        else:
            world["episode"][chosen] += 1
        try:
            observations = self._execute(START, chosen)
            check_drawn(self.scenario, world, chosen, poses)
            if poses:
                self._place(poses, chosen)
                observations = self._execute(START_FROM_POSES, chosen)
        except BaseException:
            self.arrays.write(before)
            if self._started:
                self.observe()  # and note again what follows from the state
            raise
        self.seed, self._started = new_seed, True
        return observations

    def _place(self, poses: Mapping[str, npt.NDArray[np.float64]], chosen: BoolArray) -> None:
        """Set poses in the chosen worlds, and check them by the rules of a drawn start."""
        arrays = self.arrays
        for name, pose in poses.items():
            records = arrays.tracker if name == "tracker_pose" else arrays.world
            x, y, heading = np.moveaxis(pose[chosen], -1, 0)
            records["x"][chosen], records["y"][chosen] = x, y
            records["heading_cos"][chosen], records["heading_sin"][chosen] = np.cos(heading), np.sin(heading)
        config, n = self._fixed.config, self.scenario.num_trackers
        e, i = first_bad_start(config, arrays.world, arrays.tracker, arrays.obstacle, chosen)
        if e < 0:
            return
        if i <= n:
            robot = f"tracker_{i}" if i < n else "the target"
            raise ValueError(f"{robot} of world {e} would start in a wall, an obstacle or another robot: move it")
        at = ", ".join(f"{value:.4g}" for value in poses["target_pose"][e])
        radius = config["target_speed"][0] / config["target_turn_rate"][0] + config["safe_distance"][0]
        raise ValueError(
            f"target_pose ({at}) leaves the target no room to turn: a disc of {radius:.3g} m about the centre of its "
            "left or right turning circle must be clear of obstacles and walls: move it or turn it"
        )

    def _execute(self, order: int, chosen: BoolArray | slice = slice(None)) -> FloatArray:
        """Execute an order other than STEP in the chosen worlds; return every world's observations."""
        results, orders = self._new_results(), np.full(self.num_worlds, LOOK, np.uint8)
        orders[chosen] = order
        self._advance(np.zeros(self.action_shape, np.float32), results, orders)  # actions are not read
        self._kernel = direct(self._kernel)  # which this call has compiled
        if not self._started:
            self.layout.check_added(results.observations)
        return results.observations

    # The step.

    def step(self, actions: npt.ArrayLike) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step.

        Args:
            actions: (E, rows, 2 + message_size) numbers in [-1, 1]: the speed (-1 is 0, 1 the
                greatest), the turn rate (1 is the greatest to the left), the message. Numbers up
                to 1e-6 outside, which may result from rounding, are clipped.

        Returns:
            observations (E, rows, F), rewards (E, rows), terminated (E,), truncated (E,), infos. Infos have the same
            keys at every step: ``"score"`` (E,) of the team in this step, [0, 1]; ``"reward/<term>"`` (E, rows), each
            reward term, unscaled (``posse.REWARD_TERMS``); ``"metrics/<metric>"`` (E,), each metric of the episode
            (``posse.METRICS``), 0 where it goes on; ``"working"`` (E, N), only in scenarios where trackers break. With
            autoreset ``"same_step"`` also ``"final_obs"`` (E, rows, F), the observations before new episodes start.
            Arrays are never overwritten later.

        Raises:
            ResetNeeded: Before the first :meth:`reset`, or after an end with autoreset disabled.
            ValueError: Actions of a wrong type or shape, not finite, or outside [-1, 1]. Nothing is changed.
            ScenarioError: The scenario is too tight for the start of a next episode to be drawn; only a reset helps.
        """
        self.check_running()
        actions, results = self.actions_of(actions), self._new_results()
        begun = self._over > 0 and self.autoreset == "next_step"
        self._advance(actions, results)
        observations, rewards, terms, scores, terminated, truncated = results
        infos = self._infos_of(scores, terms)
        if self._over:
            ended = terminated | truncated
            for name, values in self.metrics().items():
                infos[f"metrics/{name}"] = np.where(ended, values, 0.0)
        if self.autoreset == "same_step":
            infos["final_obs"] = observations
            if self._over:
                self.arrays.world["episode"][ended] += 1
                observations, begun = self._execute(START, ended), True
        if begun:
            try:
                check_drawn(self.scenario, self.arrays.world, self.arrays.world["step"] == 0)
            except ScenarioError:
                self._started = False  # only a reset helps
                raise
        return observations, rewards, terminated, truncated, infos

    def actions_of(self, actions: npt.ArrayLike) -> FloatArray:
        """Return actions as :meth:`step` takes them, (E, rows, 2 + m) float32 in [-1, 1]; its ValueError for others."""
        return in_box(as_float32("the array of actions", actions, self.action_shape), self.clip_actions)

    def _infos_of(self, scores: npt.NDArray[Any], terms: FloatArray) -> dict[str, Any]:
        """Return the infos of scores (E,) and terms (E, rows, K) while episodes go on."""
        infos: dict[str, Any] = self._info.copy()
        infos["score"], by_term = scores, terms.transpose(2, 0, 1)
        for key, k in self._rewards:
            infos[key] = by_term[k]
        if self.scenario.breaks > 0:
            infos["working"] = self.working
        return infos

    def _advance(self, actions: FloatArray, results: Results, orders: Orders | None = None) -> None:
        """Advance every world by valid actions, or execute its order, and note how many episodes are over.

        Several threads share the worlds. Episodes that end are not started anew.
        """
        arguments = self._fixed, self._orders if orders is None else orders, actions, results
        threads = len(self._fixed.scratch)
        if threads == 1:  # as over_worlds() does, which would take a tenth longer for one world
            self._over = self._kernel(*arguments, 0, 0, self.num_worlds)
        else:
            self._over = sum(over_worlds(self._kernel, arguments, self.num_worlds, self.scenario.num_agents, threads))
        if self._own_terms and not np.isfinite(results.rewards).all():
            check_terms(self._declared.reward_terms, results.terms)
        if self._own_rules and not np.isfinite(results.observations).all():
            self.layout.check_added(results.observations)
            s = self.scenario
            raise DeclarationError(
                f"an observation is not finite: see what target_motion={s.target_motion!r} sets, and what "
                f"sensor={s.sensor!r} measures"
            )

    def _new_results(self) -> Results:
        """Return output arrays for a pass over the worlds, uninitialised."""
        worlds, rows, _ = self.observation_shape
        return Results(
            np.empty(self.observation_shape, np.float32),
            np.empty((worlds, rows), np.float32),
            np.empty((worlds, rows, len(self.term_names)), np.float32),
            np.empty(worlds, np.float32),
            np.empty(worlds, np.bool_),
            np.empty(worlds, np.bool_),
        )

    def check_started(self, what: str) -> None:
        """Raise ResetNeeded before the first :meth:`reset`."""
        if not self._started:
            raise ResetNeeded(f"{what} before reset: call reset() first")

    def check_running(self) -> None:
        """Raise ResetNeeded if a step is not possible now."""
        self.check_started("step")
        if self._over and self.autoreset == "disabled":
            over = np.flatnonzero(self.arrays.world["over"])
            more = f" and {len(over) - 1} more" if len(over) > 1 else ""
            raise ResetNeeded(
                f"step after the end of the episode of world {over[0]}{more}: call reset() first, "
                'or reset(options={"reset_mask": mask}) for these worlds alone'
            )


def of_batch(settings: dict[str, Any]) -> dict[str, Any]:
    """Take the arguments of :class:`Batch` out of settings, and return them; the others are fields of its scenario."""
    return {name: settings.pop(name) for name in Batch.__init__.__kwdefaults__ or () if name in settings}
