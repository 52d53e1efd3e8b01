"""What an episode is summed up by: the score, and beside it figures in physical units.

To add a metric, write its function here under ``@metric``: it then arrives in ``info`` at the end
of every episode. ``nan`` stands for "never happened".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Records
from posse.scenarios import Scenario

_Column = npt.NDArray[np.float64]
_Function = Callable[[Scenario, Records], _Column]


@dataclass(frozen=True)
class Metric:
    """One figure of an episode."""

    name: str
    unit: str
    meaning: str
    function: _Function


_metrics: list[Metric] = []


def metric(unit: str) -> Callable[[_Function], _Function]:
    """Declare a function (scenario, worlds (E,) ``WORLD``) -> (E,) as a metric of its name."""

    def declare(function: _Function) -> _Function:
        meaning = (function.__doc__ or "").strip()
        _metrics.append(Metric(function.__name__, unit, meaning, function))
        return function

    return declare


def _per_step(sums: npt.NDArray[Any], worlds: Records) -> _Column:
    per_step: _Column = np.asarray(sums, np.float64) / np.maximum(worlds["step"], 1)
    return per_step


def _per_tracker_step(sums: npt.NDArray[Any], worlds: Records) -> _Column:
    mean: _Column = np.asarray(sums, np.float64) / np.maximum(worlds["tracker_steps"], 1)
    return mean


def _time(steps: npt.NDArray[Any], scenario: Scenario) -> _Column:
    return np.where(steps >= 0, steps * scenario.control_step, np.nan)


@metric("1")
def score(s: Scenario, w: Records) -> _Column:
    """Mean over the steps of occupied slots per working tracker, at most 1 a step."""
    return _per_step(w["score_sum"], w)


@metric("1")
def safe_score(s: Scenario, w: Records) -> _Column:
    """The score, where every step counts 0 from the first contact of any tracker on."""
    return _per_step(w["safe_score_sum"], w)


@metric("1")
def bound(s: Scenario, w: Records) -> _Column:
    """What the score could have been at most: every tracker straight to a slot, then in place."""
    return _per_step(w["bound_sum"], w)


@metric("s")
def detection_time(s: Scenario, w: Records) -> _Column:
    """When a tracker first had the target in sight; nan: never."""
    return _time(w["detected_at"], s)


@metric("s")
def settling_time(s: Scenario, w: Records) -> _Column:
    """When every working tracker had a slot of its own, kept for settle_time; nan: never."""
    return _time(w["settled_at"], s)


@metric("s")
def recovery_time(s: Scenario, w: Records) -> _Column:
    """From the first break of a tracker to when the others had settled anew; nan: never."""
    return np.where(w["recovered_at"] >= 0, _time(w["recovered_at"] - w["lost_at"], s), np.nan)


@metric("m")
def tracking_error(s: Scenario, w: Records) -> _Column:
    """Mean distance of a working tracker from its own slot, or from the nearest free one."""
    return _per_tracker_step(w["error_sum"], w)


@metric("1")
def time_in_sight(s: Scenario, w: Records) -> _Column:
    """Share of the working trackers' time with the target in their own sight."""
    return _per_tracker_step(w["sight_sum"], w)


@metric("count")
def tracker_contacts(s: Scenario, w: Records) -> _Column:
    """Contacts between two trackers, each counted once, when it begins."""
    return np.asarray(w["contacts_tracker"], np.float64)


@metric("count")
def obstacle_contacts(s: Scenario, w: Records) -> _Column:
    """Contacts of a tracker with an obstacle or a wall."""
    return np.asarray(w["contacts_obstacle"], np.float64)


@metric("count")
def target_contacts(s: Scenario, w: Records) -> _Column:
    """Contacts of a tracker with the target."""
    return np.asarray(w["contacts_target"], np.float64)


@metric("1")
def contact_free(s: Scenario, w: Records) -> _Column:
    """1 if no tracker touched anything, else 0; the mean is the share of contact-free episodes."""
    contacts = w["contacts_tracker"] + w["contacts_obstacle"] + w["contacts_target"]
    return np.asarray(contacts == 0, np.float64)


@metric("m")
def least_gap(s: Scenario, w: Records) -> _Column:
    """Least free width that was between a tracker and anything else, at a control step."""
    return np.asarray(w["least_gap"], np.float64)


@metric("1")
def control_effort(s: Scenario, w: Records) -> _Column:
    """Mean of (V / V_max)² + (ω / ω_max)² over the working trackers."""
    return _per_tracker_step(w["effort_sum"], w)


@metric("1")
def time_connected(s: Scenario, w: Records) -> _Column:
    """Share of the time that the working trackers were one radio graph."""
    return _per_step(w["connected_sum"], w)


@metric("s")
def duration(s: Scenario, w: Records) -> _Column:
    """Length of the episode."""
    return _time(w["step"], s)


METRICS: Final = tuple(_metrics)
"""Every metric, in the order in which they are reported."""


def episode_metrics(scenario: Scenario, worlds: Records) -> dict[str, _Column]:
    """Return every metric by name, (E,) float64, of the episodes as they stand."""
    return {m.name: m.function(scenario, worlds) for m in METRICS}
