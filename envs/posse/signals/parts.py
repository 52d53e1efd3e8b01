"""Which declared functions the kernel of a scenario is made of."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

import posse.signals.metrics

# These declare the built-in fields and metrics.
import posse.signals.observation.mate_fields
import posse.signals.observation.own_fields  # noqa: F401
from posse.registry import (
    FIELDS,
    METRICS,
    REWARD_TERMS,
    SENSORS,
    TARGET_MOTIONS,
    Registry,
)
from posse.rules.declared import Rules, rules_of
from posse.rules.senses import Sensor
from posse.rules.targets import TargetMotion
from posse.scenarios import Scenario
from posse.signals.measuring import Metric, adding, clearing
from posse.signals.observation.columns import empty_writer, row_writer, width_of
from posse.signals.observation.fields import FieldDeclaration
from posse.signals.reward import RewardTerm, reward_writer, terms_for

Declarations = tuple[FieldDeclaration, ...]


class Parts(NamedTuple):
    """Declared things, in the order in which they are worked out."""

    fields: Declarations
    """Of an observation, but for sonar and team-mates."""
    mate_fields: Declarations
    """Of a team-mate, but for what it said."""
    motions: tuple[TargetMotion, ...]
    """Of the target."""
    sensors: tuple[Sensor, ...]
    """That have the target in sight."""
    metrics: tuple[Metric, ...]
    """Of an episode."""
    reward_terms: tuple[RewardTerm, ...]

    @property
    def width(self) -> int:
        """Numbers of an observation before the sonar's."""
        return width_of(self.fields)

    @property
    def mate_width(self) -> int:
        """Numbers of a team-mate, what it said apart."""
        return width_of(self.mate_fields)

    @property
    def term_names(self) -> tuple[str, ...]:
        """Of the reward terms."""
        return tuple(term.name for term in self.reward_terms)


class Writers(NamedTuple):
    """The functions that write what is told of a world, for compiled code."""

    own: Any
    """(c, v, s, rows): writes what eight robots observe of themselves and of the target."""
    mate: Any
    """(c, v, m, s, rows): writes what they observe of a team-mate."""
    reward: Any
    """(c, w, t, weights, values) -> reward: writes the terms."""
    empty: Any
    """(o, k): writes the place of a team-mate that nobody fills."""
    width: int
    """Numbers of an observation before the sonar's."""
    mate_width: int
    """Numbers of a team-mate, what it said apart."""


class Sums(NamedTuple):
    """The functions that work out what the metrics are made from, for compiled code."""

    clear: Any
    """(w): sets the sums to zero."""
    add: Any
    """(c, w, trackers, slots): adds a control step to them."""


@functools.cache
def built_in_parts() -> Parts:
    """Return the parts that every scenario has."""
    return Parts(
        *_own_and_mates(FIELDS.built_in()),
        motions=TARGET_MOTIONS.built_in(),
        sensors=SENSORS.built_in(),
        metrics=METRICS.built_in(),
        reward_terms=REWARD_TERMS.built_in(),
    )


def _own_and_mates(fields: Declarations) -> tuple[Declarations, Declarations]:
    return (
        tuple(field for field in fields if field.subject != "mate"),
        tuple(field for field in fields if field.subject == "mate"),
    )


def parts_for(scenario: Scenario) -> Parts:
    """Return the parts for a scenario: the built-in ones, and those that it asks for by name."""
    return Parts(
        *_own_and_mates(FIELDS.with_added(*scenario.extra_fields)),
        motions=TARGET_MOTIONS.with_added(scenario.target_motion),
        sensors=SENSORS.with_added(scenario.sensor),
        metrics=METRICS.with_added(*scenario.metrics),
        reward_terms=terms_for(scenario),
    )


def added(parts: Parts) -> Iterator[tuple[Registry[Any], Any]]:
    """Yield what a user's modules have declared among parts, each with its registry."""
    groups: tuple[tuple[Registry[Any], tuple[Any, ...]], ...] = (
        (FIELDS, parts.fields), (FIELDS, parts.mate_fields), (REWARD_TERMS, parts.reward_terms),
        (TARGET_MOTIONS, parts.motions), (SENSORS, parts.sensors), (METRICS, parts.metrics),
    )  # fmt: skip
    for registry, things in groups:
        yield from ((registry, thing) for thing in things if not registry.is_built_in(thing.name))


def rules_for(parts: Parts) -> Rules:
    """Return the functions that parts of the rules are carried out by."""
    return rules_of(parts.motions, parts.sensors)


@functools.cache
def writers_for(parts: Parts) -> Writers:
    """Return the functions that write parts."""
    return Writers(
        row_writer(parts.fields, ("c", "v")),
        row_writer(parts.mate_fields, ("c", "v", "m")),
        reward_writer(parts.reward_terms),
        empty_writer(parts.mate_fields),
        parts.width,
        parts.mate_width,
    )


@functools.cache
def sums_for(parts: Parts) -> Sums:
    """Return the functions that work out the sums behind the metrics of parts."""
    return Sums(clearing(parts.metrics), adding(parts.metrics))
