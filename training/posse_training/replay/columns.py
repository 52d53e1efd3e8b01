"""The columns of a recorded episode, with names and sources, and its events.

========================== ================= ======================================================
column                     shape of a row    what it holds
========================== ================= ======================================================
tracker_x, tracker_y       (N,) m            position of each tracker
tracker_heading            (N,) rad          its heading, without jumps of 2π
tracker_sees               (N,)              1: its own sensor sees the target
tracker_slot               (N,)              the slot that it occupies; -1: none
believed_x, _y, _heading   (N,) m, rad       the pose in which it believes to be. Omitted if poses do not drift
tracker_broken             (N,)              1: it is broken
tracker_sensor_dead        (N,)              1: its target sensor is in an outage
tracker_radio_dead         (N,)              1: its radio is in an outage
tracker_fix_step           (N,)              step of its best fix of the target; -1: none
tracker_fix_x, _y          (N,) m            position of that fix
tracker_fix_heading        (N,) rad          the target's heading in it
heard_step                 (N, N)            step at which the last message that i received from j
                                             was sent; -1: never. Omitted if the radio is perfect
target_x, _y, _heading     () m, rad         the target
target_frame               () rad            heading of the slot frame, ψ
target_dart                ()                1: a smart target darts
score                      ()                score of the step
action                     (rows, 2)         speed and turn rate, in [-1, 1]
reward/NAME                (rows,)           each term with a weight in the scenario, unweighted
belief/NAME                (N, ...)          annotations by the policy
observation/NAME           (rows, ...)       each field; without ``observations`` the sonar alone
========================== ================= ======================================================

Rows are the trackers, followed by the target if it is an agent.
"""

import itertools
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse_training.replay.episode import Event

_MARKS: Final = {
    "world_detected_at": ("detection", "target detected"),
    "world_settled_at": ("settled", "settled: every slot held"),
    "world_recovered_at": ("settled", "settled again after a loss"),
}
_TOUCHED: Final = {
    "world_contacts_tracker": "each other",
    "world_contacts_obstacle": "an obstacle or wall",
    "world_contacts_target": "the target",
}

Array = npt.NDArray[Any]
Arrays = Mapping[str, Array]
"""Of one world, by the names of a trajectory: T + 1 rows each, or T of what belongs to a step."""


def columns_of(arrays: Arrays, layout: ObservationLayout, world: Mapping[str, Any]) -> dict[str, Array]:
    """Return the columns of an episode, with the reward terms and fields that its world describes."""
    columns = _states(arrays, layout.scenario)
    columns["action"] = _last_kept(arrays["actions"])[..., :2]
    for entry in world["terms"]:
        term = arrays[f"reward/{entry['name']}"]  # the first frame has no reward
        columns[f"reward/{entry['name']}"] = np.concatenate([np.zeros_like(term[:1]), term])
    for name, values in arrays.items():
        if name.startswith("annotation/"):
            columns[f"belief/{name.removeprefix('annotation/')}"] = _last_kept(values)
    views = layout.views(arrays["observations"])
    return columns | {f"observation/{entry['name']}": views[entry["name"]] for entry in world["fields"]}


def _last_kept(rows: Array) -> Array:
    """Return T rows as T + 1; the last frame, which has no action, repeats the row before."""
    return np.concatenate([rows, rows[-1:]])


def _angle(arrays: Arrays, cosine: str, sine: str) -> Array:
    return np.unwrap(np.arctan2(arrays[sine], arrays[cosine]), axis=0)


def _states(states: Arrays, scenario: Scenario) -> dict[str, Array]:
    """Return the columns of the robots, the target and the radio."""
    step = states["world_step"][:, None]

    def in_outage(name: str) -> Array:
        since = step.astype(np.int64) - states[name]
        return (since >= 0) & (since < scenario.outage_steps)

    kept = [f"tracker_{name}" for name in ("x", "y", "sees", "slot", "fix_step", "fix_x", "fix_y")]
    columns = {name: states[name] for name in kept} | {
        "tracker_heading": _angle(states, "tracker_heading_cos", "tracker_heading_sin"),
        "tracker_broken": states["tracker_broken_at"] <= step,
        "tracker_sensor_dead": in_outage("tracker_sensor_dead_from"),
        "tracker_radio_dead": in_outage("tracker_radio_dead_from"),
        "tracker_fix_heading": _angle(states, "tracker_fix_cos", "tracker_fix_sin"),
        "target_x": states["world_x"],
        "target_y": states["world_y"],
        "target_heading": _angle(states, "world_heading_cos", "world_heading_sin"),
        "target_frame": _angle(states, "world_frame_cos", "world_frame_sin"),
        "target_dart": states["world_pressed"] < 0,
        "score": states["world_score"],
    }
    if states["odometry_x"].size:
        for name in ("x", "y", "heading"):
            columns[f"believed_{name}"] = columns[f"tracker_{name}"] + states[f"odometry_{name}"]
    if states["heard_step"].size:
        columns["heard_step"] = states["heard_step"]
    return columns


def find_events(states: Arrays) -> tuple[Event, ...]:
    """Return the events of an episode in order of time; ``annotation/leader`` (T, N) may be missing, -1: none."""
    found = []
    for name, (kind, text) in _MARKS.items():
        if (at := int(states[name][-1])) >= 0:
            found.append(Event(at, kind, text))

    darts = states["world_pressed"] < 0
    begins = np.flatnonzero(darts & np.diff(darts, prepend=False))
    found += [Event(at, "dart", "the target darts") for at in begins.tolist()]

    touching = states["tracker_onsets"] > 0
    for at in np.flatnonzero(touching.any(axis=1)).tolist():
        robots = np.flatnonzero(touching[at]).tolist()
        names = " and ".join(f"tracker {i}" for i in robots)
        touched = [what for name, what in _TOUCHED.items() if states[name][at] > states[name][max(at - 1, 0)]]
        text = f"contact: {names}, with {' and '.join(touched) or 'something'}"
        found.append(Event(at, "contact", text, tuple(robots)))

    broken = states["tracker_broken_at"] <= states["world_step"][:, None]
    for i in np.flatnonzero(broken.any(axis=0)).tolist():
        at = int(broken[:, i].argmax())
        found.append(Event(at, "break", f"tracker {i} breaks", (i,)))

    leaders = majority(states.get("annotation/leader", np.empty((0, 1))))
    for before, at in itertools.pairwise(np.flatnonzero(leaders >= 0).tolist()):
        old, new = int(leaders[before]), int(leaders[at])
        if old != new:
            found.append(Event(at, "leader", f"leader changes from tracker {old} to tracker {new}", (old, new)))
    return tuple(sorted(found, key=lambda event: event.step))


def majority(leaders: Array) -> Array:
    """Return whom more than half of a team follow, (E,) of the leader of each tracker, (E, N); -1: there is none."""
    n = leaders.shape[1]
    middle = np.sort(leaders, axis=1)[:, n // 2]  # a leader of more than half stands there
    agreed = np.count_nonzero(leaders == middle[:, None], axis=1) > n / 2
    return np.where(agreed, middle, -1)
