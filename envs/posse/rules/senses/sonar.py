"""The sonar ring: how far the nearest thing is in each direction, for a tracker by itself."""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
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

_WORD: Final = 8  # blocks of eight discs, a bit each, that fill a number of 64 bits

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_TINY: Final = np.float32(1e-9)
_A_LITTLE: Final = np.float32(0.01)  # m; far more than rounding

Pose = tuple[np.float32, np.float32, np.float32, np.float32]
"""Where a robot is and how it heads, x, y, cosine, sine: of a tracker, or of the target."""
_Echo = tuple[np.float32, np.float32, np.float32, np.float32, np.float32]


@compiled
def echo(c: Record, robot: Pose, j: int, s: Record) -> _Echo:
    """Return what the sonar has of disc j.

    Where its centre lies, ahead and to the left; how far its nearest point is; how far along a
    beam's axis the centre lies at least, if that point is in the beam's width; and the square of
    its radius, or -1 where it looks narrower than a beam is wide, as it nearly always does: then no
    axis meets it but that of the beam in whose width it lies. What is out of reach is far.
    """
    at = natural(j)
    x, y, hc, hs = robot
    dx, dy, radius = s.x[at] - x, s.y[at] - y, s.radius[at]
    ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
    distance = root(ahead * ahead + left * left)
    reached = distance - radius < c.sonar_range + c.radius
    nearest = greater(distance - radius - c.radius, _ZERO)
    radius2 = radius * radius
    narrow = radius2 < (_ONE - c.beam_cosine * c.beam_cosine) * distance * distance
    return (
        ahead, left, choose(reached, nearest, FAR), c.beam_cosine * distance,
        choose(reached & (not narrow), radius2, -_ONE),
    )  # fmt: skip


@compiled
def listen(c: Record, one: _Echo, two: _Echo, three: _Echo, four: _Echo, s: Record) -> None:
    """Shorten the sonar readings by four discs."""
    wide = max(max(one[4], two[4]), max(three[4], four[4])) >= _ZERO
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
    """Return how far a disc's nearest point is, for beams in whose width that lies."""
    ahead, left, nearest, least, _ = disc
    return choose(ahead * cosine + left * sine >= least, nearest, FAR)


@compiled
def on_axis(c: Record, disc: _Echo, cosine: Lanes, sine: Lanes) -> Lanes:
    """Return where the axes of beams meet a disc; its nearest point counts for some of them."""
    ahead, left, _, least, radius2 = disc
    along, across = ahead * cosine + left * sine, left * cosine - ahead * sine
    under_root = radius2 - across * across
    axis = greater(along - root(greater(under_root, _ZERO)) - c.radius, _ZERO)
    meets = (under_root > _ZERO) & (along > _ZERO) & (along < least)
    return choose(meets, axis, FAR)


@compiled(seldom=True)
def listen_to_walls(c: Record, robot: Pose, s: Record) -> None:
    """Shorten the sonar readings by the walls of the arena."""
    half, (x, y, _, _) = c.half_arena, robot
    listen_to_wall(c, robot, _ONE, _ZERO, half - x, s)
    listen_to_wall(c, robot, -_ONE, _ZERO, half + x, s)
    listen_to_wall(c, robot, _ZERO, _ONE, half - y, s)
    listen_to_wall(c, robot, _ZERO, -_ONE, half + y, s)


@compiled
def listen_to_wall(
    c: Record,
    robot: Pose,
    normal_x: np.float32,
    normal_y: np.float32,
    distance: np.float32,
    s: Record,
) -> None:
    """Shorten the sonar readings by a wall at a distance along its outward normal."""
    if distance >= c.sonar_range + c.radius:
        return
    nearest = max(distance - c.radius, _ZERO)
    _, _, hc, hs = robot
    ahead, left = normal_x * hc + normal_y * hs, normal_y * hc - normal_x * hs
    for block in range(blocks(c.sonar_beams)):
        k = BLOCK * block
        towards = ahead * load(s.beam_cos, k) + left * load(s.beam_sin, k)
        axis = greater(distance / greater(towards, _TINY) - c.radius, _ZERO)
        found = choose(towards >= c.beam_cosine, nearest, choose(towards > _ZERO, axis, FAR))
        store(s.reading, k, lesser(load(s.reading, k), found))


@compiled
def _next(near: int, otherwise: int) -> int:
    """Return the place of the lowest bit; of no bits, another that is heard again, for nothing."""
    return lowest_bit(near) if near != 0 else otherwise


@compiled
def listen_to_discs(c: Record, robot: Pose, number: int, s: Record) -> None:
    """Shorten the sonar readings by all discs that are near."""
    x, y, _, _ = robot
    discs = blocks(num_discs(c))
    for first_block in range(0, discs, _WORD):
        near = 0  # a bit for each disc that may be, looked at without a square root
        for block in range(min(_WORD, discs - first_block)):
            j = BLOCK * (first_block + block)
            dx, dy = load(s.x, j) - x, load(s.y, j) - y
            near |= bits(dx * dx + dy * dy < load(s.heard2, j)) << (BLOCK * block)
        own = int(number) - BLOCK * first_block
        if 0 <= own < BLOCK * _WORD:
            near &= ~(1 << own)
        while near != 0:
            # Four at a time: mostly there are no more, so that the loop's end can be predicted.
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
                c, echo(c, robot, at + one, s), echo(c, robot, at + two, s),
                echo(c, robot, at + three, s), echo(c, robot, at + four, s), s,
            )  # fmt: skip


@compiled
def ping(
    c: Record,
    robot: Pose,
    number: int,
    gap: np.float32,
    s: Record,
    o: FloatArray,
    first: int,
) -> None:
    """Write the sonar ring of a robot, metres from its rim, (S,) from ``first`` on in ``o``.

    The robot is disc ``number`` of those whose places stand in ``s``
    (:func:`posse.rules.discs.lay_out`). No other is nearer than ``gap``, m between the rims.
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
