"""Play a policy in a batch and record what it did, or play it beside a PettingZoo environment."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

import posse
from posse import Batch, ObservationLayout, PairedBatch, Scenario, get_scenario
from posse.declarations import is_number
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Annotations, Memory, Policy, PolicyError, begin
from posse_baselines.registry import Target

Array = npt.NDArray[Any]

_STEPS: Final = ("actions", "rewards", "terms", "score", "terminated", "truncated", "annotations")
_POSES: Final = {"tracker_pose": "tracker", "target_pose": "world"}


@dataclass(frozen=True)
class Trajectory:
    """What E worlds did in T steps, as arrays by name: ``trajectory["tracker_pose"]``.

    A *frame* is the worlds at a control step: frame 0 is the start, step t leads from frame t to frame t + 1. Rows are
    the trackers, then the target if a policy moves it, from without or within the batch.

    ====================== ============================ ====================================================
    name to record         shape                        what it holds
    ====================== ============================ ====================================================
    observations           (T + 1, E, rows, F)
    tracker_pose           (T + 1, E, N, 3)             x, y in m, heading in rad
    target_pose            (T + 1, E, 3)
    any of ``batch.state`` (T + 1, E, ...)              ``tracker_speed``, ``heard_step``, ``world_score``, ...
    state                  (T + 1, E, ...) each         all of ``batch.state``, each by its own name
    actions                (T, E, rows, 2 + m)
    rewards                (T, E, rows)
    terms                  (T, E, rows) each            terms of the reward, as ``reward/NAME``
    score                  (T, E)
    terminated, truncated  (T, E)
    annotations            (T, E, N, ...) each          annotations of the policy on frame t, as ``annotation/NAME``
    ====================== ============================ ====================================================

    Attributes:
        steps: T.
        arrays: The arrays by name.
        layout: Of the observations.
        split: Of the worlds.
        lengths: (E,) steps of each world's first episode, or T if it has not ended. With autoreset, later frames are
            of the next episode.
        metrics: Every metric by name, (E,), of the first episode so far.
    """

    steps: int
    arrays: dict[str, Array] = field(repr=False)
    layout: ObservationLayout
    split: str
    lengths: npt.NDArray[np.int64]
    metrics: dict[str, npt.NDArray[np.float64]] = field(repr=False)

    @property
    def scenario(self) -> Scenario:
        """Settings of the worlds."""
        return self.layout.scenario

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    def named(self, prefix: str) -> dict[str, Array]:
        """Return the arrays whose names begin with ``prefix/``, by the rest of the name."""
        start = f"{prefix}/"
        return {name.removeprefix(start): array for name, array in self.arrays.items() if name.startswith(start)}

    def episode(self, world: int) -> "Trajectory":
        """Return the first episode of one world: E = 1."""
        world = range(len(self.lengths))[world]  # also from the end
        steps, one = int(self.lengths[world]), slice(world, world + 1)
        surplus = self.steps - steps  # rows after its end
        arrays = {name: array[: len(array) - surplus, one] for name, array in self.arrays.items()}
        metrics = {name: values[one] for name, values in self.metrics.items()}
        return Trajectory(steps, arrays, self.layout, self.split, self.lengths[one], metrics)


class Recorder:
    """A batch that records what is asked for by name; :class:`Trajectory` lists the names.

    :func:`rollout` records a policy. Where something else drives the robots, a recorder stands for the batch::

        recorder = Recorder(batch, ["tracker_pose", "actions"])
        observations = recorder.reset()
        while recorder.going:
            observations, *_ = recorder.step(actions)
        recorder.trajectory()

    Attributes:
        going: Number of worlds whose first episode has not ended.
        steps: Number of recorded steps; -1 before the first reset.

    Raises:
        ValueError: An unknown name, or one of a frame with ``autoreset="same_step"``, which overwrites the last one.
    """

    def __init__(self, batch: Batch, record: str | Iterable[str] = ()) -> None:
        self.batch = batch
        names, state = (record,) if isinstance(record, str) else tuple(record), tuple(batch.state)
        known = ("observations", *_POSES, *_STEPS, "state", *state)
        for name in names:
            if name not in known:
                raise ValueError(f"record={name!r} is unknown; names are: {', '.join(known)}")
            if name not in _STEPS and batch.autoreset == "same_step":
                raise ValueError(
                    f"record={name!r} is not possible with autoreset='same_step', which overwrites the last state of "
                    "an episode: make the batch with autoreset='disabled' or 'next_step'"
                )
        groups = {"state": state, "terms": ("reward",), "annotations": ("annotation",)}
        self._names = dict.fromkeys(each for name in names for each in groups.get(name, (name,)))
        self._reads_state = not self._names.keys().isdisjoint((*_POSES, *state))
        self.going, self.steps = batch.num_worlds, -1

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> FloatArray:
        """Start an episode in every world (see :meth:`posse.Batch.reset`) and record from here."""
        if isinstance(options, Mapping) and options.get("reset_mask") is not None:
            raise ValueError("reset_mask leaves episodes running, of which the beginning is not recorded: leave it out")
        observations = self.batch.reset(seed=seed, options=options)
        self.going, self.steps = self.batch.num_worlds, 0
        self._over = np.zeros(self.batch.num_worlds, np.bool_)
        self._lengths = np.zeros(self.batch.num_worlds, np.int64)
        self._rows: dict[str, list[Array]] = defaultdict(list)
        self._metrics: dict[str, npt.NDArray[np.float64]] = {}
        self._keep_frame(self.batch.everyone[1].observations if isinstance(self.batch, PairedBatch) else observations)
        return observations

    def step(
        self, actions: npt.ArrayLike, annotations: Annotations | None = None
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance the batch (see :meth:`posse.Batch.step`) and record the step, with the annotations of a policy."""
        self._check_reset()
        done = self.batch.step(actions)
        observations, rewards, terminated, truncated, infos = done
        self.steps += 1
        ended = terminated | truncated
        if ended.any():
            first = ended & ~self._over
            for name in self.batch.metrics():
                column = self._metrics.setdefault(name, np.full(len(first), np.nan))
                column[first] = infos[f"metrics/{name}"][first]
            self._lengths[first] = self.steps
            self._over |= first
            self.going -= int(first.sum())
        if not self._names:
            return done
        terms = {f"reward/{term}": infos[f"reward/{term}"] for term in self.batch.term_names}
        if isinstance(self.batch, PairedBatch):
            actions, every = self.batch.everyone
            observations, rewards = every.observations, every.rewards
            terms = dict(zip(terms, np.moveaxis(every.terms, -1, 0), strict=True))
        notes = {f"annotation/{name}": np.asarray(value) for name, value in (annotations or {}).items()}
        rows_of_all = self.batch.action_shape[:2]
        for name, value in notes.items():
            if value.dtype.kind not in "biuf" or value.shape[:2] != rows_of_all:
                raise ValueError(f"{name} must be numbers of shape {rows_of_all}, got {value.dtype} of {value.shape}")
        rows: dict[str, Array] = {
            "score": infos["score"],
            "rewards": rewards,
            "actions": np.asarray(actions, np.float32),
            "terminated": terminated,
            "truncated": truncated,
        }
        self._keep(rows | terms | notes)
        self._keep_frame(observations)
        return done

    def _check_reset(self) -> None:
        if self.steps < 0:
            raise ResetNeeded("a recorder records from its own reset on: call reset() of it first")

    def _keep_frame(self, observations: FloatArray) -> None:
        state = self.batch.state if self._reads_state else {}  # it takes as long as a step of a hundred worlds
        poses = {name: poses_of(state, who) for name, who in _POSES.items() if name in self._names}
        self._keep({**state, **poses, "observations": observations})

    def _keep(self, rows: Mapping[str, Array]) -> None:
        """Keep copies of the rows that were asked for by name, or by the part of the name before the slash."""
        for name, row in rows.items():
            if name.partition("/")[0] in self._names:
                self._rows[name].append(row.copy())

    def trajectory(self) -> Trajectory:
        """Return what was recorded since the reset; ResetNeeded before the first one."""
        self._check_reset()
        now = {name: np.array(values, np.float64) for name, values in self.batch.metrics().items()}
        for name, values in self._metrics.items():
            now[name][self._over] = values[self._over]
        arrays = {name: np.stack(rows) for name, rows in self._rows.items()}
        lengths = np.where(self._over, self._lengths, self.steps)
        return Trajectory(self.steps, arrays, self.batch.layout, self.batch.split, lengths, now)


def poses_of(state: Mapping[str, Array], who: str) -> Array:
    """Return the poses in a state: (..., N, 3) of ``"tracker"``, (..., 3) of ``"world"``, the target; m, rad."""
    heading = np.arctan2(state[f"{who}_heading_sin"], state[f"{who}_heading_cos"])
    return np.stack([state[f"{who}_x"], state[f"{who}_y"], heading], axis=-1)


def batch_for(
    policy: Policy, scenario: str | Scenario, num_worlds: int = 1, target: Target | None = None, **settings: Any
) -> Batch:
    """Return worlds of a scenario for a policy that moves the trackers, against a target or the scenario's motion.

    Their ``message_size`` is raised to that of the policy; ``settings`` are further arguments of :func:`posse.batch`.
    PolicyError if nothing moves the target, or the policy plans ahead in copies of the worlds, which lack its policy.
    """
    moved = None if target is None else target.policy
    if moved is not None and policy.reads_state:
        raise PolicyError(
            f"{policy.name!r} reads the state and plays the target's motion ahead: it cannot play against a target "
            "that is moved by a policy"
        )
    scenario = get_scenario(scenario)
    size = max(scenario.message_size, policy.message_size)
    motion = scenario.target_motion if target is None else target.motion
    scenario = scenario.replace(message_size=size, target_motion=motion)
    return _moving(posse.batch(scenario, num_worlds, target_policy=moved, **settings))


def _moving(batch: Batch) -> Batch:
    """Return a batch; PolicyError if its target is an agent that nothing moves."""
    if batch.scenario.target_is_agent and not isinstance(batch, PairedBatch):
        raise PolicyError(f"the target of {batch.scenario.name!r} is an agent: give a target too, or try posse play")
    return batch


def rollout(
    batch: Batch,
    policy: Policy,
    record: str | Collection[str] = (),
    *,
    steps: int | None = None,
    seed: int | None = None,
    options: Mapping[str, Any] | None = None,
    after_step: Callable[[Memory], object] | None = None,
) -> Trajectory:
    """Reset a batch, play a policy in it and return what was recorded.

    Args:
        batch: The worlds.
        policy: Moves the trackers; what moves the target is inside the batch (:func:`batch_for`).
        record: Names of arrays, or one, listed in :class:`Trajectory`; its metrics are always there.
        steps: How many to play, through the ends of episodes; default: until the first episode of every world has
            ended. With autoreset disabled, it ends there in any case.
        seed: As for :meth:`posse.Batch.reset`.
        options: As for :meth:`posse.Batch.reset`.
        after_step: Called after each step with the policy's memory.

    Raises:
        PolicyError: The policy does not fit the batch, the target is an agent that nothing moves, or episodes end at
            different steps with autoreset disabled.
        ValueError: An unknown name to record, or ``steps`` that are no whole number of at least 1.
    """
    if steps is not None and not (is_number(steps) and steps >= 1 and steps == int(steps)):
        raise ValueError(f"steps={steps!r} must be a whole number of at least 1")
    recorder = Recorder(_moving(batch), record)
    memory = begin(policy, batch)
    observations = recorder.reset(seed=seed, options=options)
    while recorder.steps != steps and (recorder.going or (steps is not None and batch.autoreset != "disabled")):
        actions, memory = policy.act(observations, memory)
        annotations = policy.annotations(memory) if "annotations" in record else None
        observations, *_ = recorder.step(actions, annotations)
        if recorder.going < batch.num_worlds:  # an episode has ended
            if batch.autoreset == "disabled" and recorder.going:
                raise PolicyError("episodes of this batch end at different steps: play it with an autoreset mode")
            begins = batch.arrays.world["step"] == 0
            if begins.any():
                memory = policy.restart(memory, begins)
        if after_step is not None:
            after_step(memory)
    return recorder.trajectory()


def play(batch: Batch, policy: Policy, *, seed: int | None = None) -> dict[str, npt.NDArray[np.float64]]:
    """Play one episode in every world, see :func:`rollout`, and return its metrics by name, (E,) each."""
    return rollout(batch, policy, seed=seed).metrics
