"""What a tracker senses by itself: the target, if in sight, and the sonar ring."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse.randomness import SENSOR_NOISE, normal_pair
from posse.state import NEVER
from posse.survey import (
    AHEAD,
    BEAM_COS,
    BEAM_SIN,
    BLOCK,
    DISTANCE,
    FAR,
    LEFT,
    RADIUS,
    READING,
    blocks,
    copy_block,
    lesser,
    natural,
    num_discs,
)

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_TINY: Final = np.float32(1e-9)
_VELOCITY_MEMORY: Final = np.float32(1.0)  # s; an older fix tells nothing of the velocity


@compiled
def in_sight(
    c: Record, w: Record, t: Record, obstacles: Records, dx: np.float32, dy: np.float32
) -> bool:
    """Say whether a tracker's sensor has the target, which lies (dx, dy) from it.

    In range, in the field of view, the sensor alive, and no obstacle across the line of sight.
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
    for k in range(c.num_obstacles):
        o = obstacles[k]
        ox, oy = o.x - t.x, o.y - t.y
        along = ox * dx + oy * dy
        if along > _ZERO and along < d2:
            across = ox * dy - oy * dx
            if across * across < o.radius * o.radius * d2:
                return False
    return True


@compiled
def take_fix(
    c: Record,
    t: Record,
    step: int,
    x: np.float32,
    y: np.float32,
    heading_cos: np.float32,
    heading_sin: np.float32,
    frame_cos: np.float32,
    frame_sin: np.float32,
) -> None:
    """Give a tracker a newer fix of the target, and a velocity from this and the one before."""
    steps = step - t.fix_step
    if t.fix_step >= 0 and np.float32(steps) * c.dt <= _VELOCITY_MEMORY:
        rate = _ONE / (np.float32(steps) * c.dt)
        vx, vy = (x - t.fix_x) * rate, (y - t.fix_y) * rate
        keep = min(_ONE, c.smoothing * np.float32(steps))
        vx, vy = t.fix_vx + keep * (vx - t.fix_vx), t.fix_vy + keep * (vy - t.fix_vy)
        # No target is faster than a tracker (assumption ii), so noise that says so is cut.
        speed2 = vx * vx + vy * vy
        if speed2 > c.tracker_speed * c.tracker_speed:
            cut = c.tracker_speed / np.float32(math.sqrt(speed2))
            vx, vy = vx * cut, vy * cut
        t.fix_vx, t.fix_vy = vx, vy
    else:
        t.fix_vx, t.fix_vy = _ZERO, _ZERO
    t.fix_step = step
    t.fix_x, t.fix_y = x, y
    t.fix_cos, t.fix_sin = heading_cos, heading_sin
    t.fix_frame_cos, t.fix_frame_sin = frame_cos, frame_sin


@compiled
def look(c: Record, w: Record, t: Record, obstacles: Records, number: int) -> None:
    """Let a tracker look for the target, and note the fix if it has it."""
    dx, dy = w.x - t.x, w.y - t.y
    t.sees = t.broken_at == NEVER and in_sight(c, w, t, obstacles, dx, dy)
    if not t.sees:
        return
    if w.detected_at < 0:
        w.detected_at = w.step
    if c.range_noise > _ZERO or c.bearing_noise > _ZERO:
        first, second = normal_pair(w.key, w.step, SENSOR_NOISE, number)
        scale = _ONE + c.range_noise * first
        turn = c.bearing_noise * second
        cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
        dx, dy = scale * (dx * cosine - dy * sine), scale * (dx * sine + dy * cosine)
    take_fix(
        c, t, w.step, t.x + dx, t.y + dy,
        w.heading_cos, w.heading_sin, w.frame_cos, w.frame_sin,
    )  # fmt: skip


@compiled
def listen_to_disc(
    c: Record,
    ahead: np.float32,
    left: np.float32,
    distance: np.float32,
    radius: np.float32,
    s: FloatArray,
) -> None:
    """Shorten the sonar readings by a disc whose centre lies (ahead, left) of the robot's.

    The disc's nearest point counts for the beam in whose width it lies; for any other beam, where
    its axis meets the disc. Without branches for a beam, so that several are done at once.
    """
    in_width = c.beam_cosine * distance
    nearest = max(distance - radius - c.radius, _ZERO)
    radius2, own = radius * radius, c.radius
    if radius2 < (_ONE - c.beam_cosine * c.beam_cosine) * distance * distance:
        # The disc looks narrower than a beam is wide, as it nearly always does: no axis meets it
        # but that of the beam in whose width it lies.
        for block in range(blocks(c.sonar_beams)):
            for q in range(BLOCK):
                k = BLOCK * block + q
                along = ahead * s[BEAM_COS + k] + left * s[BEAM_SIN + k]
                found = nearest if along >= in_width else FAR
                s[READING + k] = lesser(s[READING + k], found)
        return
    for block in range(blocks(c.sonar_beams)):
        for q in range(BLOCK):
            k = BLOCK * block + q
            along = ahead * s[BEAM_COS + k] + left * s[BEAM_SIN + k]
            across = left * s[BEAM_COS + k] - ahead * s[BEAM_SIN + k]
            under_root = radius2 - across * across
            axis = max(along - np.float32(math.sqrt(max(under_root, _ZERO))) - own, _ZERO)
            axis = axis if (under_root > _ZERO) & (along > _ZERO) else FAR
            found = nearest if along >= in_width else axis
            s[READING + k] = lesser(s[READING + k], found)


@compiled(seldom=True)
def listen_to_wall(
    c: Record,
    robot: Record,
    normal_x: np.float32,
    normal_y: np.float32,
    distance: np.float32,
    s: FloatArray,
) -> None:
    """Shorten the sonar readings by a wall at a distance along its outward normal."""
    if distance >= c.sonar_range + c.radius:
        return
    nearest, own, in_width = max(distance - c.radius, _ZERO), c.radius, c.beam_cosine
    ahead = normal_x * robot.heading_cos + normal_y * robot.heading_sin
    left = normal_y * robot.heading_cos - normal_x * robot.heading_sin
    for block in range(blocks(c.sonar_beams)):
        for q in range(BLOCK):
            k = BLOCK * block + q
            towards = ahead * s[BEAM_COS + k] + left * s[BEAM_SIN + k]
            axis = max(distance / max(towards, _TINY) - own, _ZERO)
            axis = axis if towards > _ZERO else FAR
            found = nearest if towards >= in_width else axis
            s[READING + k] = lesser(s[READING + k], found)


@compiled
def ping(c: Record, robot: Record, s: FloatArray, o: FloatArray, first: int) -> None:
    """Write the sonar ring of a robot, metres from its rim, (S,) from ``first`` on in ``o``.

    It stands on the :func:`~posse.survey.survey` of the discs around the robot.
    """
    nothing = c.sonar_range
    for block in range(blocks(c.sonar_beams)):
        for q in range(BLOCK):
            s[READING + BLOCK * block + q] = nothing
    reach = c.sonar_range + c.radius
    for block in range(blocks(num_discs(c))):
        heard = np.int32(0)
        for q in range(BLOCK):
            j = BLOCK * block + q
            heard += np.int32(s[DISTANCE + j] - s[RADIUS + j] < reach)
        for q in range(BLOCK if heard != 0 else 0):
            j = BLOCK * block + q
            distance = s[DISTANCE + j]
            if distance - s[RADIUS + j] < reach:
                listen_to_disc(c, s[AHEAD + j], s[LEFT + j], distance, s[RADIUS + j], s)
    if c.walled:
        half, x, y = c.half_arena, robot.x, robot.y
        listen_to_wall(c, robot, _ONE, _ZERO, half - x, s)
        listen_to_wall(c, robot, -_ONE, _ZERO, half + x, s)
        listen_to_wall(c, robot, _ZERO, _ONE, half - y, s)
        listen_to_wall(c, robot, _ZERO, -_ONE, half + y, s)
    beams = natural(c.sonar_beams)
    whole = beams // BLOCK
    for block in range(whole):
        copy_block(s, READING + BLOCK * block, o, first + BLOCK * block)
    for k in range(BLOCK * whole, beams):
        o[first + k] = s[READING + k]
