"""Runs of the paper's section 4: starts as in figure 7, what figures read from a trajectory, and settling times."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines import Policy, Trajectory, batch_for, load, rollout
from posse_baselines.playing import poses_of

Floats = npt.NDArray[np.floating[Any]]

SPLIT: Final = "test"
TARGET_HEADING: Final = math.pi
"""In the paper's figure 7 the target is the leftmost robot: it heads towards -x."""
TOLERANCE: Final = 0.1
"""m; a position relative to the target within this of its last value has settled."""
SPEED_TOLERANCE: Final = 0.1
"""m/s; a speed within this of its last value has settled."""
_DRAWN_AT_ONCE: Final = 2000  # worlds, from which starts are selected
_FRAME: Final = ("world_frame_cos", "world_frame_sin")
_RECORD: Final = ("tracker_pose", "target_pose", "tracker_speed", "tracker_broken_at", "annotations", *_FRAME)


def draw_starts(scenario: posse.Scenario, starts: int, seed: int) -> dict[str, Floats]:
    """Return starts as in figure 7, options of a reset: ``tracker_pose`` (E, N, 3) and ``target_pose`` (E, 3).

    The target is the leftmost robot and heads towards -x: of the scenario's worlds, in order, those
    with all trackers behind the target are selected.
    """
    trackers, targets = [], []
    for first in range(0, 1_000_000, _DRAWN_AT_ONCE):
        batch = posse.Batch(scenario, _DRAWN_AT_ONCE, seed=seed, split=SPLIT, first_world=first)
        batch.reset()
        tracker, target = (poses_of(batch.state, who).astype(np.float64) for who in ("tracker", "world"))
        behind = (tracker[..., 0] > target[:, None, 0]).all(axis=1)
        trackers.append(tracker[behind])
        targets.append(target[behind])
        if sum(map(len, targets)) >= starts:
            break
    drawn = np.concatenate(targets)[:starts]
    drawn[:, 2] = TARGET_HEADING
    return {"tracker_pose": np.concatenate(trackers)[:starts], "target_pose": drawn}


def run_of(
    policy: str | Policy, scenario: posse.Scenario, worlds: int, seed: int, options: Mapping[str, Any] | None = None
) -> Trajectory:
    """Play a whole episode in ``worlds`` worlds of :data:`SPLIT`."""
    team = load(policy)
    batch = batch_for(team, scenario, worlds, seed=seed, split=SPLIT, autoreset="disabled")
    return rollout(batch, team, _RECORD, options=options)


def played(scenario: posse.Scenario, seed: int) -> str:
    """Return what a figure says of its worlds: scenario with version, split, seed."""
    return f"{scenario.name} v{scenario.version}, {SPLIT} split, seed {seed}"


def times(run: Trajectory) -> Floats:
    """Return the time of each frame, (T + 1,) s."""
    return np.arange(run.steps + 1) * run.scenario.control_step


def relative(run: Trajectory) -> Floats:
    """Return the positions of the trackers relative to the target, (T + 1, E, N, 2) m."""
    return run["tracker_pose"][..., :2].astype(np.float64) - run["target_pose"][:, :, None, :2]


def slots(run: Trajectory) -> Floats:
    """Return the positions of the slots, (T + 1, E, N, 2) m."""
    c, s = (run[name][..., None] for name in _FRAME)
    x, y = np.array(run.scenario.slot_offsets).T
    return np.stack([x * c - y * s, x * s + y * c], axis=-1) + run["target_pose"][:, :, None, :2]


def slot_error(run: Trajectory) -> Floats:
    """Return the distance of each tracker from the nearest slot, (T + 1, E, N) m."""
    gaps = run["tracker_pose"][..., :, None, :2] - slots(run)[..., None, :, :]
    return np.asarray(np.linalg.norm(gaps, axis=-1).min(axis=-1))


def working(run: Trajectory) -> npt.NDArray[np.bool_]:
    """Return which trackers are not broken, (T + 1, E, N)."""
    return run["tracker_broken_at"] > np.arange(run.steps + 1)[:, None, None]


def told(run: Trajectory, name: str) -> npt.NDArray[np.integer[Any]]:
    """Return an annotation of the policy, (T + 1, E, N), with its last row twice; -1: it has none."""
    notes = run.named("annotation").get(name)
    none = np.full(run["tracker_speed"].shape, -1)
    return none if notes is None else np.concatenate([notes, notes[-1:]])


def settling_times(run: Trajectory) -> Floats:
    """Return the settling time of each world, (E,) s: the paper's "keep a certain value".

    After it, every tracker's position relative to the target stays within :data:`TOLERANCE` of its last value, and its
    speed within :data:`SPEED_TOLERANCE` of its last; ``nan`` if that holds only for less than the last second.
    """
    place, speeds, time = relative(run), run["tracker_speed"].astype(np.float64), times(run)
    moved = np.linalg.norm(place - place[-1], axis=-1) > TOLERANCE
    changed = np.abs(speeds - speeds[-1]) > SPEED_TOLERANCE
    settled = time[np.minimum(first_without((moved | changed).any(axis=-1)), run.steps)]
    return np.where(settled > time[-1] - 1.0, np.nan, settled)


def first_without(condition: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Return the first frame of each world from which on a condition, (T + 1, E), holds no more; T + 1: none."""
    return np.where(condition.any(axis=0), len(condition) - condition[::-1].argmax(axis=0), 0)


def median_world(times: Floats) -> int:
    """Return the world whose time is the median of the known ones (the lower of two)."""
    known = np.flatnonzero(np.isfinite(times))
    if len(known) == 0:
        return 0
    return int(known[np.argsort(times[known], kind="stable")[(len(known) - 1) // 2]])
