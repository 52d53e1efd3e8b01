"""Target sensors, sonar and radio."""

from posse.rules.senses.sensing import add_noise, in_sight

__all__ = ["add_noise", "in_sight"]
