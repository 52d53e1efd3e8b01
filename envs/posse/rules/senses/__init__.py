"""Target sensors, sonar and radio.

Kinds of target sensors are declared by name (:mod:`posse.rules.senses.declaration`).
"""

from posse.rules.senses.declaration import Sensor, sensor
from posse.rules.senses.sensing import add_noise, in_sight

__all__ = ["Sensor", "add_noise", "in_sight", "sensor"]
