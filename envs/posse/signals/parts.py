"""The declarations that the kernel of a scenario is composed of."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

import posse.signals.metrics

# Imported for their declarations of the built-in fields and metrics.
import posse.signals.observation.mate_fields
import posse.signals.observation.own_fields  # noqa: F401
from posse.registry import FIELDS, METRICS, REWARD_TERMS, SENSORS, TARGET_MOTIONS, Registry
from posse.rules.declared import Rules, rules_of
from posse.rules.senses import Sensor
from posse.rules.targets import TargetMotion
from posse.scenarios import Scenario
from posse.signals.measuring import Metric, adding, clearing
from posse.signals.observation.columns import empty_writer, fixed_writer, row_writer, width_of
from posse.signals.observation.fields import FieldDeclaration
from posse.signals.reward import RewardTerm, reward_writer, target_reward_writer, terms_for

Declarations = tuple[FieldDeclaration, ...]


class Parts(NamedTuple):
    """The declarations of a scenario, each kind in order of evaluation."""

    fields: Declarations
    """Observation fields, except sonar and team-mates."""
    mate_fields: Declarations
    """Fields of a team-mate, except its message."""
    motions: tuple[TargetMotion, ...]
    """Target motions."""
    sensors: tuple[Sensor, ...]
    """Target sensors."""
    metrics: tuple[Metric, ...]
    """Metrics of an episode."""
    reward_terms: tuple[RewardTerm, ...]
    """Reward terms."""

    @property
    def width(self) -> int:
        """Length of the observation before the sonar."""
        return width_of(self.fields)

    @property
    def mate_width(self) -> int:
        """Length of a team-mate's part, without its message."""
        return width_of(self.mate_fields)

    @property
    def term_names(self) -> tuple[str, ...]:
        """Names of the reward terms."""
        return tuple(term.name for term in self.reward_terms)


class Writers(NamedTuple):
    """Functions for compiled code that write observations and rewards."""

    own: Any
    """(c, v, s, rows): writes the own fields of eight observers."""
    fixed: Any
    """(c, v, s, observers): writes those of the own fields that never change to scratch memory."""
    mate: Any
    """(c, v, m, s, rows): writes the fields of a team-mate of each."""
    reward: Any
    """(c, w, t, weights, values) -> reward: writes the terms."""
    target_reward: Any
    """(c, w, weights, values) -> reward: writes the terms of a target that is an agent."""
    empty: Any
    """(o, k): writes an empty place of a team-mate."""
    width: int
    """Length of the observation before the sonar."""
    mate_width: int
    """Length of a team-mate's part, without its message."""


class Sums(NamedTuple):
    """Functions for compiled code that update the sums of the metrics."""

    clear: Any
    """(w): sets the sums to zero."""
    add: Any
    """(c, w, trackers, slots): adds a control step to the sums."""


@functools.cache
def built_in_parts() -> Parts:
    """Return the parts of every scenario."""
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
    """Return the parts of a scenario: the built-in ones, and those that it names."""
    return Parts(
        *_own_and_mates(FIELDS.with_added(*scenario.extra_fields)),
        motions=TARGET_MOTIONS.with_added(scenario.target_motion),
        sensors=SENSORS.with_added(scenario.sensor),
        metrics=METRICS.with_added(*scenario.metrics),
        reward_terms=terms_for(scenario),
    )


def added(parts: Parts) -> Iterator[tuple[Registry[Any], Any]]:
    """Yield the parts that users' modules have declared, each with its registry."""
    groups: tuple[tuple[Registry[Any], tuple[Any, ...]], ...] = (
        (FIELDS, parts.fields),
        (FIELDS, parts.mate_fields),
        (REWARD_TERMS, parts.reward_terms),
        (TARGET_MOTIONS, parts.motions),
        (SENSORS, parts.sensors),
        (METRICS, parts.metrics),
    )
    for registry, things in groups:
        yield from ((registry, thing) for thing in things if not registry.is_built_in(thing.name))


def rules_for(parts: Parts) -> Rules:
    """Return the functions that dispatch to the target motions and sensors of parts."""
    return rules_of(parts.motions, parts.sensors)


@functools.cache
def writers_for(parts: Parts) -> Writers:
    """Return the functions that write the observations and rewards of parts."""
    return Writers(
        row_writer(parts.fields, ("c", "v")),
        fixed_writer(parts.fields),
        row_writer(parts.mate_fields, ("c", "v", "m")),
        reward_writer(parts.reward_terms),
        target_reward_writer(parts.reward_terms),
        empty_writer(parts.mate_fields),
        parts.width,
        parts.mate_width,
    )


@functools.cache
def sums_for(parts: Parts) -> Sums:
    """Return the functions that update the sums of the metrics of parts."""
    return Sums(clearing(parts.metrics), adding(parts.metrics))
