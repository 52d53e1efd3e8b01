"""The laws as policies execute them, against closed-form solutions: guidance of a tracker, and l-φ of a follower."""

import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.support.drive import Instant, complex_of, drive
from tests.support.reference.score import slots

from posse import get_scenario
from posse_baselines import DDCS, Policy
from posse_baselines.ddcs import CONVERGING, FLOCKING
from posse_baselines.ddcs.baseline import FAMILY

ASPECTS = np.radians([0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 175.0])
RATIOS = (1.2, 1.5, 2.0, 3.0)
START, LAST = 4.0, 0.5  # m


def exact_time(k: float, aspect: float, general: float) -> float:
    """When θ = K σ comes within LAST of a target of speed 1 / k that heads along the x-axis."""

    def rates(_: float, state: Any) -> list[float]:
        r, sigma = state
        delta = (general - 1.0) * sigma
        return [math.cos(sigma) / k - math.cos(delta), (-math.sin(sigma) / k - math.sin(delta)) / r]

    def met(_: float, state: Any) -> float:
        return float(state[0]) - LAST

    met.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rates, (0, 300), [START, -aspect], events=met, rtol=1e-9, atol=1e-11)
    return float(found.t_events[0][0])


def intercept_times(policy: Policy, k: float, dt: float, general: float) -> Any:
    """Times until the range is LAST, one for each aspect, (7,)."""
    tracker = [[(-START * math.cos(a), START * math.sin(a), -general * a)] for a in ASPECTS]
    longest = max(exact_time(k, a, general) for a in ASPECTS)
    settings: dict[str, Any] = {"control_step": dt, "physics_step": dt / 2, "target_speed": 1.0 / k, "tolerance": 0.1}
    settings |= {"tracker_pose": tracker, "target_pose": np.zeros((len(ASPECTS), 3)), "start_distance": (1.0, 10.0)}
    settings |= {"num_trackers": 1, "tracker_turn_rate": 6.0, "formation_distance": 0.35}
    seen = drive(policy, "constant", len(ASPECTS), math.ceil(1.1 * longest / dt), **settings)
    ranges = np.stack([np.abs(now.line_of_sight[:, 0]) for now in seen])
    after = (ranges <= LAST).argmax(axis=0)
    assert (after > 0).all()
    column = np.arange(len(ASPECTS))
    before = ranges[after - 1, column]
    return dt * (after - 1 + (before - LAST) / (before - ranges[after, column]))


@pytest.mark.parametrize(
    ("general", "dt", "allowed"), [(1.0, 0.1, 0.025), (1.0, 0.02, 0.004), (0.9, 0.1, 0.01), (1.1, 0.1, 0.01)]
)
def test_pursuit_and_pngl_meet_their_target_when_their_equations_say(general: float, dt: float, allowed: float) -> None:
    policy = DDCS(FAMILY["velocity-pursuit"]).with_settings(navigation_constant=general)
    counted = slice(None if general == 1.0 else -1)  # almost head-on the limit of the turn rate counts
    for k in RATIOS:
        times = intercept_times(policy, k, dt, general)
        exact = [exact_time(k, aspect, general) for aspect in ASPECTS]
        np.testing.assert_allclose(times[counted], exact[counted], rtol=allowed)


def test_a_tracker_that_keeps_its_range_goes_round_on_a_concentric_circle() -> None:
    # R_t² = R_p² + r², with R_t = 2, about (0, 2), and r = 1.2.
    start: dict[str, Any] = {"tracker_pose": [(-1.2, -1.0, 0.0)], "target_pose": (0.0, 0.0, 0.0), "num_trackers": 1}
    last = list(drive("velocity-pursuit", "constant", 1, 900, target=lambda _: (0.6, 0.3), **start))[-100:]
    radii = [abs(complex_of(now.tracker)[0, 0] - 2j) for now in last]
    np.testing.assert_allclose(radii, 1.6, rtol=0.005)
    speeds = [now.commands[0, 0, 0] for now in last]
    np.testing.assert_allclose(speeds, 0.6 * 1.6 / 2.0, rtol=0.005)


@pytest.mark.parametrize("theta", [math.pi, 0.5, -2.0])
@pytest.mark.parametrize("name", ["pngl", "deviated-pursuit"])
def test_each_tracker_holds_a_slot_of_its_own_at_any_heading(name: str, theta: float) -> None:
    # From behind the target, and apart from each other.
    rng, worlds = np.random.default_rng(5), 100
    away = rng.uniform(-4.0, -1.0, (worlds, 5)) + 1j * (np.arange(-2, 3) + rng.uniform(-0.2, 0.2, (worlds, 5)))
    turned = rng.permuted(away, axis=1) * np.exp(1j * theta)
    starts = np.stack([turned.real, turned.imag, rng.uniform(-math.pi, math.pi, (worlds, 5))], axis=-1)
    start: dict[str, Any] = {"tracker_pose": starts, "target_pose": np.tile([0.0, 0.0, theta], (worlds, 1))}
    seen = list(drive(name, "paper-distributed", worlds, 250, start_distance=(0.5, 6.0), **start))
    relative = np.stack([-now.line_of_sight for now in seen])
    settled = np.abs(relative[200:] - relative[-1]).max(axis=(0, 2)) < 0.1
    assert settled.all()
    # Where they end: the five slots of the wedge, one each.
    places = relative[-1] * np.exp(-1j * theta)
    distance = np.abs(places[:, :, None] - slots(get_scenario("paper-distributed")))
    assert distance.min(axis=1).max() < 0.05
    assert (np.sort(distance.argmin(axis=2), axis=1) == np.arange(5)).all()


def test_chase_and_maintenance_change_with_hysteresis() -> None:
    # One that comes from afar chases until it is 0.15 m too far; one in place that has to turn
    # round first is left behind by up to 0.8 m, and does not chase.
    between: list[set[int]] = []
    for pose in ((-2.4, 0.0, 0.0), (-1.2, 0.0, 2.5)):
        tasks = set()
        start: dict[str, Any] = {"tracker_pose": [pose], "target_pose": (0.0, 0.0, 0.0), "num_trackers": 1}
        for now in drive("velocity-pursuit", "constant", 1, 60, target_speed=0.5, **start):
            excess, task = abs(now.line_of_sight[0, 0]) - 1.2, int(now.notes["task"][0, 0])
            if excess < 0.15:
                assert task == FLOCKING
            elif excess > 0.8:
                assert task == CONVERGING
            elif 0.2 < excess < 0.75:
                tasks.add(task)
        between.append(tasks)
    assert between == [{CONVERGING}, {FLOCKING}]


OFFSET = 0.15  # m, of the control point
ALPHA = 2.0  # 1/s
LIMITS: dict[str, Any] = {
    "tracker_speed": 2.0,
    "tracker_turn_rate": 10.0,
    "target_speed": 1.2,
    "start_distance": (0.5, 6.0),
    "target_pose": (0.0, 0.0, 0.0),
}
"""Wide enough to avoid limits. In the first step, 0.6 of the own speed is expected of others."""
WING = 1.2 * math.sqrt(0.5)
PLACE = complex(-WING, WING)
"""Of the second slot of the wedge, from the first, in the frame of the formation."""


def team(
    policy: str | Policy,
    *errors: complex,
    dt: float = 0.1,
    seconds: float = 3.0,
    target: Callable[[float], tuple[float, float]] = lambda _: (1.2, 0.0),
) -> list[Instant]:
    """A leader in its slot of a wedge, and one or two followers that are ``errors`` (m) off theirs."""
    slots = (-1.2 + 0j, -1.2 + PLACE, -1.2 + PLACE.conjugate())
    places = [slot + error for slot, error in zip(slots, (0j, *errors), strict=False)]
    settings = {**LIMITS, "control_step": dt, "physics_step": dt / 2, "num_trackers": len(places)}
    settings["tracker_pose"] = [(z.real, z.imag, 0.0) for z in places]
    return list(drive(policy, "constant", 1, round(seconds / dt), target=target, **settings))


@pytest.mark.parametrize(("dt", "allowed"), [(0.1, 0.02), (0.02, 0.004)])
@pytest.mark.parametrize("frame", ["leader", "slot-frame"])
def test_l_decays_as_the_exponential_says(frame: str, dt: float, allowed: float) -> None:
    wanted = PLACE + OFFSET
    for error in (0.3 + 0.2j, -0.3 + 0.2j, -0.3j, -0.4 + 0j, 0.2 + 0.3j):
        seen = team(DDCS(FAMILY["pngl-l-phi"]).with_settings(follower_frame=frame), error, dt=dt)
        assert all((now.notes["task"] == FLOCKING).all() for now in seen)
        # The follower's control point as seen from the leader.
        points = [complex_of(now.tracker)[0] + (0, OFFSET * cmath.exp(1j * now.tracker[0, 1, 2])) for now in seen]
        arm = np.diff(points)[:, 0]
        decay = np.exp(-ALPHA * np.array([now.time for now in seen]))
        off = np.abs(arm) - abs(wanted)
        np.testing.assert_allclose(off, off[0] * decay, atol=allowed)
        turned = np.angle(arm / wanted)
        np.testing.assert_allclose(turned, turned[0] * decay, atol=allowed)


@pytest.mark.parametrize(("frame", "rate"), [("leader", 0.25), ("slot-frame", 0.15)])
def test_phi_is_kept_from_the_leader_s_heading_or_the_slot_frame_while_it_turns(frame: str, rate: float) -> None:
    # Figure 6: on a circle the formation turns with its frame, and the follower's centre keeps to its place in it.
    family = FAMILY["pngl-l-phi" if frame == "slot-frame" else "ddcs-centralized"]
    policy = DDCS(family).with_settings(follower_frame=frame)
    for now in team(policy, 0j, seconds=20.0, target=lambda _: (0.8, rate))[-50:]:
        place = complex_of(now.tracker)[0]
        axis = now.psi[0] if frame == "slot-frame" else now.tracker[0, 0, 2]
        assert abs((place[1] - place[0]) * cmath.exp(-1j * axis) - PLACE) < 0.01
