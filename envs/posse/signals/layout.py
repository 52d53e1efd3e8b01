"""Layout of a robot's observation: a flat float32 vector of named fields.

The own fields come first, then the sonar, then for each place of a team-mate its fields and
message; of the fields the built-in ones (:mod:`.own_fields`), then those that the scenario names.
Unknown quantities hold the field's ``unknown`` value.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.declarations import FIELDS, Field, fields_of
from posse.numeric import FloatArray
from posse.scenarios import Scenario
from posse.scenarios.limits import SLACK

_SONAR = (
    "Distance from its rim to the nearest disc or wall along each beam, from straight ahead to the left; "
    "sonar_range if there is none."
)


class ObservationLayout:
    """Position and range of each field in the flat observation of a scenario.

    Attributes:
        fields: Every :class:`Field`, in order; those of a team-mate once.
        offsets: Index of the first number of each field, by name; in the first place of a team-mate.
        size: F, length of the flat observation.
        neighbours: Number of places for team-mates.
        stride: Length of the part of one team-mate.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        declared = [field.of(scenario) for field in fields_of(scenario)]
        own = [field for field in declared if not field.of_neighbour]
        if scenario.sonar_beams:
            own.append(Field("sonar", scenario.sonar_beams, "m", 0, scenario.sonar_range * SLACK, _SONAR))
        repeated = [field for field in declared if field.of_neighbour]
        if scenario.message_size:
            meaning = "Message from its policy."
            repeated.append(Field("neighbour_message", scenario.message_size, "1", -1, 1, meaning, 0, True))
        self.fields = (*own, *repeated)
        self.neighbours = scenario.neighbours
        self.stride = sum(field.size for field in repeated)
        self._repeated_from = sum(field.size for field in own)
        self.size = self._repeated_from + self.neighbours * self.stride
        starts = itertools.accumulate((field.size for field in self.fields), initial=0)
        self.offsets = {field.name: start for field, start in zip(self.fields, starts, strict=False)}

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest value of every entry, each (F,) float32."""
        once = np.array([(field.low, field.high) for field in self.fields for _ in range(field.size)], np.float32)
        own, repeated = np.split(once, [self._repeated_from])
        low, high = np.concatenate([own, np.tile(repeated, (self.neighbours, 1))]).T.copy()
        return low, high

    def check_added(self, observations: FloatArray) -> None:
        """Raise DeclarationError if a field that the scenario adds leaves its bounds in observations (..., F)."""
        views = self.views(observations)
        for field in self.fields:
            values = views[field.name]
            if field.name in self.scenario.extra_fields and values.size:
                low, high = np.float32(field.low), np.float32(field.high)
                wrong = values[~((values >= low) & (values <= high))]
                if wrong.size:
                    where = f"from low={field.low:g} to high={field.high:g}"
                    raise FIELDS[field.name].error(f"it returned {wrong.flat[0]:g}, which is not {where}")

    def views(self, observations: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """Return named views of flat observations (..., F), sharing their memory.

        A field of size 1 has shape (...), one of size k (..., k); a field of team-mates has an
        axis of places before that, (..., places) or (..., places, k).
        """
        if observations.shape[-1] != self.size:
            raise ValueError(
                f"observations of shape {observations.shape} do not fit: the last axis of "
                f"{self.scenario.name!r} is {self.size} long"
            )
        places = (*observations.shape[:-1], self.neighbours, self.stride)
        mates = observations[..., self._repeated_from :].reshape(places)
        views: dict[str, npt.NDArray[Any]] = {}
        for field in self.fields:
            source, start = observations, self.offsets[field.name]
            if field.of_neighbour:
                source, start = mates, start - self._repeated_from
            part = source[..., start : start + field.size]
            views[field.name] = part[..., 0] if field.size == 1 else part
        return views
