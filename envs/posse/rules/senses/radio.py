"""The radio: broadcasts of the trackers in every control step, and their reception.

Each working tracker broadcasts its pose, speed, turn rate, its best fix of the target with the
fix's time, and the policy's message. Range, delay and loss apply to the whole broadcast.
"""

import numpy as np

from posse.numeric import ZERO, FloatArray, Record, Records, compiled
from posse.rules.kinematics import turned
from posse.rules.randomness import RADIO_LOSS, uniform
from posse.rules.senses.sensing import take_fix
from posse.rules.state import BIT, NEVER, NO_BITS, WorldArrays


@compiled
def radio_works(c: Record, w: Record, t: Record) -> bool:
    """Return whether a tracker can send and receive now."""
    if t.broken_at != NEVER:
        return False
    return bool(w.step < t.radio_dead_from or w.step >= t.radio_dead_from + c.outage_steps)


@compiled
def share_fixes(c: Record, trackers: Records) -> None:
    """Perfect radio without faults: every tracker takes the newest fix."""
    if c.fix_bearing:
        return
    best = trackers[0]
    for t in trackers:
        if t.fix_step > best.fix_step:
            best = t
    for t in trackers:
        if t.fix_step < best.fix_step:
            take_fix(c, t, best)


@compiled
def keep_messages(c: Record, w: Record, trackers: Records, actions: FloatArray, message: FloatArray) -> None:
    """Store the messages in the actions (rows, 2 + m) of working trackers, to be heard after the delay."""
    slot = w.step % (c.radio_delay + 1)
    for i in range(c.num_trackers):
        works = trackers[i].broken_at == NEVER
        for k in range(c.message_size):
            message[slot, i, k] = actions[i, 2 + k] if works else ZERO


@compiled
def send(c: Record, worlds: WorldArrays, e: int) -> None:
    """Write the broadcasts of all trackers of world e to its ring buffer (D + 1, N)."""
    w = worlds.world[e]
    slot = w.step % (c.radio_delay + 1)
    for i, t in enumerate(worlds.tracker[e]):
        b = worlds.broadcast[e, slot, i]
        b.sent = radio_works(c, w, t)
        b.x, b.y, b.heading_cos, b.heading_sin = t.x, t.y, t.heading_cos, t.heading_sin
        b.speed, b.turn_rate = t.speed, t.turn_rate
        b.fix_step, b.fix = t.fix_step, t.fix
        if c.drifts:
            b.odometry = worlds.odometry[e, i]


@compiled
def hear(c: Record, worlds: WorldArrays, e: int) -> None:
    """Deliver the broadcasts sent ``radio_delay`` steps ago to the trackers of world e in range."""
    w, heard, broadcast = worlds.world[e], worlds.heard[e], worlds.broadcast[e]
    sent_at = w.step - c.radio_delay
    if sent_at < 0:
        return
    slot = sent_at % (c.radio_delay + 1)
    reach2 = c.radio_range * c.radio_range
    n = c.num_trackers
    for i, t in enumerate(worlds.tracker[e]):
        if not radio_works(c, w, t):
            continue
        for j in range(n):
            b = broadcast[slot, j]
            if j == i or not b.sent:
                continue
            dx, dy = b.x - t.x, b.y - t.y
            if dx * dx + dy * dy > reach2:
                continue
            lossy = c.radio_loss > ZERO
            if lossy and uniform(w.key, w.step, RADIO_LOSS, i * n + j) < c.radio_loss:
                continue
            h = heard[i, j]
            h.step = sent_at
            h.x, h.y, h.heading_cos, h.heading_sin = b.x, b.y, b.heading_cos, b.heading_sin
            if c.drifts:
                h.x, h.y = b.x + b.odometry.x, b.y + b.odometry.y
                h.heading_cos, h.heading_sin = turned(b.heading_cos, b.heading_sin, b.odometry.cos, b.odometry.sin)
            h.speed, h.turn_rate = b.speed, b.turn_rate
            for k in range(c.message_size):
                worlds.heard_message[e, i, j, k] = worlds.message[e, slot, j, k]
            if b.fix_step > t.fix_step and not c.fix_bearing:
                take_fix(c, t, b)


@compiled
def connected(c: Record, w: Record, trackers: Records) -> bool:
    """Return whether the radio graph of the working trackers is connected.

    Not for a perfect radio, where it always is.
    """
    working = NO_BITS
    for i in range(c.num_trackers):
        if trackers[i].broken_at == NEVER:
            working |= BIT << np.uint64(i)
    reached, before = working & (~working + BIT), NO_BITS  # at first the lowest number
    while reached != before:
        before = reached
        for i, t in enumerate(trackers):
            if reached & (BIT << np.uint64(i)) == NO_BITS or not radio_works(c, w, t):
                continue
            for j in range(c.num_trackers):
                dx, dy = trackers[j].x - t.x, trackers[j].y - t.y
                if dx * dx + dy * dy <= c.radio_range * c.radio_range and radio_works(c, w, trackers[j]):
                    reached |= BIT << np.uint64(j)
    return bool(reached == working)
