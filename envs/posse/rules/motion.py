"""Motion of the robots of one world in one control step.

Robots with nothing near move independently. The others move in physics steps, target first, then trackers by number,
with swept collision checks.
"""

import math
from typing import Any

import numpy as np

from posse.numeric import HALF, ONE, ZERO, FloatArray, Record, Records, compiled, greater, lesser
from posse.rules.contact import free_of_robots, free_of_surroundings
from posse.rules.discs import lay_out_robots
from posse.rules.kinematics import approach, arc, follow_heading
from posse.rules.randomness import DRIFT, normal_pair
from posse.rules.state import NEVER, WorldArrays
from posse.rules.targets.steering import target_turn_rate


@compiled
def move_swept(c: Record, robot: Record, number: int, obstacles: Records, s: Record) -> None:
    """Move a robot with something near by a physics step, until it is blocked.

    The positions of all robots are in scratch memory and updated there.
    """
    dx, dy, robot.heading_cos, robot.heading_sin = arc(
        robot.heading_cos, robot.heading_sin, robot.speed, robot.turn_rate, c.physics_step
    )
    x, y = robot.x, robot.y
    share = lesser(free_of_robots(c, x, y, dx, dy, s), free_of_surroundings(c, obstacles, x, y, dx, dy))
    if share < ONE:
        dx, dy = dx * share, dy * share
        robot.speed = ZERO
    robot.x += dx
    robot.y += dy
    s.x[number], s.y[number] = robot.x, robot.y


@compiled
def move_in_parts(c: Record, w: Record, trackers: Records, obstacles: Records, wanted: FloatArray, s: Record) -> None:
    """Move the robots with something near in physics steps, the target first."""
    lay_out_robots(c, w, trackers, s)
    for _ in range(c.physics_steps):
        if w.near:
            move_swept(c, w, c.num_trackers, obstacles, s)
        for i, t in enumerate(trackers):
            if t.near and t.broken_at == NEVER:
                follow_command(c, t, wanted[i])
                move_swept(c, t, i, obstacles, s)


@compiled
def follow_command(c: Record, t: Record, wanted: FloatArray) -> None:
    """Set a tracker's speed and turn rate after an action, within the limits."""
    to_speed, to_turn = HALF * (wanted[0] + ONE) * t.max_speed, wanted[1] * t.max_turn_rate
    if c.actuator_lag > ZERO:
        to_speed = t.speed + c.followed * (to_speed - t.speed)
        to_turn = t.turn_rate + c.followed * (to_turn - t.turn_rate)
    t.turn_rate = approach(t.turn_rate, to_turn, c.turn_change)
    if c.wheel_base > ZERO:
        left = greater(t.max_speed - HALF * c.wheel_base * abs(t.turn_rate), ZERO)  # rounding could give less than 0
        to_speed, slowest = lesser(to_speed, left), t.speed - c.speed_change
        if slowest > left:  # the speed cannot fall that far in a step: the turn is limited instead
            t.turn_rate *= (t.max_speed - slowest) / (t.max_speed - left)
    t.speed = approach(t.speed, to_speed, c.speed_change)


@compiled
def move_freely(robot: Record, time: np.float32) -> None:
    """Move a robot with nothing near on its arc."""
    dx, dy, robot.heading_cos, robot.heading_sin = arc(
        robot.heading_cos, robot.heading_sin, robot.speed, robot.turn_rate, time
    )
    robot.x += dx
    robot.y += dy


@compiled
def motion(c: Record, worlds: WorldArrays, e: int, actions: FloatArray, set_goal: Any, s: Record) -> None:
    """Move the robots of world e by actions (rows, 2 + m) for one control step; -1 is V = 0, 0 is ω = 0.

    Actions of trackers wait in ``worlds.command`` for the delay.

    A robot with nothing near moves on one arc, or on one per physics step if its motion changes in the control step or
    it turns by more than 1 rad; a robot with something near moves in swept physics steps.
    """
    w, trackers, obstacles = worlds.world[e], worlds.tracker[e], worlds.obstacle[e]
    wanted = actions
    if c.command_delay > 0:
        wanted = worlds.command[e, w.step % c.command_delay]  # in whose place the actions wait, below
    if c.target_is_agent:
        action = actions[c.num_trackers]
        w.speed = HALF * (action[0] + ONE) * c.target_speed
        w.turn_rate = action[1] * c.target_turn_rate
    else:
        w.turn_rate = target_turn_rate(c, w, trackers, obstacles, set_goal, s)
        w.speed = c.target_speed
    parts, time = 1, c.control_step
    if not c.whole_arcs:
        parts, time = int(c.physics_steps), c.physics_step
    near = bool(w.near)
    for _ in range(0 if near else parts):
        move_freely(w, time)
    for i, t in enumerate(trackers):
        if t.near:
            near = True
        elif t.broken_at == NEVER:
            for _ in range(parts):
                follow_command(c, t, wanted[i])
                move_freely(t, time)
    if near:
        move_in_parts(c, w, trackers, obstacles, wanted, s)
    for i in range(c.num_trackers if c.command_delay > 0 else 0):
        wanted[i, 0], wanted[i, 1] = actions[i, 0], actions[i, 1]
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
