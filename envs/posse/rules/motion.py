"""Motion of the robots of one world in one control step.

Robots with nothing near move independently, eight trackers at a time. The others move in physics
steps, target first, then trackers by number, with swept collision checks.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from posse.numeric import HALF, ONE, WIDTH, ZERO, FloatArray, Lanes, Record, Records, compiled
from posse.numeric.lanes import eight, greater, lesser, load, store, store_fields
from posse.rules.contact import free_of_robots, free_of_surroundings
from posse.rules.discs import FAR, blocks, columns, write_block
from posse.rules.kinematics import approach, arc, follow_heading
from posse.rules.randomness import DRIFT, normal_pair
from posse.rules.state import NEVER, POSE, Pose, WorldArrays
from posse.rules.targets.steering import target_turn_rate


@compiled
def move_swept(c: Record, robot: Record, place: int, count: int, obstacles: Records, s: Record) -> None:
    """Move a robot with something near by a physics step, until it is blocked.

    The positions of the ``count`` robots that may block it, itself at ``place``, are in scratch
    memory and updated there.
    """
    dx, dy, robot.heading_cos, robot.heading_sin = arc(
        robot.heading_cos, robot.heading_sin, robot.speed, robot.turn_rate, c.physics_step
    )
    x, y = robot.x, robot.y
    share = lesser(free_of_robots(c, x, y, dx, dy, s, count), free_of_surroundings(c, obstacles, x, y, dx, dy))
    if share < ONE:
        dx, dy = dx * share, dy * share
        robot.speed = ZERO
    robot.x += dx
    robot.y += dy
    s.near_x[place], s.near_y[place] = robot.x, robot.y


@compiled
def move_in_parts(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Move the robots with something near in physics steps, the target first.

    The other robots cannot block them.
    """
    near = 0
    for i, t in enumerate(trackers):
        s.near[near], s.near_x[near], s.near_y[near] = np.float32(i), t.x, t.y
        near += t.near != 0
    s.near_x[near], s.near_y[near] = w.x, w.y
    store(s.near_x, near + 1, eight(FAR))
    store(s.near_y, near + 1, eight(FAR))
    for _ in range(c.physics_steps):
        if w.near != 0:
            move_swept(c, w, near, near + 1, obstacles, s)
        for k in range(near):
            i = int(s.near[k])
            t = trackers[i]
            if t.broken_at == NEVER:
                t.speed, t.turn_rate = command(
                    c, t.speed, t.turn_rate, t.max_speed, t.max_turn_rate, s.wanted_speed[i], s.wanted_turn[i]
                )
                move_swept(c, t, k, near + 1, obstacles, s)


@compiled
def command(
    c: Record,
    speed: Lanes,
    turn_rate: Lanes,
    max_speed: Lanes,
    max_turn_rate: Lanes,
    wanted_speed: Lanes,
    wanted_turn: Lanes,
) -> tuple[Lanes, Lanes]:
    """Return speed and turn rate after an action, within the limits."""
    to_speed, to_turn = HALF * (wanted_speed + ONE) * max_speed, wanted_turn * max_turn_rate
    if c.actuator_lag > ZERO:
        to_speed, to_turn = speed + c.followed * (to_speed - speed), turn_rate + c.followed * (to_turn - turn_rate)
    speed, turn_rate = approach(speed, to_speed, c.speed_change), approach(turn_rate, to_turn, c.turn_change)
    if c.wheel_base > ZERO:
        left = max_speed - HALF * c.wheel_base * greater(turn_rate, -turn_rate)
        speed = lesser(speed, greater(left, ZERO))  # on the spot, rounding may leave less than nothing
    return speed, turn_rate


@compiled
def take_commands(c: Record, w: Record, actions: FloatArray, command: FloatArray, s: Record) -> None:
    """Write the motions to execute now: those of the actions, or the ones of ``command_delay`` steps ago."""
    for i in range(c.num_trackers):
        s.wanted_speed[i], s.wanted_turn[i] = actions[i, 0], actions[i, 1]
    if c.command_delay > 0:
        kept = command[w.step % c.command_delay]
        for i in range(c.num_trackers):
            s.wanted_speed[i], s.wanted_turn[i] = kept[i, 0], kept[i, 1]
            kept[i, 0], kept[i, 1] = actions[i, 0], actions[i, 1]


@compiled
def move_freely(c: Record, trackers: Records, parts: int, time: np.float32, s: Record) -> bool:
    """Move the trackers with nothing near on their arcs; return whether there are others."""
    n = c.num_trackers
    for block in range(blocks(n)):
        i = WIDTH * block
        pose = Pose(*columns(trackers, i, n, POSE))
        x, y, cosine, sine = pose.x, pose.y, pose.heading_cos, pose.heading_sin
        speed, turn_rate = pose.speed, pose.turn_rate
        for _ in range(parts):
            speed, turn_rate = command(
                c, speed, turn_rate, pose.max_speed, pose.max_turn_rate, load(s.wanted_speed, i), load(s.wanted_turn, i)
            )
            dx, dy, cosine, sine = arc(cosine, sine, speed, turn_rate, time)
            x, y = x + dx, y + dy
        moved = x, y, cosine, sine, speed, turn_rate, pose.max_speed, pose.max_turn_rate
        write_block(moved, 0, s.new_pose[i:])
    others = False
    for i, t in enumerate(trackers):
        if t.broken_at == NEVER:
            if t.near == 0:
                store_fields(t, POSE, load(s.new_pose[i], 0))
            else:
                others = True
    return others


@compiled
def motion(c: Record, worlds: WorldArrays, e: int, actions: FloatArray, set_goal: Any, s: Record) -> None:
    """Move the robots of world e by actions (rows, 2 + m) for one control step; -1 is V = 0, 0 is ω = 0.

    Actions of trackers wait in ``worlds.command`` for the delay.

    A robot with nothing near moves on one arc, or with limited acceleration on one per physics
    step; a robot with something near moves in swept physics steps.
    """
    w, trackers, obstacles = worlds.world[e], worlds.tracker[e], worlds.obstacle[e]
    # Well before move_freely loads blocks of it: a load that covers several stores has to wait for them.
    take_commands(c, w, actions, worlds.command[e], s)
    if c.target_agent != 0:
        action = actions[c.num_trackers]
        w.speed = HALF * (action[0] + ONE) * c.target_speed
        w.turn_rate = action[1] * c.target_turn_rate
    else:
        w.turn_rate = target_turn_rate(c, w, trackers, obstacles, set_goal, s)
        w.speed = c.target_speed
    parts, time = 1, c.control_step
    if c.whole_arcs == 0:
        parts, time = int(c.physics_steps), c.physics_step
    if w.near == 0:
        for _ in range(parts):
            dx, dy, w.heading_cos, w.heading_sin = arc(w.heading_cos, w.heading_sin, w.speed, w.turn_rate, time)
            w.x += dx
            w.y += dy
    if move_freely(c, trackers, parts, time, s) or w.near != 0:
        move_in_parts(c, w, trackers, obstacles, s)
    w.frame_cos, w.frame_sin = follow_heading(
        w.frame_cos, w.frame_sin, w.heading_cos, w.heading_sin, c.frame_c, c.frame_s
    )


@compiled
def drift(c: Record, w: Record, odometry: Records) -> None:
    """Let each tracker's own pose, as it knows it, take a step of its random walk."""
    for i, o in enumerate(odometry):
        along, across = normal_pair(w.key, w.step, DRIFT, 2 * i)
        about, _ = normal_pair(w.key, w.step, DRIFT, 2 * i + 1)
        o.x += c.position_step * along
        o.y += c.position_step * across
        o.heading += c.heading_step * about
        o.cos, o.sin = np.float32(math.cos(o.heading)), np.float32(math.sin(o.heading))
