"""The oracle: a team that reads the state of the world. It does not play by the rules.

A reference to hold scores against, not a bound: the best assignment of slots, intercept courses,
feed-forward of the slots' motion, and the safeguard, all with perfect knowledge of the present.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posse import Batch, ObservationLayout
from posse.numeric import (
    BoolArray,
    FloatArray,
    Numbers,
    OwnArrays,
    Record,
    Records,
    compiled,
    kernel,
    worlds_of,
)
from posse.rules.state import NEVER, config_record, slot_records
from posse_baselines.laws.assignment import WORK_ROWS, assign
from posse_baselines.laws.geometry import wrap
from posse_baselines.laws.heading import BODY, regulate
from posse_baselines.laws.safeguard import DISC, PLAYS, put_disc, put_wall, safe_velocity
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import intercept_time, meeting_velocity, write_motion
from posse_baselines.parallel import MOST_THREADS, over_worlds
from posse_baselines.policy import (
    BasePolicy,
    Memory,
    PolicyError,
    check_fits,
    check_observations,
    message_size_of,
)  # fmt: skip

_MOST_DISCS: Final = 24
_NEAR: Final = 3.0  # m; farther things are no danger yet
_UNLIMITED: Final = 1e4  # m/s² or rad/s²: what stands for no limit

PLAN: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("slot", np.int32),  # -1: none yet
                ("mean_x", np.float32),  # running mean of the target's velocity, m/s
                ("mean_y", np.float32),
                ("frame_c", np.float32),  # the slot frame one step ago
                ("frame_s", np.float32),
            ],
            align=True,
        ),
    )
)
"""What the oracle has planned for a tracker."""


@dataclass(frozen=True)
class OracleSettings:
    """How the oracle plays."""

    gain: float = 1.5
    """Of the slot law, 1/s."""
    replan_steps: int = 3
    """Control steps between two assignments."""
    loyalty: float = 0.5
    """How much sooner another assignment has to be for a tracker to leave its slot, s."""
    weave_time: float = 1.5
    """The target is taken to keep its present velocity for about so long, s, then its mean one."""
    mean_time: float = 6.0
    """Time constant of that mean, s."""
    clearance: float = 0.75
    """Distance at which the way to a slot leads round the target, m."""
    margin: float = 0.15
    """Free width that it keeps, m."""


@dataclass
class _OracleMemory(OwnArrays):
    batch: Batch
    config: Records
    slots: Records
    plans: Records
    costs: FloatArray
    work: FloatArray
    discs: Records
    bodies: Records
    plays: Records


SETTINGS_FIELDS: Final = tuple(OracleSettings.__dataclass_fields__)
_SETTINGS: Final[np.dtype[Any]] = np.dtype(
    (np.record, np.dtype([(name, np.float64) for name in SETTINGS_FIELDS]))
)


class Oracle(BasePolicy):
    """Reads the state of the worlds: a reference, which no team that plays by the rules can copy.

    Args:
        settings: How it plays.
    """

    name = "oracle"
    reads_state: bool = True

    def __init__(self, settings: OracleSettings | None = None) -> None:
        self.settings = settings or OracleSettings()
        self._batch: Batch | None = None

    def watch(self, batch: Batch) -> None:
        """Take the batch whose state is to be read by the memories made from now on."""
        self._batch = batch

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory for the batch that is being watched.

        Raises:
            PolicyError: No batch was shown to it, or one of another size.
        """
        check_fits(self, layout)
        batch = self._batch
        if batch is None:
            raise PolicyError(
                "policy 'oracle' reads the state: show it the batch with watch(batch), or use "
                "posse_baselines.begin(policy, batch)"
            )
        if batch.num_worlds != num_worlds or batch.layout.size != layout.size:
            raise PolicyError(
                f"policy 'oracle' watches {batch.num_worlds} worlds of {batch.scenario.name!r}, "
                f"not {num_worlds} of {layout.scenario.name!r}: call watch(batch) before begin()"
            )
        n = layout.scenario.num_trackers
        plans = np.zeros((num_worlds, n), PLAN)
        plans["slot"] = -1
        parts = MOST_THREADS
        return _OracleMemory(
            batch, config_record(layout.scenario), slot_records(layout.scenario), plans,
            np.zeros((parts, n, n), np.float32), np.zeros((parts, WORK_ROWS, n + 1), np.float32),
            np.zeros((parts, _MOST_DISCS), DISC), np.zeros(parts, BODY),
            np.zeros(parts, PLAYS),
        )  # fmt: skip

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions for the state that the watched batch is in; observations are not read."""
        m: _OracleMemory = memory
        layout, num_worlds = m.batch.layout, m.batch.num_worlds
        check_observations(self, observations, num_worlds, layout)
        settings = np.zeros(1, _SETTINGS)
        for name in SETTINGS_FIELDS:
            settings[name] = getattr(self.settings, name)
        n = layout.scenario.num_trackers
        actions = np.zeros((num_worlds, n, 2 + message_size_of(layout)), np.float32)
        arrays = m.batch.arrays
        over_worlds(
            lead_all,
            (
                m.config, m.slots, settings, arrays.world, arrays.tracker, arrays.obstacle,
                m.plans, m.costs, m.work, m.discs, m.bodies, m.plays, actions,
            ),
            num_worlds,
            n,
        )  # fmt: skip
        return actions, memory

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Forget the plans of the worlds of a mask (E,)."""
        m: _OracleMemory = memory
        m.plans[mask] = np.zeros((), PLAN)
        m.plans["slot"][mask] = -1
        return m

    def annotations(self, memory: Memory) -> dict[str, Any]:
        """Return ``slot`` (E, N), the slot that each tracker is sent to; -1: none."""
        return {"slot": memory.plans["slot"].copy()}


@compiled
def lead(
    c: Record,
    slots: Records,
    s: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    plans: Records,
    cost: FloatArray,
    work: FloatArray,
    discs: Records,
    body: Record,
    plays: Record,
    actions: FloatArray,
) -> None:
    """Write the actions (N, 2 + m) of one world's team."""
    n = c.num_trackers
    dt = float(c.dt)
    acceleration = 1.0 / c.per_acceleration if c.per_acceleration > 0.0 else _UNLIMITED
    turn_acceleration = _UNLIMITED
    if c.per_turn_acceleration > 0.0:
        turn_acceleration = 1.0 / c.per_turn_acceleration
    body.dt, body.acceleration, body.turn_acceleration = dt, acceleration, turn_acceleration
    vx, vy = float(w.speed * w.heading_cos), float(w.speed * w.heading_sin)
    # The slot frame turns towards the heading, at its limit until it is there.
    psi = math.atan2(w.frame_sin, w.frame_cos)
    lag = wrap(math.atan2(w.heading_sin, w.heading_cos) - psi)
    most = math.atan2(c.frame_s, c.frame_c) / dt
    rate = min(max(lag / dt, -most), most)
    share = min(1.0, dt / s.mean_time) if w.step > 0 else 1.0
    p = plans[0]
    p.mean_x += share * (vx - p.mean_x)
    p.mean_y += share * (vy - p.mean_y)
    mean_x, mean_y = float(p.mean_x), float(p.mean_y)
    if w.step % int(s.replan_steps) == 0 or p.slot < 0:
        plan(c, slots, s, w, trackers, plans, cost, work, vx, vy, mean_x, mean_y)
    for i in range(n):
        t = trackers[i]
        if t.broken_at != NEVER:
            write_motion(actions[i], 0.0, 0.0, 1.0, 1.0)
            continue
        speed = float(t.max_speed)
        body.max_speed, body.max_omega = speed, t.max_turn_rate
        slot = slots[plans[i].slot]
        arm_x, arm_y = rotate(slot.x, slot.y, w.frame_cos, w.frame_sin)
        wx, wy = meeting_velocity(
            t.x - w.x, t.y - w.y, arm_x, arm_y, vx, vy, mean_x, mean_y, rate,
            s.weave_time, s.clearance, s.gain, speed, acceleration,
        )  # fmt: skip
        count = surround(c, w, trackers, obstacles, i, s.margin, discs)
        body.heading_cos, body.heading_sin = t.heading_cos, t.heading_sin
        body.speed, body.omega = t.speed, t.turn_rate
        wx, wy, _ = safe_velocity(body, discs, count, wx, wy, plays)
        v, omega = regulate(body, wx, wy, 0.0)
        write_motion(actions[i], v, omega, speed, t.max_turn_rate)


@compiled
def plan(
    c: Record,
    slots: Records,
    s: Record,
    w: Record,
    trackers: Records,
    plans: Records,
    cost: FloatArray,
    work: FloatArray,
    vx: float,
    vy: float,
    mean_x: float,
    mean_y: float,
) -> None:
    """Assign the working trackers to slots so that they arrive soonest in total."""
    n, rows = c.num_trackers, 0
    for i in range(n):
        t = trackers[i]
        if t.broken_at != NEVER:
            continue
        speed = float(t.max_speed)
        for k in range(n):
            arm_x, arm_y = rotate(slots[k].x, slots[k].y, w.frame_cos, w.frame_sin)
            x, y = w.x + arm_x - t.x, w.y + arm_y - t.y
            time = intercept_time(x, y, vx, vy, speed)
            if time > s.weave_time:
                time = intercept_time(x, y, mean_x, mean_y, speed)
            # Turning towards it takes time, too.
            away = wrap(math.atan2(y, x) - math.atan2(t.heading_sin, t.heading_cos))
            time += 0.5 * abs(away) / t.max_turn_rate * min(1.0, time)
            if plans[i].slot == k:
                time -= s.loyalty
            cost[rows, k] = time
        rows += 1
    assign(cost, rows, n, work)
    rows = 0
    for i in range(n):
        if trackers[i].broken_at == NEVER:
            plans[i].slot = int(work[0, rows])
            rows += 1


@compiled
def surround(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    i: int,
    margin: float,
    discs: Records,
) -> int:
    """List what is near tracker i; return how many things that are."""
    t = trackers[i]
    count, two = 0, 2.0 * c.radius
    dx, dy = w.x - t.x, w.y - t.y
    if dx * dx + dy * dy < _NEAR * _NEAR:
        count = put_disc(
            discs,
            count,
            dx,
            dy,
            w.speed * w.heading_cos,
            w.speed * w.heading_sin,
            two,
            2.0 * margin,
        )
    for j in range(c.num_trackers):
        other = trackers[j]
        dx, dy = other.x - t.x, other.y - t.y
        if j != i and dx * dx + dy * dy < _NEAR * _NEAR:
            count = put_disc(
                discs, count, dx, dy,
                other.speed * other.heading_cos, other.speed * other.heading_sin, two, margin,
            )  # fmt: skip
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy = o.x - t.x, o.y - t.y
        reach = o.radius + c.radius
        if dx * dx + dy * dy < (_NEAR + reach) * (_NEAR + reach):
            count = put_disc(discs, count, dx, dy, 0.0, 0.0, reach, margin)
    if c.walled:
        half = c.half_arena
        if half - t.x < _NEAR:
            count = put_wall(discs, count, half - t.x, 1.0, 0.0, c.radius, margin)
        if half + t.x < _NEAR:
            count = put_wall(discs, count, half + t.x, -1.0, 0.0, c.radius, margin)
        if half - t.y < _NEAR:
            count = put_wall(discs, count, half - t.y, 0.0, 1.0, c.radius, margin)
        if half + t.y < _NEAR:
            count = put_wall(discs, count, half + t.y, 0.0, -1.0, c.radius, margin)
    return count


@kernel
def lead_all(
    config: Records,
    slots: Records,
    settings: Records,
    world: Records,
    tracker: Records,
    obstacle: Records,
    plans: Records,
    costs: FloatArray,
    work: FloatArray,
    discs: Records,
    bodies: Records,
    plays: Records,
    actions: FloatArray,
    thread: int,
    turns: Numbers,
) -> None:
    """Write the actions of a thread's worlds."""
    for e in worlds_of(thread, turns):
        lead(
            config[0], slots, settings[0], world[e], tracker[e], obstacle[e], plans[e],
            costs[thread], work[thread], discs[thread], bodies[thread], plays[thread], actions[e],
        )  # fmt: skip
