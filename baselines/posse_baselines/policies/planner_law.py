"""The law that the planner plays: slots by least total time, courses that meet them, the safeguard.

It reads the state of the worlds: poses, the slot frame, obstacles. What it leaves open for each tracker is a
:data:`WAY`. :func:`drive` plays it in any batch of worlds.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import Batch
from posse.numeric import BoolArray, FloatArray, Record, Records, compiled, kernel, over_worlds, record_type
from posse.rules import NEVER
from posse_baselines.ddcs.memory import record
from posse_baselines.laws.geometry import angle_of, length, wrap
from posse_baselines.laws.guidance import BODY, UNLIMITED, regulate, write_motion
from posse_baselines.laws.safeguard import put_disc, put_walls, safe_velocity
from posse_baselines.laws.steering import Work, approach_velocity, assign, slot_velocity, way_round, work_for, work_of

_REPLAN_STEPS: Final = 3  # control steps between two assignments of the slots
_LOYALTY: Final = 0.5  # s; least gain for which a tracker changes its slot
_TURNING: Final = 0.5  # delay of an arrival as a share of the time for a turn on the spot
_MARGIN: Final = 0.15  # m; free width that is kept; twice as much to the target

WAY: Final = record_type(
    ("ahead", np.float64),  # shift of the slot along the target's heading, m
    ("left", np.float64),  # shift of the slot to its left, m
    ("gain", np.float64),  # of the slot law, 1/s
)
"""How one tracker plays."""

PLAN: Final = record(
    slot=np.int32(-1),  # -1: none yet
    wish=np.complex64(0),  # the safe velocity that it was to have, m/s
    **BODY,
)
"""Memory of one tracker at the start, and its motion, an array of one record."""


class Teams(NamedTuple):
    """What the law knows of the teams in E worlds beside the state of these."""

    config: Records
    """(1,) the scenario as kernels read it."""
    slots: npt.NDArray[np.complex64]
    """(N,) position of each slot in the slot frame, m."""
    ways: Records
    """(E, N) :data:`WAY`."""
    plans: Records
    """(E, N) :data:`PLAN`, brought up to date by :func:`drive`."""
    late: FloatArray
    """(N,) s; by how much a slot is taken to be reached later than it is, so that others are filled before it."""


def drive(teams: Teams, batch: Batch, going: BoolArray, actions: FloatArray) -> None:
    """Write actions (E, rows, 2 + m) for the trackers of those worlds that are ``going`` (E,)."""
    robots = batch.scenario.num_trackers
    given = teams, work_for(robots)
    over_worlds(drive_all, (given, batch.arrays, going, actions), batch.num_worlds, robots)


@compiled
def velocity_of(r: Record) -> complex:
    """Return the velocity of a robot."""
    return complex(r.speed * r.heading_cos, r.speed * r.heading_sin)


@compiled
def arm_of(w: Record, slot: complex) -> complex:
    """Return where a slot is from the target, m."""
    return slot * complex(w.frame_cos, w.frame_sin)


@compiled
def assign_slots(teams: Teams, worlds: Any, e: int, work: Work) -> None:
    """Assign the working trackers of world e to slots with the least total arrival time."""
    w, plans, n = worlds.world[e], teams.plans[e], len(teams.slots)
    work.cost[:] = 0.0
    for i in range(n):
        t = worlds.tracker[e, i]
        if t.broken_at != NEVER:
            continue
        for k in range(n):
            way = complex(w.x, w.y) + arm_of(w, teams.slots[k]) - complex(t.x, t.y)
            time = length(way) / float(t.max_speed)
            # Time for turning towards it.
            away = wrap(angle_of(way) - math.atan2(t.heading_sin, t.heading_cos))
            time += teams.late[k] + _TURNING * abs(away) / t.max_turn_rate * min(1.0, time)
            if plans[i].slot == k:
                time -= _LOYALTY
            work.cost[i, k] = time
    assign(work.cost, work.assigning)
    for i in range(n):
        if worlds.tracker[e, i].broken_at == NEVER:
            plans[i].slot = int(work.assigning[0, i])


@compiled
def surround(c: Record, worlds: Any, e: int, i: int, discs: Records) -> int:
    """List what is near tracker i of world e, as discs for the safeguard; return how many things that are."""
    w, t = worlds.world[e], worlds.tracker[e, i]
    here, count, two = complex(t.x, t.y), 0, 2.0 * c.robot_radius
    count = put_disc(discs, count, complex(w.x, w.y) - here, velocity_of(w), two, 2.0 * _MARGIN)
    for j in range(c.num_trackers):
        other = worlds.tracker[e, j]
        if j != i:
            count = put_disc(discs, count, complex(other.x, other.y) - here, velocity_of(other), two, _MARGIN)
    for k in range(c.num_obstacles):
        disc = worlds.obstacle[e, k]
        count = put_disc(discs, count, complex(disc.x, disc.y) - here, 0j, disc.radius + c.robot_radius, _MARGIN)
    return put_walls(discs, count, c, here, c.robot_radius, _MARGIN)


@compiled
def wanted_velocity(w: Record, t: Record, way: Record, slot: complex, frame_rate: float) -> complex:
    """Return the velocity (m/s) that meets a slot on a course round the target."""
    arm, start = arm_of(w, slot), complex(t.x, t.y) - complex(w.x, w.y)
    aim = arm + complex(way.ahead, way.left) * complex(w.heading_cos, w.heading_sin)
    velocity = slot_velocity(velocity_of(w), frame_rate, aim)
    return approach_velocity(way_round(start, aim) - start, velocity, way.gain, float(t.max_speed))


@compiled
def frame_rate_of(c: Record, w: Record) -> float:
    """Return the turn rate of the slot frame (rad/s): at its limit until it is at the target's heading."""
    lag = wrap(math.atan2(w.heading_sin, w.heading_cos) - math.atan2(w.frame_sin, w.frame_cos))
    most = math.atan2(c.frame_s, c.frame_c) / float(c.control_step)
    return min(max(lag / float(c.control_step), -most), most)


@compiled
def drive_team(teams: Teams, worlds: Any, e: int, work: Work, actions: FloatArray) -> None:
    """Write the actions (N, 2 + m) of the team of world e."""
    c, w = teams.config[0], worlds.world[e]
    if w.step % _REPLAN_STEPS == 0 or teams.plans[e, 0].slot < 0:
        assign_slots(teams, worlds, e, work)
    frame_rate = frame_rate_of(c, w)
    for i in range(c.num_trackers):
        t, me = worlds.tracker[e, i], teams.plans[e, i]
        if t.broken_at != NEVER:
            actions[i, 0], actions[i, 1] = -1.0, 0.0
            continue
        me.heading, me.speed, me.omega = complex(t.heading_cos, t.heading_sin), t.speed, t.turn_rate
        me.max_speed, me.max_omega, me.dt = t.max_speed, t.max_turn_rate, c.control_step
        me.acceleration = 1.0 / c.per_acceleration if c.per_acceleration > 0.0 else UNLIMITED
        me.turn_acceleration = 1.0 / c.per_turn_acceleration if c.per_turn_acceleration > 0.0 else UNLIMITED
        velocity = wanted_velocity(w, t, teams.ways[e, i], teams.slots[me.slot], frame_rate)
        me.wish, _ = safe_velocity(me, work.discs[: surround(c, worlds, e, i, work.discs)], velocity)
        v, omega = regulate(me, me.wish)
        if c.actuator_lag > 0.0:  # command what the lag leaves of it
            more = 1.0 / (1.0 - math.exp(-me.dt / c.actuator_lag)) - 1.0
            v, omega = v + more * (v - me.speed), omega + more * (omega - me.omega)
        write_motion(me, v, omega, actions[i])


@kernel
def drive_all(
    given: Any, worlds: Any, going: BoolArray, actions: FloatArray, thread: int, first: int, end: int
) -> None:
    """Write the actions of those of a share of the worlds that are going on; ``worlds`` are the arrays of a batch."""
    teams, works = given
    work = work_of(works, thread)
    for e in range(first, end):
        if going[e]:
            drive_team(teams, worlds, e, work, actions[e])
