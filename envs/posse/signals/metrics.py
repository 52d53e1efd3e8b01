"""The metrics of an episode: the score, and further quantities in physical units.

To add a metric, declare it here or in a module of your own (:mod:`posse.signals.measuring`).
``info`` reports it at the end of every episode, one of your own if the scenario names it. ``nan``
stands for "never happened".
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import registry
from posse.numeric import Record, Records
from posse.rules.score import could_arrive
from posse.rules.senses.radio import connected
from posse.rules.state import NEVER
from posse.scenarios import Scenario
from posse.signals.measuring import Column, Metric, figure, metric

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


def _time(steps: npt.NDArray[Any], scenario: Scenario) -> Column:
    return np.where(steps >= 0, steps * scenario.control_step, np.nan)


@metric("1")
def score(c: Record, w: Record) -> np.float32:
    """Mean over the steps of occupied slots per working tracker, at most 1 in each step."""
    return np.float32(w.score)


@metric("1")
def safe_score(c: Record, w: Record) -> np.float32:
    """The score, where every step from the team's first contact on counts 0."""
    contacts = w.contacts_tracker + w.contacts_obstacle + w.contacts_target
    return np.float32(w.score) if contacts == 0 else _ZERO


@metric("1", sum_type=np.float32)
def bound(c: Record, w: Record, trackers: Records, slots: Records) -> np.float32:
    """Upper bound of the score: every tracker drives straight to a slot and then stays in it."""
    count = 0
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at == NEVER:
            if t.could_arrive == 0:
                t.could_arrive = could_arrive(c, w, t, slots)
            count += t.could_arrive
    return np.float32(count) / np.float32(w.working) if w.working > 0 else _ZERO


@figure("s")
def detection_time(s: Scenario, w: Records) -> Column:
    """Time at which a tracker first had the target in sight; nan: never."""
    return _time(w["detected_at"], s)


@figure("s")
def settling_time(s: Scenario, w: Records) -> Column:
    """Start of the first settle_time with each working tracker in its own slot; nan: never."""
    return _time(w["settled_at"], s)


@figure("s")
def recovery_time(s: Scenario, w: Records) -> Column:
    """Time from a tracker's first break until the others settled again; nan: never."""
    return np.where(w["recovered_at"] >= 0, _time(w["recovered_at"] - w["lost_at"], s), np.nan)


@metric("m", per="tracker_step")
def tracking_error(c: Record, w: Record, t: Record) -> np.float32:
    """Mean distance of a working tracker from its own slot, or the nearest free one."""
    return np.float32(t.slot_distance)


@metric("1", per="tracker_step")
def time_in_sight(c: Record, w: Record, t: Record) -> np.float32:
    """Share of the working trackers' time with the target in sight of their own sensor."""
    return np.float32(t.sees)


@figure("count")
def tracker_contacts(s: Scenario, w: Records) -> Column:
    """Contacts between two trackers, each counted once at its beginning."""
    return np.asarray(w["contacts_tracker"], np.float64)


@figure("count")
def obstacle_contacts(s: Scenario, w: Records) -> Column:
    """Contacts of a tracker with an obstacle or a wall."""
    return np.asarray(w["contacts_obstacle"], np.float64)


@figure("count")
def target_contacts(s: Scenario, w: Records) -> Column:
    """Contacts of a tracker with the target."""
    return np.asarray(w["contacts_target"], np.float64)


@figure("1")
def contact_free(s: Scenario, w: Records) -> Column:
    """1 if no tracker touched anything, else 0; the mean is the share of contact-free episodes."""
    contacts = w["contacts_tracker"] + w["contacts_obstacle"] + w["contacts_target"]
    return np.asarray(contacts == 0, np.float64)


@figure("m")
def least_gap(s: Scenario, w: Records) -> Column:
    """Least clearance of a tracker from anything else, over all control steps."""
    return np.asarray(w["least_gap"], np.float64)


@metric("1", per="tracker_step")
def control_effort(c: Record, w: Record, t: Record) -> np.float32:
    """Mean of (V / V_max)² + (ω / ω_max)² over the working trackers."""
    v, turn = t.speed * t.per_speed, t.turn_rate * t.per_turn_rate
    return np.float32(v * v + turn * turn)


@metric("1")
def time_connected(c: Record, w: Record, trackers: Records) -> np.float32:
    """Share of the time in which the radio graph of the working trackers was connected."""
    return _ONE if c.perfect_radio or connected(c, w, trackers) else _ZERO


@figure("s")
def duration(s: Scenario, w: Records) -> Column:
    """Length of the episode."""
    return _time(w["step"], s)


METRICS: Final[tuple[Metric, ...]] = registry.METRICS.built_in()
"""Every built-in metric, in the order in which they are reported."""


def episode_metrics(scenario: Scenario, worlds: Records) -> dict[str, Column]:
    """Return the metrics of the current episodes by name, (E,) float64.

    These are the built-in ones and those that the scenario names.
    """
    metrics = registry.METRICS.with_added(*scenario.metrics)
    return {m.name: m.function(scenario, worlds) for m in metrics}
