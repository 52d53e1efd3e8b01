"""The control step of one tracker, and the loop over all trackers of all worlds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from posse.numeric import Blocks, FloatArray, Record, Records, compiled, kernel, worlds_of
from posse_baselines.ddcs.memory import FLOCKING, SEARCHING
from posse_baselines.ddcs.messages import write_message
from posse_baselines.ddcs.monitoring import hear_mates, watch_target
from posse_baselines.ddcs.surroundings import surround
from posse_baselines.ddcs.tracking.detour import way_past
from posse_baselines.ddcs.tracking.leadership import settle_lead
from posse_baselines.ddcs.tracking.motion import CENTRALIZED, note_error, take_up, wanted_motion
from posse_baselines.ddcs.tracking.searching import begin_search, look_around, wander
from posse_baselines.ddcs.tracking.slots import choose_slot
from posse_baselines.ddcs.tracking.tasks import next_task
from posse_baselines.laws.heading import regulate
from posse_baselines.laws.safeguard import safe_velocity
from posse_baselines.laws.steering import write_motion

_UNLIMITED = 1e4  # m/s² or rad/s²: what stands for no limit


@compiled
def feel_body(f: Record, o: FloatArray, body: Record) -> None:
    """Read the robot's motion and limits from an observation (F,)."""
    body.heading_cos, body.heading_sin = o[f.heading], o[f.heading + 1]
    body.speed, body.omega = o[f.speed], o[f.turn_rate]
    body.max_speed, body.max_omega = o[f.max_speed], o[f.max_turn_rate]
    body.acceleration, body.turn_acceleration = _UNLIMITED, _UNLIMITED
    if o[f.acceleration_time] > 0.0:
        body.acceleration = o[f.max_speed] / o[f.acceleration_time]
    if o[f.turn_acceleration_time] > 0.0:
        body.turn_acceleration = o[f.max_turn_rate] / o[f.turn_acceleration_time]
    body.dt = f.dt


@compiled
def plan(
    f: Record,
    s: Record,
    slots: Records,
    outermost: float,
    d: Record,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    o: FloatArray,
    cost: FloatArray,
    work: FloatArray,
    body: Record,
) -> None:
    """Monitor and track: set the wanted velocity of one tracker for its observation (F,)."""
    own = int(o[f.number])
    x, y = float(o[f.position]), float(o[f.position + 1])
    hc, hs = float(o[f.heading]), float(o[f.heading + 1])
    feel_body(f, o, body)
    # Monitoring
    watch_target(f, s, d, o, outermost)
    hear_mates(f, s, d, mates, o)
    look_around(f, s, d, mates, seen, x, y)
    # Tracking
    if s.model == CENTRALIZED:
        settle_lead(f, s, d, mates, own, x, y)
    d.closing = 0
    if d.known == 0:
        d.slot, d.error = -1, -1.0
        if d.task != SEARCHING:
            begin_search(f, d, seen)
    else:
        if d.slot < 0 or d.step % max(1, round(s.replan_time / f.dt)) == 0:
            choose_slot(f, s, d, mates, slots, own, x, y, hc, hs, body.max_speed, body.max_omega, cost, work)
        note_error(f, s, d, mates, slots, own, x, y)
    d.task = next_task(s, d)
    if d.task == SEARCHING or d.slot < 0:
        vx, vy = wander(f, s, d, mates, seen, own, x, y, hc, hs, body.max_speed)
        vx, vy, speed, omega = take_up(body, vx, vy, 0.0)
    else:
        vx, vy, speed, omega = wanted_motion(f, s, d, mates, slots, own, x, y, body)
    d.wish_x, d.wish_y, d.wish_speed, d.wish_omega = vx, vy, speed, omega


@compiled
def carry_out(
    f: Record,
    s: Record,
    slots: Records,
    d: Record,
    mates: Records,
    o: FloatArray,
    beams: FloatArray,
    discs: Records,
    body: Record,
    plays: Record,
    action: FloatArray,
) -> None:
    """Actuate: write the action (2 + m,) of one tracker that realises its wanted velocity."""
    own = int(o[f.number])
    x, y = float(o[f.position]), float(o[f.position + 1])
    hc, hs = float(o[f.heading]), float(o[f.heading + 1])
    vx, vy, speed, omega = d.wish_x, d.wish_y, d.wish_speed, d.wish_omega
    count = surround(f, s, d, mates, slots, own, x, y, hc, hs, o, beams, discs)
    past = False
    if s.detour > 0.0 and d.task != FLOCKING:
        wanted_x, wanted_y = vx, vy
        vx, vy = way_past(f, s, d, discs, count, vx, vy)
        past = vx != wanted_x or vy != wanted_y
    vx, vy, changed = safe_velocity(body, discs, count, vx, vy, plays)
    if changed or past:
        speed, omega = regulate(body, vx, vy, 0.0)
    write_motion(action, speed, omega, body.max_speed, body.max_omega)
    write_message(d, action)
    d.step += 1


@kernel
def decide_all(
    offsets: Records,
    settings: Records,
    slots: Records,
    outermost: float,
    minds: Records,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    observations: FloatArray,
    costs: FloatArray,
    work: FloatArray,
    beams: FloatArray,
    discs: Records,
    bodies: Records,
    plays: Records,
    actions: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Write the actions of a thread's worlds."""
    f, s = offsets[0], settings[0]
    for e in worlds_of(thread, blocks):
        for i in range(observations.shape[1]):
            d, o, body = minds[e, i], observations[e, i], bodies[thread]
            plan(f, s, slots, outermost, d, mates[e, i], seen[e, i], o, costs[thread], work[thread], body)
            carry_out(f, s, slots, d, mates[e, i], o, beams, discs[thread], body, plays[thread], actions[e, i])
