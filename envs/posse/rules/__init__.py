"""Dynamics, contacts, sensing, radio and scoring of one world.

The names below are public: records, constants and functions for policies and users' own modules.
"""

from posse.rules.kinematics import arc, in_frame
from posse.rules.randomness import SENSOR_NOISE, TARGET, between, normal_pair, uniform
from posse.rules.state import CONFIG, NEVER, TRACKER, beam_directions, config_record, parts, slot_records, world_record
from posse.rules.targets.smart import DART_TURN, PATIENCE
from posse.scenarios.setting import SPLITS

__all__ = [
    "CONFIG",
    "DART_TURN",
    "NEVER",
    "PATIENCE",
    "SENSOR_NOISE",
    "SPLITS",
    "TARGET",
    "TRACKER",
    "arc",
    "beam_directions",
    "between",
    "config_record",
    "in_frame",
    "normal_pair",
    "parts",
    "slot_records",
    "uniform",
    "world_record",
]
