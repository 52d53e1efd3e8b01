"""Events of an episode for the timeline, derived from its states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse_training.replay.episode import Event

_States = Mapping[str, npt.NDArray[Any]]
_TOUCHED: Final = {
    "world_contacts_tracker": "each other",
    "world_contacts_obstacle": "an obstacle or wall",
    "world_contacts_target": "the target",
}


def find_events(states: _States) -> tuple[Event, ...]:
    """Return the events of an episode of one world in order of time.

    Args:
        states: States by name, (T + 1, ...) each, and perhaps ``annotation/leader`` (T, N), -1: none.
    """
    leader = states.get("annotation/leader")
    found = [
        *_marks(states),
        *_darts(states),
        *_contacts(states),
        *_breaks(states),
        *([] if leader is None else _exchanges(leader)),
    ]
    return tuple(sorted(found, key=lambda event: event.step))


def _marks(states: _States) -> list[Event]:
    """Return the events whose times the engine records."""
    events = []
    for name, kind, text in (
        ("world_detected_at", "detection", "target detected"),
        ("world_settled_at", "settled", "settled: every slot held"),
        ("world_recovered_at", "settled", "settled again after a loss"),
    ):
        step = int(states[name][-1])
        if 0 <= step < len(states[name]):
            events.append(Event(step, kind, text))
    return events


def _rises(happens: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """Return the frames in which a boolean over time (T + 1,) becomes true."""
    return np.flatnonzero(happens & ~np.concatenate([[False], happens[:-1]]))


def _darts(states: _States) -> list[Event]:
    starts = _rises(states["world_pressed"] < 0)
    return [Event(int(step), "dart", "the target darts") for step in starts]


def _names(robots: npt.NDArray[Any]) -> str:
    return " and ".join(f"tracker {i}" for i in robots)


def _contacts(states: _States) -> list[Event]:
    events = []
    for step in np.flatnonzero((states["tracker_onsets"] > 0).any(axis=1)).tolist():
        robots = np.flatnonzero(states["tracker_onsets"][step] > 0)
        before = max(step - 1, 0)
        touched = [what for name, what in _TOUCHED.items() if states[name][step] > states[name][before]]
        text = f"contact: {_names(robots)}, with {' and '.join(touched) or 'something'}"
        events.append(Event(step, "contact", text, tuple(robots.tolist())))
    return events


def _breaks(states: _States) -> list[Event]:
    steps = np.arange(len(states["world_step"]))
    broken = states["tracker_broken_at"] <= states["world_step"][:, None]
    return [
        Event(int(steps[broken[:, i]][0]), "break", f"tracker {i} breaks", (i,))
        for i in np.flatnonzero(broken.any(axis=0)).tolist()
    ]


def _exchanges(leader: npt.NDArray[Any]) -> list[Event]:
    """Return the changes of the leader that more than half of the team follow."""
    n = leader.shape[1]
    middle = np.sort(leader, axis=1)[:, n // 2]
    agreed = np.count_nonzero(leader == middle[:, None], axis=1) > n / 2
    events, last = [], -1
    for step in np.flatnonzero(agreed & (middle >= 0)).tolist():
        now = int(middle[step])
        if last >= 0 and now != last:
            text = f"leader changes from tracker {last} to tracker {now}"
            events.append(Event(step, "leader", text, (last, now)))
        last = now
    return events
