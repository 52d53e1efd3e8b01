"""A team's settings, and the whole team at play: slots, search, obstacles, late commands, drift; what it refuses."""

import math
from typing import Any

import numpy as np
import pytest
from tests.support.drive import drive

import posse
from posse_baselines import DDCS, PolicyError, begin, load, play, rollout, tunables
from posse_baselines.ddcs import SEARCHING, Settings
from posse_baselines.ddcs.baseline import FAMILY


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"model": "central"}, "model='central' is unknown; known: distributed, centralized"),
        ({"gain": math.nan}, r"gain=nan must lie in \[0.2, 6\] 1/s"),
        ({"near": 1.5, "far": 1.2}, "near=1.5 must be below far=1.2"),
        ({"radio": "no"}, "radio='no' must be True or False"),
        ({"range_near": 1.0}, "range_near=1.0 must be below range_far=0.8"),
        ({"forbidden": ("flocking>flocking",)}, r"forbidden=\('flocking>flocking',\) must be a tuple of some of"),
        ({"forbidden": 3}, "forbidden=3 must be a tuple"),
    ],
)
def test_impossible_settings_are_refused(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Settings(**setting)


def test_a_changed_policy_is_of_the_same_kind() -> None:
    policy: Any = load("belief-planner")
    changed = policy.with_settings(near=np.float32(0.5))
    assert (type(changed), changed.settings_for(posse.get_scenario("smart")).near) == (type(policy), 0.5)
    with pytest.raises(ValueError, match=r"unknown setting 'alpha'.*did you mean 'alpha_2'"):
        policy.with_settings(alpha=1.0)
    policy = load("pngl-l-phi-tuned")
    with pytest.raises(PolicyError, match=r"settings of 'pngl-l-phi-tuned' on 'leader-loss': near=.* below far=1\.3"):
        policy.with_settings(far=1.3).settings_for(posse.get_scenario("leader-loss"))


def test_both_ends_of_each_range_can_be_played() -> None:
    batch = posse.batch("field", 2, message_size=5, horizon=40)
    for end in ("low", "high"):
        values = {t.name: getattr(t, end) for t in tunables(FAMILY["pngl-l-phi"])}
        values |= {"near": 0.1, "far": 4.0, "range_near": 0.1, "range_far": 4.0}
        assert np.isfinite(play(batch, DDCS(FAMILY["pngl-l-phi"]).with_settings(**values))["score"]).all()


@pytest.mark.parametrize("scenario", ["smart", "field"])
@pytest.mark.parametrize("name", ["pngl-l-phi", "ddcs-distributed"])
def test_small_robots_do_in_a_small_world_what_large_ones_do_in_a_large_one(scenario: str, name: str) -> None:
    policy, share = load(name), 0.4
    large = posse.get_scenario(scenario, message_size=policy.message_size)
    lengths = {k: np.asarray(v) * share for k, v in large.to_dict().items() if large.settings()[k].unit[:1] == "m"}
    small = large.replace(**{key: v.tolist() for key, v in lengths.items() if key != "odometry_drift"})
    batch = posse.batch(large, 3, seed=3)
    layout = posse.ObservationLayout(small)
    observations, memory, of_small = batch.reset(), begin(policy, batch), policy.begin(layout, 3)
    for _ in range(200):
        shrunk = observations.copy()
        for field in layout.fields:
            layout.views(shrunk)[field.name][...] *= share if field.unit in ("m", "m/s") else 1.0
        actions, memory = policy.act(observations, memory)
        same, of_small = policy.act(shrunk, of_small)
        np.testing.assert_allclose(same, actions, atol=1e-4)
        observations = batch.step(actions)[0]
    estimate, other = (policy.annotations(m)["estimate"][..., :2] for m in (memory, of_small))
    np.testing.assert_allclose(other, estimate * share, atol=1e-4)


@pytest.mark.parametrize(
    ("worlds", "settings"),
    [
        (40, {"formation": "ring", "num_trackers": 6}),
        (40, {"formation": "rows", "num_trackers": 9}),
        (40, {"radio_loss": 0.3, "radio_delay": 2}),
        (40, {"num_trackers": 8, "formation": "ring", "num_neighbours": 3}),
        # Team-mates that are no longer in the observation must not stay as obstacles where they were.
        (4, {"num_trackers": 40, "num_neighbours": 8, "formation": "rows"}),
    ],
)
def test_trackers_end_in_slots_of_their_own(worlds: int, settings: dict[str, Any]) -> None:
    batch = posse.batch("constant", worlds, split="train", message_size=5, **settings)
    metrics = play(batch, load("ddcs-distributed"))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.95
    assert metrics["score"].mean() >= 0.85 * metrics["bound"].mean()


@pytest.mark.parametrize("name", sorted({*FAMILY} - {"velocity-pursuit", "ddcs-no-radio"}))
def test_every_member_of_the_family_settles_on_a_straight_target(name: str) -> None:
    batch = posse.batch("constant", 40, split="train", message_size=5)
    metrics = play(batch, load(name))
    assert np.isfinite(metrics["settling_time"]).mean() >= 0.9
    assert (metrics["tracker_contacts"] + metrics["target_contacts"] == 0).mean() >= 0.9


@pytest.mark.parametrize("neighbours", [4, 1])
def test_obstacles_are_kept_off(neighbours: int) -> None:
    batch = posse.batch("obstacles", 60, split="train", message_size=5, num_neighbours=neighbours)
    metrics = play(batch, load("ddcs-distributed"))
    assert (metrics["obstacle_contacts"] == 0).mean() >= 0.95
    assert (metrics["tracker_contacts"] == 0).mean() >= 0.95


def test_a_rectangle_is_searched_as_fast_as_a_square_of_its_area() -> None:
    make: dict[str, Any] = {"seed": 4, "split": "train", "message_size": 5, "horizon": 300}
    batches = [posse.batch("search", 80, arena=arena, **make) for arena in (20.0, (28.0, 14.0))]
    found = [play(batch, load("ddcs-distributed"))["detection_time"] for batch in batches]
    square, rectangle = np.nan_to_num(found, nan=30.0)
    assert rectangle.max() < 30.0, "found in every world"
    assert rectangle.mean() < square.mean() + 1.0


LATE, DRIFT = {"actuator_lag": 0.5, "command_delay": 3}, {"odometry_drift": 0.05, "heading_drift": 0.01}


@pytest.mark.parametrize(("name", "fault"), [("pngl-l-phi", LATE), ("ddcs-distributed", LATE), ("pngl-l-phi", DRIFT)])
def test_late_commands_and_drifting_poses_cost_the_team_little(name: str, fault: dict[str, Any]) -> None:
    policy = load(name)
    metrics = play(posse.batch("constant", 60, split="train", message_size=policy.message_size, **fault), policy)
    assert metrics["safe_score"].mean() >= 0.75
    assert (metrics["contact_free"] == 0).mean() <= 0.02


def test_on_the_open_plane_a_lost_target_is_searched_for_where_it_was_lost() -> None:
    start: dict[str, Any] = {"tracker_pose": [(5.0, 0.0, 0.0)], "target_pose": (8.0, 0.0, 0.0), "num_trackers": 1}
    start |= {"sensor_outages": 1.0, "outage_time": 100.0, "horizon": 2000}
    run = drive("ddcs-distributed", "constant", 1, 2000, **start)
    places = np.array([now.tracker[0, 0, :2] for now in run if (now.notes["task"] == SEARCHING).all()])
    assert len(places) > 400
    assert places[0, 0] > 25.0
    assert np.hypot(*(places - places[0]).T).max() < 15.0


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


@pytest.mark.parametrize("heading", [-3.0, -2.5, 0.1])
def test_the_slots_of_equally_late_trackers_differ(heading: float) -> None:
    """In file behind the target, several assignments take the same time: all trackers choose the same."""
    batch, policy = posse.batch("constant", 1, message_size=5), load("ddcs-distributed")
    file = [(-away * math.cos(heading), -away * math.sin(heading), heading) for away in (5, 6, 7, 8, 9)]
    observations = batch.reset(options={"tracker_pose": file, "target_pose": (0.0, 0.0, heading)})
    _, memory = policy.act(observations, begin(policy, batch))
    assert sorted(policy.annotations(memory)["slot"][0]) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(("beams", "memory"), [(0, 1.0), (1, 1.0), (8, 0.1)])
def test_what_makes_no_difference(beams: int, memory: float) -> None:
    """One beam, which all team-mates explain; how long a turn rate is remembered where the target runs straight."""
    worlds = [posse.batch("constant", 40, message_size=5, target_speed=0.3, sonar_beams=count) for count in (8, beams)]
    usual, other = DDCS(FAMILY["ddcs-distributed"]), DDCS(FAMILY["ddcs-distributed"]).with_settings(turn_memory=memory)
    scores = [play(batch, team)["score"] for batch, team in zip(worlds, (usual, other), strict=True)]
    np.testing.assert_allclose(scores[0], scores[1], rtol=1e-3, atol=1e-3)


def test_delays_that_are_not_foreseen_are_refused() -> None:
    policy = load("pngl")
    begin(policy, posse.batch(message_size=5, command_delay=10))
    with pytest.raises(PolicyError, match="command_delay=11, but at most 10"):
        begin(policy, posse.batch(message_size=5, command_delay=11))


@pytest.mark.parametrize(
    ("name", "speeds", "delay"),
    [("ddcs-distributed", (0.7, 1.5), 0), ("learned-smart", (0.7, 1.5), 0), ("ddcs-distributed", (1.0, 1.0), 10)],
)
def test_the_turn_of_the_slots_is_foreseen(name: str, speeds: tuple[float, float], delay: int) -> None:
    """The slowest robot limits it; at the speed of the others it would be six times as fast. It goes on in a delay."""
    each = (speeds[0], *[speeds[1]] * 4)
    batch = posse.batch("accelerating", 40, message_size=5, tracker_speed=each, command_delay=delay)
    assert play(batch, load(name))["score"].mean() > (0.79 if name == "ddcs-distributed" else 0.68)


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
