"""Layouts of flat float32 vectors: a robot's observation, and the full state of a world.

In an observation the own fields come first, then the sonar, then for each place of a team-mate its fields and
message; of the fields the built-in ones (:mod:`.own_fields`), then those that the scenario names.
Unknown quantities hold the field's ``unknown`` value.

The state, for centralized critics, determines the future of the world, apart from random draws: poses, speeds, the slot
frame ψ, the target's goal heading and its motion's memory, obstacles, past and future faults, every tracker's fix, and
the radio's last received and pending messages. Derived values (sonar, contacts, occupied slots, end of the episode) and
the sums of metrics are not included.
"""

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.declarations import FIELDS, Declarations, Field
from posse.numeric import FloatArray
from posse.rules.state import NEVER, Fix, Pose, WorldArrays
from posse.scenarios import Scenario
from posse.scenarios.scenario import SLACK

_SONAR = (
    "Distance from its rim to the nearest disc or wall in the cone of each beam, from straight ahead to the left; "
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
        declared = [field.of(scenario) for field in Declarations.of(scenario).fields]
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
        for field in (field for field in self.fields if field.name in self.scenario.extra_fields):
            values, low, high = views[field.name], np.float32(field.low), np.float32(field.high)
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


class StateLayout:
    """The entries of a scenario's state vector, in physical units; control steps are times in s.

    Attributes:
        shapes: Shape of every entry, in order, by its name in :attr:`posse.Batch.state`.
        size: S, length of the vector.
        offsets: Index of the first number of each entry, by name.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._control_step = scenario.control_step
        one = WorldArrays.allocate(scenario, 1).by_name()
        # A scenario without obstacles, messages or a radio that fails has nothing to say of them.
        self.shapes = {name: one[name].shape[1:] for name in _entries(scenario) if one[name].size}
        ends = np.cumsum([math.prod(shape) for shape in self.shapes.values()]).tolist()
        self.offsets = dict(zip(self.shapes, [0, *ends], strict=False))
        self.size: int = ends[-1]

    def vector(self, arrays: WorldArrays) -> FloatArray:
        """Return the states of a batch's worlds, a new array (E, S) float32."""
        fields = arrays.by_name()
        parts = [self._read(field, fields).reshape(len(arrays.world), -1) for field in self.shapes]
        return np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")

    def _read(self, field: str, fields: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Return the values of a field, (E, *shape)."""
        values, array = fields[field], field.partition("_")[0]
        is_step = values.dtype == np.int32 and field.endswith(("_step", "_at", "_from"))
        if is_step:
            values = np.where((values < 0) | (values >= NEVER), -1.0, values * self._control_step)
        # What was never heard or sent is "none", whatever an earlier episode left there.
        none = -1.0 if is_step else 0.0
        if array == "heard" and field != "heard_message":
            values = np.where(fields["heard_step"] >= 0, values, none)
        if array == "broadcast":
            values = np.where(fields["broadcast_sent"] != 0, values, none)
        if array in ("broadcast", "message", "command"):  # ring buffers by step: the newest first
            newest = fields["world_step"][:, None] - (array == "command")
            places = (newest - np.arange(values.shape[1])) % values.shape[1]
            values = values[np.arange(len(values))[:, None], places]
        return values

    def views(self, vectors: FloatArray) -> dict[str, FloatArray]:
        """Return named views (..., *shape) of state vectors (..., S)."""
        if vectors.shape[-1] != self.size:
            raise ValueError(f"states of shape {vectors.shape} do not fit: S = {self.size}")
        views = {}
        for name, shape in self.shapes.items():
            part = vectors[..., self.offsets[name] : self.offsets[name] + math.prod(shape)]
            views[name] = part.reshape((*vectors.shape[:-1], *shape))
        return views


def _entries(s: Scenario) -> tuple[str, ...]:
    """Return the names of all entries, in order.

    A time is -1 where there is none. Commands, messages and what was sent come newest first; what was heard, by
    receiver and sender.
    """
    memory = (each for motion in Declarations.of(s).motions for each in motion.memory)
    errors = ("odometry_x", "odometry_y", "odometry_heading") if s.drifts else ()
    pose, fix = Pose._fields[:6], [f"fix_{name}" for name in Fix._fields]  # of a pose without its limits
    world = ("step", *pose, "frame_cos", "frame_sin", "goal_cos", "goal_sin", *memory, "break_step", "breaks_left")
    faults = ("broken_at", "breaks_at", "sensor_dead_from", "radio_dead_from", "sees")
    return (
        *(f"world_{name}" for name in world),
        *(f"tracker_{name}" for name in (*pose, *fix, "fix_step", *faults)),
        *(*errors, "command", "obstacle_x", "obstacle_y", "obstacle_radius", "message", "heard_message"),
        *(f"heard_{name}" for name in ("step", *pose)),
        *(f"broadcast_{name}" for name in ("sent", "fix_step", *pose, *fix[:6], *errors)),
    )
