"""How eight worlds' robots are observed: views, which are the inputs of fields, and rows, to which fields are written.

A view describes the same robot of eight worlds, one per lane; with fewer worlds the last one is repeated. The generated
functions (:mod:`posse.signals.generate`) compute its fields. Each gives a *column* of eight numbers, one for each
world; eight columns are transposed and written to the worlds' rows.

Team-mates follow, nearest first. With a perfect radio, and for a target agent, they are as they are now, otherwise as
last heard.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from posse.numeric import ONE, ZERO, FloatArray, Lanes, Mask, Record, choose, compiled
from posse.numeric.lanes import bits, eight, from_int, greater, lesser, load, load_fields, root, store, transpose
from posse.rules.discs import FAR, columns
from posse.rules.kinematics import in_frame, turned
from posse.rules.state import (
    CONDITION_AT,
    FIX_AT,
    NEVER,
    POSE_AT,
    TARGET_POSE_AT,
    Condition,
    Fix,
    Heard,
    Odometry,
    Pose,
    TargetPose,
    WorldArrays,
)


@compiled
def write_block(block: tuple[Lanes, ...], first: int, rows: FloatArray) -> None:
    """Write eight columns, the first of them column ``first``, to at most eight rows: of fewer, the last repeatedly."""
    a, b, c, d, e, f, g, h = transpose(block)
    last = len(rows) - 1
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    store(rows[0], first, a)
    store(rows[min(1, last)], first, b)
    store(rows[min(2, last)], first, c)
    store(rows[min(3, last)], first, d)
    store(rows[min(4, last)], first, e)
    store(rows[min(5, last)], first, f)
    store(rows[min(6, last)], first, g)
    store(rows[min(7, last)], first, h)


class Observers(NamedTuple):
    """Robot i of the worlds ``first`` to ``end``, at most eight."""

    first: int
    end: int
    i: int
    now: bool  # whether they know their team-mates as they are now, not as last heard


class View(NamedTuple):
    """Eight observers, and their knowledge of the target.

    Positions and directions are in the common frame.
    """

    number: Lanes  # of the tracker; -1: the target
    own: Pose  # as it knows it: fields of posse.rules.state.Pose
    touching: Lanes  # 1 while it touches anything, else 0
    working: Lanes  # 0 once it is broken, else 1
    step: Lanes  # control steps since the start
    target_known: Mask  # whether it has a fix of the target, described by the following
    target_seen: Lanes  # 1 while its own sensor sees the target, else 0
    target_step: Lanes  # control step of the fix
    target_dx: Lanes  # vector to the target at the fix, m; for a bearing: a unit vector
    target_dy: Lanes
    target_distance: Lanes  # m
    fix: Fix  # of the target, common frame: fields of posse.rules.state.Fix


@compiled
def ego(v: View, x: Lanes, y: Lanes) -> tuple[Lanes, Lanes]:
    """Return a vector of the common frame in the robot's frame: ahead, and to the left."""
    return in_frame(x, y, v.own.heading_cos, v.own.heading_sin)


class Mate(NamedTuple):
    """A team-mate of each of eight observers: current or as last received."""

    number: Lanes
    age: Lanes  # age of the data, s
    dx: Lanes  # vector to it, common frame, m
    dy: Lanes
    distance: Lanes  # m
    heading_cos: Lanes
    heading_sin: Lanes
    speed: Lanes  # m/s
    turn_rate: Lanes  # rad/s


@compiled
def view_of(c: Record, worlds: WorldArrays, observers: Observers, target: TargetPose) -> View:
    """Return the view of a robot of eight worlds."""
    first, end, i, _ = observers
    if i < c.num_trackers:
        number = eight(np.float32(i))
        own = Pose(*columns(worlds.tracker[:, i], first, end, POSE_AT))
        if c.drifts:  # its pose as it knows it
            error = Odometry(*columns(worlds.odometry[:, i], first, end))
            cos, sin = turned(own.heading_cos, own.heading_sin, error.cos, error.sin)
            x, y = own.x + error.x, own.y + error.y
            own = Pose(x, y, cos, sin, own.speed, own.turn_rate, own.max_speed, own.max_turn_rate)
        fix = Fix(*columns(worlds.tracker[:, i], first, end, FIX_AT))
        condition = Condition(*columns(worlds.tracker[:, i], first, end, CONDITION_AT))
        touching, sees, fixed_at = from_int(condition.touching), from_int(condition.sees), from_int(condition.fix_step)
        working = choose(from_int(condition.broken_at) == np.float32(NEVER), ONE, ZERO)
    else:  # a target agent: its limits act at once, and it has no target
        zero, number = eight(ZERO), eight(-ONE)
        x, y, cos, sin, speed, turn_rate, _, _ = target
        own = Pose(x, y, cos, sin, speed, turn_rate, eight(c.target_speed), eight(c.target_turn_rate))
        fix = Fix(zero, zero, zero, zero, zero, zero, zero, zero)
        touching, sees, fixed_at = from_int(target.in_contact), zero, number
        working = eight(ONE)
    dx, dy = fix.x, fix.y
    if not c.fix_bearing:
        dx, dy = dx - own.x, dy - own.y
    return View(
        number=number,
        own=own,
        touching=touching,
        working=working,
        step=from_int(target.step),
        target_known=fixed_at >= ZERO,
        target_seen=sees,
        target_step=fixed_at,
        target_dx=dx,
        target_dy=dy,
        target_distance=root(dx * dx + dy * dy),
        fix=fix,
    )


class Generated(NamedTuple):
    """The generated functions, for compiled code, and the lengths of what they write."""

    write_own: Any  # writes the own fields of eight observers
    write_mate: Any  # writes those of a team-mate of each; the values for "unknown" where there is none
    reward: Any  # returns the reward of a tracker, and writes the values of its terms, (K,)
    target_reward: Any  # returns the same of a target that is an agent
    begin_motion: Any  # clears the memories of the target's motion, and draws its parameters for an episode
    set_goal: Any  # sets the goal heading of a scripted target
    sees: Any  # returns whether the target, (dx, dy) away, is in sight of a tracker
    measure: Any  # returns the vector to the target as measured
    clear_sums: Any  # sets the sums of the metrics to zero
    add_to_sums: Any  # adds a control step to the sums of the metrics
    own_size: int  # length of the observation before the sonar
    mate_size: int  # length of a team-mate's part, without its message


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, end: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observations of all agents of the worlds ``first`` to ``end``, at most eight, without the sonar."""
    n = c.num_trackers
    for i in range(n):
        pose = Pose(*columns(worlds.tracker[:, i], first, end, POSE_AT))
        store(s.team_x[i], 0, pose.x)
        store(s.team_y[i], 0, pose.y)
    target = TargetPose(*columns(worlds.world, first, end, TARGET_POSE_AT))
    for i in range(n + c.target_is_agent):
        observers = Observers(first, end, i, c.perfect_radio != 0 or i == n)
        view = view_of(c, worlds, observers, target)
        rows = observations[first:end, i]
        made.write_own(c, view, rows)
        _list_nearest(c, worlds, observers, view, s)
        start, size = made.own_size + c.sonar_beams, made.mate_size + c.message_size
        for p in range(c.neighbours):
            mate = _mate_in_place(c, worlds, observers, view, p, s)
            place = rows[:, start + p * size :]
            made.write_mate(c, view, mate, place)
            if c.message_size > 0:
                _write_messages(c, worlds, observers, p, s, place[:, made.mate_size :])


@compiled
def _list_nearest(c: Record, worlds: WorldArrays, observers: Observers, v: View, s: Record) -> None:
    """List the nearest mates that the observers know; of equally near ones the lower number is first."""
    first, end, i, now = observers
    n, places, mate_number, mate_distance = c.num_trackers, c.neighbours, s.mate_number, s.mate_distance
    for p in range(places):
        store(mate_number[p], 0, eight(-ONE))
        store(mate_distance[p], 0, eight(FAR))
    if places == 0:
        return
    for j in range(n - 1, -1, -1):  # so that a mate comes before equally near ones in the list
        if j == i:
            continue
        if now:
            x, y, known = load(s.team_x[j], 0), load(s.team_y[j], 0), v.step >= ZERO
        else:
            heard = Heard(*columns(worlds.heard[:, i, j], first, end))
            x, y, sent = heard.x, heard.y, from_int(heard.step)
            known = (sent >= ZERO) & (v.step - sent <= np.float32(c.forget_steps))
        ahead, left = ego(v, x - v.own.x, y - v.own.y)
        number = choose(known, np.float32(j), -ONE)
        distance = choose(known, root(ahead * ahead + left * left), FAR)
        if bits(distance <= load(mate_distance[places - 1], 0)) == 0:
            continue
        for p in range(min(n - j, places)):
            other, whose = load(mate_distance[p], 0), load(mate_number[p], 0)
            nearer = distance <= other
            store(mate_number[p], 0, choose(nearer, number, whose))
            store(mate_distance[p], 0, lesser(other, distance))
            number, distance = choose(nearer, whose, number), greater(other, distance)


@compiled
def _mate_in_place(c: Record, worlds: WorldArrays, observers: Observers, v: View, p: int, s: Record) -> Mate:
    """Return the mate in a place of each observer; in an empty place, number -1 and the data of the first tracker."""
    rows = (
        _fields_of(worlds, observers, p, 0, s),
        _fields_of(worlds, observers, p, 1, s),
        _fields_of(worlds, observers, p, 2, s),
        _fields_of(worlds, observers, p, 3, s),
        _fields_of(worlds, observers, p, 4, s),
        _fields_of(worlds, observers, p, 5, s),
        _fields_of(worlds, observers, p, 6, s),
        _fields_of(worlds, observers, p, 7, s),
    )
    x, y, cos, sin, speed, turn_rate, sent, _ = transpose(rows)
    return Mate(
        number=load(s.mate_number[p], 0),
        age=eight(ZERO) if observers.now else (v.step - from_int(sent)) * c.control_step,
        dx=x - v.own.x,
        dy=y - v.own.y,
        distance=load(s.mate_distance[p], 0),
        heading_cos=cos,
        heading_sin=sin,
        speed=speed,
        turn_rate=turn_rate,
    )


@compiled
def _fields_of(worlds: WorldArrays, observers: Observers, p: int, lane: int, s: Record) -> Lanes:
    """Return eight fields of a lane's mate in a place, of :class:`Pose` or of :class:`Heard`, which begins alike."""
    e = min(observers.first + lane, observers.end - 1)
    j = max(int(s.mate_number[p, lane]), 0)
    if observers.now:
        return load_fields(worlds.tracker[e, j], POSE_AT)
    return load_fields(worlds.heard[e, observers.i, j], 0)


@compiled
def _write_messages(c: Record, worlds: WorldArrays, observers: Observers, p: int, s: Record, rows: FloatArray) -> None:
    """Write the messages of the mates in a place: none in an empty one, and none to a target."""
    first, end, i, now = observers
    for e in range(first, end):
        lane = e - first
        number = int(s.mate_number[p, lane])
        for q in range(c.message_size):
            said = ZERO
            if number >= 0 and i < c.num_trackers:
                said = worlds.message[e, 0, number, q] if now else worlds.heard_message[e, i, number, q]
            rows[lane, q] = said
