"""The built-in metrics of an episode: the score, and further quantities in physical units.

To add one, declare it here, or in a module of your own (:func:`posse.metric`).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from posse.declarations import metric
from posse.numeric import ONE, ZERO, Record, Records
from posse.rules.score import could_arrive
from posse.rules.senses.radio import connected
from posse.rules.state import NEVER
from posse.scenarios import Scenario
from posse.signals.reward import effort

Column = npt.NDArray[np.float64]


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
    return np.float32(w.score) if contacts == 0 else ZERO


@metric("1")
def bound(c: Record, w: Record, trackers: Records, slots: Records) -> np.float32:
    """Upper bound of the score: every tracker drives straight to a slot and then stays in it."""
    count = 0
    for t in trackers:
        if t.broken_at == NEVER:
            if not t.could_arrive:
                t.could_arrive = could_arrive(c, w, t, slots)
            count += t.could_arrive
    return np.float32(count) / np.float32(w.working)


@metric("s")
def detection_time(s: Scenario, w: Records) -> Column:
    """Time at which a tracker first had the target in sight; nan: never."""
    return _time(w["detected_at"], s)


@metric("s")
def settling_time(s: Scenario, w: Records) -> Column:
    """Start of the first settle_time with each working tracker in its own slot; nan: never."""
    return _time(w["settled_at"], s)


@metric("s")
def recovery_time(s: Scenario, w: Records) -> Column:
    """Time from a tracker's first break until the others settled again; nan: never."""
    return np.where(w["recovered_at"] >= 0, _time(w["recovered_at"] - w["lost_at"], s), np.nan)


@metric("m")
def tracking_error(c: Record, w: Record, t: Record) -> np.float32:
    """Mean distance of a working tracker from its own slot, or the nearest free one."""
    return np.float32(t.slot_distance)


@metric("1")
def time_in_sight(c: Record, w: Record, t: Record) -> np.float32:
    """Share of the working trackers' time with the target in sight of their own sensor."""
    return np.float32(t.sees)


@metric("count")
def tracker_contacts(s: Scenario, w: Records) -> Column:
    """Contacts between two trackers, each counted once at its beginning."""
    return w["contacts_tracker"]


@metric("count")
def obstacle_contacts(s: Scenario, w: Records) -> Column:
    """Contacts of a tracker with an obstacle or a wall."""
    return w["contacts_obstacle"]


@metric("count")
def target_contacts(s: Scenario, w: Records) -> Column:
    """Contacts of a tracker with the target."""
    return w["contacts_target"]


@metric("1")
def contact_free(s: Scenario, w: Records) -> Column:
    """1 if no tracker touched anything, else 0; the mean is the share of contact-free episodes."""
    contacts = w["contacts_tracker"] + w["contacts_obstacle"] + w["contacts_target"]
    return np.asarray(contacts == 0, np.float64)


@metric("m")
def least_gap(s: Scenario, w: Records) -> Column:
    """Least clearance of a tracker from anything else, over all control steps."""
    return w["least_gap"]


@metric("1")
def control_effort(c: Record, w: Record, t: Record) -> np.float32:
    """Mean of (V / V_max)² + (ω / ω_max)² over the working trackers."""
    return np.float32(effort(c, w, t))


@metric("1")
def time_connected(c: Record, w: Record, trackers: Records) -> np.float32:
    """Share of the time in which the radio graph of the working trackers was connected."""
    return ONE if c.perfect_radio or connected(c, w, trackers) else ZERO


@metric("s")
def duration(s: Scenario, w: Records) -> Column:
    """Length of the episode."""
    return _time(w["step"], s)
