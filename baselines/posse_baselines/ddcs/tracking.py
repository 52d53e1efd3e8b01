"""The tracking layer: the four tasks, and the law of the present one."""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import CONVERGING, EXCHANGING, FLOCKING, SEARCHING
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience
from posse_baselines.ddcs.slots import slot_place
from posse_baselines.laws.formation_control import (
    l_l_control,
    l_phi_demand,
    polar_slot_velocity,
    separation,
)  # fmt: skip
from posse_baselines.laws.guidance import (
    deviation,
    lawful_heading,
    length,
    line_of_sight,
    next_stage,
    pursuit_speed,
    wrap,
)  # fmt: skip
from posse_baselines.laws.steering import approach_velocity, intercept_time, way_round

CENTRALIZED: Final = 1
POLAR: Final = 1
PNGL: Final = 2
BY_SLOT: Final = 1
L_L: Final = 1

_FAR_SIGHT: Final = 8.0  # m; a sensor that reaches farther finds the target without being moved


@compiled
def next_task(s: Record, d: Record) -> int:
    """Return the task that follows from what the mind knows: the state machine of the DDCS.

    ===================  =========================================================================
    searching            nobody knows where the target is
    leader exchange      another leader was appointed, and has not been heard of yet
    converging           the target is known, the tracker's place is far
    flocking             it is in its place; ends when it is ``far`` from it
    ===================  =========================================================================
    """
    if d.known == 0:
        return SEARCHING
    if d.exchanges > 0 and d.confirmed == 0 and s.exchange:
        return EXCHANGING
    if d.error < 0.0:
        return CONVERGING
    limit = s.far if d.task == FLOCKING else s.near
    return FLOCKING if d.error <= limit else CONVERGING


@compiled
def hunt(s: Record, d: Record, n: int, x: float, y: float, body: Record) -> tuple[float, float]:
    """Return the velocity (m/s) of a tracker that helps to see a target again.

    The team spreads on a ring about where the target should be, slot by slot on either side of its
    heading; the ring grows with the time that it was not seen.
    """
    side = 1.0 if d.slot % 2 else -1.0
    angle = d.now_theta + side * ((d.slot + 1) // 2) * 2.0 * math.pi / n
    away = s.hunt_growth * d.age
    dx = d.now_x + away * math.cos(angle) - x
    dy = d.now_y + away * math.sin(angle) - y
    distance = length(dx, dy)
    speed = min(body.max_speed, s.gain * distance)
    return speed * dx / max(distance, 1e-6), speed * dy / max(distance, 1e-6)


@compiled
def on_target(
    s: Record, d: Record, slots: Records, x: float, y: float, body: Record
) -> tuple[float, float]:
    """Return the velocity (m/s) that takes up the slot on the target; note how far it is."""
    place_x, place_y, arm_x, arm_y = slot_place(d, slots[d.slot])
    d.error = length(place_x - x, place_y - y)
    round_x, round_y = way_round(x - d.now_x, y - d.now_y, arm_x, arm_y, s.clearance)
    dx, dy = d.now_x + round_x - x, d.now_y + round_y - y
    vx, vy = d.speed_x, d.speed_y
    if s.guidance == POLAR:
        r, sigma = line_of_sight(x, y, d.now_x, d.now_y)
        speed, delta = polar_slot_velocity(
            r, sigma, d.speed, d.now_theta, length(arm_x, arm_y),
            wrap(math.atan2(arm_y, arm_x) + math.pi), d.psi_rate,
            s.range_gain, s.bearing_gain, body.max_speed,
        )  # fmt: skip
        return speed * math.cos(sigma + delta), speed * math.sin(sigma + delta)
    # Far away, the slot is met where its mean motion takes it; near, where it is.
    time = min(intercept_time(dx, dy, vx, vy, body.max_speed), 20.0)
    ahead = 1.0
    if time > 0.1:
        ahead = s.weave_time * (1.0 - math.exp(-time / s.weave_time)) / time
    sx = ahead * (vx - d.psi_rate * arm_y) + (1.0 - ahead) * d.mean_x
    sy = ahead * (vy + d.psi_rate * arm_x) + (1.0 - ahead) * d.mean_y
    return approach_velocity(dx, dy, sx, sy, s.gain, body.max_speed, body.acceleration)


@compiled
def in_pursuit(
    s: Record, d: Record, constant: float, wanted_range: float, x: float, y: float, body: Record
) -> tuple[float, float]:
    """Return the velocity (m/s) of pursuit with a navigation constant K, at a wanted range.

    Chase at full speed, then the speed of (13); K = 1 is velocity pursuit.
    """
    r, sigma = line_of_sight(x, y, d.now_x, d.now_y)
    d.error = abs(r - wanted_range)
    heading = lawful_heading(sigma, constant, 0.0)
    d.stage = next_stage(d.stage, r, wanted_range, s.enter_margin, s.leave_margin)
    speed = pursuit_speed(
        d.stage, d.speed, deviation(d.now_theta, sigma), deviation(heading, sigma),
        r, wanted_range, s.range_gain, body.max_speed,
    )  # fmt: skip
    return speed * math.cos(heading), speed * math.sin(heading)


@compiled
def place_on(
    f: Record, s: Record, d: Record, mate: Record, own: Record, theirs: Record
) -> tuple[float, float, float, float, float]:
    """Return where a place in the formation is by a team-mate that is in its own.

    The team-mate's place (x, y) now, the wanted place (x, y), and the team-mate's speed (m/s). The
    formation's heading is that of the slot frame.
    """
    mate_x, mate_y = mate_now(f, s, d, mate)
    silent = (d.step - mate.step) * f.dt > patience(s, d)
    speed = 0.0 if silent else length(mate.speed_x, mate.speed_y)
    along, left = own.x - theirs.x, own.y - theirs.y
    c, sn = d.frame_cos, d.frame_sin
    return mate_x, mate_y, mate_x + along * c - left * sn, mate_y + along * sn + left * c, speed


@compiled
def demand_on(
    f: Record,
    s: Record,
    d: Record,
    mate: Record,
    own: Record,
    theirs: Record,
    x: float,
    y: float,
    body: Record,
) -> tuple[float, float, float, float, float]:
    """Return what l-φ on a team-mate wants of the control point, and where that is.

    (l, A, B, direction now, wanted direction): the directions of l in the common frame. The wanted
    φ turns as the slot frame does, less the team-mate's own turning.
    """
    mate_x, mate_y, place_x, place_y, speed = place_on(f, s, d, mate, own, theirs)
    theta = math.atan2(float(mate.heading_sin), float(mate.heading_cos))
    ahead_x, ahead_y = s.point_offset * body.heading_cos, s.point_offset * body.heading_sin
    l_now, phi = separation(mate_x, mate_y, theta, x + ahead_x, y + ahead_y)
    l_d, phi_d = separation(mate_x, mate_y, theta, place_x + ahead_x, place_y + ahead_y)
    # The wanted φ keeps to the slot frame: to the leader's frame it turns back as the leader turns.
    across_rate = d.psi_rate
    a, b = l_phi_demand(l_now, phi, l_d, phi_d, speed, across_rate, s.alpha_1, s.alpha_2)
    return l_now, a, b, theta + phi, theta + phi_d


@compiled
def second_of(f: Record, s: Record, d: Record, mates: Records, slots: Records, own: int) -> int:
    """Return the team-mate that a follower under l-l keeps its distance from beside the leader.

    Of those whose slots come between the leader's and its own, and who are in their places: the one
    of the last slot from which the lines to both cross widely enough in the follower's place. -1 if
    there is none.
    """
    found, n = -1, len(slots)
    place, first = slots[d.slot], slots[0]
    lead_x, lead_y = place.x - first.x, place.y - first.y
    for j in range(n):
        mate = mates[j]
        if j == own or j == d.leader or mate.task != FLOCKING or not 0 < mate.slot < d.slot:
            continue
        if (found >= 0 and mate.slot < mates[found].slot) or not is_there(f, s, d, mate, n):
            continue
        dx, dy = place.x - slots[mate.slot].x, place.y - slots[mate.slot].y
        widest = length(lead_x, lead_y) * length(dx, dy)
        if abs(lead_x * dy - lead_y * dx) >= 2.0 * s.least_crossing * widest:
            found = j
    return found


@compiled
def on_leader(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    slots: Records,
    own: int,
    x: float,
    y: float,
    body: Record,
) -> tuple[float, float]:
    """Return the velocity (m/s) wanted of a follower's control point, by l-φ on the leader.

    Or by l-l on the leader and one more, where that is the law and there is such a one.
    """
    leader, place = mates[d.leader], slots[d.slot]
    _, _, place_x, place_y, speed = place_on(f, s, d, leader, place, slots[0])
    dx, dy = place_x - x, place_y - y
    d.error = length(dx, dy)
    if d.error > s.far:
        vx, vy = speed * float(leader.heading_cos), speed * float(leader.heading_sin)
        return approach_velocity(dx, dy, vx, vy, s.gain, body.max_speed, body.acceleration)
    l_i, a, b, angle, wanted = demand_on(f, s, d, leader, place, slots[0], x, y, body)
    second = second_of(f, s, d, mates, slots, own) if s.follower_law == L_L else -1
    if second < 0:
        c, sn = math.cos(angle), math.sin(angle)
        return a * c - b * sn, a * sn + b * c
    mate = mates[second]
    l_k, a_k, b_k, angle_k, wanted_k = demand_on(f, s, d, mate, place, slots[mate.slot], x, y, body)
    # With directions of the common frame for γ, and d = 1, it gives the control point's velocity.
    return l_l_control(
        l_i, a, b, angle, l_k, a_k, b_k, angle_k, wanted_k - wanted, s.least_crossing, 1.0
    )


@compiled
def wanted_velocity(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    slots: Records,
    own: int,
    wanted_range: float,
    x: float,
    y: float,
    body: Record,
) -> tuple[float, float]:
    """Return the velocity (m/s) of a tracker that knows where the target is."""
    n = len(slots)
    if s.guidance == PNGL:
        constant = 1.0 + s.spread * (2.0 * own / (n - 1) - 1.0 if n > 1 else 0.0)
        return in_pursuit(s, d, constant, wanted_range, x, y, body)
    if d.age > d.usual_age + s.close_in_after and f.sight < _FAR_SIGHT:
        place_x, place_y, _, _ = slot_place(d, slots[d.slot])
        d.error = length(place_x - x, place_y - y)
        return hunt(s, d, n, x, y, body)
    if s.model == CENTRALIZED and d.leader >= 0:
        if d.leader == own:
            if s.leader_law == BY_SLOT:
                return on_target(s, d, slots, x, y, body)
            wanted_range = length(slots[0].x, slots[0].y)
            return in_pursuit(s, d, 1.0, wanted_range, x, y, body)
        leader = mates[d.leader]
        if is_there(f, s, d, leader, n) or (s.exchange == 0 and leader.step >= 0):
            return on_leader(f, s, d, mates, slots, own, x, y, body)
    return on_target(s, d, slots, x, y, body)
