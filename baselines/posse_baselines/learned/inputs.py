"""What a learned policy's network reads of an observation.

A network has inputs of a fixed meaning, while an observation depends on team size and message length. An
:class:`Encoding` finds the fields that the network reads in any layout that has them; surplus team-mates are left out,
missing ones are filled with the field's value for "unknown". An :class:`Encoder` applies it to a layout.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import MOST_THREADS, BoolArray, FloatArray, OwnArrays, Records, kernel, over_worlds
from posse_baselines.ddcs.memory import MATE, Minds, offsets_of, patience_of, unit_of
from posse_baselines.laws.steering import work_for, work_of
from posse_baselines.learned.features import ESTIMATE, FEATURES, MOST, NUM_FEATURES, Known, write_features
from posse_baselines.policy import PolicyError, check_observations

KINDS: Final = ("plain", "features")
"""The observation; :mod:`posse_baselines.learned.features`, then the observation."""
_SHARE: Final = 0.25  # of a new fix in the estimate of the target, where fixes are noisy
_DRIFTING: Final = 0.1  # the same where poses drift: the velocity between two fixes has the noise of odometry
_TRUST: Final = 0.15  # in a new heading of the slot frame, where headings are noisy


class EncodedField(NamedTuple):
    """One field that a network reads; ``unknown`` replaces it where it is missing."""

    name: str
    size: int
    unit: str
    unknown: float
    of_neighbour: bool


@dataclass(frozen=True)
class Encoding:
    """Which numbers a network reads, in order.

    Attributes:
        kind: One of :data:`KINDS`.
        neighbours: Number of team-mates that it reads, nearest first.
        fields: The fields that it reads; a team-mate's fields are listed once.
    """

    kind: str
    neighbours: int
    fields: tuple[EncodedField, ...]

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise PolicyError(f"unknown encoding {self.kind!r:.80}; encodings are: {', '.join(KINDS)}")

    @classmethod
    def of(cls, layout: ObservationLayout, kind: str = "plain", neighbours: int | None = None) -> "Encoding":
        """Return the encoding that reads every field of a layout, of all team-mates or of the nearest so many."""
        fields = tuple(
            EncodedField(f.name, f.size, f.unit, float(f.unknown or 0), f.of_neighbour) for f in layout.fields
        )
        return cls(kind, layout.neighbours if neighbours is None else neighbours, fields)

    @property
    def message_size(self) -> int:
        """Numbers of a team-mate's message that it reads."""
        return sum(f.size for f in self.fields if f.name == "neighbour_message")

    @property
    def size(self) -> int:
        """Number of network inputs."""
        read = sum(f.size * (self.neighbours if f.of_neighbour else 1) for f in self.fields)
        return read + self.num_features

    @property
    def num_features(self) -> int:
        """Number of features, which precede the observation."""
        return NUM_FEATURES if self.kind == "features" else 0

    def _in_order(self) -> list[tuple[EncodedField, int]]:
        """Return the fields in the order in which they are read, those of a team-mate with its place."""
        own = [(f, 0) for f in self.fields if not f.of_neighbour]
        return own + [(f, place) for place in range(self.neighbours) for f in self.fields if f.of_neighbour]

    def names(self) -> list[str]:
        """Return the name of each number that is read of an observation, in order.

        As the indices of :meth:`posse.ObservationLayout.views`: ``neighbour_bearing[1, 0]`` is the first number of
        that field of the second-nearest team-mate.
        """
        names = []
        for field, place in self._in_order():
            for k in range(field.size):
                at = [str(place)] * field.of_neighbour + [str(k)] * (field.size > 1)
                names.append(f"{field.name}[{', '.join(at)}]" if at else field.name)
        return names

    def columns(self, layout: ObservationLayout) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Return the column of each number in an observation, -1 where it is missing, and its value there.

        PolicyError if the layout lacks a field, or has it in another size or unit.
        """
        known = {f.name: f for f in layout.fields}
        for mine in self.fields:
            theirs = known.get(mine.name)
            # Surplus numbers of messages are left out.
            most = math.inf if mine.name == "neighbour_message" else mine.size
            if theirs and theirs.unit == mine.unit and mine.size <= theirs.size <= most:
                continue
            found = f"{theirs.size} x {theirs.unit!r}" if theirs else "no such field"
            raise PolicyError(
                f"the observations of scenario {layout.scenario.name!r} do not fit: the policy "
                f"reads {mine.name!r:.80} as {mine.size} x {mine.unit!r:.80}, the scenario has "
                f"{found}; play it with the settings on its card"
            )
        columns: list[int] = []
        unknown: list[float] = []
        for field, place in self._in_order():
            start = layout.offsets[field.name] + place * layout.stride
            there = not field.of_neighbour or place < layout.neighbours
            columns += range(start, start + field.size) if there else [-1] * field.size
            unknown += [field.unknown] * field.size
        return np.array(columns, np.int64), np.array(unknown, np.float32)


class Encoder(OwnArrays):
    """An encoding applied to the observations of R ``robots``, by default all trackers, in each of E worlds.

    The layout has to fit, see :meth:`Encoding.columns`.

    Attributes:
        estimates: (E, R), what each robot remembers of the target (:data:`posse_baselines.learned.features.ESTIMATE`).
    """

    def __init__(
        self, encoding: Encoding, layout: ObservationLayout, num_worlds: int, robots: int | None = None
    ) -> None:
        self.encoding, self.layout, s = encoding, layout, layout.scenario
        self.estimates = np.zeros((num_worlds, robots or s.num_trackers), ESTIMATE)
        self.estimates["age"] = -1.0
        self._columns, self._unknown = encoding.columns(layout)
        slots = np.array([complex(*slot) for slot in s.slot_offsets], np.complex64)
        # From the first slot the target is in sight; where it is not from all, that one is filled at any rate.
        first = bool(np.abs(slots).max() > s.sensing_range)
        share = _DRIFTING if s.drifts else _SHARE if s.range_noise > 0.0 or s.bearing_noise > 0.0 else 1.0
        trust = _TRUST if s.heading_noise > 0.0 else 1.0
        numbers = map(np.float32, (share, trust, min(s.tracker_speeds), unit_of(s), patience_of(s)))
        self._known = Known(offsets_of(layout), slots, complex(*s.half_sides), first, *numbers)

    def restart(self, mask: BoolArray) -> None:
        """Forget the target in the worlds of a mask (E,), whose episodes restart."""
        self.estimates["age"][mask] = -1.0

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return what is remembered as arrays (E, R) by name; views, not copies."""
        return {f"target_{name}": self.estimates[name] for name in ESTIMATE.names or ()}

    def encode(self, observations: FloatArray, minds: Minds | None = None, worlds: Any = ...) -> FloatArray:
        """Return observations (worlds, R, F) of all worlds, or of those, as (rows, size).

        Where poses drift, ``minds``, the memory of the safeguard or of a script, says where team-mates are. Call it
        once a control step. PolicyError if the observations have another shape.
        """
        robots = self.estimates[worlds].shape
        rows = check_observations(observations, robots, self.layout).reshape(-1, self.layout.size)
        read, missing = np.take(rows, self._columns, axis=1, mode="wrap"), self._columns < 0
        read[:, missing] = self._unknown[missing]
        if self.encoding.num_features == 0:
            return read
        features, estimates = np.zeros(len(rows), FEATURES), self.estimates[worlds]
        mates = np.zeros((len(rows), 0), MATE.dtype)
        if minds is not None and self.layout.scenario.drifts:
            mates = minds.mates[worlds].reshape(len(rows), -1)
        works = np.empty((MOST_THREADS, MOST), np.complex64), work_for(len(self._known.slots))
        # The threads share out rows as if each were a world of one tracker.
        over_worlds(_write_all, (rows, (self._known, mates, *works), estimates.reshape(-1), features), len(rows), 1)
        self.estimates[worlds] = estimates
        return np.hstack([features.view(np.float32).reshape(len(rows), self.encoding.num_features), read])


@kernel
def _write_all(
    rows: FloatArray, given: Any, estimates: Records, features: Records, thread: int, first: int, end: int
) -> None:
    known, mates, places, works = given
    work = work_of(works, thread)
    for r in range(first, end):
        write_features(rows[r], known, mates[r], estimates[r], places[thread], work, features[r])
