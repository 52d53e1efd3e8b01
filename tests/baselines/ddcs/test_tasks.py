"""The four tasks and the lead: conditions of changes, behaviour, exchange by radio, and effects of leaving one out."""

from typing import Any

import numpy as np
import pytest
from tests.support.drive import Instant, complex_of, drive
from tests.support.reference.score import slots

import posse
from posse_baselines import DDCS, play
from posse_baselines.ddcs import CONVERGING, EXCHANGING, FLOCKING, SEARCHING
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.ddcs.settings import NO_EXCHANGE

NO_RETURN = ("exchange>converging", "exchange>flocking")


def metrics(name: str, scenario: str, *forbidden: str) -> dict[str, Any]:
    policy = DDCS(FAMILY[name]).with_settings(forbidden=forbidden)
    return play(posse.batch(scenario, 24, seed=3, split="train", message_size=5), policy)


def test_searching_lasts_until_the_target_is_seen_or_reported() -> None:
    begun_by_hearing = 0
    for now in drive("ddcs-distributed", "search", 40, 60, split="train"):
        knows = now.notes["estimate_age"] >= 0
        np.testing.assert_array_equal(now.notes["task"] != SEARCHING, knows)
        begun_by_hearing += (knows & (np.abs(now.line_of_sight) > 3.0)).sum()
    assert knows.any()
    assert not knows.all()
    assert begun_by_hearing > 0


def test_converging_and_flocking_change_with_hysteresis() -> None:
    settings = FAMILY["ddcs-distributed"]
    wedge = slots(posse.get_scenario("accelerating"))
    begun, before = 0, None
    for now in drive("ddcs-distributed", "accelerating", 20, 250, split="train"):
        task, slot = now.notes["task"], wedge[now.notes["slot"]]
        place = complex_of(now.target)[:, None] + slot * np.exp(1j * now.psi[:, None])
        error = np.abs(place - complex_of(now.tracker))
        assert (error[task == FLOCKING] < settings.far + 0.05).all()
        assert (error[task == CONVERGING] > settings.near - 0.05).all()
        if before is not None:
            begins = (before == CONVERGING) & (task == FLOCKING)
            assert (error[begins] < settings.near + 0.05).all()
            begun += begins.sum()
        before = task
    assert begun >= 20 * 4
    assert (task == FLOCKING).mean() > 0.95


def test_a_straggler_that_is_told_of_the_flock_speeds_up_and_heads_for_it() -> None:
    # Rule iv of section 3.5: it sees neither the target nor its place, and is told by radio.
    pose = [(-1.2, 0.0, 0.0), (-2.05, 0.85, 0.0), (-11.0, 2.0, 0.3)]
    start: dict[str, Any] = {"tracker_pose": pose, "target_pose": (0.0, 0.0, 0.0), "start_distance": (1.0, 12.0)}
    for name, task in (("pngl-l-phi", CONVERGING), ("ddcs-no-radio", SEARCHING)):
        far, speeds = [], []
        for now in drive(name, "constant", 1, 100, num_trackers=3, sensing_range=3.0, **start):
            assert now.notes["task"][0, 2] == task
            far.append(abs(now.line_of_sight[0, 2]))
            speeds.append(now.commands[0, 2, 0])
        if task == CONVERGING:
            assert min(speeds[5:]) > 0.97
            assert far[-1] < far[0] - 0.9 * 0.4 * 10.0  # it gains 0.4 m/s on the flock


def test_a_tracker_that_hears_of_another_leader_holds_the_flocks_course() -> None:
    speeds = []
    for now in drive("pngl-l-phi", "leader-loss", 20, 250, split="train", radio_delay=3):
        exchanging = (now.notes["task"] == EXCHANGING) & ~now.broken
        heading = now.tracker[..., 2] - now.target[:, None, 2]
        on_course = exchanging & (np.abs(np.angle(np.exp(1j * heading))) < 0.1)
        speeds.append(now.commands[on_course, 0])
    held = np.concatenate(speeds)
    assert len(held) > 15
    assert (np.abs(held - 0.6) < 0.02).mean() > 0.85  # the safeguard may slow some


@pytest.mark.parametrize(
    ("name", "scenario", "metric", "forbidden"),
    [
        ("ddcs-distributed", "search", "settling_time", ("searching>converging",)),
        ("pngl-l-phi", "constant", "settling_time", ("converging>flocking",)),
        ("pngl-l-phi", "leader-loss", "recovery_time", NO_EXCHANGE),
        ("pngl-l-phi", "leader-loss", "recovery_time", NO_RETURN),
    ],
)
def test_without_a_transition_the_team_fails(name: str, scenario: str, metric: str, forbidden: tuple[str, ...]) -> None:
    assert np.isfinite(metrics(name, scenario)[metric]).mean() > 0.9
    assert np.isfinite(metrics(name, scenario, *forbidden)[metric]).mean() < 0.5


def agree(now: Instant) -> Any:
    """Whether all working trackers of a world name one leader, (E,)."""
    leader = now.notes["leader"]
    low = np.where(now.broken, 10**6, leader).min(axis=1)
    high = np.where(now.broken, -(10**6), leader).max(axis=1)
    return (low == high) & (low >= 0)


def test_the_nearest_leads_from_the_first_step_on() -> None:
    before = np.ones(30, np.bool_)
    for k, now in enumerate(drive("pngl-l-phi", "constant", 30, 100, split="train")):
        agreed = agree(now)
        assert (agreed | before).all()  # a handover is heard of one step later
        before = agreed
        if k == 0:
            assert agreed.all()
            nearest = np.abs(now.line_of_sight).argmin(axis=1)
            np.testing.assert_array_equal(now.notes["leader"][:, 0], nearest)


def test_the_lead_passes_to_who_is_clearly_nearer_and_to_nobody_else() -> None:
    passed, before = 0, None
    for now in drive("pngl-l-phi", "smart", 60, 200, split="train"):
        leader, away = now.notes["leader"][:, 0], np.abs(now.line_of_sight)
        if before is not None:
            for world in np.flatnonzero((leader != before) & agree(now)):
                assert away[world, leader[world]] < away[world, before[world]] - 0.3
                passed += 1
        before = leader.copy()
    assert passed > 10


def test_a_broken_leader_is_followed_by_the_nearest_that_works() -> None:
    worlds, rows = 40, np.arange(40)
    waited, exchanging = np.zeros(worlds, np.int64), np.zeros(worlds, np.bool_)
    rank, broke_leader = np.full(worlds, -1), np.zeros(worlds, np.bool_)
    for now in drive("pngl-l-phi", "leader-loss", worlds, 299, horizon=300, split="train"):
        leader = now.notes["leader"]
        dead = now.broken[rows[:, None], np.maximum(leader, 0)] & ~now.broken
        broke_leader |= dead.any(axis=1)
        waited = np.where(dead.any(axis=1), waited + 1, 0)
        assert waited.max() <= 20
        exchanging |= broke_leader & ((now.notes["task"] == EXCHANGING) & ~now.broken).any(axis=1)
        away = np.where(now.broken, np.inf, np.abs(now.line_of_sight))
        order = away.argsort(axis=1).argsort(axis=1)
        of_working = np.where(now.broken, -1, leader).max(axis=1)
        fresh = broke_leader & ~dead.any(axis=1) & agree(now) & (rank < 0)
        rank[fresh] = order[rows, of_working][fresh]
    assert broke_leader.mean() > 0.9  # else the scenario does not break the leader
    np.testing.assert_array_equal(exchanging, broke_leader)
    assert (rank[broke_leader] == 0).mean() > 0.85  # two may be equally near
    assert (agree(now) & (waited == 0)).all()


def test_searchers_have_a_leader_and_who_hears_nobody_leads_itself() -> None:
    # Three hear each other, the lowest number leads; the fourth is out of everybody's reach.
    pose = [(-9.0, -9.0, 0.0), (-9.0, -7.0, 0.0), (-9.0, -5.0, 0.0), (9.0, -9.0, 1.0)]
    start: dict[str, Any] = {"tracker_pose": pose, "target_pose": (6.0, 6.0, 0.0), "start_distance": (4.0, 28.0)}
    for k, now in enumerate(drive("pngl-l-phi", "search", 3, 20, num_trackers=4, radio_range=6.0, **start)):
        assert (now.notes["task"] == SEARCHING).all()
        leader = now.notes["leader"]
        assert (leader[:, 3] == 3).all()
        assert k < 2 or (leader[:, :3] == 0).all()


def test_two_halves_out_of_reach_have_a_leader_each_and_agree_when_they_meet() -> None:
    # Two groups see the target from far sides; each within its own radio range only.
    left = [(-14.0, 0.0, 0.0), (-14.0, 1.0, 0.0)]
    right = [(14.0, 0.0, 3.1), (14.0, 1.0, 3.1), (14.0, -1.0, 3.1)]
    start: dict[str, Any] = {"tracker_pose": [*left, *right], "target_pose": (0.0, 0.0, 1.57), "split": "train"}
    start |= {"start_distance": (4.0, 16.0)}
    for k, now in enumerate(drive("pngl-l-phi", "constant", 6, 500, radio_range=6.0, radio_loss=0.2, **start)):
        leader = now.notes["leader"]
        if k == 30:
            assert np.isin(leader[:, :2], [0, 1]).all()
            assert np.isin(leader[:, 2:], [2, 3, 4]).all()
            assert (leader[:, :1] == leader[:, :2]).all()
            assert (leader[:, 2:3] == leader[:, 2:]).all()
    assert agree(now).all()
