"""What goes wrong in an episode: trackers break for good, sensors and radios fail for a while."""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import Record, Records, compiled
from posse.rules.randomness import FAULTS, bits, uniform
from posse.rules.state import NEVER

_PER_TRACKER: Final = 4  # draws for each tracker
_BREAKS: Final = 1000  # where the draws of the breaks begin


@compiled
def _drawn_step(c: Record, w: Record, earliest: int, index: int) -> int:
    """Return a control step drawn from what is left of the window in which trackers break."""
    width = max(0, c.break_until - earliest)
    return int(earliest + np.int32(np.float32(width) * uniform(w.key, 0, FAULTS, index)))


@compiled
def draw_faults(c: Record, w: Record, trackers: Records) -> None:
    """Draw the faults of an episode."""
    n = c.num_trackers
    for i in range(n):
        t = trackers[i]
        t.broken_at, t.breaks_at = NEVER, NEVER
        t.sensor_dead_from, t.radio_dead_from = NEVER, NEVER
        if uniform(w.key, 0, FAULTS, _PER_TRACKER * i) < c.sensor_outages:
            share = uniform(w.key, 0, FAULTS, _PER_TRACKER * i + 1)
            t.sensor_dead_from = np.int32(share * np.float32(c.horizon))
        if uniform(w.key, 0, FAULTS, _PER_TRACKER * i + 2) < c.radio_outages:
            share = uniform(w.key, 0, FAULTS, _PER_TRACKER * i + 3)
            t.radio_dead_from = np.int32(share * np.float32(c.horizon))
    w.breaks_left, w.break_step = c.breaks, NEVER
    if c.breaks == 0:
        return
    if c.break_nearest:
        w.break_step = _drawn_step(c, w, c.break_from, _BREAKS)
        return
    if c.break_number >= 0:
        trackers[c.break_number].breaks_at = _drawn_step(c, w, c.break_from, _BREAKS)
        return
    for k in range(c.breaks):
        chosen = np.int64(bits(w.key, 0, FAULTS, _BREAKS + 2 * k + 1) % np.uint64(n))
        while trackers[chosen].breaks_at != NEVER:
            chosen = (chosen + 1) % n
        trackers[chosen].breaks_at = _drawn_step(c, w, c.break_from, _BREAKS + 2 * k + 2)


@compiled
def break_tracker(w: Record, t: Record) -> None:
    """Break one tracker for good."""
    t.broken_at = w.step
    t.speed, t.turn_rate = np.float32(0.0), np.float32(0.0)
    w.working -= 1
    if w.lost_at < 0:
        w.lost_at = w.step
    # Whoever is left has to settle anew before the loss counts as recovered from.
    w.held = 0


@compiled
def apply_faults(c: Record, w: Record, trackers: Records) -> None:
    """Break the trackers whose time has come."""
    if w.breaks_left == 0:
        return
    if c.break_nearest:
        if w.step < w.break_step:
            return
        nearest, least = -1, np.float32(np.inf)
        for i in range(c.num_trackers):
            t = trackers[i]
            dx, dy = t.x - w.x, t.y - w.y
            d2 = dx * dx + dy * dy
            if t.broken_at == NEVER and d2 < least:
                nearest, least = i, d2
        if nearest >= 0:
            break_tracker(w, trackers[nearest])
        w.breaks_left -= 1
        # Several break one after the other, each when it is nearest.
        w.break_step = _drawn_step(c, w, w.step + 1, _BREAKS + w.breaks_left)
        return
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at == NEVER and w.step >= t.breaks_at:
            break_tracker(w, t)
            w.breaks_left -= 1
