"""Layout of a robot's observation: a flat float32 vector of named fields.

The own fields (:mod:`.own_fields`, and those named by the scenario) come first, then the sonar,
then for each place of a team-mate its fields (:mod:`.mate_fields`, and those named by the scenario)
and message. Unknown quantities hold the field's ``unknown`` value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray
from posse.registry import FIELDS
from posse.scenarios import Scenario
from posse.signals.generate import declarations_for
from posse.signals.observation.fields import SLACK, Field


def _sonar_fields(s: Scenario) -> list[Field]:
    """Return the sonar's field, written by :func:`posse.rules.senses.sonar.ping`."""
    if s.sonar_beams == 0:
        return []
    return [
        Field(
            "sonar",
            s.sonar_beams,
            "m",
            0,
            s.sonar_range * SLACK,
            "Distance from its rim to the nearest disc or wall along each beam, from straight "
            "ahead to the left; sonar_range if there is none.",
        )
    ]


def _message_fields(s: Scenario) -> list[Field]:
    """Return the field of a team-mate's message, written by :mod:`~.mates`."""
    if s.message_size == 0:
        return []
    return [Field("neighbour_message", s.message_size, "1", -1, 1, "Message from its policy.", 0, of_neighbour=True)]


class ObservationLayout:
    """Position and range of each field in the flat observation of a scenario.

    Attributes:
        fields: Every :class:`Field`, in order; those of a team-mate once.
        size: F, length of the flat observation.
        neighbours: Number of places for team-mates.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        declared = declarations_for(scenario)
        single = [*(field.of(scenario) for field in declared.fields), *_sonar_fields(scenario)]
        repeated = [*(field.of(scenario) for field in declared.mate_fields), *_message_fields(scenario)]
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
        """Length of the part of one team-mate."""
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

    def check_added(self, observations: FloatArray) -> None:
        """Check the fields that the scenario adds in observations (..., F).

        Raises:
            DeclarationError: One has a value that is not finite or not between its bounds.
        """
        names = self.scenario.extra_fields
        views = self.views(observations) if names else {}
        for field in self.fields:
            if field.name in names:
                values = views[field.name]
                wrong = values[~((values >= np.float32(field.low)) & (values <= np.float32(field.high)))]
                if wrong.size:
                    raise FIELDS.error(
                        FIELDS[field.name].function,
                        f"it returned {wrong.flat[0]:g}, which is not from low={field.low:g} to high={field.high:g}",
                    )

    def views(self, observations: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """Return named views of flat observations (..., F), sharing their memory.

        A field of size 1 has shape (...), one of size k (..., k); a field of team-mates has an
        axis of places before that, (..., places) or (..., places, k).

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
            ValueError: A missing or unknown field, or a wrong shape.
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
