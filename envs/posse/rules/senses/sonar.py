"""The sonar ring: distance to the nearest disc or wall in each direction."""

import numpy as np

from posse.numeric import ONE, TINY, WIDTH, ZERO, FloatArray, Record, Records, compiled
from posse.numeric.lanes import bits, choose, eight, greater, lesser, load, lowest_bit, root, store
from posse.rules.discs import FAR, blocks, num_discs, to_wall
from posse.rules.kinematics import A_LITTLE_MORE, in_frame


@compiled
def echo_of_disc(c: Record, ahead: np.float32, left: np.float32, radius: np.float32, s: Record) -> None:
    """Update the sonar readings with a disc, whose place is given in the robot's frame.

    A beam that contains the nearest point of the disc reads the distance of that point; another one, the distance at
    which its axis meets the disc. Usually the disc appears narrower than a beam, and no other axis can meet it.
    """
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


@compiled
def echo_of_walls(c: Record, robot: Record, s: Record) -> None:
    """Update the sonar readings with the walls of the arena."""
    for normal_x, normal_y in ((ONE, ZERO), (-ONE, ZERO), (ZERO, ONE), (ZERO, -ONE)):  # outward
        half = c.half_width if normal_y == ZERO else c.half_height
        distance = half - (normal_x * robot.x + normal_y * robot.y)
        if distance >= c.sonar_range + c.robot_radius:
            continue
        nearest = max(distance - c.robot_radius, ZERO)
        ahead, left = in_frame(normal_x, normal_y, robot.heading_cos, robot.heading_sin)
        for block in range(blocks(c.sonar_beams)):
            k = WIDTH * block
            towards = ahead * load(s.beam_cos, k) + left * load(s.beam_sin, k)
            axis = greater(distance / greater(towards, TINY) - c.robot_radius, ZERO)
            found = choose(towards >= c.beam_cosine, nearest, choose(towards > ZERO, axis, FAR))
            store(s.reading, k, lesser(load(s.reading, k), found))


@compiled
def ping(c: Record, robot: Record, number: int, s: Record, o: FloatArray, first: int) -> None:
    """Write the sonar ring of a tracker or the target, metres from its rim, (S,) from ``first`` on in ``o``.

    The robot is disc ``number`` in ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    x, y, cosine, sine = robot.x, robot.y, robot.heading_cos, robot.heading_sin
    for block in range(blocks(c.sonar_beams)):
        k = WIDTH * block
        store(s.reading, k, eight(c.sonar_range))
    for block in range(blocks(num_discs(c))):
        j = WIDTH * block
        dx, dy = load(s.x, j) - x, load(s.y, j) - y
        reach = (load(s.radius, j) + (c.sonar_range + c.robot_radius)) * A_LITTLE_MORE
        near = bits(dx * dx + dy * dy < reach * reach)  # without a square root
        while near != 0:
            disc = j + lowest_bit(near)
            if disc != number:
                ahead, left = in_frame(s.x[disc] - x, s.y[disc] - y, cosine, sine)
                echo_of_disc(c, ahead, left, s.radius[disc], s)
            near &= near - 1
    if to_wall(c, x, y) < c.sonar_range + c.robot_radius:
        echo_of_walls(c, robot, s)
    whole = c.sonar_beams // WIDTH  # blocks; after those, another would write beyond the sonar's part
    for block in range(whole):
        store(o, first + WIDTH * block, load(s.reading, WIDTH * block))
    for k in range(WIDTH * whole, c.sonar_beams):
        o[first + k] = s.reading[k]


@compiled
def write_sonar(c: Record, w: Record, trackers: Records, s: Record, observations: FloatArray, first: int) -> None:
    """Write the sonar rings of all agents of a world to (rows, F), from ``first`` on."""
    n = c.num_trackers
    for i in range(n):
        ping(c, trackers[i], i, s, observations[i], first)
    if c.target_is_agent:
        ping(c, w, n, s, observations[n], first)
