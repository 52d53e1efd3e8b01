"""Faults: trackers break permanently; sensors and radios fail temporarily."""

from typing import Final

import numpy as np

from posse.numeric import ONE, ZERO, Record, Records, compiled
from posse.rules.randomness import FAULTS, bits, uniform
from posse.rules.state import NEVER

_PER_TRACKER: Final = 4  # draws for each tracker
_BREAKS: Final = 1000  # first index of the draws for breaks


@compiled
def _drawn_step(c: Record, w: Record, earliest: int, index: int) -> int:
    """Return a control step drawn from the rest of the window in which trackers break, one after the other."""
    width = max(0, min(c.break_until, c.horizon - w.breaks_left) - earliest)
    return int(earliest + np.int32(np.float32(width) * uniform(w.key, 0, FAULTS, index)))


@compiled
def _drawn_outage(c: Record, w: Record, chance: np.float32, looked: int, index: int) -> np.int32:
    """Return the start of an outage, given none in the first ``looked`` steps, or NEVER."""
    left = np.float32(c.horizon - looked)
    share = left / np.float32(c.horizon)
    if uniform(w.key, 0, FAULTS, index) >= chance * share / (ONE - chance * (ONE - share)):
        return NEVER
    return np.int32(looked) + np.int32(uniform(w.key, 0, FAULTS, index + 1) * left)


@compiled
def draw_faults(c: Record, w: Record, trackers: Records) -> None:
    """Draw the faults of an episode."""
    for t in trackers:
        t.broken_at = NEVER
    w.breaks_left, w.break_step = c.breaks, NEVER
    draw_coming_faults(c, w, trackers, 0, 0)


@compiled
def draw_coming_faults(c: Record, w: Record, trackers: Records, looked: int, moved: int) -> None:
    """Draw future faults, given the past ones.

    Sensors have been read ``looked`` times in this episode, and robots moved in ``moved`` steps;
    both are 0 at its start. Faults that have begun are unchanged.
    """
    n = c.num_trackers
    for i, t in enumerate(trackers):
        if t.sensor_dead_from >= looked:
            t.sensor_dead_from = _drawn_outage(c, w, c.sensor_outages, looked, _PER_TRACKER * i)
        if t.radio_dead_from >= looked:
            t.radio_dead_from = _drawn_outage(c, w, c.radio_outages, looked, _PER_TRACKER * i + 2)
        if t.broken_at == NEVER:
            t.breaks_at = NEVER
    if w.breaks_left == 0:
        return
    earliest = max(c.break_from, moved)
    if c.break_nearest:
        w.break_step = _drawn_step(c, w, earliest, _BREAKS)
        return
    for k in range(w.breaks_left):
        chosen = np.int64(bits(w.key, 0, FAULTS, _BREAKS + 2 * k + 1) % np.uint64(n))
        while trackers[chosen].breaks_at != NEVER:
            chosen = (chosen + 1) % n
        trackers[chosen].breaks_at = _drawn_step(c, w, earliest, _BREAKS + 2 * k + 2)


@compiled
def break_tracker(w: Record, t: Record) -> None:
    """Break one tracker permanently."""
    t.broken_at = w.step
    t.speed, t.turn_rate = ZERO, ZERO
    w.working -= 1
    if w.lost_at < 0:
        w.lost_at = w.step
    # The rest of the team has to settle again to recover.
    w.held = 0


@compiled
def apply_faults(c: Record, w: Record, trackers: Records) -> None:
    """Break the trackers that are due."""
    if w.breaks_left == 0:
        return
    if c.break_nearest:
        if w.step < w.break_step:
            return
        nearest, least = 0, np.float32(np.inf)
        for i, t in enumerate(trackers):
            dx, dy = t.x - w.x, t.y - w.y
            d2 = dx * dx + dy * dy
            if t.broken_at == NEVER and d2 < least:
                nearest, least = i, d2
        break_tracker(w, trackers[nearest])
        w.breaks_left -= 1
        # Several break in sequence, each when it is nearest.
        w.break_step = _drawn_step(c, w, w.step + 1, _BREAKS + w.breaks_left)
        return
    for t in trackers:
        if t.broken_at == NEVER and w.step >= t.breaks_at:
            break_tracker(w, t)
            w.breaks_left -= 1
