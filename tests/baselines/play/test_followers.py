"""Followers of the centralized model as policies play them: l-φ and its frames."""

import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.support.drive import Instant, complex_of, drive

from posse_baselines import DDCS, Policy
from posse_baselines.ddcs import FLOCKING
from posse_baselines.ddcs.baseline import FAMILY

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
    policy = DDCS(FAMILY["pngl-l-phi" if frame == "slot-frame" else "ddcs-centralized"]).with_settings(
        follower_frame=frame
    )
    for now in team(policy, 0j, seconds=20.0, target=lambda _: (0.8, rate))[-50:]:
        place = complex_of(now.tracker)[0]
        axis = now.psi[0] if frame == "slot-frame" else now.tracker[0, 0, 2]
        assert abs((place[1] - place[0]) * cmath.exp(-1j * axis) - PLACE) < 0.01
