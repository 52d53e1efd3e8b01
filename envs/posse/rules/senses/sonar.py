"""The sonar ring: distance to the nearest disc or wall in each direction."""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    ONE,
    TINY,
    WIDTH,
    ZERO,
    FloatArray,
    Record,
    bits,
    choose,
    compiled,
    eight,
    greater,
    lesser,
    load,
    lowest_bit,
    out_of_line,
    root,
    store,
)
from posse.rules.discs import FAR, blocks, nonnegative, num_discs, to_wall

_A_LITTLE_MORE: Final = np.float32(1.0001)  # far more than rounding

Place = tuple[np.float32, np.float32, np.float32, np.float32]
"""x, y, cosine and sine of the heading, of a tracker or the target."""


@compiled
def echo_of_disc(c: Record, robot: Place, j: int, s: Record) -> None:
    """Update the sonar readings with disc j.

    A beam that contains the nearest point of the disc reads the distance of that point; another one, the distance at
    which its axis meets the disc. Usually the disc appears narrower than a beam, and no other axis can meet it.
    """
    x, y, hc, hs = robot
    dx, dy, radius = s.x[j] - x, s.y[j] - y, s.radius[j]
    ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
    distance = root(ahead * ahead + left * left)
    if distance - radius >= c.sonar_range + c.robot_radius:
        return
    nearest, least = greater(distance - radius - c.robot_radius, ZERO), c.beam_cosine * distance
    radius2 = radius * radius
    wide = radius2 >= (ONE - c.beam_cosine * c.beam_cosine) * distance * distance
    for block in range(blocks(c.sonar_beams)):
        k = WIDTH * block
        cosine, sine, reading = load(s.beam_cos, k), load(s.beam_sin, k), load(s.reading, k)
        along = ahead * cosine + left * sine
        reading = lesser(reading, choose(along >= least, nearest, FAR))
        if wide:
            across = left * cosine - ahead * sine
            under_root = radius2 - across * across
            axis = greater(along - root(greater(under_root, ZERO)) - c.robot_radius, ZERO)
            meets = (under_root > ZERO) & (along > ZERO) & (along < least)
            reading = lesser(reading, choose(meets, axis, FAR))
        store(s.reading, k, reading)


@out_of_line
def echo_of_walls(c: Record, robot: Place, s: Record) -> None:
    """Update the sonar readings with the walls of the arena."""
    x, y, hc, hs = robot
    for normal_x, normal_y in ((ONE, ZERO), (-ONE, ZERO), (ZERO, ONE), (ZERO, -ONE)):  # outward
        half = c.half_width if normal_y == ZERO else c.half_height
        distance = half - (normal_x * x + normal_y * y)
        if distance >= c.sonar_range + c.robot_radius:
            continue
        nearest = max(distance - c.robot_radius, ZERO)
        ahead, left = normal_x * hc + normal_y * hs, normal_y * hc - normal_x * hs
        for block in range(blocks(c.sonar_beams)):
            k = WIDTH * block
            towards = ahead * load(s.beam_cos, k) + left * load(s.beam_sin, k)
            axis = greater(distance / greater(towards, TINY) - c.robot_radius, ZERO)
            found = choose(towards >= c.beam_cosine, nearest, choose(towards > ZERO, axis, FAR))
            store(s.reading, k, lesser(load(s.reading, k), found))


@compiled
def ping(c: Record, robot: Place, number: int, s: Record, o: FloatArray, first: int) -> None:
    """Write the sonar ring of a robot, metres from its rim, (S,) from ``first`` on in ``o``.

    The robot is disc ``number`` in ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    x, y, _, _ = robot
    for block in range(blocks(c.sonar_beams)):
        store(s.reading, WIDTH * block, eight(c.sonar_range))
    for block in range(blocks(num_discs(c))):
        j = WIDTH * block
        dx, dy = load(s.x, j) - x, load(s.y, j) - y
        reach = (load(s.radius, j) + (c.sonar_range + c.robot_radius)) * _A_LITTLE_MORE
        near = bits(dx * dx + dy * dy < reach * reach)  # without a square root
        while near != 0:
            disc = nonnegative(j + lowest_bit(near))
            if disc != number:
                echo_of_disc(c, robot, disc, s)
            near &= near - 1
    if to_wall(c, x, y) < c.sonar_range + c.robot_radius:
        echo_of_walls(c, robot, s)
    for k in range(nonnegative(c.sonar_beams)):
        o[nonnegative(first + k)] = s.reading[k]
