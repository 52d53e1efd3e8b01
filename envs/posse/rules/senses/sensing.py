"""The built-in target sensor, and fixes of the target."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.numeric import (
    ONE,
    TINY,
    WIDTH,
    ZERO,
    Lanes,
    Record,
    Records,
    bits,
    choose,
    compiled,
    eight,
    greater,
    lesser,
    load,
    root,
    store_fields,
)
from posse.rules.discs import blocks, columns, natural, store_rows
from posse.rules.randomness import SENSOR_NOISE, normal_pair
from posse.rules.senses.declaration import sensor
from posse.rules.state import FIX, NEVER, Fix

_VELOCITY_MEMORY: Final = np.float32(1.0)  # s; older fixes give no velocity


@sensor("range-bearing")
def in_sight(c: Record, w: Record, t: Record, dx: np.float32, dy: np.float32, s: Record) -> bool:
    """Range and bearing of a target in sight.

    In sight: in range and in the field of view, not occluded, while the sensor works. Returns
    whether this holds for the target at (dx, dy) from a tracker.
    """
    d2 = dx * dx + dy * dy
    if d2 > c.sensing_range * c.sensing_range:
        return False
    if w.step >= t.sensor_dead_from and w.step < t.sensor_dead_from + c.outage_steps:
        return False
    if c.all_round == 0:
        along = dx * t.heading_cos + dy * t.heading_sin
        if along < c.view_cosine * np.float32(math.sqrt(d2)):
            return False
    return not hidden(c, t, dx, dy, s)


@compiled
def hidden(c: Record, t: Record, dx: np.float32, dy: np.float32, s: Record) -> bool:
    """Return whether an obstacle occludes the point (dx, dy) from a tracker.

    In blocks of eight, since single branches would be mispredicted.
    """
    d2 = dx * dx + dy * dy
    first = natural(c.num_trackers) + 1
    for block in range(blocks(c.num_obstacles)):
        j = first + WIDTH * block
        ox, oy, radius = load(s.x, j) - t.x, load(s.y, j) - t.y, load(s.radius, j)
        along, across = ox * dx + oy * dy, ox * dy - oy * dx
        meets = (along > ZERO) & (along < d2) & (across * across < radius * radius * d2)
        if bits(meets) != 0:
            return True
    return False


@compiled
def fix_velocity(c: Record, since: Lanes, dx: Lanes, dy: Lanes, old_vx: Lanes, old_vy: Lanes) -> tuple[Lanes, Lanes]:
    """Return the target's velocity from a fix at (dx, dy) from the previous one.

    ``since`` counts the control steps between them; ``old_vx`` and ``old_vy`` are the previous
    velocity. All are numbers or lanes.
    """
    rate = ONE / (since * c.control_step)
    vx, vy, keep = dx * rate, dy * rate, lesser(ONE, c.smoothing * since)
    vx, vy = old_vx + keep * (vx - old_vx), old_vy + keep * (vy - old_vy)
    # No target is faster than a tracker (assumption ii): limit the effect of noise.
    speed2 = vx * vx + vy * vy
    too_fast = speed2 > c.fastest * c.fastest
    cut = choose(too_fast, c.fastest / root(greater(speed2, TINY)), ONE)
    return vx * cut, vy * cut


@compiled
def take_fix(c: Record, t: Record, sender: Record) -> None:
    """Take a sender's newer fix, with the velocity from this and the previous one."""
    since = np.float32(sender.fix_step - t.fix_step)
    if t.fix_step >= 0 and since * c.control_step <= _VELOCITY_MEMORY:
        dx, dy = sender.fix.x - t.fix.x, sender.fix.y - t.fix.y
        t.fix_vx, t.fix_vy = fix_velocity(c, since, dx, dy, t.fix_vx, t.fix_vy)
    else:
        t.fix_vx, t.fix_vy = ZERO, ZERO
    t.fix_step, t.fix = sender.fix_step, sender.fix


@compiled
def look(c: Record, w: Record, trackers: Records, sees: Any, measure: Any, s: Record) -> int:
    """Read the target sensors and store fixes; return the number of trackers with one.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    n = natural(c.num_trackers)
    measured = c.measured != 0
    seeing = 0
    for i in range(n):
        t = trackers[i]
        dx, dy = w.x - t.x, w.y - t.y
        t.sees = t.broken_at == NEVER and sees(c, w, t, dx, dy, s)
        seeing += t.sees
        s.fixed_at[i] = np.float32(t.fix_step)
        if measured and t.sees:
            s.seen_dx[i], s.seen_dy[i] = measure(c, w, i, dx, dy)
    if seeing == 0:
        return 0
    if w.detected_at < 0:
        w.detected_at = w.step
    if c.fix_bearing != 0:
        note_bearings(c, w, trackers, s)
        return seeing
    for block in range(blocks(n)):
        i = WIDTH * block
        own_x, own_y, before = load(s.x, i), load(s.y, i), load(s.fixed_at, i)
        dx, dy = w.x - own_x, w.y - own_y
        if measured:
            dx, dy = load(s.seen_dx, i), load(s.seen_dy, i)
        x, y = own_x + dx, own_y + dy
        old = Fix(*columns(trackers, i, n, FIX))
        since = greater(np.float32(w.step) - before, ONE)
        vx, vy = fix_velocity(c, since, x - old.fix_x, y - old.fix_y, old.fix_vx, old.fix_vy)
        fresh = (before >= ZERO) & (since * c.control_step <= _VELOCITY_MEMORY)
        new = Fix(
            fix_x=x,
            fix_y=y,
            fix_cos=eight(w.heading_cos),
            fix_sin=eight(w.heading_sin),
            fix_frame_cos=eight(w.frame_cos),
            fix_frame_sin=eight(w.frame_sin),
            fix_vx=choose(fresh, vx, ZERO),
            fix_vy=choose(fresh, vy, ZERO),
        )
        store_rows(new, s.new_fix, WIDTH * i)
    for i in range(n):
        t = trackers[i]
        if t.sees:
            t.fix_step = w.step
            store_fields(t, FIX, load(s.new_fix, WIDTH * i))
    return seeing


@compiled(out_of_line=True)
def note_bearings(c: Record, w: Record, trackers: Records, s: Record) -> None:
    """Store bearing fixes of the trackers that see the target."""
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.sees:
            dx, dy = w.x - t.x, w.y - t.y
            if c.measured != 0:
                dx, dy = s.seen_dx[i], s.seen_dy[i]
            per_metre = ONE / max(np.float32(math.sqrt(dx * dx + dy * dy)), TINY)
            t.fix_step = w.step
            t.fix.x, t.fix.y = dx * per_metre, dy * per_metre
            t.fix.cos, t.fix.sin, t.fix.frame_cos, t.fix.frame_sin = ZERO, ZERO, ZERO, ZERO


@compiled
def add_noise(c: Record, w: Record, number: int, dx: np.float32, dy: np.float32) -> tuple[np.float32, np.float32]:
    """Return the vector (dx, dy) from a tracker with the scenario's noise."""
    first, second = normal_pair(w.key, w.step, SENSOR_NOISE, number)
    scale = ONE + c.range_noise * first
    turn = c.bearing_noise * second
    cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
    return scale * (dx * cosine - dy * sine), scale * (dx * sine + dy * cosine)
