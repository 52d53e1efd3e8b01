"""The observation of one robot: a flat float32 vector, its fields declared by name.

The fields come in five blocks, all declared here: own motion, the task and the target, which
:mod:`posse.signals.together` writes; the sonar (:mod:`posse.rules.senses.sonar`); and team-mates,
where they are now (:mod:`posse.signals.mates`) or as they were heard of, which stands here, with
all that a target is given that is an agent. Directions are cosine and sine; *ego* means the
robot's own frame, x ahead and y to the left; the *common frame* is the one that the team agreed on
at the start. A quantity that is not known holds the field's ``unknown`` value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Record, Records, compiled
from posse.rules.discs import natural, within_one
from posse.rules.senses.sonar import ping
from posse.rules.state import WorldArrays
from posse.scenarios import Scenario
from posse.signals.columns import write_rows
from posse.signals.fields import SLACK
from posse.signals.fields import Field as Field
from posse.signals.mates import MATE, copy_message, leave_empty
from posse.signals.nearest import keep_nearest
from posse.signals.parts import Writers, parts_for
from posse.signals.views import view_of_target

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)


@compiled
def _write_direction(
    hc: np.float32, hs: np.float32, x: np.float32, y: np.float32, o: FloatArray, k: int
) -> int:
    """Write a unit vector of the common frame in the frame whose heading is (hc, hs)."""
    o[k] = within_one(x * hc + y * hs)
    o[k + 1] = within_one(y * hc - x * hs)
    return k + 2


@compiled
def _write_place(
    hc: np.float32, hs: np.float32, dx: np.float32, dy: np.float32, o: FloatArray, k: int
) -> int:
    """Write the range and the ego direction of what lies (dx, dy) away in the common frame."""
    distance = np.float32(math.sqrt(dx * dx + dy * dy))
    o[k] = distance
    if distance > _ZERO:
        per_metre = _ONE / distance
        return int(_write_direction(hc, hs, dx * per_metre, dy * per_metre, o, k + 1))
    o[k + 1] = _ONE
    o[k + 2] = _ZERO
    return k + 3


def _sonar_fields(s: Scenario) -> list[Field]:
    if s.sonar_beams == 0:
        return []
    return [
        Field(
            "sonar", s.sonar_beams, "m", 0, s.sonar_range * SLACK,
            "distance from its rim to anything, each beam from straight ahead to the left; "
            "sonar_range where nothing is near",
        )
    ]  # fmt: skip


def _neighbour_fields(s: Scenario) -> list[Field]:
    fields = [
        Field("neighbour_number", 1, "1", -1, s.num_trackers - 1, "its number", -1),
        Field("neighbour_age", 1, "s", -1, s.forget_after * SLACK, "age of what was heard", -1),
        Field(
            "neighbour_range", 1, "m", -1, s.range_bound * SLACK,
            "distance from here to where it was", -1,
        ),
        Field("neighbour_bearing", 2, "1", -1, 1, "direction of where it was, ego", 0),
        Field("neighbour_heading", 2, "1", -1, 1, "its heading, ego", 0),
        Field("neighbour_speed", 1, "m/s", 0, max(s.tracker_speeds) * SLACK, "its speed", 0),
        Field(
            "neighbour_turn_rate", 1, "rad/s",
            -max(s.tracker_turn_rates) * SLACK, max(s.tracker_turn_rates) * SLACK,
            "its turn rate", 0,
        ),
    ]  # fmt: skip
    if s.message_size:
        fields.append(
            Field("neighbour_message", s.message_size, "1", -1, 1, "what its policy added", 0)
        )
    return [Field(**{**f.__dict__, "of_neighbour": True}) for f in fields]


@compiled
def _write_neighbour(
    robot: Record, other: Record, number: int, age: np.float32, o: FloatArray, k: int
) -> None:
    """Write what a robot knows of another from k on, (9 + m,), the message excepted."""
    hc, hs = robot.heading_cos, robot.heading_sin
    o[k] = np.float32(number)
    o[k + 1] = age
    k = _write_place(hc, hs, other.x - robot.x, other.y - robot.y, o, k + 2)
    k = _write_direction(hc, hs, other.heading_cos, other.heading_sin, o, k)
    o[k] = other.speed
    o[k + 1] = other.turn_rate


@compiled(seldom=True)
def _observe_heard(
    c: Record,
    w: Record,
    trackers: Records,
    heard: Records,
    heard_message: FloatArray,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates of all trackers from what each last heard, from ``k`` on."""
    for i in range(c.num_trackers):
        _write_heard(
            c, w, trackers[i], i, heard[i], heard_message[i], s, observations[i], natural(k)
        )


@compiled
def _write_heard(
    c: Record,
    w: Record,
    t: Record,
    i: int,
    heard: Records,
    said: FloatArray,
    s: Record,
    o: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates from what tracker i last heard of each, and what they said."""
    filled = 0
    for j in range(c.num_trackers if c.neighbours > 0 else 0):
        h = heard[j]
        if j != i and h.step >= 0 and w.step - h.step <= c.forget_steps:
            dx, dy = h.x - t.x, h.y - t.y
            filled = keep_nearest(c.neighbours, filled, j, dx * dx + dy * dy, s)
    for p in range(c.neighbours):
        if p < filled:
            j = int(s.who[p])
            age = np.float32(w.step - heard[j].step) * c.dt
            _write_neighbour(t, heard[j], j, age, o, k)
            copy_message(c, said[j], o, k)
        else:
            leave_empty(c, o, k)
        k += MATE + natural(c.message_size)


@compiled
def observe_alone(
    c: Record,
    w: Record,
    trackers: Records,
    heard: Records,
    heard_message: FloatArray,
    s: Record,
    observations: FloatArray,
    width: int,
) -> None:
    """Write what :mod:`posse.signals.together` does not write of observations, (rows, F).

    Where every disc is stands in ``s``.
    """
    n = natural(c.num_trackers)
    for i in range(n):
        t = trackers[i]
        pose = (t.x, t.y, t.heading_cos, t.heading_sin)
        ping(c, pose, i, s.gap[i], s, observations[i], width)
    k = width + natural(c.sonar_beams)
    if not c.perfect_radio:
        _observe_heard(c, w, trackers, heard, heard_message, s, observations, k)


@compiled(seldom=True)
def observe_target(
    c: Record,
    worlds: WorldArrays,
    e: int,
    writers: Writers,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what a target that is an agent is given: it knows where trackers are."""
    w, trackers, n = worlds.world[e], worlds.tracker[e], natural(c.num_trackers)
    view = view_of_target(c, w, worlds.obstacle[e])
    writers.own(c, view, s.columns)
    write_rows(s.columns, writers.width, e, n, 1, 0, observations, 0)
    pose, o = (w.x, w.y, w.heading_cos, w.heading_sin), observations[e, n]
    ping(c, pose, n, _ZERO, s, o, writers.width)
    k = writers.width + natural(c.sonar_beams)
    filled = 0
    for j in range(c.num_trackers if c.neighbours > 0 else 0):
        dx, dy = trackers[j].x - w.x, trackers[j].y - w.y
        filled = keep_nearest(c.neighbours, filled, j, dx * dx + dy * dy, s)
    for p in range(c.neighbours):
        leave_empty(c, o, k)
        if p < filled:
            j = int(s.who[p])
            _write_neighbour(w, trackers[j], j, _ZERO, o, k)
        k += MATE + natural(c.message_size)


class ObservationLayout:
    """Where each field lies in the flat observation of a scenario, and what it may hold.

    Attributes:
        fields: Every :class:`Field`, in order; those of a team-mate once.
        size: F, length of the flat observation.
        neighbours: Places for team-mates.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        single = [
            *(field.of(scenario) for field in parts_for(scenario).fields),
            *_sonar_fields(scenario),
        ]
        repeated = _neighbour_fields(scenario)
        self.fields: tuple[Field, ...] = (*single, *repeated)
        self.neighbours = scenario.neighbours
        self._repeated_from = sum(field.size for field in single)
        self._stride = sum(field.size for field in repeated)
        self.size = self._repeated_from + self.neighbours * self._stride
        self.offsets: dict[str, int] = {}
        offset = 0
        for field in self.fields:
            self.offsets[field.name] = offset
            offset += field.size

    @property
    def stride(self) -> int:
        """Length of one team-mate's part."""
        return self._stride

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest value of every entry, each (F,) float32."""

        def stack(values: list[tuple[Field, float]]) -> list[float]:
            single = [v for f, v in values if not f.of_neighbour for _ in range(f.size)]
            repeated = [v for f, v in values if f.of_neighbour for _ in range(f.size)]
            return single + repeated * self.neighbours

        low = stack([(field, field.low) for field in self.fields])
        high = stack([(field, field.high) for field in self.fields])
        return np.array(low, np.float32), np.array(high, np.float32)

    def views(self, observations: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """Return named views of flat observations (..., F), sharing their memory.

        A field of size 1 is (...), one of size k is (..., k); a team-mate's field has one more
        axis before, (..., places) or (..., places, k).

        Raises:
            ValueError: The last axis is not F long.
        """
        if observations.shape[-1] != self.size:
            raise ValueError(
                f"observations of shape {observations.shape} do not fit: the last axis of "
                f"{self.scenario.name!r} is {self.size} long"
            )
        mates = observations[..., self._repeated_from :].reshape(
            *observations.shape[:-1], self.neighbours, self._stride
        )
        views: dict[str, npt.NDArray[Any]] = {}
        for field in self.fields:
            start = self.offsets[field.name]
            source = observations
            if field.of_neighbour:
                source, start = mates, start - self._repeated_from
            part = source[..., start : start + field.size]
            views[field.name] = part[..., 0] if field.size == 1 else part
        return views

    def flatten(self, views: Mapping[str, npt.ArrayLike]) -> FloatArray:
        """Return the flat observations (..., F) of named values; the inverse of :meth:`views`.

        Raises:
            ValueError: A field is missing, unknown, or of a shape that does not fit.
        """
        names = [field.name for field in self.fields]
        if set(views) != set(names):
            odd = sorted(set(views) ^ set(names))
            raise ValueError(f"fields missing or unknown: {', '.join(odd)}")
        leading = np.shape(views["speed"])
        flat = np.empty((*leading, self.size), np.float32)
        for name, part in self.views(flat).items():
            value = np.asarray(views[name], np.float32)
            if value.shape != part.shape:
                raise ValueError(f"{name} has shape {value.shape}, wanted {part.shape}")
            part[...] = value
        return flat

    def describe(self) -> list[dict[str, Any]]:
        """Return every field as a plain dictionary, in order, for files and tables."""
        return [{**field.__dict__, "offset": self.offsets[field.name]} for field in self.fields]
