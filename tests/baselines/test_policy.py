"""Properties of every policy: shapes, ranges, equality over batches, restarts, refusals."""

from typing import Any

import numpy as np
import pytest
from tests.support.attack import out_of_band
from tests.support.learned import policy_for

import posse
from posse_baselines import BasePolicy, Policy, PolicyError, batch_for, begin, load, policy_names, rollout
from posse_baselines.ddcs import DDCS
from posse_baselines.learned import LearnedPolicy
from posse_baselines.policies.belief_planner import BeliefPlanner
from posse_baselines.policies.planner import PlannerSettings
from posse_baselines.policy import from_function

NAMES = policy_names()
PLAYS_BY_THE_RULES = [name for name in NAMES if name != "planner"]


def trace(policy: Policy, batch: posse.Batch, steps: int) -> tuple[Any, Any]:
    """Observations and actions of a policy, (steps, E, N, ...)."""
    played = rollout(batch, policy, ["observations", "actions"], steps=steps)
    return played["observations"][:-1], played["actions"]


@pytest.mark.parametrize("name", NAMES)
def test_an_episode_unpickled_from_buffers_goes_on_as_before(name: str) -> None:
    policy = load(name)
    assert (policy.name, policy.reads_state) == (name, name not in PLAYS_BY_THE_RULES)
    batch = batch_for(policy, "field", 2, horizon=60)
    observations, memory = batch.reset(seed=1), begin(policy, batch)
    for _ in range(5):
        actions, memory = policy.act(observations, memory)
        assert actions.dtype == np.float32
        observations, *_ = batch.step(actions)
    game, seen = (policy, batch, memory), observations
    ends = []
    for policy, batch, memory in (out_of_band(game), game):
        observations, memory = seen, policy.restart(memory, np.array([True, False]))
        for _ in range(5):
            actions, memory = policy.act(observations, memory)
            observations, *_ = batch.step(actions)
        ends.append(observations)
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "settings",
    [
        {"num_trackers": 1, "sonar_beams": 1},
        {"num_trackers": 7, "formation": "rows", "num_neighbours": 2},
        {"num_trackers": 64, "formation": "rows", "start_distance": (4.0, 30.0)},
        {"num_trackers": 3, "num_neighbours": 0, "sonar_beams": 0},
        {"start_distance": (0.5, 0.53)},
        {"message_size": 9, "radio_range": 4.0, "radio_delay": 2, "radio_loss": 0.5},
    ],
)
def test_every_policy_plays_every_team(name: str, settings: dict[str, Any]) -> None:
    policy = load(name)
    if name == "belief-planner" and settings.get("num_trackers") == 64:  # each plans for all
        policy = BeliefPlanner(PlannerSettings(look_ahead=0.5, rounds=0))
    batch = batch_for(policy, "constant", 2, **{"horizon": 60, **settings})
    reads = [field.name for field in policy.encoding.fields] if isinstance(policy, LearnedPolicy) else []
    if "sonar" in reads and "sonar_beams" in settings:
        with pytest.raises(PolicyError, match="sonar"):  # its network reads it
            begin(policy, batch)
        return
    trace(policy, batch, 5)  # the batch refuses other shapes, and numbers outside [-1, 1]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long if "planner" in n else ()) for n in NAMES])
def test_a_world_plays_alike_alone_and_in_a_batch(name: str) -> None:
    policy = load(name)
    worlds = 30 if name == "belief-planner" else 416  # so many that threads share them; each of its trackers keeps one
    many = batch_for(policy, "field", worlds, seed=4, horizon=60)
    alone = batch_for(policy, "field", 1, seed=4, first_world=worlds - 1, horizon=60)
    steps = 12 if policy.reads_state else 8  # the planner's: it plans three times
    np.testing.assert_array_equal(trace(policy, many, steps)[1][:, -1], trace(policy, alone, steps)[1][:, 0])


@pytest.mark.parametrize("name", PLAYS_BY_THE_RULES)
def test_trackers_know_only_their_own_observation(name: str) -> None:
    # Tracker 0 acts independently of the observations of others.
    policy = load(name)
    seen, done = trace(policy, batch := batch_for(policy, "constant", 2, horizon=60), 20)
    policy = load(name)  # nothing is remembered outside of the memory
    memory = policy.begin(batch.layout, 2)
    for observations, actions in zip(seen, done, strict=True):
        changed = observations.copy()
        changed[:, 1:] = observations[:, :1]
        repeated, memory = policy.act(changed, memory)
        np.testing.assert_array_equal(repeated[:, 0], actions[:, 0])


@pytest.mark.parametrize("name", PLAYS_BY_THE_RULES)
def test_a_restarted_world_plays_as_a_new_one(name: str) -> None:
    policy = load(name)
    seen, done = trace(policy, batch := batch_for(policy, "field", 2, horizon=60), 25)
    memory = policy.begin(batch.layout, 2)
    for observations in seen:
        actions, memory = policy.act(observations, memory)
    memory = policy.restart(memory, np.array([False, True]))
    differs = False
    for observations, actions in zip(seen, done, strict=True):
        repeated, memory = policy.act(observations, memory)
        np.testing.assert_array_equal(repeated[1], actions[1])
        differs |= not np.array_equal(repeated[0], actions[0])
    # In these steps no tracker sees the target, so that one that hears nobody has nothing to remember.
    remembers = isinstance(policy, DDCS) or getattr(policy, "adviser", None) is not None
    assert differs == (remembers and name != "ddcs-no-radio")


@pytest.mark.parametrize("autoreset", ["next_step", "same_step"])
def test_rollout_restarts_memories_when_episodes_begin(autoreset: str) -> None:
    class Counting(BasePolicy):
        """Remembers how many steps of its episode each world has played, and how many episodes began."""

        def begin(self, layout: posse.ObservationLayout, num_worlds: int) -> Any:
            return np.zeros(num_worlds), 1

        def act(self, observations: Any, memory: Any) -> Any:
            played, episodes = memory
            left = batch.layout.views(observations)["time_left"][:, 0]
            np.testing.assert_allclose(left, 3.0 - 0.1 * played, atol=1e-5)
            return np.zeros((*observations.shape[:2], 2), np.float32), (played + 1, episodes)

        def restart(self, memory: Any, mask: Any) -> Any:
            return np.where(mask, 0, memory[0]), memory[1] + 1

    batch = posse.batch("constant", 3, horizon=30, autoreset=autoreset)
    memories: list[Any] = []
    rollout(batch, Counting(), steps=66, after_step=memories.append)
    assert memories[-1][1] == 3


def test_an_episode_of_a_trajectory_ends_where_its_world_did() -> None:
    settings: dict[str, Any] = {"terminate_on_contact": True, "start_distance": (0.6, 1.5), "seed": 3}
    names = ("tracker_x", "actions", "terminated")
    found = rollout(posse.batch("constant", 8, **settings), load("random"), names)
    assert len(set(found.lengths)) > 1
    cut = rollout(posse.batch("constant", 8, **settings), load("random"), steps=15)
    assert min(cut.lengths) < 15
    assert np.isfinite(cut.metrics["score"]).all()
    for world, length in enumerate(found.lengths):
        alone = rollout(posse.batch("constant", 1, first_world=world, **settings), load("random"), names)
        one = found.episode(world)
        assert one.steps == alone.steps == length
        for name in names:
            np.testing.assert_array_equal(one[name], alone[name])
        assert one.metrics["score"] == alone.metrics["score"]
    assert found.episode(-1).metrics["score"] == found.metrics["score"][-1]


def test_what_is_recorded_stays_as_it_was() -> None:
    erasing = from_function(lambda observations: np.multiply(observations, 0, out=observations)[..., :2])
    played = rollout(posse.batch("constant", 1), erasing, ["observations", "annotations"], steps=3)
    assert played["observations"].any(axis=-1).all()
    assert "array" not in repr(played).replace("lengths=array", "")
    short = posse.batch("constant", 1, autoreset="disabled", horizon=5, settle_time=0.1)
    assert rollout(short, load("idle"), steps=9).steps == 5


def test_what_cannot_be_recorded_or_played_is_named() -> None:
    for wrong in ("idle", None, type(load("idle"))):
        with pytest.raises(TypeError, match="is no policy"):
            rollout(posse.batch("constant", 1), wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="record='speed' is unknown; names are: observations, "):
        rollout(posse.batch("constant", 1), load("idle"), ["speed"])
    with pytest.raises(ValueError, match="autoreset='same_step'"):
        rollout(posse.batch("constant", 1, autoreset="same_step"), load("idle"), ["tracker_x"])
    for steps in (0, "3", np.inf):
        with pytest.raises(ValueError, match=rf"steps={steps!r} must be"):
            rollout(posse.batch("constant", 1), load("idle"), steps=steps)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="reset_mask leaves episodes running"):
        rollout(posse.batch("constant", 1), load("idle"), options={"reset_mask": np.array([True])})
    with pytest.raises(ValueError, match="options must be a dictionary"):
        rollout(posse.batch("constant", 1), load("idle"), options=5)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["belief-planner", "ddcs-tuned", "learned-radio"])
def test_a_memory_that_is_written_back_goes_on_as_before(name: str) -> None:
    policy: Any = load(name)
    batch = posse.batch("radio", 2, seed=1, message_size=policy.message_size)
    memory, observations = policy.begin(batch.layout, 2), batch.reset()
    for step in range(40):
        if step == 30:
            saved, restored = policy.arrays(memory), policy.begin(batch.layout, 2)
            for field, array in policy.arrays(restored).items():
                array[...] = saved[field]
        actions, memory = policy.act(observations, memory)
        if step >= 30:
            again, restored = policy.act(observations, restored)
            np.testing.assert_array_equal(again, actions)
        observations = batch.step(actions)[0]


def test_a_memory_that_cannot_be_saved_or_restarted_is_refused() -> None:
    with pytest.raises(PolicyError, match=r"'idle' cannot be saved: define its method arrays\(memory\)"):
        BasePolicy.arrays(load("idle"), np.zeros(3))  # type: ignore[arg-type]
    assert load("idle").restart(None, np.ones(3, np.bool_)) is None
    with pytest.raises(PolicyError, match=r"'idle' must forget.*define restart\(memory, mask\)"):
        load("idle").restart(np.zeros(3), np.ones(3, np.bool_))


@pytest.mark.parametrize("policy", [load("ddcs-distributed"), policy_for(posse.batch().layout, outputs=5)])
def test_a_policy_with_more_to_say_than_messages_hold_is_refused(policy: Policy) -> None:
    size = policy.message_size
    with pytest.raises(PolicyError, match=rf"adds {size} numbers.*message_size=2.*message_size={size}"):
        policy.begin(posse.batch("constant", message_size=2).layout, 1)


def test_only_pursuit_plays_with_bearings_alone(request: pytest.FixtureRequest) -> None:
    request.addfinalizer(lambda: posse.SENSORS.pop("by-bearing"))  # commands would tell the user to import this module

    @posse.sensor("by-bearing", fix="bearing")
    def by_bearing(c: Any, w: Any, t: Any, dx: Any, dy: Any) -> bool:
        """In sight everywhere."""
        return True

    batch = posse.batch("constant", 9, sensor="by-bearing", message_size=5, horizon=100)
    for name in ("ddcs-tuned", "belief-planner", "corrected-smart", "learned-smart"):
        with pytest.raises(PolicyError, match="sensor='by-bearing' measures bearings alone"):
            load(name).begin(batch.layout, 1)
    distances = [rollout(batch, load(name)).metrics["tracking_error"].mean() for name in ("idle", "pursuit")]
    assert distances[1] < 0.6 * distances[0]


@pytest.mark.parametrize("name", ["learned-radio", "ddcs-distributed"])
def test_observations_of_another_shape_are_refused(name: str) -> None:
    policy = load(name)
    batch = batch_for(policy, "constant", 3, horizon=60)
    memory = begin(policy, batch)
    with pytest.raises(PolicyError, match=r"shape \(2, 5, .*wanted \(3, 5, "):
        policy.act(batch.reset()[:2], memory)
