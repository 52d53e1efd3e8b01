"""Runs of the paper's section 4: starts as in figure 7, recordings, and settling times."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines import Policy, begin, load

Floats = npt.NDArray[np.floating[Any]]

SPLIT: Final = "test"
TARGET_HEADING: Final = math.pi
"""In the paper's figure 7 the target is the leftmost robot: it heads towards -x."""
DRAWN_AT_ONCE: Final = 2000
"""Number of worlds drawn at a time, from which starts are selected."""
SPEED_TOLERANCE: Final = 0.1
"""m/s; a speed within this of its last value has settled."""


@dataclass(frozen=True)
class Recording:
    """The motion of all robots of E worlds at T + 1 times.

    Attributes:
        time: (T + 1,) s.
        trackers: (T + 1, E, N, 3): x, y, θ.
        target: (T + 1, E, 3).
        speeds: (T + 1, E, N) m/s.
        slots: (T + 1, E, N, 2): positions of the slots, m.
        leader: (T + 1, E, N): the leader assumed by each tracker; -1: none.
        task: (T + 1, E, N): position in ``posse_baselines.ddcs.TASKS``; -1: none.
        working: (T + 1, E, N).
        radius: Radius of a robot, m.
    """

    time: Floats
    trackers: Floats
    target: Floats
    speeds: Floats
    slots: Floats
    leader: npt.NDArray[np.integer[Any]]
    task: npt.NDArray[np.integer[Any]]
    working: npt.NDArray[np.bool_]
    radius: float

    @property
    def relative(self) -> Floats:
        """Positions of the trackers relative to the target, (T + 1, E, N, 2) m."""
        return self.trackers[..., :2] - self.target[:, :, None, :2]

    @property
    def error(self) -> Floats:
        """Distance of each tracker from the nearest slot, (T + 1, E, N), m."""
        gaps = self.trackers[..., :, None, :2] - self.slots[..., None, :, :]
        return np.asarray(np.linalg.norm(gaps, axis=-1).min(axis=-1))


def draw_starts(scenario: posse.Scenario, starts: int, seed: int) -> tuple[Floats, Floats]:
    """Return starts as in figure 7, tracker poses (E, N, 3) and target poses (E, 3).

    The target is the leftmost robot and heads towards -x: of the scenario's worlds, in order, those
    with all trackers behind the target are selected.
    """
    trackers, targets = [], []
    for first in range(0, 1_000_000, DRAWN_AT_ONCE):
        batch = posse.Batch(scenario, DRAWN_AT_ONCE, seed=seed, split=SPLIT, first_world=first)
        batch.reset()
        tracker, target = _poses(batch.state, "tracker"), _poses(batch.state, "world")
        behind = (tracker[..., 0] > target[:, None, 0]).all(axis=1)
        trackers.append(tracker[behind])
        targets.append(target[behind])
        if sum(map(len, targets)) >= starts:
            break
    drawn = np.concatenate(targets)[:starts]
    drawn[:, 2] = TARGET_HEADING
    return np.concatenate(trackers)[:starts], drawn


def played(scenario: posse.Scenario, seed: int) -> str:
    """Return what a figure says of its worlds: scenario with version, split, seed."""
    return f"{scenario.name} v{scenario.version}, {SPLIT} split, seed {seed}"


def record(
    policy: str | Policy, scenario: posse.Scenario, worlds: int, seed: int, options: Mapping[str, Any] | None = None
) -> Recording:
    """Play a whole episode of ``worlds`` worlds of :data:`SPLIT`."""
    team = load(policy) if isinstance(policy, str) else policy
    scenario = scenario.replace(message_size=team.message_size)
    batch = posse.Batch(scenario, worlds, seed=seed, split=SPLIT, autoreset="disabled")
    observations = batch.reset(options=dict(options or {}))
    memory, offsets = begin(team, batch), np.array(scenario.slot_offsets)
    instants = []
    for step in range(scenario.horizon + 1):
        actions, memory = team.act(observations, memory)
        instants.append(_instant(batch, offsets, team.annotations(memory), observations))
        if step < scenario.horizon:
            observations, *_ = batch.step(actions)
    time = np.arange(scenario.horizon + 1) * scenario.control_step
    trackers, target, speeds, slots, leader, task, working = (np.stack(part) for part in zip(*instants, strict=True))
    return Recording(time, trackers, target, speeds, slots, leader, task, working, scenario.robot_radius)


def _poses(state: Mapping[str, Any], who: str) -> Floats:
    theta = np.arctan2(state[f"{who}_heading_sin"], state[f"{who}_heading_cos"])
    return np.stack([state[f"{who}_x"], state[f"{who}_y"], theta], axis=-1).astype(np.float64)


def _instant(batch: posse.Batch, offsets: Floats, notes: Mapping[str, Any], observations: Any) -> tuple[Any, ...]:
    state = batch.state
    trackers, target = _poses(state, "tracker"), _poses(state, "world")
    c, s = state["world_frame_cos"][:, None], state["world_frame_sin"][:, None]
    x, y = offsets[:, 0], offsets[:, 1]
    slots = np.stack([x * c - y * s, x * s + y * c], axis=-1) + target[:, None, :2]
    none = np.full(trackers.shape[:2], -1)
    working = batch.layout.views(observations)["working"] > 0.0
    return (
        trackers,
        target,
        state["tracker_speed"].astype(np.float64),
        slots,
        notes.get("leader", none),
        notes.get("task", none),
        working,
    )


def settling_times(recording: Recording, tolerance: float) -> Floats:
    """Return the settling time of each world, (E,) s: the paper's "keep a certain value".

    After it, every tracker's position relative to the target stays within ``tolerance`` of its
    last value, and its speed within :data:`SPEED_TOLERANCE` of its last; ``nan`` if that holds
    only for less than the last second.
    """
    relative, speeds = recording.relative, recording.speeds
    moved = np.linalg.norm(relative - relative[-1], axis=-1) > tolerance
    changed = np.abs(speeds - speeds[-1]) > SPEED_TOLERANCE
    unsettled = (moved | changed).any(axis=-1)  # (T + 1, E)
    steps = len(recording.time)
    last = np.where(unsettled.any(axis=0), steps - 1 - unsettled[::-1].argmax(axis=0), -1)
    times = recording.time[np.minimum(last + 1, steps - 1)]
    return np.where(times > recording.time[-1] - 1.0, np.nan, times)


def median_world(times: Floats) -> int:
    """Return the world whose time is the median of the known ones (the lower of two)."""
    known = np.flatnonzero(np.isfinite(times))
    if len(known) == 0:
        return 0
    return int(known[np.argsort(times[known], kind="stable")[(len(known) - 1) // 2]])
