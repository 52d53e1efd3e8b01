"""The adapter: slots are trackers, last observations are last, truncation is told."""

from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

import posse
from posse_baselines import PolicyError, load
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.safeguard import Guard
from posse_training.train.vec_env import TeamVecEnv

HORIZON = 12


def make(worlds: int = 3, *, parts: int = 1, see_state: bool = False, **settings: Any) -> Any:
    """Return worlds in so many batches."""
    values = {"seed": 5, "horizon": HORIZON, "settle_time": 0.5, "autoreset": "disabled", **settings}
    kind, each = values.pop("kind", "plain"), worlds // parts
    batches = [posse.batch("constant", each, first_world=k * each, **values) for k in range(parts)]
    return TeamVecEnv(batches, Encoding.of(batches[0].layout, kind), see_state=see_state)


def begin(env: Any) -> Any:
    """Return the first observations of episodes that are not shortened."""
    observations = env.reset()
    for k, batch in enumerate(env.batches):
        env.arrays()[f"{k}.cut_at"][:] = batch.scenario.horizon
    return observations


def draw(env: Any, generator: np.random.Generator) -> Any:
    return generator.uniform(-1, 1, (env.num_envs, *env.action_space.shape)).astype(np.float32)


def test_slots_are_trackers_and_ends_hold_the_last_observation() -> None:
    env = make()
    batch = posse.batch("constant", 3, seed=5, horizon=HORIZON, settle_time=0.5, autoreset="same_step")
    np.testing.assert_array_equal(begin(env).reshape(3, 5, -1), batch.reset())
    generator = np.random.default_rng(1)
    total = np.zeros((3, 5))
    for step in range(1, 3 * HORIZON + 1):
        actions = draw(env, generator)
        observations, rewards, dones, infos = env.step(actions)
        expected, wanted, _, truncated, info = batch.step(actions.reshape(3, 5, 2))
        np.testing.assert_array_equal(observations.reshape(3, 5, -1), expected)
        np.testing.assert_array_equal(rewards.reshape(3, 5), wanted)
        total += wanted
        assert dones.all() == dones.any() == truncated.all() == (step % HORIZON == 0)
        if dones.any():
            for slot, told in enumerate(infos):
                e, i = divmod(slot, 5)
                np.testing.assert_array_equal(told["terminal_observation"], info["final_obs"][e, i])
                assert told["TimeLimit.truncated"] is True
                assert told["episode"]["l"] == HORIZON
                assert told["episode"]["r"] == pytest.approx(total[e, i])
                assert told["episode"]["score"] == info["metrics/score"][e]
                assert told["metrics"]["score"] == info["metrics/score"][e]
                assert told["is_success"] == np.isfinite(info["metrics/settling_time"][e])
            total[:] = 0
        else:
            assert all(told == {} for told in infos)


def test_shortened_episodes_are_in_no_statistics_of_sb3() -> None:
    env = make(worlds=4)
    model = PPO("MlpPolicy", env, device="cpu")
    lengths: Any = evaluate_policy(model, env, n_eval_episodes=20, return_episode_rewards=True)[1]
    assert set(lengths) == {HORIZON}


@pytest.mark.parametrize("drift", [{}, {"odometry_drift": 0.1, "message_size": 6}])  # five are the safeguard's
def test_behind_the_safeguard_actions_are_wanted_velocities(drift: dict[str, Any]) -> None:
    settings: dict[str, Any] = {"seed": 5, "horizon": HORIZON, "settle_time": 0.5, **drift}
    batches = [posse.batch("smart", 1, first_world=e, autoreset="disabled", **settings) for e in range(3)]
    env: Any = TeamVecEnv(batches, Encoding.of(batches[0].layout), safeguard=True)
    bare = posse.batch("smart", 3, autoreset="disabled", **settings)
    guard = Guard(bare.layout, 3)
    begin(env)
    seen = bare.reset()
    generator = np.random.default_rng(1)
    for _ in range(2 * HORIZON):
        wanted = draw(env, generator)
        observations, _, dones, _ = env.step(wanted)
        seen, *_ = bare.step(guard.actions(seen, wanted.reshape(3, 5, 3 if drift else 2)))
        if dones.any():
            seen = bare.reset(options={"reset_mask": np.ones(3, np.bool_)})
            guard.restart(np.ones(3, np.bool_))
        np.testing.assert_array_equal(observations.reshape(3, 5, -1), seen)


def test_a_contact_that_ends_an_episode_is_no_truncation() -> None:
    env = make(terminate_on_contact=True, horizon=400, num_trackers=2, start_distance=(0.5, 1.0))
    begin(env)
    told: list[dict[str, Any]] = []
    forward = np.tile(np.array([1.0, 0.3], np.float32), (env.num_envs, 1))
    for _ in range(399):  # one less than an episode
        _, _, _, infos = env.step(forward)
        told += [info for info in infos if "terminal_observation" in info]
    assert told
    assert not any(info["TimeLimit.truncated"] for info in told)


@pytest.mark.parametrize("parts", [1, 2])
def test_first_episodes_are_shortened_to_spread_the_ends(parts: int) -> None:
    env = make(worlds=4, parts=parts, kind="features", range_noise=0.02, bearing_noise=0.02)
    env.reset()
    generator = np.random.default_rng(0)
    ends: list[list[int]] = [[] for _ in range(4)]
    for step in range(1, 4 * HORIZON + 1):
        seen, _, dones, infos = env.step(draw(env, generator))
        raw = seen[:, env.encoding.num_features :].reshape(4, 5, -1)
        anew = Encoder(env.encoding, env.batches[0].layout, 4).encode(raw)  # which averages no earlier fixes
        np.testing.assert_array_equal(seen[dones], anew[dones])
        for e in np.flatnonzero(dones[::5]).tolist():
            ends[e].append(step)
            assert infos[5 * e]["TimeLimit.truncated"] is True
            assert ("episode" in infos[5 * e]) == ("metrics" in infos[5 * e]) == (step >= HORIZON)
    first = (3, 6, 9, 12) if parts == 1 else (3, 9, 6, 12)  # of two batches they take turns
    assert ends == [[*range(step, 4 * HORIZON + 1, HORIZON)] for step in first]
    many = make(worlds=2 * HORIZON)
    many.reset()
    assert many.step(draw(many, generator))[2][::5].tolist() == [True] * 3 + [False] * (2 * HORIZON - 3)


def test_teams_of_several_sizes_and_scenarios() -> None:
    batches = [
        posse.batch("constant", 2, num_trackers=3, autoreset="disabled", horizon=50),
        posse.batch("radio", 3, num_trackers=7, autoreset="disabled", horizon=50),
    ]
    encoding = Encoding.of(batches[1].layout, "features", 4)
    env: Any = TeamVecEnv(batches, encoding, see_state=True)
    assert env.num_envs == 2 * 3 + 3 * 7
    observations = env.reset()
    again = posse.batch("radio", 3, num_trackers=7, horizon=50)
    expected = Encoder(encoding, again.layout, again.num_worlds).encode(again.reset())
    np.testing.assert_array_equal(observations[6:, : encoding.size], expected)
    assert np.isfinite(env.step(np.zeros((27, 2), np.float32))[0]).all()


def test_the_state_is_the_truth_as_it_was_at_the_end() -> None:
    env = make(worlds=2, parts=2, see_state=True)
    begin(env)
    for step in range(HORIZON):
        observations, _, dones, infos = env.step(np.zeros((10, 2), np.float32))
        assert dones.all() == (step == HORIZON - 1)
    time_left = env.encoding.size + 5
    assert observations[:, time_left] == pytest.approx(HORIZON * 0.1)
    finals = np.stack([info["terminal_observation"] for info in infos])
    assert finals[:, time_left] == pytest.approx(0)
    # Each tracker comes first in its own copy, the others follow by number.
    w, t = env.batches[1].arrays.world, env.batches[1].arrays.tracker
    for i in (0, 3):
        dx, dy = t["x"][0, i] - w["x"][0], t["y"][0, i] - w["y"][0]
        ahead = dx * w["frame_cos"][0] + dy * w["frame_sin"][0]
        assert observations[5 + i, env.encoding.size + 6] == pytest.approx(ahead, rel=1e-5)
        other = observations[5 + (i + 4) % 5]
        assert other[env.encoding.size + 6 + 11] == pytest.approx(ahead, rel=1e-5)


@pytest.mark.parametrize(
    ("batches", "message"),
    [
        ([], r"one length, these have \[\]"),
        ([{"autoreset": "same_step"}], "make batches with 'disabled'"),
        ([{"target_motion": "agent"}], "the target"),
        ([{}, {"message_size": 1}], r"one length, these have \[2, 3\]"),
    ],
)
def test_invalid_batches_are_refused(batches: list[dict[str, Any]], message: str) -> None:
    made = [posse.batch("constant", 1, **{"autoreset": "disabled", **settings}) for settings in batches]
    layout = posse.ObservationLayout(posse.get_scenario("constant"))
    with pytest.raises(ValueError, match=message):
        TeamVecEnv(made, Encoding.of(layout))
    moved = posse.batch("constant", 1, autoreset="disabled", team_policy=load("pursuit"))
    with pytest.raises(ValueError, match="see_state needs all trackers moved from outside, here 1 are"):
        TeamVecEnv([moved], Encoding.of(moved.layout), see_state=True)
    with pytest.raises(PolicyError, match="not for a target moved from outside"):
        TeamVecEnv([moved], Encoding.of(moved.layout), safeguard=True)


def test_options_are_of_the_next_reset_and_refused_actions_step_no_batch() -> None:
    env = make(worlds=2, parts=2)
    env.set_options({"target_pose": (1.0, 2.0, 0.0), "tracker_pose": [(3.0 * i, 7.0, 0.0) for i in range(5)]})
    for at in (True, False):
        env.reset()
        assert [batch.arrays.world["x"][0] == 1.0 for batch in env.batches] == [at, at]
    env.set_options({"reset_mask": np.array([True, False])})
    with pytest.raises(ValueError, match="reset_mask leaves episodes running"):
        env.reset()
    wrong = np.zeros((10, 2))
    wrong[9, 0] = np.nan
    for actions, words in ((wrong, "nan"), (np.zeros((5, 4)), r"shape \(5, 4\), wanted \(10, 2\)")):
        with pytest.raises(ValueError, match=words):
            env.step(list(actions))
    assert [batch.arrays.world["step"][0] for batch in env.batches] == [0, 0]
