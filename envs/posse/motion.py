"""How actions become motion, for one world and one control step.

Robots that nothing can touch within the step move on one arc each, eight of them at a time. The
others move by physics steps, target first, then trackers by number, each move swept.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse.contact import free_of_robot, free_of_surroundings
from posse.formation import follow_heading
from posse.kinematics import approach, arc
from posse.lanes import Lanes, load, store_fields
from posse.state import NEVER, POSE
from posse.survey import BLOCK, OWN, ROW, blocks, columns, natural, store_rows
from posse.target_motion import AGENT, target_turn_rate

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)

# Rows of scratch memory, of each tracker: what its action asks for, and, eight numbers each, where
# it is after its move. What the target weighs up (posse.target_motion) lies before them.
_WANTED_SPEED: Final = OWN + 1 * ROW
_WANTED_TURN: Final = OWN + 2 * ROW
_NEW_POSE: Final = OWN + 3 * ROW
_NEAR: Final = OWN + 7 * ROW  # the numbers of those that something is near to


@compiled
def move(robot: Record, time: np.float32) -> None:
    """Move a robot that nothing is near to on its arc."""
    dx, dy, robot.heading_cos, robot.heading_sin = arc(
        robot.heading_cos, robot.heading_sin, robot.speed, robot.turn_rate, time
    )
    robot.x += dx
    robot.y += dy


@compiled
def move_swept(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    robot: Record,
    number: int,
    near: int,
    s: FloatArray,
) -> None:
    """Move a tracker (number -1: the target) by a physics step, as far as nothing blocks.

    ``near`` trackers, whose numbers stand in scratch memory, are those that may be in the way.
    """
    dx, dy, robot.heading_cos, robot.heading_sin = arc(
        robot.heading_cos, robot.heading_sin, robot.speed, robot.turn_rate, c.physics_dt
    )
    if robot.near:
        x, y, share = robot.x, robot.y, _ONE
        for k in range(near):
            j = natural(int(s[_NEAR + k]))
            if j != number:
                share = min(share, free_of_robot(c, trackers[j], x, y, dx, dy))
        if number >= 0:
            share = min(share, free_of_robot(c, w, x, y, dx, dy))
        share = min(share, free_of_surroundings(c, obstacles, x, y, dx, dy))
        if share < _ONE:
            dx, dy = dx * share, dy * share
            robot.speed = _ZERO
    robot.x += dx
    robot.y += dy


@compiled(seldom=True)
def move_in_parts(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    actions: FloatArray,
    s: FloatArray,
) -> None:
    """Move those that something is near to, by physics steps, the target first.

    Whom nothing is near to is in nobody's way.
    """
    near = 0
    for j in range(natural(c.num_trackers)):
        s[_NEAR + near] = np.float32(j)
        near = natural(near + (trackers[j].near != 0))
    target_in_parts = w.near != 0 or c.whole_arcs == 0
    for _ in range(c.physics_steps):
        if target_in_parts:
            move_swept(c, w, trackers, obstacles, w, -1, near, s)
        for i in range(c.num_trackers):
            t = trackers[i]
            if t.broken_at == NEVER and (t.near != 0 or c.whole_arcs == 0):
                t.speed, t.turn_rate = command(
                    c, t.speed, t.turn_rate, actions[i, 0], actions[i, 1]
                )
                move_swept(c, w, trackers, obstacles, t, i, near, s)


@compiled
def command(
    c: Record, speed: Lanes, turn_rate: Lanes, wanted_speed: Lanes, wanted_turn: Lanes
) -> tuple[Lanes, Lanes]:
    """Return speed and turn rate, brought towards what an action asks for within the limits."""
    return (
        approach(speed, _HALF * (wanted_speed + _ONE) * c.tracker_speed, c.speed_change),
        approach(turn_rate, wanted_turn * c.tracker_turn_rate, c.turn_change),
    )


@compiled
def lay_out_actions(c: Record, actions: FloatArray, s: FloatArray) -> None:
    """Write which speeds and turn rates actions (rows, 2 + m) ask for to rows of scratch memory."""
    for i in range(natural(c.num_trackers)):
        s[_WANTED_SPEED + i], s[_WANTED_TURN + i] = actions[i, 0], actions[i, 1]


@compiled
def move_freely(c: Record, trackers: Records, s: FloatArray) -> bool:
    """Move the trackers that nothing is near to on their arcs; say whether there are others."""
    n = natural(c.num_trackers)
    for block in range(blocks(n)):
        i = BLOCK * block
        x, y, cosine, sine, speed, turn_rate, next_1, next_2 = columns(trackers, i, n, POSE)
        speed, turn_rate = command(
            c, speed, turn_rate, load(s, _WANTED_SPEED + i), load(s, _WANTED_TURN + i)
        )
        dx, dy, cosine, sine = arc(cosine, sine, speed, turn_rate, c.dt)
        store_rows(
            x + dx, y + dy, cosine, sine, speed, turn_rate, next_1, next_2,
            _NEW_POSE + BLOCK * i, BLOCK, s,
        )  # fmt: skip
    others = False
    for i in range(n):
        t = trackers[i]
        if t.broken_at == NEVER:
            if t.near == 0:
                store_fields(t, POSE, load(s, _NEW_POSE + BLOCK * i))
            else:
                others = True
    return others


@compiled
def command_target(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    actions: FloatArray,
    scratch: FloatArray,
) -> None:
    """Set the target's speed and turn rate for the control step."""
    w.speed = c.target_speed
    if c.motion == AGENT:
        action = actions[c.num_trackers]
        w.speed = _HALF * (action[0] + _ONE) * c.target_speed
        w.turn_rate = action[1] * c.target_turn_rate
    else:
        w.turn_rate = target_turn_rate(c, w, trackers, obstacles, scratch)


@compiled
def motion(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    actions: FloatArray,
    scratch: FloatArray,
) -> None:
    """Turn actions (rows, 2 + m) into motion for one control step; -1 is V = 0, 0 is ω = 0.

    A robot that nothing can touch within the step moves on one arc; one that something is near to
    moves by physics steps, each of them swept.
    """
    lay_out_actions(c, actions, scratch)
    command_target(c, w, trackers, obstacles, actions, scratch)
    in_parts = True
    if c.whole_arcs:
        if w.near == 0:
            move(w, c.dt)
        in_parts = move_freely(c, trackers, scratch) or w.near != 0
    if in_parts:
        move_in_parts(c, w, trackers, obstacles, actions, scratch)
    w.frame_cos, w.frame_sin = follow_heading(
        w.frame_cos, w.frame_sin, w.heading_cos, w.heading_sin, c.frame_c, c.frame_s
    )
