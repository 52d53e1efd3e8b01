"""The full state of a world as one flat float32 vector, for centralized critics.

It determines the future of the world, apart from random draws: poses, speeds, the slot frame ψ, the
target's goal heading and its motion's memory, obstacles, past and future faults, every tracker's
fix, and the radio's last received and pending messages. Derived values (sonar, contacts, occupied
slots, end of the episode) and the sums of metrics are not included.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Records
from posse.registry import TARGET_MOTIONS
from posse.rules.state import NEVER, WorldArrays
from posse.scenarios import Scenario

_Values = npt.NDArray[Any]
_Read = Callable[[WorldArrays], _Values]

_POSE: Final = {"x": "m", "y": "m", "heading_cos": "1", "heading_sin": "1", "speed": "m/s", "turn_rate": "rad/s"}
_FIX: Final = {"fix_x": "m", "fix_y": "m", "fix_cos": "1", "fix_sin": "1", "fix_frame_cos": "1", "fix_frame_sin": "1"}
_FRAME: Final = {"frame_cos": "1", "frame_sin": "1", "goal_cos": "1", "goal_sin": "1"}


_ODOMETRY: Final = {"x": "m", "y": "m", "heading": "rad"}


class StateEntry(NamedTuple):
    """One named part of the state vector."""

    name: str
    unit: str
    meaning: str
    read: _Read
    """(arrays) -> (E, *shape)."""
    shape: tuple[int, ...] = ()


class StateLayout:
    """The entries of a scenario's state vector.

    Attributes:
        entries: Every :class:`StateEntry`, in order.
        size: S, length of the vector.
        offsets: Index of the first number of each entry, by name.
    """

    def __init__(self, scenario: Scenario) -> None:
        one = WorldArrays.allocate(scenario, 1)
        table = [StateEntry(*row) for row in _table(scenario)]
        shaped = [entry._replace(shape=entry.read(one).shape[1:]) for entry in table]
        # A scenario without obstacles, messages or a radio that fails has nothing to say of them.
        self.entries = tuple(entry for entry in shaped if 0 not in entry.shape)
        ends = np.cumsum([int(np.prod(entry.shape)) for entry in self.entries]).tolist()
        self.offsets = dict(zip((entry.name for entry in self.entries), [0, *ends], strict=False))
        self.size: int = ends[-1]

    def vector(self, arrays: WorldArrays) -> FloatArray:
        """Return the states of a batch's worlds, a new array (E, S) float32."""
        parts = [entry.read(arrays).reshape(len(arrays.world), -1) for entry in self.entries]
        return np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")

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


def _table(s: Scenario) -> list[tuple[str, str, str, _Read]]:
    """Return name, unit, meaning and transform of every entry, in order."""

    def of(array: str, field: str) -> _Read:
        return lambda arrays: _field(getattr(arrays, array), field)

    def when(array: str, field: str) -> _Read:
        """Read a control step as a time in s, -1 for never."""

        def read(arrays: WorldArrays) -> _Values:
            steps = getattr(arrays, array)[field]
            return np.where((steps < 0) | (steps >= NEVER), -1.0, steps * s.control_step)

        return read

    # What was never heard or sent is zero, whatever an earlier episode left there.

    def heard(field: str) -> _Read:
        return lambda arrays: np.where(arrays.heard["step"] >= 0, arrays.heard[field], 0)

    def sent(read: _Read, empty: float = 0) -> _Read:
        return lambda arrays: _newest_first(arrays, np.where(arrays.broadcast["sent"] != 0, read(arrays), empty))

    memory = [each for motion in TARGET_MOTIONS.with_added(s.target_motion) for each in motion.memory]
    return [
        ("time", "s", "since the start", lambda arrays: arrays.world["step"] * s.control_step),
        *((f"target_{k}", unit, f"the target's {k}", of("world", k)) for k, unit in {**_POSE, **_FRAME}.items()),
        *((each.name, each.unit, each.meaning, of("world", each.name)) for each in memory),
        ("next_break", "s", "when the nearest tracker breaks; -1: never", when("world", "break_step")),
        ("breaks_left", "count", "trackers that are still to break", of("world", "breaks_left")),
        *((f"tracker_{k}", unit, f"each tracker's {k}", of("tracker", k)) for k, unit in {**_POSE, **_FIX}.items()),
        *((f"tracker_{k}", "m/s", "velocity from its fixes", of("tracker", k)) for k in ("fix_vx", "fix_vy")),
        ("tracker_fix_time", "s", "when its fix was taken; -1: it has none", when("tracker", "fix_step")),
        ("tracker_broken_at", "s", "when it broke; -1: it works", when("tracker", "broken_at")),
        ("tracker_breaks_at", "s", "when it will break; -1: never", when("tracker", "breaks_at")),
        (
            "tracker_sensor_dead_from",
            "s",
            "start of its sensor's outage; -1: none",
            when("tracker", "sensor_dead_from"),
        ),
        ("tracker_radio_dead_from", "s", "start of its radio's outage; -1: none", when("tracker", "radio_dead_from")),
        ("tracker_sees", "1", "1 while it sees the target", of("tracker", "sees")),
        *((f"odometry_{k}", u, "error of each own pose", of("odometry", k)) for k, u in _ODOMETRY.items()),
        (
            "command",
            "1",
            "actions not yet executed, newest first",
            lambda arrays: _newest_first(arrays, arrays.command, 1),
        ),
        *((f"obstacle_{k}", "m", f"each obstacle's {k}", of("obstacle", k)) for k in ("x", "y", "radius")),
        ("message", "1", "policies' messages, newest first", lambda arrays: _newest_first(arrays, arrays.message)),
        ("heard_message", "1", "last received: receiver, sender", lambda arrays: arrays.heard_message),
        ("heard_time", "s", "when that was sent; -1: never", when("heard", "step")),
        *((f"heard_{k}", unit, "of the sender, as last received", heard(k)) for k, unit in _POSE.items()),
        ("sent", "1", "1: a message was sent; in flight, newest first", sent(of("broadcast", "sent"))),
        ("sent_fix_time", "s", "time of the fix sent; -1: none", sent(when("broadcast", "fix_step"), -1)),
        *(
            (f"sent_{k}", unit, "as sent, newest first", sent(of("broadcast", k)))
            for k, unit in {**_POSE, **_FIX}.items()
        ),
    ]


def _field(records: Records, name: str) -> _Values:
    return np.asarray(records["fix"][name.removeprefix("fix_")] if name.startswith("fix_") else records[name])


def _newest_first(arrays: WorldArrays, ring: _Values, least: int = 0) -> _Values:
    """Return a ring buffer (E, D + 1, ...) in order of age, from the age ``least`` on."""
    ages = least + np.arange(ring.shape[1])
    places = (arrays.world["step"][:, None] - ages) % max(1, len(ages))
    return np.asarray(ring[np.arange(len(ring))[:, None], places])
