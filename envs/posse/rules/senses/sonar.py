"""The sonar ring: distance to the nearest disc or wall in each direction."""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    ONE,
    TINY,
    ZERO,
    FloatArray,
    Lanes,
    Record,
    bits,
    choose,
    compiled,
    eight,
    greater,
    lesser,
    load,
    lowest_bit,
    root,
    store,
)
from posse.rules.discs import BLOCK, FAR, blocks, natural, num_discs

_WORD: Final = 8  # blocks of eight discs in a bit set of 64

_A_LITTLE: Final = np.float32(0.01)  # m; far more than rounding

Pose = tuple[np.float32, np.float32, np.float32, np.float32]
"""x, y, cosine and sine of the heading, of a tracker or the target."""
_Echo = tuple[np.float32, np.float32, np.float32, np.float32, np.float32]


@compiled
def echo(c: Record, robot: Pose, j: int, s: Record) -> _Echo:
    """Return the echo of disc j.

    The position of its centre, ahead and to the left; the distance of its nearest point; the least
    distance of the centre along a beam's axis for which that point is within the beam; and the
    squared radius, or -1 if the disc appears narrower than a beam (the usual case), so that only
    the axis of the beam that contains it can meet it. Distances out of range are ``FAR``.
    """
    at = natural(j)
    x, y, hc, hs = robot
    dx, dy, radius = s.x[at] - x, s.y[at] - y, s.radius[at]
    ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
    distance = root(ahead * ahead + left * left)
    reached = distance - radius < c.sonar_range + c.radius
    nearest = greater(distance - radius - c.radius, ZERO)
    radius2 = radius * radius
    narrow = radius2 < (ONE - c.beam_cosine * c.beam_cosine) * distance * distance
    return (
        ahead,
        left,
        choose(reached, nearest, FAR),
        c.beam_cosine * distance,
        choose(reached & (not narrow), radius2, -ONE),
    )


@compiled
def listen(c: Record, one: _Echo, two: _Echo, three: _Echo, four: _Echo, s: Record) -> None:
    """Update the sonar readings with four discs."""
    wide = max(max(one[4], two[4]), max(three[4], four[4])) >= ZERO
    for block in range(blocks(c.sonar_beams)):
        k = BLOCK * block
        cosine, sine = load(s.beam_cos, k), load(s.beam_sin, k)
        reading = load(s.reading, k)
        reading = lesser(reading, in_width(one, cosine, sine))
        reading = lesser(reading, in_width(two, cosine, sine))
        reading = lesser(reading, in_width(three, cosine, sine))
        reading = lesser(reading, in_width(four, cosine, sine))
        if wide:
            reading = lesser(reading, on_axis(c, one, cosine, sine))
            reading = lesser(reading, on_axis(c, two, cosine, sine))
            reading = lesser(reading, on_axis(c, three, cosine, sine))
            reading = lesser(reading, on_axis(c, four, cosine, sine))
        store(s.reading, k, reading)


@compiled
def in_width(disc: _Echo, cosine: Lanes, sine: Lanes) -> Lanes:
    """Return the distance of a disc's nearest point for the beams that contain it."""
    ahead, left, nearest, least, _ = disc
    return choose(ahead * cosine + left * sine >= least, nearest, FAR)


@compiled
def on_axis(c: Record, disc: _Echo, cosine: Lanes, sine: Lanes) -> Lanes:
    """Return the distance at which the axes of beams meet a disc, unless its nearest point does."""
    ahead, left, _, least, radius2 = disc
    along, across = ahead * cosine + left * sine, left * cosine - ahead * sine
    under_root = radius2 - across * across
    axis = greater(along - root(greater(under_root, ZERO)) - c.radius, ZERO)
    meets = (under_root > ZERO) & (along > ZERO) & (along < least)
    return choose(meets, axis, FAR)


@compiled(seldom=True)
def listen_to_walls(c: Record, robot: Pose, s: Record) -> None:
    """Update the sonar readings with the walls of the arena."""
    half, (x, y, _, _) = c.half_arena, robot
    listen_to_wall(c, robot, ONE, ZERO, half - x, s)
    listen_to_wall(c, robot, -ONE, ZERO, half + x, s)
    listen_to_wall(c, robot, ZERO, ONE, half - y, s)
    listen_to_wall(c, robot, ZERO, -ONE, half + y, s)


@compiled
def listen_to_wall(
    c: Record, robot: Pose, normal_x: np.float32, normal_y: np.float32, distance: np.float32, s: Record
) -> None:
    """Update the sonar readings with a wall at a distance along its outward normal."""
    if distance >= c.sonar_range + c.radius:
        return
    nearest = max(distance - c.radius, ZERO)
    _, _, hc, hs = robot
    ahead, left = normal_x * hc + normal_y * hs, normal_y * hc - normal_x * hs
    for block in range(blocks(c.sonar_beams)):
        k = BLOCK * block
        towards = ahead * load(s.beam_cos, k) + left * load(s.beam_sin, k)
        axis = greater(distance / greater(towards, TINY) - c.radius, ZERO)
        found = choose(towards >= c.beam_cosine, nearest, choose(towards > ZERO, axis, FAR))
        store(s.reading, k, lesser(load(s.reading, k), found))


@compiled
def _next(near: int, otherwise: int) -> int:
    """Return the index of the lowest bit, or ``otherwise`` if there is none."""
    return lowest_bit(near) if near != 0 else otherwise


@compiled
def listen_to_discs(c: Record, robot: Pose, number: int, s: Record) -> None:
    """Update the sonar readings with all discs in range."""
    x, y, _, _ = robot
    discs = blocks(num_discs(c))
    for first_block in range(0, discs, _WORD):
        near = 0  # candidate discs as bits, found without a square root
        for block in range(min(_WORD, discs - first_block)):
            j = BLOCK * (first_block + block)
            dx, dy = load(s.x, j) - x, load(s.y, j) - y
            near |= bits(dx * dx + dy * dy < load(s.heard2, j)) << (BLOCK * block)
        own = int(number) - BLOCK * first_block
        if 0 <= own < BLOCK * _WORD:
            near &= ~(1 << own)
        while near != 0:
            # Four at a time: usually enough, so that the end of the loop is predictable.
            at = natural(BLOCK * first_block)
            one = lowest_bit(near)
            near &= near - 1
            two = _next(near, one)
            near &= near - 1
            three = _next(near, one)
            near &= near - 1
            four = _next(near, one)
            near &= near - 1
            listen(
                c,
                echo(c, robot, at + one, s),
                echo(c, robot, at + two, s),
                echo(c, robot, at + three, s),
                echo(c, robot, at + four, s),
                s,
            )


@compiled
def ping(c: Record, robot: Pose, number: int, gap: np.float32, s: Record, o: FloatArray, first: int) -> None:
    """Write the sonar ring of a robot, metres from its rim, (S,) from ``first`` on in ``o``.

    The robot is disc ``number`` in ``s`` (:func:`posse.rules.discs.lay_out`); the gap to
    the nearest other disc is at least ``gap``, m.
    """
    for block in range(blocks(c.sonar_beams)):
        store(s.reading, BLOCK * block, eight(c.sonar_range))
    if gap < c.sonar_range + _A_LITTLE:
        listen_to_discs(c, robot, number, s)
    x, y, _, _ = robot
    if c.walled and c.half_arena - max(abs(x), abs(y)) < c.sonar_range + c.radius:
        listen_to_walls(c, robot, s)
    beams = natural(c.sonar_beams)
    whole = beams // BLOCK
    for block in range(whole):
        store(o, first + BLOCK * block, load(s.reading, BLOCK * block))
    for k in range(BLOCK * whole, beams):
        o[first + k] = s.reading[k]
