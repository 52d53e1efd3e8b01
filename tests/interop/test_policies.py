"""Functions and stable-baselines3 models play as policies, by the actions that they choose."""

import functools
from typing import Any

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import posse
from posse.adapters.actions import MOTIONS
from posse_baselines import PolicyError, begin, deploy, from_function, load, stack_agents
from posse_baselines.learned import Encoding
from posse_baselines.learned.inputs import Encoder
from posse_baselines.safeguard import Guard
from posse_training.sb3 import TeamVecEnv, from_sb3


def acted(policy: Any, **settings: Any) -> tuple[Any, Any]:
    """Return observations (E, N, F) and what a policy does on them."""
    batch = posse.batch("constant", 2, seed=1, **settings)
    observations = batch.reset()
    actions, _ = policy.act(observations, begin(policy, batch))
    batch.step(actions)
    return observations, actions


def test_one_observation_plays_each_tracker() -> None:
    solo = posse.get_scenario("constant", num_trackers=1, num_neighbours=0)
    env: Any = VecNormalize(DummyVecEnv([lambda: gymnasium.make("posse/Solo-v0", scenario=solo)]))
    env.obs_rms.mean += 1.0
    model = PPO("MlpPolicy", env, device="cpu")
    observations, actions = acted(from_sb3(model), num_trackers=3, num_neighbours=0)
    for e in range(2):
        for i in range(3):
            expected = model.predict(env.normalize_obs(observations[e, i]), deterministic=True)[0]
            np.testing.assert_allclose(actions[e, i], expected, rtol=1e-5, atol=1e-5)


def test_discrete_actions_and_absent_messages_are_played() -> None:
    env = gymnasium.make("posse/Tracker-v0", discrete_actions=True)
    model = DQN("MlpPolicy", env, device="cpu", buffer_size=10)
    said = load("ddcs-distributed").message_size
    observations, actions = acted(from_sb3(model, message_size=said), message_size=said)
    chosen = model.predict(observations.reshape(10, -1), deterministic=True)[0].reshape(2, 5)
    np.testing.assert_array_equal(actions[..., :2], MOTIONS[chosen])
    assert not actions[..., 2:].any()


def test_no_robot_alone_plays_the_model_of_a_team() -> None:
    model = PPO("MlpPolicy", gymnasium.make("posse/Team-v0"), device="cpu")
    with pytest.raises(PolicyError, match="reads the observations of all trackers"):
        deploy(from_sb3(model), posse.Robot("constant", 0))
    ends = np.float32(0.0), np.float32(1.0)
    scaled = PPO("MlpPolicy", gymnasium.wrappers.RescaleAction(gymnasium.make("posse/Team-v0"), *ends), device="cpu")
    thirds = DQN("MlpPolicy", gymnasium.wrappers.DiscretizeAction(gymnasium.make("posse/Solo-v0"), 3), buffer_size=10)
    wrong: dict[str, Any]
    for wrong, message in (
        ({"model": scaled}, "on those of posse"),
        ({"model": thirds}, "on those of posse"),
        ({"model": "solo.zip"}, r"PPO\.load\(path\)"),
        ({"model": model, "normalize": "x.pkl"}, r"normalize='x\.pkl' is no VecNormalize"),
    ):
        with pytest.raises(PolicyError, match=message):
            from_sb3(**wrong)


@pytest.mark.parametrize("safeguard", [False, True])
def test_encoded_observations_are_played(safeguard: bool) -> None:
    batch = posse.batch("constant", 2, autoreset="disabled")
    encoding = Encoding.of(batch.layout, "features", neighbours=2)
    env = TeamVecEnv([batch], encoding, safeguard=safeguard)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=80, device="cpu")
    observations, actions = acted(from_sb3(model, encoding=encoding, safeguard=safeguard), num_trackers=4)
    layout = posse.ObservationLayout(posse.get_scenario("constant", num_trackers=4))
    inputs = Encoder(encoding, layout, len(observations)).encode(observations)
    wanted = model.predict(inputs.reshape(8, -1), deterministic=True)[0].reshape(2, 4, 2)
    expected = Guard(layout, len(observations)).actions(observations, wanted) if safeguard else wanted
    np.testing.assert_allclose(actions, expected, rtol=1e-5, atol=1e-5)
    with pytest.raises(PolicyError, match="learned on observations"):
        acted(from_sb3(model))
    with pytest.raises(PolicyError, match="has no room"):
        acted(from_sb3(model, encoding=encoding, safeguard=True), odometry_drift=0.1)


def test_a_function_plays_as_a_policy() -> None:
    with pytest.raises(ValueError, match="message_size=-1 must be"):
        from_function(np.zeros_like, message_size=-1)
    with pytest.raises(TypeError, match="takes a function, got 3"):
        from_function(3)  # type: ignore[arg-type]
    assert from_function(functools.partial(np.zeros_like)).name == "function"

    def ahead(observations: Any) -> Any:
        return np.full((*observations.shape[:2], 2), 0.5)

    policy = from_function(ahead)
    assert policy.name == "ahead"
    assert stack_agents({"tracker_0": [0.0]}).dtype == np.float32
    assert (acted(policy)[1] == 0.5).all()
    spoken = acted(policy, message_size=2)[1]
    assert spoken.shape == (2, 5, 4)
    assert not spoken[..., 2:].any()
    brief = from_function(lambda o: np.ones((*o.shape[:2], 3)), message_size=1)
    assert acted(brief, message_size=2)[1][0, 0].tolist() == [1, 1, 1, 0]
    numbers = from_function(lambda o: np.full(o.shape[:2], 7), discrete_actions=True)
    np.testing.assert_array_equal(acted(numbers)[1][0, 0], MOTIONS[7])


@pytest.mark.parametrize("shape", [(2, 5), (2, 5, 3), (5, 2), (2, 4, 2)])
def test_a_function_of_another_shape_is_named(shape: tuple[int, ...]) -> None:
    policy = from_function(lambda observations: np.zeros(shape), name="wrong")
    with pytest.raises(ValueError, match="what the function of policy 'wrong' returned has shape"):
        acted(policy)
