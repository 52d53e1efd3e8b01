"""The score, from the slots that are occupied.

At each control step, score = occupied slots / working trackers, at most 1. A slot is occupied when
a working tracker that touches nothing is within tolerance of it; any tracker may occupy any slot.
"""

import numpy as np

from posse.numeric import ONE, ZERO, Record, Records, compiled
from posse.rules.discs import find_slots
from posse.rules.kinematics import in_frame
from posse.rules.state import BIT, NEVER, NO_BITS


@compiled
def find_occupied(c: Record, w: Record, trackers: Records, slots: Records, s: Record) -> None:
    """Determine which tracker occupies which slot, and the distance of each from a free slot.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    taken = NO_BITS
    find_slots(c, w, slots, taken, s)
    occupied = 0
    near2 = c.tolerance * c.tolerance
    for i, t in enumerate(trackers):
        t.slot = -1
        t.slot_progress = t.slot_distance  # of the step before; the new one is subtracted below
        t.slot_distance = s.slot_distance[i]  # to the nearest slot, until all that are taken are known
        if s.slot_distance2[i] <= near2 and t.broken_at == NEVER and not t.touching:
            best = int(s.slot[i])
            bit = BIT << np.uint64(best)
            if taken & bit == NO_BITS:
                taken |= bit
                occupied += 1
                t.slot = best
    if taken != NO_BITS:
        find_slots(c, w, slots, taken, s)
    for i, t in enumerate(trackers):
        if t.slot < 0 and s.slot[i] >= ZERO:
            t.slot_distance = s.slot_distance[i]
        t.slot_progress -= t.slot_distance
    w.score = min(ONE, np.float32(occupied) / np.float32(w.working))  # at least one works
    w.held = w.held + 1 if occupied >= w.working else 0


@compiled
def could_arrive(c: Record, w: Record, t: Record, slots: Records) -> bool:
    """Return whether a tracker, straight from its start at full speed, could be in a slot."""
    reach = t.max_speed * np.float32(w.step) * c.control_step + c.tolerance
    dx, dy = t.start_x - w.x, t.start_y - w.y
    most = reach + c.slots_reach
    if dx * dx + dy * dy > most * most:
        return False
    ahead, left = in_frame(dx, dy, w.frame_cos, w.frame_sin)
    for slot in range(c.num_trackers):
        sx, sy = ahead - slots[slot].x, left - slots[slot].y
        if sx * sx + sy * sy <= reach * reach:
            return True
    return False


@compiled
def settle(c: Record, w: Record) -> None:
    """Record when the team has settled, and when it has recovered from a loss."""
    if w.held >= c.settle_steps:
        begun = w.step - w.held + 1
        if w.settled_at < 0:
            w.settled_at = begun
        if w.lost_at >= 0 and w.recovered_at < 0:
            w.recovered_at = begun
