"""Settings are declared with unit, range and use in tuning; invalid ones are refused."""

import math
from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import DDCS, begin, load, play, tunables
from posse_baselines.ddcs import Settings
from posse_baselines.ddcs.baseline import FAMILY


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"model": "central"}, "model='central' is unknown; known: distributed, centralized"),
        ({"gain": math.nan}, r"gain=nan must lie in \[0.2, 6\] 1/s"),
        ({"near": 1.5, "far": 1.2}, "near=1.5 must be below far=1.2"),
        ({"radio": "no"}, "radio='no' must be True or False"),
        ({"range_near": 1.0}, "range_near=1.0 must be below range_far=0.8"),
        ({"forbidden": ("flocking>flocking",)}, "forbidden='flocking>flocking' is unknown"),
    ],
)
def test_impossible_settings_are_refused(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Settings(**setting)


def test_a_changed_policy_is_of_the_same_kind() -> None:
    policy: Any = load("belief-planner")
    changed = policy.with_settings(near=0.5)
    assert (type(changed), changed.settings_for(posse.get_scenario("smart")).near) == (type(policy), 0.5)
    with pytest.raises(ValueError, match=r"unknown setting 'alpha'.*did you mean 'alpha_2'"):
        policy.with_settings(alpha=1.0)


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
    lengths = {
        key: np.asarray(v) * share for key, v in large.to_dict().items() if large.settings()[key].unit[:1] == "m"
    }
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
