"""What a learned policy's network reads of an observation.

A network has inputs of a fixed meaning, while a scenario's observation depends on its team size and
message length. An :class:`Encoding` lists the fields that the network reads and the number of
team-mates, and finds them in any layout that has them: surplus team-mates are left out, missing
ones are filled with the field's value for "unknown".
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
from posse.numeric import FloatArray
from posse_baselines.learned.features import NUM_FEATURES
from posse_baselines.policy import PolicyError

KINDS: Final = ("plain", "slots", "belief")
"""``plain``: the observation; ``slots``: :mod:`posse_baselines.learned.features`, then the
observation; ``belief``: the same, and behind the adviser's proposal what the adviser believes
(:mod:`posse_baselines.learned.advice`), which is no part of the encoding's ``size``."""
MOST_NEIGHBOURS: Final = 4096
"""Team-mates that an encoding reads, at most."""

_ABSENT: Final = -1
_LARGEST: Final = 1e30  # of the numbers for "unknown", so that the network's inputs stay finite
Columns = npt.NDArray[np.int64]


@dataclass(frozen=True)
class EncodedField:
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

    @classmethod
    def of(cls, layout: ObservationLayout, kind: str = "plain", neighbours: int | None = None) -> Encoding:
        """Return the encoding that reads every field of a layout.

        Args:
            layout: Layout of the training scenario.
            kind: One of :data:`KINDS`.
            neighbours: Number of team-mates to read; default: as many as the layout has.

        Raises:
            PolicyError: An unknown kind, or a number of team-mates out of range.
        """
        if kind not in KINDS:
            raise PolicyError(f"unknown encoding {kind!r}; encodings are: {', '.join(KINDS)}")
        places = layout.neighbours if neighbours is None else neighbours
        if not 0 <= places <= MOST_NEIGHBOURS:
            raise PolicyError(f"neighbours={places} must lie in [0, {MOST_NEIGHBOURS}]")
        fields = tuple(
            EncodedField(f.name, f.size, f.unit, float(f.unknown or 0), f.of_neighbour) for f in layout.fields
        )
        return cls(kind, places, fields)

    @property
    def message_size(self) -> int:
        """Numbers of a team-mate's message that it reads."""
        return sum(f.size for f in self.fields if f.name == "neighbour_message")

    @property
    def read_size(self) -> int:
        """Numbers of an observation that it reads."""
        own = sum(f.size for f in self.fields if not f.of_neighbour)
        each = sum(f.size for f in self.fields if f.of_neighbour)
        return own + self.neighbours * each

    @property
    def size(self) -> int:
        """Number of network inputs."""
        return self.read_size + (NUM_FEATURES if self.with_features else 0)

    @property
    def with_features(self) -> bool:
        """Whether derived features precede the observation."""
        return self.kind != "plain"

    @property
    def believes(self) -> bool:
        """Whether the network also reads the adviser's belief."""
        return self.kind == "belief"

    @property
    def digest(self) -> str:
        """A hash over the meaning of all network inputs."""
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
            PolicyError: The values do not describe an encoding.
        """
        try:
            fields = tuple(
                EncodedField(str(name), int(size), str(unit), float(unknown), bool(of_neighbour))
                for name, size, unit, unknown, of_neighbour in values["fields"]
            )
            kind, neighbours = str(values["kind"]), int(values["neighbours"])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise PolicyError(f"the description of the policy's inputs is damaged: {error!s:.200}") from error
        if (
            kind not in KINDS
            or not 0 <= neighbours <= MOST_NEIGHBOURS
            or any(f.size < 1 or not abs(f.unknown) <= _LARGEST for f in fields)
        ):
            raise PolicyError("the description of the policy's inputs is damaged")
        return cls(kind, neighbours, fields)

    def columns(self, layout: ObservationLayout) -> tuple[Columns, FloatArray]:
        """Return the column of each number in an observation, and its value where it is missing.

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
                    f"reads {mine.name!r:.80} as {mine.size} x {mine.unit!r:.80}, the scenario has "
                    f"{found}; play it with the settings on its card"
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
