"""What a learned policy's network is given: the observation, in the form it was trained on.

A network has inputs of a fixed meaning; the observation of a scenario depends on the size of its
team and on the length of its messages. An :class:`Encoding` says which fields the network reads and
for how many team-mates, and finds them in any layout that has them: places that the network does
not read are left out, places that a small team does not have hold "not known".
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import FloatArray, Numbers, OwnArrays, compiled, kernel, worlds_of
from posse_baselines.learned.features import NUM_FEATURES, SCRATCH, feature_tables, write_features
from posse_baselines.parallel import MOST_THREADS, over_worlds
from posse_baselines.policy import PolicyError

KINDS: Final = ("plain", "slots")
"""``plain``: the observation; ``slots``: :mod:`posse_baselines.learned.features`, then the
observation."""

_ABSENT: Final = -1
Columns = npt.NDArray[np.int64]


@dataclass(frozen=True)
class EncodedField:
    """One field that a network reads; ``unknown`` stands where it is missing."""

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
        neighbours: Places for team-mates that it reads, nearest first.
        fields: What it reads, those of a team-mate once.
    """

    kind: str
    neighbours: int
    fields: tuple[EncodedField, ...]

    @classmethod
    def of(
        cls, layout: ObservationLayout, kind: str = "plain", neighbours: int | None = None
    ) -> Encoding:
        """Return the encoding that reads every field of a layout.

        Args:
            layout: Of the scenario that is trained on.
            kind: One of :data:`KINDS`.
            neighbours: Places for team-mates to read; default: as many as the layout has.

        Raises:
            PolicyError: An unknown kind, or a negative number of places.
        """
        if kind not in KINDS:
            raise PolicyError(f"unknown encoding {kind!r}; encodings are: {', '.join(KINDS)}")
        places = layout.neighbours if neighbours is None else neighbours
        if places < 0:
            raise PolicyError(f"neighbours={places} must be at least 0")
        fields = tuple(
            EncodedField(f.name, f.size, f.unit, float(f.unknown or 0), f.of_neighbour)
            for f in layout.fields
        )
        return cls(kind, places, fields)

    @property
    def message_size(self) -> int:
        """How many numbers of a team-mate's message it reads."""
        return sum(f.size for f in self.fields if f.name == "neighbour_message")

    @property
    def read_size(self) -> int:
        """Numbers that it reads of an observation."""
        own = sum(f.size for f in self.fields if not f.of_neighbour)
        each = sum(f.size for f in self.fields if f.of_neighbour)
        return own + self.neighbours * each

    @property
    def size(self) -> int:
        """Inputs of the network."""
        return self.read_size + (NUM_FEATURES if self.kind == "slots" else 0)

    @property
    def digest(self) -> str:
        """A hash over all that the network's inputs mean."""
        text = json.dumps(self.to_dict(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def to_dict(self) -> dict[str, Any]:
        """Return the encoding as plain values, for a policy's card."""
        return {
            "kind": self.kind,
            "neighbours": self.neighbours,
            "fields": [[f.name, f.size, f.unit, f.unknown, f.of_neighbour] for f in self.fields],
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Encoding:
        """Return the encoding of :meth:`to_dict`.

        Raises:
            PolicyError: The values are not those of an encoding.
        """
        try:
            fields = tuple(
                EncodedField(str(name), int(size), str(unit), float(unknown), bool(of_neighbour))
                for name, size, unit, unknown, of_neighbour in values["fields"]
            )
            kind, neighbours = str(values["kind"]), int(values["neighbours"])
        except (KeyError, TypeError, ValueError) as error:
            raise PolicyError(
                f"the description of the policy's inputs is damaged: {error}"
            ) from error
        if kind not in KINDS or neighbours < 0 or any(f.size < 1 for f in fields):
            raise PolicyError("the description of the policy's inputs is damaged")
        return cls(kind, neighbours, fields)

    def columns(self, layout: ObservationLayout) -> tuple[Columns, FloatArray]:
        """Return where in an observation each number lies, and what stands for a missing one.

        Both (read_size,); a column of -1 is missing.

        Raises:
            PolicyError: The layout lacks a field, or has it in another size or unit.
        """
        places = [f for f in layout.fields if f.of_neighbour]
        known = {f.name: f for f in layout.fields}
        for mine in self.fields:
            theirs = known.get(mine.name)
            message = mine.name == "neighbour_message"
            if (
                theirs is None
                or theirs.unit != mine.unit
                or (theirs.size < mine.size if message else theirs.size != mine.size)
            ):
                found = "no such field" if theirs is None else f"{theirs.size} x {theirs.unit!r}"
                raise PolicyError(
                    f"the observations of scenario {layout.scenario.name!r} do not fit: the policy "
                    f"reads {mine.name!r} as {mine.size} x {mine.unit!r}, there it is {found}; "
                    "play it with the settings that its card names"
                )
        columns: list[int] = []
        unknown: list[float] = []
        stride = sum(f.size for f in places)
        for of_neighbour, repeats in ((False, 1), (True, self.neighbours)):
            for place in range(repeats):
                there = not of_neighbour or place < layout.neighbours
                for field in self.fields:
                    if field.of_neighbour != of_neighbour:
                        continue
                    start = layout.offsets[field.name] + place * stride
                    for k in range(field.size):
                        columns.append(start + k if there else _ABSENT)
                        unknown.append(field.unknown)
        return np.array(columns, np.int64), np.array(unknown, np.float32)


@compiled
def encode_row(
    row: FloatArray,
    columns: Columns,
    unknown: FloatArray,
    offsets: npt.NDArray[np.int64],
    slots: FloatArray,
    with_features: int,
    scratch: FloatArray,
    out: FloatArray,
) -> None:
    """Write what the network is given of one tracker's observation (F,) to ``out`` (size,)."""
    start = 0
    if with_features:
        start = NUM_FEATURES
        write_features(row, offsets, slots, scratch, out[:start])
    for k in range(len(columns)):
        c = columns[k]
        out[start + k] = row[c] if c >= 0 else unknown[k]


@kernel
def _encode_rows(
    rows: FloatArray,
    columns: Columns,
    unknown: FloatArray,
    offsets: npt.NDArray[np.int64],
    slots: FloatArray,
    with_features: int,
    scratch: FloatArray,
    out: FloatArray,
    thread: int,
    turns: Numbers,
) -> None:
    s = scratch[thread]
    for r in worlds_of(thread, turns):
        encode_row(rows[r], columns, unknown, offsets, slots, with_features, s, out[r])


class Encoder(OwnArrays):
    """An encoding at work on the observations of one layout.

    Raises:
        PolicyError: The layout does not fit.
    """

    def __init__(self, encoding: Encoding, layout: ObservationLayout) -> None:
        self.encoding = encoding
        columns, unknown = encoding.columns(layout)
        offsets, slots = feature_tables(layout)
        self._scratch = np.empty((MOST_THREADS, SCRATCH), np.float32)
        self.tables = (columns, unknown, offsets, slots, int(encoding.kind == "slots"))
        """What :func:`encode_row` takes between the observation and the output."""

    def encode(self, observations: FloatArray, out: FloatArray | None = None) -> FloatArray:
        """Return (..., F) observations as (rows, size), written to ``out`` if given."""
        rows = np.ascontiguousarray(observations).reshape(-1, observations.shape[-1])
        if out is None:
            out = np.empty((len(rows), self.encoding.size), np.float32)
        # Each row is a world of one tracker, to those who share the work out.
        over_worlds(_encode_rows, (rows, *self.tables, self._scratch, out), len(rows), 1)
        return out
