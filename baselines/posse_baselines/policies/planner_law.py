"""The law that the planner plays: slots by least total time, courses that meet them, the safeguard.

It reads the state of the worlds: poses, the slot frame, obstacles. What it leaves open for each tracker is a
:data:`WAY`. :func:`drive` plays it in any batch of worlds.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import Batch, Scenario
from posse.numeric import BoolArray, FloatArray, Record, Records, compiled, kernel, over_worlds, record_type
from posse.rules import NEVER, config_record, slot_records
from posse_baselines.ddcs.memory import record
from posse_baselines.laws.geometry import angle_of, dot, wrap
from posse_baselines.laws.guidance import BODY, UNLIMITED, regulate, write_motion
from posse_baselines.laws.safeguard import NEAR, put_disc, put_near, put_walls, safe_velocity
from posse_baselines.laws.steering import (
    Work,
    approach_velocity,
    assign,
    intercept_time,
    slot_velocity,
    way_round,
    work_for,
)

_REPLAN_STEPS: Final = 3  # control steps between two assignments of the slots
_LOYALTY: Final = 0.5  # s; least gain for which a tracker changes its slot
_TURNING: Final = 0.5  # delay of an arrival as a share of the time for a turn on the spot
_CLEARANCE: Final = 0.75  # m; distance at which the way to a slot leads round the target
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
    """What the law knows of the teams in E worlds beside the state of these; made by :func:`teams_of`."""

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
    work: Work


class Scene(NamedTuple):
    """One world as the law reads it."""

    teams: Teams
    config: Record
    world: Record
    trackers: Records
    obstacles: Records
    ways: Records
    plans: Records
    frame_rate: float
    """Turn rate of the slot frame, rad/s."""


def teams_of(scenario: Scenario, ways: Records) -> Teams:
    """Return teams that play ways (E, N) and have no slots yet."""
    n = ways.shape[1]
    plans, late = np.full(ways.shape, PLAN), np.zeros(n, np.float32)
    slots = np.array([complex(slot.x, slot.y) for slot in slot_records(scenario)], np.complex64)
    return Teams(config_record(scenario), slots, ways, plans, late, work_for(n))


def drive(teams: Teams, batch: Batch, going: BoolArray, actions: FloatArray) -> None:
    """Write actions (E, rows, 2 + m) for the trackers of those worlds that are ``going`` (E,)."""
    over_worlds(drive_all, (teams, batch.arrays, going, actions), batch.num_worlds, batch.scenario.num_trackers)


@compiled
def velocity_of(r: Record) -> complex:
    """Return the velocity of a robot."""
    return complex(r.speed * r.heading_cos, r.speed * r.heading_sin)


@compiled
def arm_of(scene: Scene, slot: complex) -> complex:
    """Return where a slot is from the target, m."""
    return slot * complex(scene.world.frame_cos, scene.world.frame_sin)


@compiled
def assign_slots(scene: Scene, work: Work) -> None:
    """Assign the working trackers to slots with the least total arrival time."""
    w, plans, n = scene.world, scene.plans, scene.config.num_trackers
    work.cost[:] = 0.0
    for i in range(n):
        t = scene.trackers[i]
        if t.broken_at != NEVER:
            continue
        for k in range(n):
            slot = scene.teams.slots[k]
            way = complex(w.x, w.y) + arm_of(scene, slot) - complex(t.x, t.y)
            time = intercept_time(way, velocity_of(w), float(t.max_speed))
            # Time for turning towards it.
            away = wrap(angle_of(way) - math.atan2(t.heading_sin, t.heading_cos))
            time += scene.teams.late[k] + _TURNING * abs(away) / t.max_turn_rate * min(1.0, time)
            if plans[i].slot == k:
                time -= _LOYALTY
            work.cost[i, k] = time
    assign(work.cost, work.assigning)
    for i in range(n):
        if scene.trackers[i].broken_at == NEVER:
            plans[i].slot = int(work.assigning[0, i])


@compiled
def surround(scene: Scene, i: int, discs: Records) -> int:
    """List what is near tracker i, as discs for the safeguard; return how many things that are."""
    c, w, t = scene.config, scene.world, scene.trackers[i]
    count, two = 0, 2.0 * c.robot_radius
    way = complex(w.x, w.y) - complex(t.x, t.y)
    count = put_near(discs, count, way, velocity_of(w), two, 2.0 * _MARGIN)
    for j in range(c.num_trackers):
        other = scene.trackers[j]
        way = complex(other.x, other.y) - complex(t.x, t.y)
        if j != i:
            count = put_near(discs, count, way, velocity_of(other), two, _MARGIN)
    for k in range(c.num_obstacles):
        disc = scene.obstacles[k]
        way, reach = complex(disc.x, disc.y) - complex(t.x, t.y), disc.radius + c.robot_radius
        if dot(way, way) < (NEAR + reach) * (NEAR + reach):
            count = put_disc(discs, count, way, 0j, reach, _MARGIN)
    if c.walled:
        count = put_walls(discs, count, c, complex(t.x, t.y), c.robot_radius, _MARGIN)
    return count


@compiled
def wanted_velocity(scene: Scene, i: int, acceleration: float) -> complex:
    """Return the velocity (m/s) on a course that meets tracker i's slot, round the target."""
    w, t, way, place = scene.world, scene.trackers[i], scene.ways[i], scene.teams.slots[scene.plans[i].slot]
    arm, start = arm_of(scene, place), complex(t.x, t.y) - complex(w.x, w.y)
    shift = complex(way.ahead, way.left) * complex(w.heading_cos, w.heading_sin)
    velocity = slot_velocity(velocity_of(w), scene.frame_rate, arm + shift)
    goal = way_round(start, arm + shift, _CLEARANCE)
    return approach_velocity(goal - start, velocity, way.gain, float(t.max_speed), acceleration)


@compiled
def frame_rate_of(c: Record, w: Record) -> float:
    """Return the turn rate of the slot frame (rad/s): at its limit until it is at the target's heading."""
    lag = wrap(math.atan2(w.heading_sin, w.heading_cos) - math.atan2(w.frame_sin, w.frame_cos))
    most = math.atan2(c.frame_s, c.frame_c) / float(c.control_step)
    return min(max(lag / float(c.control_step), -most), most)


@compiled
def drive_team(scene: Scene, work: Work, actions: FloatArray) -> None:
    """Write the actions (N, 2 + m) of one world's team."""
    c, w = scene.config, scene.world
    if w.step % _REPLAN_STEPS == 0 or scene.plans[0].slot < 0:
        assign_slots(scene, work)
    for i in range(c.num_trackers):
        t, me = scene.trackers[i], scene.plans[i]
        if t.broken_at != NEVER:
            actions[i, 0], actions[i, 1] = -1.0, 0.0
            continue
        me.heading, me.speed, me.omega = complex(t.heading_cos, t.heading_sin), t.speed, t.turn_rate
        me.max_speed, me.max_omega, me.dt = t.max_speed, t.max_turn_rate, c.control_step
        me.acceleration = 1.0 / c.per_acceleration if c.per_acceleration > 0.0 else UNLIMITED
        me.turn_acceleration = 1.0 / c.per_turn_acceleration if c.per_turn_acceleration > 0.0 else UNLIMITED
        velocity = wanted_velocity(scene, i, me.acceleration)
        discs = work.discs[: surround(scene, i, work.discs)]
        me.wish, _ = safe_velocity(me, discs, velocity)
        v, omega = regulate(me, me.wish)
        if c.actuator_lag > 0.0:  # command what the lag leaves of it
            more = 1.0 / (1.0 - math.exp(-me.dt / c.actuator_lag)) - 1.0
            v, omega = v + more * (v - me.speed), omega + more * (omega - me.omega)
        write_motion(me, v, omega, actions[i])


@kernel
def drive_all(
    teams: Teams, worlds: Any, going: BoolArray, actions: FloatArray, thread: int, first: int, end: int
) -> None:
    """Write the actions of those of a share of the worlds that are going on; ``worlds`` are the arrays of a batch."""
    w = teams.work
    work = Work(w.cost[thread], w.assigning[thread], w.discs[thread])
    for e in range(first, end):
        if going[e]:
            config, world = teams.config[0], worlds.world[e]
            scene = Scene(
                teams,
                config,
                world,
                worlds.tracker[e],
                worlds.obstacle[e],
                teams.ways[e],
                teams.plans[e],
                frame_rate_of(config, world),
            )
            drive_team(scene, work, actions[e])
