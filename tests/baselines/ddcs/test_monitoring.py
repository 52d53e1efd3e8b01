"""Monitoring and detours."""

import math
from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import PolicyError, begin, load, play, rollout
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.laws.safeguard import DISC, put_disc, turn_past


def test_late_fixes_are_extrapolated_to_the_present() -> None:
    settings: dict[str, Any] = {"radio_delay": 8, "sensing_range": 2.5, "start_distance": (2.0, 3.0)}
    batch = posse.batch("accelerating", 20, message_size=5, autoreset="disabled", split="train", **settings)
    played = rollout(batch, load("ddcs-distributed"), ["observations", "annotations", "target_pose"], steps=150)
    v, late = batch.layout.views(played["observations"][:-1]), slice(51, None)
    counts = (v["target_age"] > 0.5) & (v["target_age"] < 1.5)
    position, heading, bearing = (v[name] @ [1, 1j] for name in ("position", "heading", "target_bearing"))
    target = played["target_pose"][:-1, :, None, :2] @ [1, 1j]
    estimated = np.abs(played["annotation/estimate"][..., :2] @ [1, 1j] - target)[late][counts[late]]
    fixed = np.abs(position + v["target_range"] * bearing * heading - target)[late][counts[late]]
    assert fixed.size > 100
    assert estimated.mean() < 0.3 * fixed.mean()


def test_claims_that_name_no_robot_or_slot_of_the_team_are_none() -> None:
    policy, batch = load("pngl-l-phi"), posse.batch(message_size=5)
    observations = batch.reset()
    batch.layout.views(observations)["neighbour_message"][...] = 0.6
    _, memory = policy.act(observations, begin(policy, batch))
    assert memory.mates["leader"].max() == memory.mates["slot"].max() == -1


@pytest.mark.parametrize("field", ["number", "neighbour_number"])
def test_numbers_of_no_tracker_are_refused(field: str) -> None:
    policy, batch = load("ddcs-distributed"), posse.batch(message_size=5)
    batch.layout.views(observations := batch.reset())[field][...] = 7.0
    with pytest.raises(ValueError, match="observations that are no scenario's"):
        policy.act(observations, begin(policy, batch))


def test_delays_that_are_not_foreseen_are_refused() -> None:
    policy = load("pngl")
    begin(policy, posse.batch(message_size=5, command_delay=10))
    with pytest.raises(PolicyError, match="command_delay=11, but at most 10"):
        begin(policy, posse.batch(message_size=5, command_delay=11))


@pytest.mark.parametrize(("name", "least"), [("ddcs-distributed", 0.8), ("learned-smart", 0.68)])
def test_unequal_robots_agree_on_the_turn_of_the_slots(name: str, least: float) -> None:
    """The slowest one limits it; at the own speed of the others it would be six times as fast."""
    batch = posse.batch("accelerating", 40, message_size=5, tracker_speed=(0.7, 1.5, 1.5, 1.5, 1.5))
    assert play(batch, load(name))["score"].mean() > least


def test_noise_of_the_headings_is_filtered() -> None:
    noise, errors = 0.1, {}
    for trust in (1.0, 0.1):
        policy = DDCS(FAMILY["ddcs-distributed"]).with_settings(heading_trust=trust)
        batch = posse.batch("smart", 20, message_size=5, autoreset="disabled", split="train", heading_noise=noise)
        played = rollout(batch, policy, ["annotations", "target_pose"], steps=120)
        wrong = played["annotation/estimate"][61:, ..., 2] - played["target_pose"][61:-1, :, None, 2]
        errors[trust] = np.std(np.angle(np.exp(1j * wrong)))
    assert errors[1.0] == pytest.approx(noise, rel=0.1, abs=0.005)
    assert errors[0.1] <= 0.5 * noise


CLEARANCE = 0.2


def turn(discs: list[tuple[float, float, float]], side: float, speed: float = 0.0) -> float:
    """The turn of a robot that heads along the x-axis, past discs (x, y, reach)."""
    records, count = np.zeros(8, DISC), 0
    for x, y, reach in discs:
        count = put_disc(records, count, complex(x, y), complex(speed), reach, 0.1)
    return float(turn_past(records[:count], CLEARANCE, 1 + 0j, side))


@pytest.mark.parametrize("y", [-0.3, 0.0, 0.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_way_past_a_disc_is_its_tangent(y: float, side: float) -> None:
    x, reach = 1.7, 0.6
    angle = turn([(x, y, reach)], side)
    miss = x * math.sin(angle) - y * math.cos(angle)  # by which the line in that direction passes the centre
    assert side * miss == pytest.approx(reach + CLEARANCE)
    assert abs(angle) < math.pi / 2


def test_what_is_not_in_the_way_is_passed_straight() -> None:
    assert turn([(1.0, 0.9, 0.6), (-0.5, 0.0, 0.4)], 1.0) == 0.0  # beside and behind
    assert turn([(1.0, 0.0, 0.6)], 1.0, speed=0.1) == 0.0  # it moves: left to the safeguard
    assert turn([(1001.0, 0.0, 1000.0)], 1.0) == 0.0  # a wall
