"""The full state of a world as one flat float32 vector, for centralized critics.

It determines the future of the world, apart from random draws: poses, speeds, the slot frame ψ, the
target's goal heading and its motion's memory, obstacles, past and future faults, every tracker's
fix, and the radio's last received and pending messages. Derived values (sonar, contacts, occupied
slots, end of the episode) and the sums of metrics are not included. To add an entry, add its line
to the function of its part below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray
from posse.registry import SENSORS, TARGET_MOTIONS
from posse.rules.state import NEVER, WorldArrays, perfect_radio
from posse.scenarios import Scenario

_SLACK: Final = 1.001  # bounds are true for numbers rounded to float32, too
_Values = npt.NDArray[Any]


@dataclass(frozen=True)
class StateEntry:
    """One named part of the state vector."""

    name: str
    shape: tuple[int, ...]
    unit: str
    low: float
    high: float
    meaning: str
    read: Callable[[WorldArrays], _Values]
    """(arrays) -> (E, *shape)."""


class StateLayout:
    """The entries of a scenario's state vector.

    Attributes:
        entries: Every :class:`StateEntry`, in order.
        size: S, length of the vector.
        offsets: Index of the first number of each entry, by name.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.entries = tuple(_entries(scenario))
        self.offsets: dict[str, int] = {}
        offset = 0
        for entry in self.entries:
            self.offsets[entry.name] = offset
            offset += int(np.prod(entry.shape))
        self.size = offset

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest value of every number, each (S,) float32."""
        counts = [int(np.prod(entry.shape)) for entry in self.entries]
        low = np.repeat([entry.low for entry in self.entries], counts)
        high = np.repeat([entry.high for entry in self.entries], counts)
        return low.astype(np.float32), high.astype(np.float32)

    def vector(self, arrays: WorldArrays) -> FloatArray:
        """Return the states of a batch's worlds, a new array (E, S) float32."""
        num_worlds = len(arrays.world)
        vectors = np.empty((num_worlds, self.size), np.float32)
        for entry in self.entries:
            start = self.offsets[entry.name]
            part = entry.read(arrays).reshape(num_worlds, -1)
            vectors[:, start : start + part.shape[1]] = part
        return vectors

    def views(self, vectors: FloatArray) -> dict[str, FloatArray]:
        """Return named views (..., *shape) of state vectors (..., S).

        Raises:
            ValueError: The last axis is not S long.
        """
        if vectors.shape[-1] != self.size:
            raise ValueError(f"states of shape {vectors.shape} do not fit: S = {self.size}")
        views = {}
        for entry in self.entries:
            start = self.offsets[entry.name]
            part = vectors[..., start : start + int(np.prod(entry.shape))]
            views[entry.name] = part.reshape((*vectors.shape[:-1], *entry.shape))
        return views


def _entries(s: Scenario) -> list[StateEntry]:
    return [*_target_entries(s), *_tracker_entries(s), *_obstacle_entries(s), *_radio_entries(s)]


def _scaled(array: str, field: str, scale: float = 1.0) -> Callable[[WorldArrays], _Values]:
    def read(arrays: WorldArrays) -> _Values:
        values: _Values = getattr(arrays, array)[field]
        return values if scale == 1.0 else values * scale

    return read


def _when(array: str, field: str, step: float) -> Callable[[WorldArrays], _Values]:
    """Read a control step as a time in s, -1 for never."""

    def read(arrays: WorldArrays) -> _Values:
        steps = getattr(arrays, array)[field]
        return np.where((steps < 0) | (steps >= NEVER), -1.0, steps * step)

    return read


def _in_order_of_age(arrays: WorldArrays, ring: _Values) -> _Values:
    """Return a ring buffer (E, D + 1, ...) in order, newest first."""
    length = ring.shape[1]
    if length == 0:
        return ring
    places = (arrays.world["step"][:, None] - np.arange(length)) % length
    ordered: _Values = ring[np.arange(len(ring))[:, None], places]
    return ordered


# Entries never heard or sent are zero, whatever an earlier episode left there.


def _of_heard(field: str) -> Callable[[WorldArrays], _Values]:
    return lambda arrays: np.where(arrays.heard["step"] >= 0, arrays.heard[field], 0)


def _of_broadcast(field: str) -> Callable[[WorldArrays], _Values]:
    def read(arrays: WorldArrays) -> _Values:
        sent = arrays.broadcast["sent"] != 0
        return _in_order_of_age(arrays, np.where(sent, arrays.broadcast[field], 0))

    return read


def _sent_fix_time(step: float) -> Callable[[WorldArrays], _Values]:
    def read(arrays: WorldArrays) -> _Values:
        known = (arrays.broadcast["sent"] != 0) & (arrays.broadcast["fix_step"] >= 0)
        times = np.where(known, arrays.broadcast["fix_step"] * step, -1.0)
        return _in_order_of_age(arrays, times)

    return read


_POSE: Final = ("x", "y", "heading_cos", "heading_sin", "speed", "turn_rate")
_FIX: Final = ("fix_x", "fix_y", "fix_cos", "fix_sin", "fix_frame_cos", "fix_frame_sin")


def _limits(s: Scenario) -> dict[str, tuple[str, float, float]]:
    """Unit, least and greatest value of what robots and fixes have in common."""
    place = s.position_bound * _SLACK
    # The error of a measured position is at most three standard deviations times the range.
    fix = (s.position_bound + 3 * (s.range_noise + s.bearing_noise) * s.range_bound) * _SLACK
    if SENSORS[s.sensor].fix == "bearing":
        fix = max(fix, _SLACK)  # a unit vector
    turn = max(*s.tracker_turn_rates, s.target_turn_rate) * _SLACK
    limits = {
        "x": ("m", -place, place),
        "y": ("m", -place, place),
        "fix_x": ("m", -fix, fix),
        "fix_y": ("m", -fix, fix),
        "speed": ("m/s", 0.0, max(s.tracker_speeds) * _SLACK),
        "turn_rate": ("rad/s", -turn, turn),
    }
    for name in ("heading", "fix", "fix_frame", "frame", "goal"):
        for part in ("cos", "sin"):
            limits[f"{name}_{part}"] = ("1", -_SLACK, _SLACK)
    return limits


def _target_entries(s: Scenario) -> list[StateEntry]:
    limits, dt = _limits(s), s.control_step
    named = [
        StateEntry(f"target_{name}", (), *limits[name], f"the target's {name}", _scaled("world", name))
        for name in (*_POSE, "frame_cos", "frame_sin", "goal_cos", "goal_sin")
    ]
    memory = [
        StateEntry(m.name, (), m.unit, m.bound("low", s), m.bound("high", s), m.meaning, _scaled("world", m.name))
        for motion in TARGET_MOTIONS.with_added(s.target_motion)
        for m in motion.memory
    ]
    times = (-1.0, (s.duration + s.control_step * s.breaks) * _SLACK)
    return [
        StateEntry("time", (), "s", 0, s.duration * _SLACK, "since the start", _scaled("world", "step", dt)),
        *named,
        *memory,
        StateEntry(
            "next_break",
            (),
            "s",
            *times,
            "when the nearest tracker breaks; -1: never",
            _when("world", "break_step", dt),
        ),
        StateEntry(
            "breaks_left", (), "count", 0, s.breaks, "trackers that are still to break", _scaled("world", "breaks_left")
        ),
    ]


def _tracker_entries(s: Scenario) -> list[StateEntry]:
    limits, n, dt = _limits(s), s.num_trackers, s.control_step
    speed, duration = max(s.tracker_speeds) * _SLACK, s.duration * _SLACK
    named = [
        StateEntry(f"tracker_{name}", (n,), *limits[name], f"each tracker's {name}", _scaled("tracker", name))
        for name in (*_POSE, *_FIX)
    ]
    velocity = [
        StateEntry(f"tracker_{name}", (n,), "m/s", -speed, speed, "velocity from its fixes", _scaled("tracker", name))
        for name in ("fix_vx", "fix_vy")
    ]
    times = [
        StateEntry(f"tracker_{name}", (n,), "s", -1, duration, meaning, _when("tracker", field, dt))
        for name, field, meaning in (
            ("fix_time", "fix_step", "when its fix was taken; -1: it has none"),
            ("broken_at", "broken_at", "when it broke; -1: it works"),
            ("breaks_at", "breaks_at", "when it will break; -1: never"),
            ("sensor_dead_from", "sensor_dead_from", "start of its sensor's outage; -1: none"),
            ("radio_dead_from", "radio_dead_from", "start of its radio's outage; -1: none"),
        )
    ]
    sees = StateEntry("tracker_sees", (n,), "1", 0, 1, "1 while it sees the target", _scaled("tracker", "sees"))
    return [*named, *velocity, *times, sees]


def _obstacle_entries(s: Scenario) -> list[StateEntry]:
    if s.num_obstacles == 0:
        return []
    half = s.arena / 2
    shape = (s.num_obstacles,)
    return [
        StateEntry("obstacle_x", shape, "m", -half, half, "centre", _scaled("obstacle", "x")),
        StateEntry("obstacle_y", shape, "m", -half, half, "centre", _scaled("obstacle", "y")),
        StateEntry(
            "obstacle_radius", shape, "m", 0, s.obstacle_radius[1] * _SLACK, "radius", _scaled("obstacle", "radius")
        ),
    ]


def _radio_entries(s: Scenario) -> list[StateEntry]:
    n, m, kept, dt = s.num_trackers, s.message_size, s.radio_delay + 1, s.control_step
    entries: list[StateEntry] = []
    if m:
        entries.append(
            StateEntry(
                "message",
                (kept, n, m),
                "1",
                -1,
                1,
                "policies' messages, newest first",
                lambda arrays: _in_order_of_age(arrays, arrays.message),
            )
        )
    if perfect_radio(s):
        return entries
    limits, duration = _limits(s), s.duration * _SLACK
    if m:
        entries.append(
            StateEntry(
                "heard_message",
                (n, n, m),
                "1",
                -1,
                1,
                "last received: receiver, sender",
                lambda arrays: arrays.heard_message,
            )
        )
    entries.append(
        StateEntry("heard_time", (n, n), "s", -1, duration, "when that was sent; -1: never", _when("heard", "step", dt))
    )
    entries += [
        StateEntry(f"heard_{name}", (n, n), *limits[name], "of the sender, as last received", _of_heard(name))
        for name in _POSE
    ]
    entries.append(
        StateEntry(
            "sent", (kept, n), "1", 0, 1, "1: a message was sent; in flight, newest first", _of_broadcast("sent")
        )
    )
    entries.append(
        StateEntry("sent_fix_time", (kept, n), "s", -1, duration, "time of the fix sent; -1: none", _sent_fix_time(dt))
    )
    entries += [
        StateEntry(f"sent_{name}", (kept, n), *limits[name], "as sent, newest first", _of_broadcast(name))
        for name in (*_POSE, *_FIX)
    ]
    return entries
