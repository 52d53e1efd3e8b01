"""Events of an episode for the timeline, derived from its states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse_training.evaluation.episodes import majority
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


def find_events(states: Mapping[str, npt.NDArray[Any]]) -> tuple[Event, ...]:
    """Return the events of an episode of one world in order of time.

    Args:
        states: States by name, (T + 1, ...) each, and perhaps ``annotation/leader`` (T, N), -1: none.
    """
    steps = np.arange(len(states["world_step"]))
    found = []
    for name, (kind, text) in _MARKS.items():
        at = int(states[name][-1])
        if 0 <= at < len(steps):
            found.append(Event(at, kind, text))

    darts = states["world_pressed"] < 0
    begins = darts & ~np.concatenate([[False], darts[:-1]])
    found += [Event(at, "dart", "the target darts") for at in steps[begins].tolist()]

    touching = states["tracker_onsets"] > 0
    for at in steps[touching.any(axis=1)].tolist():
        robots = np.flatnonzero(touching[at]).tolist()
        names = " and ".join(f"tracker {i}" for i in robots)
        touched = [what for name, what in _TOUCHED.items() if states[name][at] > states[name][max(at - 1, 0)]]
        text = f"contact: {names}, with {' and '.join(touched) or 'something'}"
        found.append(Event(at, "contact", text, tuple(robots)))

    broken = states["tracker_broken_at"] <= states["world_step"][:, None]
    for i in np.flatnonzero(broken.any(axis=0)).tolist():
        at = int(broken[:, i].argmax())
        found.append(Event(at, "break", f"tracker {i} breaks", (i,)))

    last = -1
    for at, leader in enumerate(majority(states.get("annotation/leader", np.empty((0, 1)))).tolist()):
        if leader >= 0:
            if last not in (-1, leader):
                text = f"leader changes from tracker {last} to tracker {leader}"
                found.append(Event(at, "leader", text, (last, leader)))
            last = leader
    return tuple(sorted(found, key=lambda event: event.step))
