"""Offsets of observation fields, and constants of a scenario, for kernels.

Laws and settings give lengths and speeds for robots of 0.15 m radius. Smaller and larger robots are taken for those:
what they observe, and the constants of their scenario, are converted once, to a unit of :func:`unit_of` metres.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse import ObservationLayout, Scenario
from posse.numeric import FloatArray, Records, record_type
from posse.scenarios.setting import OPEN_PLANE_EXTENT

_FIELDS: Final = (
    *("heading", "position", "speed", "turn_rate", "number"),
    *("max_speed", "max_turn_rate", "acceleration_time", "turn_acceleration_time"),
    *("target_known", "target_seen", "target_age", "target_range", "target_bearing"),
    *("target_heading", "target_frame", "target_velocity", "sonar"),
    *("neighbour_number", "neighbour_age", "neighbour_range", "neighbour_bearing"),
    *("neighbour_heading", "neighbour_speed", "neighbour_turn_rate", "neighbour_message"),
)
_RADIUS: Final = 0.15  # m; of the robots that laws and settings are given for
_WIDER: Final = 1.2
_MOST_SIGHT: Final = 8.0  # units; obstacles hide more the farther one looks
_OPEN_AREA: Final = 1.4 * OPEN_PLANE_EXTENT

OFFSETS: Final = record_type(
    *((name, np.int32) for name in _FIELDS),  # -1: the layout has no such field
    ("neighbours", np.int32),  # places for team-mates
    ("stride", np.int32),  # length of one team-mate's part
    ("sonar_beams", np.int32),
    ("message_size", np.int32),
)
"""Offsets of the fields of a layout.

A team-mate's fields are those of the first place; the next ones follow ``stride`` apart.
"""

CONSTANTS: Final = record_type(
    ("dt", np.float32),  # control step, s
    ("delay", np.int32),  # control steps after which a command is executed
    ("followed", np.float64),  # share of a wanted change of the motion that a step brings; 1: no lag
    ("sonar_range", np.float32),  # reading that means "nothing near", m
    ("wide_beam", np.float32),  # cosine of a little more than half a beam's width
    ("radius", np.float32),  # of a robot's disc, m
    ("walled", np.int32),
    ("half_width", np.float32),  # of the arena, m
    ("half_height", np.float32),
    ("sight", np.float32),  # how far its target sensor reaches, m
    ("drifts", np.int32),  # 1: each robot's own pose, as it knows it, drifts
    ("area_x", np.float32),  # half the width of the rectangle that is to be searched, m
    ("area_y", np.float32),  # half its height
)
"""Of a scenario: constants of robots and arena; a metre is a unit of :func:`unit_of`."""


def unit_of(scenario: Scenario) -> float:
    """Return the length (m) that the robots of a scenario take for a metre: 1 at a radius of 0.15 m."""
    return scenario.robot_radius / _RADIUS


def in_units(layout: ObservationLayout, observations: FloatArray) -> FloatArray:
    """Return observations (E, R, F) whose lengths and speeds are in units of :func:`unit_of`."""
    unit = unit_of(layout.scenario)
    if unit == 1.0:
        return observations
    converted = observations.copy()
    views = layout.views(converted)
    for field in layout.fields:
        if field.unit in ("m", "m/s"):
            views[field.name] /= unit
    return converted


def offsets_of(layout: ObservationLayout) -> Records:
    """Return an array of one :data:`OFFSETS`."""
    record = np.full(1, -1, np.int32).repeat(OFFSETS.itemsize // 4).view(OFFSETS)
    scenario = layout.scenario
    for name in _FIELDS:
        record[name] = layout.offsets.get(name, -1)
    record["neighbours"], record["stride"] = layout.neighbours, layout.stride
    record["sonar_beams"] = scenario.sonar_beams
    record["message_size"] = scenario.message_size
    return record


def constants_of(scenario: Scenario) -> Records:
    """Return an array of one :data:`CONSTANTS`."""
    record, unit = np.zeros(1, CONSTANTS), unit_of(scenario)
    record["dt"] = scenario.control_step
    lag = scenario.actuator_lag
    record["delay"], record["followed"] = scenario.command_delay, 1.0
    if lag > 0:
        record["followed"] = 1 - math.exp(-scenario.control_step / lag)
    record["wide_beam"] = math.cos(_WIDER * math.pi / max(1, scenario.sonar_beams))
    record["sonar_range"] = scenario.sonar_range / unit
    record["radius"] = scenario.robot_radius / unit
    record["sight"] = min(scenario.sensing_range / unit, _MOST_SIGHT)
    half_width, half_height = (half / unit for half in scenario.half_sides)
    record["half_width"], record["half_height"] = half_width, half_height
    record["area_x"], record["area_y"] = min(half_width, _OPEN_AREA), min(half_height, _OPEN_AREA)
    record["drifts"] = scenario.drifts
    record["walled"] = scenario.walled
    return record
