"""Formation control against closed forms, and against motion recomputed here in plain Python."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse_baselines.laws import formation_control as control
from posse_baselines.laws import guidance

if TYPE_CHECKING:
    from collections.abc import Callable

PROPERTY = settings(derandomize=True, database=None, deadline=None, max_examples=100)
ANGLES = st.floats(-math.pi, math.pi)
OFFSET = 0.2
ALPHA_1, ALPHA_2 = 1.0, 1.5

Pose = tuple[complex, float]
"""A position in the complex plane (m) and a heading (rad), which is not wrapped."""

Motion = tuple[tuple[float, float], tuple[float, float]]
"""A leader's (speed, turn rate) before and after CHANGE."""

CHANGE = 0.5

MOTIONS: dict[str, Motion] = {
    "straight": ((0.6, 0.0), (0.6, 0.0)),
    "turns": ((0.6, 0.5), (0.6, 0.5)),
    "turns on the spot": ((0.0, -0.6), (0.0, -0.6)),
    "starts": ((0.0, 0.0), (0.6, 0.0)),
    "stops": ((0.6, 0.3), (0.0, 0.0)),
    "rests": ((0.0, 0.0), (0.0, 0.0)),
}


def move(pose: Pose, speed: float, omega: float, dt: float) -> Pose:
    """Follow a circular arc: its chord has the direction of the heading at half the turn."""
    position, theta = pose
    half = omega * dt / 2
    chord = speed * dt * (math.sin(half) / half if half else 1.0)
    return position + cmath.rect(chord, theta + half), theta + omega * dt


def short_way(angle: float) -> float:
    return cmath.phase(cmath.exp(1j * angle))


def point_of(follower: Pose) -> complex:
    return follower[0] + cmath.rect(OFFSET, follower[1])


def measure(leader: Pose, follower: Pose) -> tuple[float, float, float]:
    """Return l, phi and gamma."""
    distance, angle = cmath.polar(point_of(follower) - leader[0])
    return distance, short_way(angle - leader[1]), short_way(angle - follower[1])


# --- where the follower is -----------------------------------------------------------------------


def test_separation_of_the_control_point() -> None:
    x, y = control.control_point(1.0, 2.0, math.pi / 2, 0.5)
    assert (x, y) == pytest.approx((1.0, 2.5))
    distance, phi = control.separation(3.0, 2.5, math.pi / 2, x, y)
    assert (distance, phi) == pytest.approx((2.0, math.pi / 2))


@PROPERTY
@given(
    st.floats(0.5, 4.0),
    ANGLES,
    ANGLES,
    st.floats(0.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(-1.0, 1.0),
    st.floats(-2.0, 2.0),
)
def test_separation_rates_are_derivatives(
    distance: float,
    phi: float,
    theta: float,
    leader_speed: float,
    leader_omega: float,
    speed: float,
    omega: float,
) -> None:
    leader: Pose = (0j, 0.4)
    point = cmath.rect(distance, leader[1] + phi)
    follower: Pose = (point - cmath.rect(OFFSET, theta), theta)
    step = 1e-5
    after, before = (
        measure(move(leader, leader_speed, leader_omega, dt), move(follower, speed, omega, dt))
        for dt in (step, -step)
    )
    gamma = leader[1] + phi - theta
    assert control.separation_rates(
        distance, phi, gamma, leader_speed, leader_omega, speed, omega, OFFSET
    ) == pytest.approx(
        ((after[0] - before[0]) / (2 * step), short_way(after[1] - before[1]) / (2 * step)),
        abs=1e-7,
    )


@PROPERTY
@given(st.floats(0.5, 4.0), ANGLES, ANGLES)
def test_slot_and_control_point_convert_both_ways(
    distance: float, bearing: float, heading: float
) -> None:
    l_d, phi_d = control.slot_to_control_point(distance, bearing, heading, OFFSET)
    assert cmath.rect(l_d, phi_d) == pytest.approx(
        cmath.rect(distance, bearing) + cmath.rect(OFFSET, heading)
    )
    back = control.control_point_to_slot(l_d, phi_d, heading, OFFSET)
    assert cmath.rect(*back) == pytest.approx(cmath.rect(distance, bearing))


def test_slot_heading_is_tangent_to_the_slots_path() -> None:
    leader: Pose = (1.0 + 2.0j, 0.7)
    distance, bearing = 1.5, 2.4

    def slot(dt: float) -> complex:
        position, theta = move(leader, 0.6, 0.4, dt)
        return position + cmath.rect(distance, theta + bearing)

    tangent = cmath.phase(slot(1e-5) - slot(-1e-5)) - leader[1]
    assert control.slot_heading(distance, bearing, 0.6, 0.4) == pytest.approx(tangent, abs=1e-8)
    assert control.slot_heading(distance, bearing, 0.6, 0.0) == 0.0
    assert control.slot_heading(distance, bearing, 0.0, 0.0) == 0.0


# --- l-phi ---------------------------------------------------------------------------------------


def follow(
    motion: Motion, theta: float, l_d: float, phi_d: float, dt: float
) -> tuple[float, set[bool]]:
    """Return the largest departure from exponential decay in 2 s, and the signs of cos gamma."""
    leader: Pose = (0j, 0.3)
    first = (0.5, -0.8)
    point = cmath.rect(l_d + first[0], leader[1] + phi_d + first[1])
    follower: Pose = (point - cmath.rect(OFFSET, theta), theta)
    worst, ahead = 0.0, set()
    for step in range(round(2.0 / dt) + 1):
        time = step * dt
        l_now, phi, gamma = measure(leader, follower)
        ahead.add(math.cos(gamma) > 0)
        worst = max(
            worst,
            abs(l_now - l_d - first[0] * math.exp(-ALPHA_1 * time)),
            abs(short_way(phi - phi_d) - first[1] * math.exp(-ALPHA_2 * time)),
        )
        speed, omega = motion[step >= round(CHANGE / dt)]
        demand = control.l_phi_demand(l_now, phi, l_d, phi_d, speed, omega, ALPHA_1, ALPHA_2)
        command = control.l_phi_control(*demand, gamma, OFFSET)
        leader = move(leader, speed, omega, dt)
        follower = move(follower, *command, dt)
    return worst, ahead


@pytest.mark.parametrize("theta", [0.3, 1.9, -2.2])
@pytest.mark.parametrize("phi_d", [math.pi, 2.3, -2.0])
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_l_phi_errors_decay_exponentially_as_the_step_shrinks(
    motion: Motion, phi_d: float, theta: float
) -> None:
    coarse, fine = (follow(motion, theta, 1.2, phi_d, dt)[0] for dt in (0.005, 0.0025))
    assert fine < 0.02
    assert coarse / fine == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(("phi_d", "theta"), [(2.3, 1.8), (-2.3, -1.9)])
def test_l_phi_passes_gamma_of_a_right_angle(phi_d: float, theta: float) -> None:
    worst, ahead = follow(MOTIONS["straight"], theta, 1.2, phi_d, 0.0025)
    assert ahead == {True, False}
    assert worst < 0.02


@PROPERTY
@given(
    st.floats(0.3, 4.0),
    ANGLES,
    ANGLES,
    st.floats(0.5, 2.0),
    ANGLES,
    st.floats(0.0, 1.0),
    st.floats(-1.0, 1.0),
)
def test_l_phi_gives_the_wanted_rates_at_every_angle(
    l_now: float,
    phi: float,
    gamma: float,
    l_d: float,
    phi_d: float,
    leader_speed: float,
    leader_omega: float,
) -> None:
    demand = control.l_phi_demand(
        l_now, phi, l_d, phi_d, leader_speed, leader_omega, ALPHA_1, ALPHA_2
    )
    speed, omega = control.l_phi_control(*demand, gamma, OFFSET)
    l_rate = speed * math.cos(gamma) + OFFSET * omega * math.sin(gamma)
    l_rate -= leader_speed * math.cos(phi)
    phi_rate = -speed * math.sin(gamma) + OFFSET * omega * math.cos(gamma)
    phi_rate = (phi_rate + leader_speed * math.sin(phi)) / l_now - leader_omega
    assert l_rate == pytest.approx(ALPHA_1 * (l_d - l_now), abs=1e-9)
    assert phi_rate == pytest.approx(ALPHA_2 * guidance.wrap(phi_d - phi), abs=1e-9)


# --- a robot with limits -------------------------------------------------------------------------


@PROPERTY
@given(st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_limits_hold_and_reversing_becomes_a_turn(speed: float, omega: float) -> None:
    limited = control.limit_command(speed, omega, OFFSET, 1.0, 2.0)
    assert 0.0 <= limited[0] <= 1.0
    assert abs(limited[1]) <= 2.0
    if speed >= 0.0:
        assert limited == pytest.approx((np.clip(speed, 0, 1), np.clip(omega, -2, 2)))
    else:
        wanted = math.hypot(speed, omega * OFFSET) / OFFSET
        assert limited[0] == 0.0
        assert abs(limited[1]) == pytest.approx(min(wanted, 2.0))
        assert limited[1] * omega >= 0.0


@pytest.mark.parametrize("theta", [-2.9, -1.5, 0.0, 1.5, 3.0])
@pytest.mark.parametrize("start", [3.0 + 3.0j, -4.0 + 1.0j, 1.0 - 2.0j])
@pytest.mark.parametrize("turn", [0.0, 0.1])
def test_limited_follower_reaches_its_slot(turn: float, start: complex, theta: float) -> None:
    distance, bearing, dt = 1.2, math.pi * 3 / 4, 0.1
    leader: Pose = (0j, 0.0)
    follower: Pose = (start, theta)
    heading = control.slot_heading(distance, bearing, 0.6, turn)
    l_d, phi_d = control.slot_to_control_point(distance, bearing, heading, OFFSET)
    for _ in range(600):
        l_now, phi, gamma = measure(leader, follower)
        demand = control.l_phi_demand(l_now, phi, l_d, phi_d, 0.6, turn, 1.0, 1.0)
        command = control.l_phi_control(*demand, gamma, OFFSET)
        command = control.limit_command(*command, OFFSET, 1.0, 2.0)
        leader = move(leader, 0.6, turn, dt)
        follower = move(follower, *command, dt)
    slot = leader[0] + cmath.rect(distance, leader[1] + bearing)
    assert abs(slot - follower[0]) < 0.02
    assert short_way(follower[1] - leader[1] - heading) == pytest.approx(0.0, abs=0.02)


# --- l-l -----------------------------------------------------------------------------------------

LEADERS = (0j, -1.0 + 1.0j)
PLACE = -1.5 - 0.8j
"""The wanted place of the control point, in the frame of the first leader."""


def wanted_of(leader: complex) -> tuple[float, float]:
    return cmath.polar(PLACE - leader)


def l_l_command(
    leaders: list[Pose], follower: Pose, motion: tuple[float, float]
) -> tuple[float, float]:
    def seen(index: int) -> tuple[float, float, float, float]:
        l_now, phi, gamma = measure(leaders[index], follower)
        wanted = wanted_of(LEADERS[index])
        demand = control.l_phi_demand(l_now, phi, *wanted, *motion, ALPHA_1, ALPHA_2)
        return l_now, *demand, gamma

    crossing = wanted_of(LEADERS[1])[1] - wanted_of(LEADERS[0])[1]
    return control.l_l_control(*seen(0), *seen(1), crossing, 0.15, OFFSET)


def follow_two(start: complex, theta: float, dt: float, seconds: float) -> tuple[float, float]:
    """Return the largest departure of both distances from their decay, and the last misplacement.

    Both leaders go straight.
    """
    leaders: list[Pose] = [(at, 0.0) for at in LEADERS]
    follower: Pose = (start - cmath.rect(OFFSET, theta), theta)
    wanted = [wanted_of(at)[0] for at in LEADERS]
    first = [abs(start - at) - l_d for at, l_d in zip(LEADERS, wanted, strict=True)]
    worst = 0.0
    for step in range(round(seconds / dt)):
        decay = math.exp(-ALPHA_1 * step * dt)
        for leader, l_d, error in zip(leaders, wanted, first, strict=True):
            now = abs(point_of(follower) - leader[0]) - l_d
            worst = max(worst, abs(now - error * decay))
        command = l_l_command(leaders, follower, (0.6, 0.0))
        leaders = [move(leader, 0.6, 0.0, dt) for leader in leaders]
        follower = move(follower, *command, dt)
    return worst, abs(point_of(follower) - leaders[0][0] - PLACE)


@pytest.mark.parametrize("theta", [0.0, 1.5, -2.5])
@pytest.mark.parametrize("start", [-2.2 - 0.9j, -1.2 - 1.6j])
def test_l_l_distances_decay_exponentially_as_the_step_shrinks(
    start: complex, theta: float
) -> None:
    coarse, fine = (follow_two(start, theta, dt, 2.0)[0] for dt in (0.005, 0.0025))
    assert fine < 0.01
    assert coarse / fine == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(
    "start",
    [-2.0 + 2.0j, 1.0 - 1.0j, -0.5 + 0.45j, 0.4 + 2.0j],
    ids=["in line behind", "in line ahead", "between", "wrong side"],
)
def test_l_l_finds_its_place_from_where_it_is_singular_or_ambiguous(start: complex) -> None:
    assert follow_two(start, 0.2, 0.01, 12.0)[1] < 1e-3


@pytest.mark.parametrize(("start", "nearer"), [(-2.05 + 2.0j, 1), (1.0 - 1.05j, 0)])
def test_l_l_near_collinear_leaders_is_l_phi_on_the_nearer(start: complex, nearer: int) -> None:
    follower: Pose = (start, 0.4)
    leaders: list[Pose] = [(at, 0.0) for at in LEADERS]
    l_now, phi, gamma = measure(leaders[nearer], follower)
    demand = control.l_phi_demand(
        l_now, phi, *wanted_of(LEADERS[nearer]), 0.6, 0.1, ALPHA_1, ALPHA_2
    )
    assert l_l_command(leaders, follower, (0.6, 0.1)) == control.l_phi_control(
        *demand, gamma, OFFSET
    )


# --- slots on the target: what the laws ask for --------------------------------------------------


@pytest.mark.parametrize("slot_frame", [-2.0, 0.0, 3.0])
@pytest.mark.parametrize("bearing", [math.pi, 2.4, -2.4, 0.0])
def test_slot_line_of_sight_looks_at_the_target(slot_frame: float, bearing: float) -> None:
    x, y, _, _ = control.slot_motion(3.0, -1.0, 0.6, 0.5, slot_frame, 0.1, 1.5, bearing)
    _, sigma = guidance.line_of_sight(x, y, 3.0, -1.0)
    wanted = control.slot_line_of_sight(slot_frame, bearing)
    assert -math.pi < wanted <= math.pi
    assert short_way(wanted - sigma) == pytest.approx(0.0, abs=1e-12)


@PROPERTY
@given(
    st.floats(0.3, 10.0),
    ANGLES,
    ANGLES,
    st.floats(0.0, 0.9),
    st.floats(0.5, 3.0),
    ANGLES,
    st.floats(-0.2, 0.2),
)
def test_polar_law_gives_the_wanted_rates(
    r: float,
    sigma: float,
    target_theta: float,
    target_speed: float,
    wanted_range: float,
    wanted_sigma: float,
    frame_rate: float,
) -> None:
    arguments = (
        r,
        sigma,
        target_speed,
        target_theta,
        wanted_range,
        wanted_sigma,
        frame_rate,
        0.7,
        0.4,
    )
    speed, delta = control.polar_slot_velocity(*arguments, 100.0)
    gap_rate = cmath.rect(target_speed, target_theta) - cmath.rect(speed, sigma + delta)
    gap_rate /= cmath.rect(r, sigma)
    sigma_rate = frame_rate + 0.4 * min(1.0, wanted_range / r) * guidance.wrap(wanted_sigma - sigma)
    assert gap_rate.real * r == pytest.approx(0.7 * (wanted_range - r), abs=1e-9)
    assert gap_rate.imag == pytest.approx(sigma_rate, abs=1e-9)
    limited = control.polar_slot_velocity(*arguments, 1.0)
    assert limited == pytest.approx((min(speed, 1.0), delta))


def test_slot_motion_is_the_derivative_of_the_slot() -> None:
    target: Pose = (1.0 + 2.0j, 0.7)

    def place(dt: float) -> tuple[complex, complex]:
        position, theta = move(target, 0.6, 0.2, dt)
        x, y, along_x, along_y = control.slot_motion(
            position.real, position.imag, 0.6, theta, theta, 0.2, 1.5, 2.4
        )
        assert abs(complex(x, y) - position) == pytest.approx(1.5)
        assert short_way(cmath.phase(complex(x, y) - position) - theta - 2.4) == pytest.approx(0)
        return complex(x, y), complex(along_x, along_y)

    difference = (place(1e-5)[0] - place(-1e-5)[0]) / 2e-5
    assert place(0.0)[1] == pytest.approx(difference, abs=1e-8)


@PROPERTY
@given(
    st.complex_numbers(min_magnitude=0.01, max_magnitude=10.0),
    st.complex_numbers(max_magnitude=0.99),
    st.floats(0.2, 3.0),
)
def test_cartesian_law_adds_an_approach_along_the_offset(
    offset: complex, slot: complex, gain: float
) -> None:
    def velocity(max_speed: float) -> complex:
        return cmath.rect(
            *control.cartesian_slot_velocity(
                offset.real, offset.imag, slot.real, slot.imag, gain, max_speed
            )
        )

    free = slot + gain * offset
    assert velocity(100.0) == pytest.approx(free, abs=1e-9)
    limited = velocity(1.0)
    if abs(free) <= 1.0:
        assert limited == pytest.approx(free, abs=1e-9)
    else:
        share = (limited - slot) / offset
        assert abs(limited) == pytest.approx(1.0)
        assert share.imag == pytest.approx(0.0, abs=1e-9)
        assert -1e-9 <= share.real <= gain


def test_cartesian_law_at_the_slot_and_behind_a_faster_one() -> None:
    assert control.cartesian_slot_velocity(0.0, 0.0, 0.3, 0.4, 1.0, 1.0) == pytest.approx(
        (0.5, math.atan2(4, 3))
    )
    assert control.cartesian_slot_velocity(0.0, 0.0, 0.0, 0.0, 1.0, 1.0) == (0.0, 0.0)
    speed, heading = control.cartesian_slot_velocity(0.5, 0.0, 0.0, 2.0, 1.0, 1.0)
    assert (speed, heading) == pytest.approx((1.0, math.atan2(2.0, 0.5)))


@PROPERTY
@given(ANGLES, ANGLES, st.floats(0.0, 2.0), st.floats(-0.5, 0.5))
def test_drive_never_reverses_and_turns_the_short_way(
    theta: float, wanted: float, speed: float, rate: float
) -> None:
    error = short_way(wanted - theta)
    v, omega = control.drive(theta, speed, wanted, rate, 1.0, 2.0, 0.1)
    assert v == pytest.approx(np.clip(speed * math.cos(error), 0.0, 1.0), abs=1e-12)
    assert abs(omega) <= 2.0
    if 0.25 < abs(error) < math.pi - 1e-6:
        assert omega == math.copysign(2.0, error)
    elif abs(error) < 0.1:
        assert omega == pytest.approx(rate + error / 0.1, abs=1e-9)


# --- slots on the target: convergence ------------------------------------------------------------


def keep_slot(
    law: str, turn: float, start: Pose, slot: tuple[float, float], seconds: float
) -> tuple[Pose, list[float]]:
    """Return the tracker's pose in the target's frame, and its distance from its slot by time."""
    dt, target_speed = 0.1, 0.6
    target: Pose = (0j, 2.9)
    tracker = (target[0] + start[0], start[1])
    away = []
    for _ in range(round(seconds / dt)):
        frame = target[1]  # the frame keeps up with a target that turns within its limit
        gap = target[0] - tracker[0]
        if law == "polar":
            sigma = cmath.phase(gap)
            speed, delta = control.polar_slot_velocity(
                abs(gap),
                sigma,
                target_speed,
                target[1],
                slot[0],
                control.slot_line_of_sight(frame, slot[1]),
                turn,
                1.0,
                0.5,
                1.0,
            )
            heading = sigma + delta
        else:
            x, y, along_x, along_y = control.slot_motion(
                target[0].real, target[0].imag, target_speed, target[1], frame, turn, *slot
            )
            speed, heading = control.cartesian_slot_velocity(
                x - tracker[0].real, y - tracker[0].imag, along_x, along_y, 1.0, 1.0
            )
        command = control.drive(tracker[1], speed, heading, turn, 1.0, 2.0, dt)
        assert 0.0 <= command[0] <= 1.0
        assert abs(command[1]) <= 2.0
        tracker = move(tracker, *command, dt)
        target = move(target, target_speed, turn, dt)
        away.append(abs(target[0] + cmath.rect(slot[0], target[1] + slot[1]) - tracker[0]))
    return (tracker[0] - target[0], tracker[1] - target[1]), away


@pytest.mark.parametrize("law", ["polar", "cartesian"])
@pytest.mark.parametrize("turn", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("slot", [(1.0, math.pi), (2.8, 2.6), (2.8, -2.6), (1.5, 0.3)])
@pytest.mark.parametrize("start", [(6.0 + 0j, 0.0), (-5.0 + 4.0j, 1.5), (1.0 - 7.0j, -3.0)])
def test_slot_law_reaches_its_slot_and_stays(
    start: Pose, slot: tuple[float, float], turn: float, law: str
) -> None:
    pose, away = keep_slot(law, turn, start, slot, 60.0)
    assert max(away[-50:]) < 0.01
    assert short_way(pose[1] - control.slot_heading(*slot, 0.6, turn)) == pytest.approx(
        0.0, abs=0.01
    )


@pytest.mark.parametrize("start", [(6.0 + 1.0j, -2.5), (-5.0 + 4.0j, 0.0), (1.0 - 7.0j, 2.0)])
def test_cartesian_approach_to_a_steady_slot_takes_the_straight_line(start: Pose) -> None:
    slot = (1.0, math.pi)
    _, away = keep_slot("cartesian", 0.0, start, slot, 60.0)
    arrived = 0.1 * (1 + next(step for step, distance in enumerate(away) if distance < 0.8))
    # The earliest time at which a straight course at 1 m/s comes within 0.8 m of the slot. Half a
    # turn on the spot takes 1.6 s; in that time the slot moves by less than it takes 2.4 s to make
    # up at the speed difference of 0.4 m/s.
    offset = cmath.rect(slot[0], 2.9 + slot[1]) - start[0]
    earliest = next(
        time
        for time in np.arange(0.0, 60.0, 0.01)
        if abs(offset + cmath.rect(0.6, 2.9) * time) <= 0.8 + time
    )
    assert earliest <= arrived <= earliest + 4.0


# --- compilation ---------------------------------------------------------------------------------


CALLS: list[tuple[Callable[..., Any], tuple[float, ...]]] = [
    (control.control_point, (1.0, 2.0, 0.3, 0.2)),
    (control.separation, (1.0, 2.0, 0.3, -1.0, 1.0)),
    (control.separation_rates, (1.5, 2.5, 2.0, 0.6, 0.1, 0.7, -0.2, 0.2)),
    (control.slot_heading, (1.5, 2.5, 0.6, 0.1)),
    (control.slot_to_control_point, (1.5, 2.5, 0.1, 0.2)),
    (control.control_point_to_slot, (1.5, 2.5, 0.1, 0.2)),
    (control.l_phi_demand, (1.5, 2.5, 1.2, 2.2, 0.6, 0.1, 1.0, 1.5)),
    (control.l_phi_control, (0.3, -0.2, 2.0, 0.2)),
    (control.l_l_control, (1.5, 0.3, -0.2, 2.0, 1.2, 0.1, 0.2, 3.0, 1.0, 0.15, 0.2)),
    (control.l_l_control, (1.5, 0.3, -0.2, 2.0, 1.2, 0.1, 0.2, 2.1, 1.0, 0.15, 0.2)),
    (control.limit_command, (-0.3, 0.7, 0.2, 1.0, 2.0)),
    (control.slot_line_of_sight, (2.0, 2.5)),
    (control.polar_slot_velocity, (4.0, 0.3, 0.6, 0.5, 1.5, 0.4, 0.1, 1.0, 0.5, 1.0)),
    (control.slot_motion, (1.0, 2.0, 0.6, 0.5, 0.4, 0.1, 1.5, 2.5)),
    (control.cartesian_slot_velocity, (3.0, -2.0, 0.4, 0.3, 1.0, 1.0)),
    (control.drive, (0.1, 0.8, 0.2, 0.1, 1.0, 2.0, 0.1)),
]


@pytest.mark.parametrize("call", CALLS, ids=lambda call: str(call[0].__name__))
def test_compiled_and_plain_function_agree_in_both_precisions(
    call: tuple[Callable[..., Any], tuple[float, ...]],
) -> None:
    function, arguments = call
    plain = getattr(function, "py_func", function)
    expected = plain(*arguments)
    assert function(*arguments) == pytest.approx(expected, rel=1e-12)
    single = [np.float32(value) for value in arguments]
    assert function(*single) == pytest.approx(expected, rel=1e-5, abs=1e-5)
