"""The DDCS: tasks change when they should, all agree on who leads, slots are shared out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import posse
from posse.rules.state import slot_records
from posse.scenarios.formation import slot_offsets
from posse_baselines import begin, play
from posse_baselines.ddcs import CONVERGING, DDCS, EXCHANGING, FLOCKING, SEARCHING, Settings
from posse_baselines.ddcs.leadership import better_claim
from posse_baselines.ddcs.memory import MATE, MIND
from posse_baselines.ddcs.messages import COUNT, decode, encode, is_newer
from posse_baselines.ddcs.settings import settings_record
from posse_baselines.ddcs.tracking import on_leader
from posse_baselines.laws.offsets import offsets_of
from posse_baselines.laws.safeguard import BODY


@dataclass(frozen=True)
class Seen:
    """A step: what the team was given, and what it had in mind then."""

    views: dict[str, Any]
    notes: dict[str, Any]
    state: dict[str, Any]


def watch(
    scenario: str, worlds: int, steps: int, policy: DDCS | None = None, **settings: Any
) -> Iterator[Seen]:
    """Play ``steps`` control steps, or to the end of the episode (0)."""
    policy = policy or DDCS()
    options = settings.pop("options", None)
    batch = posse.batch(scenario, worlds, message_size=5, autoreset="disabled", **settings)
    observations, memory = batch.reset(options=options), begin(policy, batch)
    for _ in range(steps or batch.scenario.horizon):
        actions, memory = policy.act(observations, memory)
        state = {name: array.copy() for name, array in batch.state.items()}
        yield Seen(batch.layout.views(observations), policy.annotations(memory), state)
        observations, *_ = batch.step(actions)


# --- tasks ---------------------------------------------------------------------------------------


def test_searching_lasts_until_the_target_is_seen_or_reported() -> None:
    begun_by_hearing = 0
    for seen in watch("search", 40, 60, split="train"):
        knows = seen.views["target_known"] > 0
        np.testing.assert_array_equal(seen.notes["task"] != SEARCHING, knows)
        begun_by_hearing += (knows & (seen.views["target_seen"] == 0)).sum()
    assert knows.any()
    assert not knows.all()
    assert begun_by_hearing > 0


def test_converging_turns_to_flocking_near_the_place_and_back_far_from_it() -> None:
    settings = Settings()
    before = None
    changes = 0
    for seen in watch("accelerating", 20, 250, DDCS(settings), split="train"):
        task, slot = seen.notes["task"], seen.notes["slot"]
        assert not (task == SEARCHING).any()
        assert not (task == EXCHANGING).any() or seen.notes["exchanges"].any()
        x, y = slot_places(seen, slot)
        error = np.hypot(x - seen.state["tracker_x"], y - seen.state["tracker_y"])
        slack = 0.05
        assert (error[task == FLOCKING] < settings.far + slack).all()
        # Near its place a tracker flocks, unless it is being told of a new leader.
        assert (error[task == CONVERGING] > settings.near - slack).all()
        if before is not None:
            begins = (before == CONVERGING) & (task == FLOCKING)
            assert (error[begins] < settings.near + slack).all()
            changes += begins.sum()
        before = task
    assert changes >= 20 * 4
    assert (task == FLOCKING).mean() > 0.95


def slot_places(seen: Seen, slot: Any) -> tuple[Any, Any]:
    """The true places of slots (E, N) of the default wedge."""
    offsets = np.array(slot_offsets(posse.get_scenario("constant")))[slot]
    c, s = seen.state["world_frame_cos"][:, None], seen.state["world_frame_sin"][:, None]
    x = seen.state["world_x"][:, None] + offsets[..., 0] * c - offsets[..., 1] * s
    y = seen.state["world_y"][:, None] + offsets[..., 0] * s + offsets[..., 1] * c
    return x, y


def test_a_target_lost_for_too_long_is_searched_for() -> None:
    policy = DDCS(Settings(target_lost_after=3.0))
    batch = posse.batch("constant", 4, message_size=5, sensing_range=12.0)
    observations, memory = batch.reset(), begin(policy, batch)
    layout = batch.layout
    for _ in range(30):
        actions, memory = policy.act(observations, memory)
        observations, *_ = batch.step(actions)
    assert not (policy.annotations(memory)["task"] == SEARCHING).any()
    tasks = []
    for k in range(1, 41):  # from now on the fix only gets older
        views = layout.views(observations.copy())
        views["target_seen"][...] = 0.0
        views["target_age"][...] = 0.1 * k
        actions, memory = policy.act(layout.flatten(views), memory)
        tasks.append(policy.annotations(memory)["task"])
        if k == 15:
            assert (actions[:, :, 0] > -1.0).all()  # nobody waits
    assert not (np.stack(tasks[:29]) == SEARCHING).any()
    assert (np.stack(tasks[31:]) == SEARCHING).all()
    assert (policy.annotations(memory)["estimate_age"] == -1.0).all()


def test_searchers_spread_and_find_the_target() -> None:
    batch = posse.batch("search", 100, split="train", message_size=5, autoreset="disabled")
    metrics = play(batch, DDCS())
    assert np.isfinite(metrics["detection_time"]).mean() >= 0.97
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.85


# --- the lead ------------------------------------------------------------------------------------


def working(seen: Seen) -> Any:
    return seen.views["working"] > 0


def agree(seen: Seen) -> Any:
    """Whether all working trackers of a world name one leader, (E,)."""
    leader = seen.notes["leader"]
    low = np.where(working(seen), leader, 10**6).min(axis=1)
    high = np.where(working(seen), leader, -(10**6)).max(axis=1)
    return (low == high) & (low >= 0)


def test_all_agree_on_the_nearest_as_leader_from_the_start() -> None:
    before = np.ones(30, np.bool_)
    for k, seen in enumerate(watch("constant", 30, 100, split="train")):
        agreed = agree(seen)
        assert (agreed | before).all()  # a handover is heard of one step later
        before = agreed
        if k == 0:
            assert agreed.all()
            nearest = seen.views["target_range"].argmin(axis=1)
            np.testing.assert_array_equal(seen.notes["leader"][:, 0], nearest)


@pytest.mark.parametrize("model", ["distributed", "centralized"])
def test_a_broken_leader_is_replaced_by_one_that_works(model: str) -> None:
    policy = DDCS(Settings(model=model))
    exchanging = np.zeros(30, np.bool_)
    waited = np.zeros(30, np.int64)
    broke_leader = np.zeros(30, np.bool_)
    for seen in watch("leader-loss", 30, 0, policy, split="train"):
        leader = seen.notes["leader"]
        lost = seen.state["world_lost_at"] >= 0
        dead = np.take_along_axis(~working(seen), leader, axis=1) & working(seen)
        broke_leader |= dead.any(axis=1)
        # Nobody follows a broken leader for longer than it takes to be sure, and to be told.
        waited = np.where(dead.any(axis=1), waited + 1, 0)
        assert waited.max() <= 20
        exchanging |= lost & ((seen.notes["task"] == EXCHANGING) & working(seen)).any(axis=1)
    assert broke_leader.mean() > 0.9  # else the scenario does not break the leader
    np.testing.assert_array_equal(exchanging, broke_leader)
    assert (agree(seen) & (waited == 0)).all()


def test_without_exchange_the_first_leader_stays() -> None:
    policy = DDCS(Settings(model="centralized", exchange=False))
    first = None
    for seen in watch("leader-loss", 10, 0, policy, split="train"):
        first = seen.notes["leader"].copy() if first is None else first
        np.testing.assert_array_equal(seen.notes["leader"], first)
    assert (seen.notes["exchanges"] == 0).all()


def test_without_exchange_the_first_leader_is_agreed_on_over_a_lossy_radio() -> None:
    policy = DDCS(Settings(exchange=False))
    *_, seen = watch("constant", 20, 60, policy, split="train", radio_loss=0.5, radio_delay=2)
    assert agree(seen).all()


def test_two_halves_out_of_reach_have_a_leader_each_and_agree_when_they_meet() -> None:
    # Two groups see the target from far sides; each within its own radio range only.
    poses = [
        (-14.0, 0.0, 0.0),
        (-14.0, 1.0, 0.0),
        (14.0, 0.0, 3.1),
        (14.0, 1.0, 3.1),
        (14.0, -1.0, 3.1),
    ]
    apart, together = False, None
    for k, seen in enumerate(
        watch(
            "constant",
            6,
            500,
            radio_range=6.0,
            radio_loss=0.2,
            split="train",
            start_distance=(4.0, 16.0),
            options={"tracker_pose": poses, "target_pose": (0.0, 0.0, 1.57)},
        )
    ):
        leader = seen.notes["leader"]
        if k == 30:
            left = np.isin(leader[:, :2], [0, 1]).all()
            apart = bool(left and np.isin(leader[:, 2:], [2, 3, 4]).all())
            assert (leader[:, :1] == leader[:, :2]).all()
            assert (leader[:, 2:3] == leader[:, 2:]).all()
        together = agree(seen)
    assert apart
    assert together is not None
    assert together.all()


def test_a_lossy_radio_seldom_parts_the_team() -> None:
    agreed = [
        agree(seen).mean() for seen in watch("radio", 30, 300, split="train", radio_range=40.0)
    ]
    assert np.mean(agreed[20:]) > 0.9


def test_claims_are_ordered_without_a_tie() -> None:
    claims = [(term, leader) for term in (COUNT - 1, 0, 1) for leader in (-1, 0, 3)]
    for a in claims:
        for b in claims:
            if a != b and min(a[1], b[1]) >= 0:
                assert better_claim(*a, *b) != better_claim(*b, *a)
    assert better_claim(0, 4, COUNT - 1, 1)  # counts wrap round
    assert better_claim(5, 1, 5, 2)
    assert not better_claim(6, -1, 5, 2)


def test_whole_numbers_survive_the_message() -> None:
    for value in range(-1, COUNT):
        assert decode(float(np.float32(encode(value)))) == value
        assert 0.0 <= encode(value) < 1.0
    assert decode(0.0) == -1
    assert is_newer(3, COUNT - 2)
    assert not is_newer(COUNT - 2, 3)
    assert not is_newer(7, 7)


# --- slots ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"formation": "ring", "num_trackers": 6},
        {"formation": "rows", "num_trackers": 9},
        {"radio_loss": 0.3, "radio_delay": 2},
        {"num_trackers": 8, "formation": "ring", "num_neighbours": 3},
    ],
)
def test_trackers_end_in_slots_of_their_own(settings: dict[str, Any]) -> None:
    batch = posse.batch("constant", 40, split="train", message_size=5, **settings)
    metrics = play(batch, DDCS())
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.95
    assert metrics["score"].mean() >= 0.85 * metrics["bound"].mean()


def test_a_large_team_of_which_each_knows_eight_settles() -> None:
    # Team-mates that are no longer in the observation must not stay as obstacles where they were.
    batch = posse.batch(
        "constant", 20, split="validation", message_size=5, autoreset="disabled",
        num_trackers=40, num_neighbours=8, formation="rows",
    )  # fmt: skip
    metrics = play(batch, DDCS())
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.9


@pytest.mark.parametrize("guidance", ["cartesian", "polar"])
@pytest.mark.parametrize("model", ["distributed", "centralized"])
def test_every_law_settles_on_a_straight_target(guidance: str, model: str) -> None:
    policy = DDCS(Settings(guidance=guidance, model=model))
    metrics = play(posse.batch("constant", 40, split="train", message_size=5), policy)
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.95
    assert (metrics["tracker_contacts"] + metrics["target_contacts"] == 0).mean() >= 0.95


def test_pngl_spreads_bearings_by_its_constants() -> None:
    # The bearing of the tracker with constant K settles at θ_t / K, shown at θ_t = π.
    policy = DDCS(Settings(guidance="pngl"), "pngl")
    pose = [(x, y, 3.0) for x, y in ((6.0, -2.0), (6.0, -1.0), (6.0, 0.0), (6.0, 1.0), (6.0, 2.0))]
    options = {"tracker_pose": pose, "target_pose": (0.0, 0.0, 2.6)}
    *_, seen = watch("constant", 1, 500, policy, options=options, robot_radius=0.01)
    dx = seen.state["world_x"][0] - seen.state["tracker_x"][0]
    dy = seen.state["world_y"][0] - seen.state["tracker_y"][0]
    constants = 1.0 + 0.1 * np.linspace(-1, 1, 5)
    np.testing.assert_allclose(np.arctan2(dy, dx), 2.6 / constants, atol=0.05)
    np.testing.assert_allclose(np.hypot(dx, dy), 1.2, atol=0.1)


# --- l-l -----------------------------------------------------------------------------------------

L_L = Settings(model="centralized", follower_law="l-l")


def test_l_l_settles_as_often_as_l_phi() -> None:
    settled = []
    for policy in (DDCS(L_L), DDCS(L_L.replace(follower_law="l-phi"))):
        batch = posse.batch("constant", 60, split="validation", message_size=5)
        settled.append(np.isfinite(play(batch, policy)["settling_time"]).mean())
    assert settled[0] >= settled[1] - 0.05
    assert settled[0] >= 0.95


def test_l_l_drives_the_third_robot_and_those_behind_it() -> None:
    # Both laws think about what l-l does; only what they would do differs.
    policies = DDCS(L_L), DDCS(L_L.replace(follower_law="l-phi"))
    batch = posse.batch("accelerating", 10, split="validation", message_size=5)
    observations = batch.reset()
    memories = [begin(policy, batch) for policy in policies]
    differs, slots, settled = [], [], []
    for _ in range(300):
        (actions, memories[0]), (others, memories[1]) = (
            policy.act(observations, memory)
            for policy, memory in zip(policies, memories, strict=True)
        )
        np.testing.assert_array_equal(actions[..., 2:], others[..., 2:])
        notes = policies[0].annotations(memories[0])
        slots.append(notes["slot"].copy())
        settled.append((notes["task"] == FLOCKING).all(axis=1, keepdims=True) & (slots[-1] >= 0))
        differs.append((actions[..., :2] != others[..., :2]).any(axis=-1))
        observations, *_ = batch.step(actions)
    different, slot, flocking = np.array(differs), np.array(slots), np.array(settled)
    assert not different[slot < 2].any()
    assert flocking.mean() > 0.4
    for k in (2, 3, 4):
        assert different[flocking & (slot == k)].mean() > 0.95


def beside_two(at: Any, settings: Settings) -> Any:
    """What the robot of the fourth slot of a wedge, heading east at (x, y), wants of its point.

    The leader (0) stands in its place at the origin, the one of the third slot (2) in its own.
    """
    scenario = posse.get_scenario("constant")
    slots = slot_records(scenario)
    batch = posse.batch(scenario, 1, message_size=5)
    mind, mates, body = np.zeros(1, MIND)[0], np.zeros(5, MATE), np.zeros(1, BODY)[0]
    mates["step"], mates["slot"], mates["heading_cos"] = -1, -1, 1.0
    for j in (0, 2):
        mates[j]["step"], mates[j]["slot"], mates[j]["task"] = 0, j, FLOCKING
        mates[j]["x"] = slots[j]["x"] - slots[0]["x"]
        mates[j]["y"] = slots[j]["y"] - slots[0]["y"]
        mates[j]["speed_x"] = 0.6
    mind["slot"], mind["leader"], mind["task"], mind["frame_cos"] = 3, 0, FLOCKING, 1.0
    body["heading_cos"], body["max_speed"], body["acceleration"] = 1.0, 1.0, 1e4
    velocity = on_leader(
        offsets_of(batch.layout)[0], settings_record(settings)[0], mind,
        mates.view(np.recarray), slots, 3, float(at[0]), float(at[1]), body,
    )  # fmt: skip
    return np.array(velocity)


def test_under_l_l_both_distances_are_closed() -> None:
    offsets = np.array(slot_offsets(posse.get_scenario("constant")))
    two, place = offsets[2] - offsets[0], offsets[3] - offsets[0]
    assert beside_two(place, L_L) == pytest.approx((0.6, 0.0), abs=1e-6)
    away = place + np.array([0.3, 0.2])
    wanted = beside_two(away, L_L) - (0.6, 0.0)
    point = np.array([L_L.point_offset, 0.0])
    for mate in (np.zeros(2), two):
        arm = away + point - mate
        distance = np.linalg.norm(arm)
        error = distance - np.linalg.norm(place + point - mate)
        assert wanted @ arm / distance == pytest.approx(-L_L.alpha_1 * error, abs=1e-6)
    l_phi = beside_two(away, L_L.replace(follower_law="l-phi")) - (0.6, 0.0)
    assert np.hypot(*(wanted - l_phi)) > 0.02  # which closes the distance from the leader only


@pytest.mark.parametrize("share", [-0.4, -1e-9, 0.0, 1e-9, 0.5, 1.0, 1.4])
def test_under_l_l_a_follower_in_line_with_both_keeps_its_place_on_the_nearer(share: float) -> None:
    settings = L_L.replace(far=5.0)  # however far: only the law
    offsets = np.array(slot_offsets(posse.get_scenario("constant")))
    two = offsets[2] - offsets[0]
    at = share * two - (settings.point_offset, 0.0)
    wanted = beside_two(at, settings)
    l_phi = beside_two(at, settings.replace(follower_law="l-phi"))
    assert np.isfinite(wanted).all()
    if share < 0.5:
        np.testing.assert_array_equal(wanted, l_phi)
    if share > 0.5:
        assert (wanted != l_phi).any()


def test_where_all_slots_are_in_line_l_l_is_l_phi() -> None:
    # The first row of a block; the second row has the first to keep its distances from.
    policies = DDCS(L_L), DDCS(L_L.replace(follower_law="l-phi"))
    batch = posse.batch(
        "constant", 10, split="validation", message_size=5, formation="rows", num_trackers=6
    )
    observations = batch.reset()
    memories = [begin(policy, batch) for policy in policies]
    later = 0
    for _ in range(250):
        (actions, memories[0]), (others, memories[1]) = (
            policy.act(observations, memory)
            for policy, memory in zip(policies, memories, strict=True)
        )
        different = (actions != others).any(axis=-1)
        slot = policies[0].annotations(memories[0])["slot"]
        assert not different[slot < 3].any()
        later += different.sum()
        observations, *_ = batch.step(actions)
    assert later > 1000


# --- monitoring ----------------------------------------------------------------------------------


def estimate_error(seen: Seen) -> Any:
    x, y = seen.notes["estimate"][..., 0], seen.notes["estimate"][..., 1]
    return np.hypot(x - seen.state["world_x"][:, None], y - seen.state["world_y"][:, None])


def fix_error(seen: Seen) -> Any:
    """By how much the fix itself, as it was given, is off the target's present place."""
    v = seen.views
    c, s = v["heading"][..., 0], v["heading"][..., 1]
    bx, by = v["target_bearing"][..., 0], v["target_bearing"][..., 1]
    x = v["position"][..., 0] + v["target_range"] * (bx * c - by * s)
    y = v["position"][..., 1] + v["target_range"] * (bx * s + by * c)
    return np.hypot(x - seen.state["world_x"][:, None], y - seen.state["world_y"][:, None])


def test_late_fixes_are_carried_on_to_the_present() -> None:
    settings: dict[str, Any] = {
        "radio_delay": 8,
        "sensing_range": 2.5,
        "start_distance": (2.0, 3.0),
    }
    late, raw = [], []
    for k, seen in enumerate(watch("accelerating", 20, 150, split="train", **settings)):
        mask = (seen.views["target_age"] > 0.5) & (seen.views["target_age"] < 1.5)
        if k > 30:
            late.append(estimate_error(seen)[mask])
            raw.append(fix_error(seen)[mask])
    assert np.concatenate(late).size > 100
    assert np.concatenate(late).mean() < 0.3 * np.concatenate(raw).mean()


def test_noise_is_filtered() -> None:
    noise: dict[str, Any] = {"range_noise": 0.03, "bearing_noise": 0.03, "velocity_smoothing": 0.5}
    kept, raw = [], []
    for k, seen in enumerate(watch("constant", 20, 150, split="train", **noise)):
        if k > 50:
            kept.append(estimate_error(seen).mean())
            raw.append(fix_error(seen).mean())
    assert np.mean(kept) < 0.8 * np.mean(raw)


def test_without_radio_nothing_heard_has_an_effect() -> None:
    policy = DDCS(Settings(radio=False), "ddcs-no-radio")
    batch = posse.batch("field", 4, message_size=5)
    observations = batch.reset()
    plain, deaf = begin(policy, batch), begin(policy, batch)
    for _ in range(80):
        views = batch.layout.views(observations.copy())
        for name in ("neighbour_number", "neighbour_age", "neighbour_range"):
            views[name][...] = -1.0
        heard = views["target_seen"] == 0
        views["target_known"][heard] = 0.0
        actions, plain = policy.act(observations, plain)
        without, deaf = policy.act(batch.layout.flatten(views), deaf)
        np.testing.assert_array_equal(actions, without)
        observations, *_ = batch.step(actions)


# --- safeguard, settings -------------------------------------------------------------------------


def test_obstacles_are_kept_off() -> None:
    batch = posse.batch("obstacles", 60, split="train", message_size=5)
    metrics = play(batch, DDCS())
    assert (metrics["obstacle_contacts"] == 0).mean() >= 0.95
    assert (metrics["tracker_contacts"] == 0).mean() >= 0.95


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"model": "central"}, "model='central' is unknown; known: distributed, centralized"),
        ({"guidance": "pn"}, "guidance='pn' is unknown"),
        ({"gain": float("nan")}, "gain=nan must be a finite number"),
        ({"time_lag": -1.0}, "time_lag=-1.0 must be"),
        ({"near": 2.0}, "near=2.0 must be below far=1.2"),
        ({"enter_margin": 1.0}, "enter_margin=1.0 must be below"),
        ({"fix_trust": 0.0}, "fix_trust=0.0 must lie in"),
        ({"spread": 0.2}, "spread=0.2 must lie in"),
        ({"follower_law": "l-psi"}, "follower_law='l-psi' is unknown; known: l-phi, l-l"),
        ({"least_crossing": 0.5}, "least_crossing=0.5 must lie in"),
        ({"point_offset": 0.0}, "point_offset=0.0 must be above 0"),
    ],
)
def test_impossible_settings_are_refused(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Settings(**setting)
