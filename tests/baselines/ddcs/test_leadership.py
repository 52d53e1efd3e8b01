"""Selection and exchange of leaders by section 3.5, agreed on by radio."""

from typing import Any

import numpy as np
from tests.support.drive import Instant, drive

from posse_baselines.ddcs import EXCHANGING, SEARCHING


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
