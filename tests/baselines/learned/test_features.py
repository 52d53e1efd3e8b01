"""What networks read and answer: encodings by name, features of the state, the numbers, corrections of an adviser."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.learned import network_for, observations_of, policy_for
from tests.support.reference.state import directions, points

import posse
from posse.numeric import FloatArray
from posse_baselines import DDCS, PolicyError, play, rollout
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.learned import Encoder, Encoding, LearnedPolicy, Network
from posse_baselines.learned.features import FEATURES
from posse_baselines.learned.network import LIMIT
from posse_baselines.safeguard import Guard


def test_names_are_those_of_views() -> None:
    batch, observations = observations_of("radio")
    encoding = Encoding.of(batch.layout, neighbours=3)  # of five: the nearest
    views, rows = batch.layout.views(observations), Encoder(encoding, batch.layout, 6).encode(observations)
    for name, column in zip(encoding.names(), rows.T, strict=True):
        field, _, at = name.rstrip("]").partition("[")
        index = tuple(int(i) for i in at.split(", ") if i)
        np.testing.assert_array_equal(views[field][(..., *index)].ravel(), column)


def test_longer_messages_than_it_uses_change_nothing() -> None:
    small, observations = observations_of("smart", steps=0)
    policy = policy_for(small.layout)
    large, more = observations_of("smart", steps=0, message_size=2)
    mine, _ = policy.act(observations, policy.begin(small.layout, 6))
    theirs, _ = policy.act(more, policy.begin(large.layout, 6))
    np.testing.assert_array_equal(theirs[:, :, :2], mine)
    assert not theirs[:, :, 2:].any()


def test_places_that_a_small_team_lacks_are_unknown() -> None:
    full, batch = posse.batch("smart").layout, posse.batch("smart", num_trackers=2)
    rows = Encoder(Encoding.of(full), batch.layout, batch.num_worlds).encode(batch.reset())
    named = full.views(rows)
    np.testing.assert_array_equal(named["neighbour_range"][:, 1:], -1)
    np.testing.assert_array_equal(named["neighbour_bearing"][:, 1:], 0)
    assert (named["neighbour_range"][:, 0] > 0).all()


def ways_to_slots(batch: posse.Batch) -> npt.NDArray[np.complex128]:
    """The way from each tracker to each slot in its own axes, (E, N, N)."""
    frame = points(batch, "world", "frame_cos", "frame_sin")
    places = points(batch, "world")[:, None] + np.array(batch.scenario.slot_offsets) @ [1, 1j] * frame[:, None]
    ways = (places[:, None] - points(batch, "tracker")[..., None]) / directions(batch, "tracker")[..., None]
    return np.asarray(ways)


def features_of(batch: posse.Batch, observations: FloatArray) -> npt.NDArray[np.void]:
    """The features of the encoding features, records (E, N)."""
    encoding = Encoding.of(batch.layout, "features")
    rows = Encoder(encoding, batch.layout, batch.num_worlds).encode(observations)[:, : encoding.num_features]
    return np.ascontiguousarray(rows).view(FEATURES).reshape(observations.shape[:2])


def away_from_slots(batch: posse.Batch, features: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
    """How far each slot is from the place that each tracker takes for its own slot, (E, N, N)."""
    soft = features["slot_far"]  # its length is d / (d + 3)
    return np.asarray(np.abs(ways_to_slots(batch) - (3.0 * soft / (1 - np.abs(soft)))[..., None]))


@pytest.mark.parametrize("silent", [False, True])
def test_own_slot_is_where_the_state_says(silent: bool) -> None:
    batch, observations = observations_of("constant", worlds=8, steps=30)
    views = batch.layout.views(observations)
    if silent:
        views["neighbour_age"][views["neighbour_number"] == 4] = 1.1
    away = away_from_slots(batch, features_of(batch, observations))
    chosen = away.argmin(axis=2)
    np.testing.assert_allclose(away.min(axis=2), 0, atol=0.02)
    # With a perfect radio all compute the same assignment.
    heard = 4 if silent else 5
    assert all(len(set(row[:heard])) == heard for row in chosen)


def test_where_poses_drift_robots_agree_on_slots_by_what_the_safeguard_measured() -> None:
    batch = posse.batch("constant", 40, odometry_drift=0.4, heading_drift=0.06, message_size=5)
    encoder = Encoder(Encoding("features", 0, ()), batch.layout, 40)
    guard, observations = Guard(batch.layout, 40), batch.reset()
    for _ in range(90):
        observations, *_ = batch.step(guard.actions(observations, np.zeros((40, 5, 2))))
    rows = [encoder.encode(observations, minds) for minds in (guard, None)]
    chosen = [away_from_slots(batch, each.view(FEATURES).reshape(40, 5)).argmin(axis=2) for each in rows]
    agree = [np.mean([len(set(slots)) == 5 for slots in each]) for each in chosen]
    assert agree[0] > 0.8 > 0.6 > agree[1]


def test_slots_go_on_turning_after_the_fix() -> None:
    """The slot frame is behind the heading of a target that drives straight on; the robots rest."""
    batch = posse.batch("constant", 8)
    batch.reset()
    frame = points(batch, "world", "heading_cos", "heading_sin") * np.exp(0.5j)
    batch.arrays.world["frame_cos"], batch.arrays.world["frame_sin"] = frame.real, frame.imag
    rest = np.full(batch.action_shape, (-1.0, 0.0))
    for _ in range(2):  # from two fixes follows a velocity
        observations, *_ = batch.step(rest)
    for _ in range(15):
        before = ways_to_slots(batch)
        batch.step(rest)
    after = ways_to_slots(batch)
    batch.layout.views(observations)["target_age"][...] = 15 * batch.scenario.control_step
    features = features_of(batch, observations)
    away = away_from_slots(batch, features)
    np.testing.assert_allclose(away.min(axis=2), 0, atol=0.01)
    mine = np.take_along_axis(np.stack([before, after]), away.argmin(axis=2)[None, ..., None], axis=-1)[..., 0]
    wish = (mine[1] - mine[0]) / batch.scenario.control_step + 0.8 * mine[1]  # with the law's gain, 1/s
    np.testing.assert_allclose(features["law_direction"], wish / np.abs(wish), atol=0.01)


@pytest.mark.parametrize(("side", "inside"), [(1, {0, 1, 2, 4}), (-1, {0, 1, 2, 3})])
def test_four_robots_leave_the_slot_in_a_wall(side: int, inside: set[int]) -> None:
    batch = posse.batch("search", start_distance=(1.0, 20.0), target_motion="constant")
    poses = [(x, side * 9.4, 0.0) for x in (-3.0, -2.4, -1.8, -1.2, -0.6)]  # nearest to that slot
    batch.reset(options={"tracker_pose": poses, "target_pose": [0.0, side * 8.6, 0.0]})
    observations, *_ = batch.step(np.full(batch.action_shape, (-1.0, 0.0)))
    views = batch.layout.views(observations)
    views["neighbour_age"][views["neighbour_number"] == 4] = 1.1
    away = away_from_slots(batch, features_of(batch, observations))[0, :4]
    np.testing.assert_allclose(away.min(axis=1), 0, atol=0.05)
    assert set(away.argmin(axis=1)) == inside


def slots_without_the_first_robot(**overrides: Any) -> list[int]:
    """The slots that robots in the slots 1 to 4 choose, when number 0, far away, has been silent for 1.1 s."""
    batch = posse.batch("constant", **overrides)
    places = [(5.0, 0.0), *batch.scenario.slot_offsets[1:]]
    batch.reset(options={"tracker_pose": [(*p, 0.0) for p in places], "target_pose": [0.0, 0.0, 0.0]})
    observations, *_ = batch.step(np.full(batch.action_shape, (-1.0, 0.0)))
    views = batch.layout.views(observations)
    views["neighbour_age"][views["neighbour_number"] == 0] = 1.1
    away = away_from_slots(batch, features_of(batch, observations))
    return [int(k) for k in away[0, 1:].argmin(axis=1)]


def test_the_first_slot_is_filled_where_the_target_is_not_in_sight_from_all() -> None:
    assert slots_without_the_first_robot() == [1, 2, 3, 4]
    assert 0 in slots_without_the_first_robot(sensing_range=3.0)  # the outer slots are 3.4 m away
    # Where radios fail, silence does not mean that it is broken: its slot stays its own.
    assert slots_without_the_first_robot(sensing_range=3.0, radio_outages=1e-9) == [1, 2, 3, 4]


def test_noisy_fixes_are_averaged_while_robots_drive() -> None:
    """A share of 1/4 leaves sqrt(1/7) of the deviation of white noise; the target drives straight on."""
    batch = posse.batch("constant", 40, seed=1, range_noise=0.02, bearing_noise=0.02)
    encoder = Encoder(Encoding.of(batch.layout, "features"), batch.layout, 40)
    observations = batch.reset()
    for _ in range(40):
        rows = encoder.encode(observations)
        observations, *_ = batch.step(np.full(batch.action_shape, 0.5, np.float32))
    rows, views = encoder.encode(observations), batch.layout.views(observations)
    soft = np.ascontiguousarray(rows[:, : encoder.encoding.num_features]).view(FEATURES)["target"].reshape(40, 5)
    true = (points(batch, "world")[:, None] - points(batch, "tracker")) / directions(batch, "tracker")
    measured = views["target_range"] * (views["target_bearing"] @ [1, 1j])
    raw, averaged = (np.sqrt(np.mean(np.abs(way - true) ** 2)) for way in (measured, soft / (1 - np.abs(soft))))
    assert averaged < 0.6 * raw


def test_after_a_silence_the_speed_is_the_old_one_and_the_slot_frame_the_new_one() -> None:
    """The target drives straight on, the slot frame is behind its heading; filters are on, noise is next to none."""
    batch = posse.batch("constant", 8, heading_noise=1e-6, odometry_drift=1e-6)
    observations = batch.reset()
    frame = points(batch, "world", "heading_cos", "heading_sin") * np.exp(0.5j)
    batch.arrays.world["frame_cos"], batch.arrays.world["frame_sin"] = frame.real, frame.imag
    encoder = Encoder(Encoding("features", 0, ()), batch.layout, 8)
    for step in range(-2, 17):
        seen, *_ = batch.step(np.full(batch.action_shape, (-1.0, 0.0)))
        out_of_sight = 0 < step < 16
        observations = observations if out_of_sight else seen
        views = batch.layout.views(observations)
        views["target_age"][...] = step * batch.scenario.control_step if out_of_sight else 0.0
        views["target_velocity"][...] *= {-2: 0.0, 1: 0.5, 16: 0.0}.get(step, 1.0)
        rows = encoder.encode(observations)
    features = rows.view(FEATURES).reshape(8, 5)
    np.testing.assert_allclose(np.abs(features["target_velocity"]), batch.scenario.target_speed, rtol=1e-3)
    np.testing.assert_allclose(away_from_slots(batch, features).min(axis=2), 0, atol=0.01)


def test_noisy_headings_are_filtered_by_what_the_slot_frame_can_do() -> None:
    """Of white noise a share of 0.15 leaves sqrt(0.15 / 1.85); the target drives straight on, mostly out of sight."""
    batch = posse.batch("constant", 40, seed=1, heading_noise=0.1, sensing_range=6.0, start_distance=(1.0, 3.0))
    encoder = Encoder(Encoding.of(batch.layout, "features"), batch.layout, 40)
    observations = batch.reset()
    for _ in range(200):
        rows = encoder.encode(observations)
        observations, *_ = batch.step(np.full(batch.action_shape, (-1.0, 0.5), np.float32))
    rows, views = encoder.encode(observations), batch.layout.views(observations)
    assert np.median(views["target_age"]) > 3.0
    told = (
        np.ascontiguousarray(rows[:, : encoder.encoding.num_features]).view(FEATURES)["target_velocity"].reshape(40, 5)
    )
    true = directions(batch, "world")[:, None] / directions(batch, "tracker")
    goes = np.abs(told) > 0.1  # it runs into robots, too
    raw, filtered = (np.std(np.angle(v / true)[goes]) for v in (views["target_heading"] @ [1, 1j], told))
    assert filtered < 0.4 * raw


def test_a_team_that_explores_finds_the_target() -> None:
    """A linear policy that reads nothing but the direction to its slot, or to explore in."""
    encoding = Encoding("features", 0, ())
    weights = np.zeros((2, encoding.num_features), np.float32)
    at = FEATURES.fields["law_direction"][1] // 4  # type: ignore[index]
    weights[0, at] = weights[1, at + 1] = 1.0
    ones, zeros = np.ones_like(weights[0]), np.zeros_like(weights[0])
    network = Network(zeros, ones, (weights,), (zeros[:2],), "tanh", "clip")
    policy = LearnedPolicy(network, encoding, {}, safeguard=True)
    found = rollout(posse.batch("search", 100), policy).metrics
    assert np.nanmedian(found["detection_time"]) < 8.0
    assert np.isfinite(found["detection_time"]).mean() > 0.97
    assert found["contact_free"].mean() > 0.9, "behind the safeguard"


def in_double_precision(network: Network, rows: FloatArray) -> npt.NDArray[np.float64]:
    """The actions for encoded observations, by matrix products."""
    x = np.clip((rows - network.mean) * network.scale, -LIMIT, LIMIT).astype(np.float64)
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True), 1):
        x = x @ weight.T.astype(np.float64) + bias
        if layer < len(network.weights):
            x = np.tanh(x) if network.activation == "tanh" else np.maximum(x, 0)
    return np.asarray(np.tanh(x) if network.output == "tanh" else np.clip(x, -1, 1))


@pytest.mark.parametrize("kind", ["plain", "features"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_actions_are_the_networks_output(kind: str, activation: str, output: str) -> None:
    batch, observations = observations_of("field")
    policy = policy_for(batch.layout, kind, activation=activation, output=output)
    actions, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(policy.encoding, batch.layout, batch.num_worlds).encode(observations)
    expected = in_double_precision(policy.network, rows).reshape(actions.shape)
    np.testing.assert_allclose(actions, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(actions).max() <= 1
    assert np.ptp(actions) > 0.3  # the networks say something


SCRIPT = DDCS(FAMILY["ddcs-distributed"])


def listener(answer: tuple[float, float], kind: str = "features", safeguard: bool = False) -> LearnedPolicy:
    """Return a policy whose network has a constant output."""
    encoding = Encoding.of(worlds().layout, kind)
    size = encoding.size + 2
    network = network_for(size, weights=(np.zeros((2, size), np.float32),), biases=(np.array(answer, np.float32),))
    return LearnedPolicy(network, encoding, {"name": "mine"}, SCRIPT, safeguard)


def worlds() -> posse.Batch:
    return posse.batch("field", 6, message_size=SCRIPT.message_size, horizon=80)


def test_an_adviser_that_its_name_does_not_make_again_is_refused() -> None:
    mine = listener((0.0, 0.0))
    with pytest.raises(PolicyError, match=r"'ddcs-distributed' cannot be an adviser: .* by its name"):
        LearnedPolicy(mine.network, mine.encoding, {}, SCRIPT.with_settings(gain=2.0))


@pytest.mark.parametrize(("kind", "safeguard"), [("plain", False), ("features", True)])
def test_an_answer_of_zero_is_the_adviser_itself(kind: str, safeguard: bool) -> None:
    mine, script = (play(worlds(), team, seed=3) for team in (listener((0.0, 0.0), kind, safeguard), SCRIPT))
    np.testing.assert_equal(mine, script)


def test_an_answer_is_twice_as_large_a_correction_and_leaves_the_message() -> None:
    batch, ddcs, answer = worlds(), SCRIPT, np.array((0.125, -0.25), np.float32)
    observations = batch.reset(seed=3)
    proposals, memory = ddcs.propose(observations, ddcs.begin(batch.layout, 6))
    wanted, _ = ddcs.carry_out(observations, memory, np.broadcast_to(2 * answer, proposals.shape))
    policy = listener((0.125, -0.25))
    corrected, _ = policy.act(observations, policy.begin(batch.layout, 6))
    np.testing.assert_array_equal(corrected, wanted)
    plain, _ = ddcs.act(observations, ddcs.begin(batch.layout, 6))
    assert (corrected[..., :2] != plain[..., :2]).any()
    np.testing.assert_array_equal(corrected[..., 2:], plain[..., 2:])
