"""Which declared functions the kernel of a scenario is made of."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import posse.signals.own_fields  # noqa: F401 (declares the built-in fields)
from posse.registry import FIELDS
from posse.scenarios.scenario import Scenario
from posse.signals.columns import own_writer, settings_writer, width_of
from posse.signals.fields import FieldDeclaration


class Parts(NamedTuple):
    """Declared things, in the order in which they are worked out."""

    fields: tuple[FieldDeclaration, ...]
    """Of an observation, but for sonar and team-mates."""

    @property
    def width(self) -> int:
        """Numbers of an observation before the sonar's."""
        return width_of(self.fields)


class Writers(NamedTuple):
    """The functions that write what is told of a world, for compiled code."""

    settings: Any
    """(c, columns): writes the columns that are always the same."""
    own: Any
    """(c, v, columns): writes the columns of eight observers."""
    width: int
    """Numbers of an observation before the sonar's."""


@functools.cache
def built_in_parts() -> Parts:
    """Return the parts that every scenario has."""
    return Parts(tuple(field for field in FIELDS.built_in() if field.subject != "mate"))


def parts_for(scenario: Scenario) -> Parts:
    """Return the parts for a scenario."""
    return built_in_parts()


@functools.cache
def writers_for(parts: Parts) -> Writers:
    """Return the functions that write parts."""
    return Writers(settings_writer(parts.fields), own_writer(parts.fields), parts.width)
