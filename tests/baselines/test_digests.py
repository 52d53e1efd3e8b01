"""What every policy does in every scenario is what it did when ``digests.json`` was written.

Of each world one number is compared: the mean of its actions under drawn weights, over few steps, since differences by
rounding grow with time. After a change that is meant, write the file again::

    PYTHONPATH=envs:baselines python tests/baselines/test_digests.py
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import load, policy_names, rollout

FILE = Path(__file__).with_name("digests.json")
POLICIES = [name for name in policy_names() if name != "belief-planner"]
"""Not the belief planner: it takes seconds a world, and where two plans are level, rounding decides."""
WORLDS, STEPS = 4, 12
TEAMS: tuple[dict[str, Any], ...] = (
    {},
    {"num_trackers": 3, "start_distance": (1.0, 3.0)},
    {"num_trackers": 8, "start_distance": (1.0, 4.0)},
)


def digest(name: str) -> dict[str, list[float]]:
    """Return one number a world, of three teams in each scenario; of one, where a policy plays ahead."""
    policy = load(name)
    found: dict[str, list[float]] = {}
    for scenario in posse.scenario_names():
        found[scenario] = []
        for team in TEAMS[:1] if policy.reads_state else TEAMS:
            batch = posse.batch(scenario, WORLDS, message_size=policy.message_size, **team)
            played = rollout(batch, policy, ["actions"], steps=STEPS, seed=11)["actions"][..., :2]
            weights = np.random.default_rng(0).uniform(-1, 1, played.shape)
            found[scenario] += [round(float(mean), 4) for mean in 10 * (weights * played).mean(axis=(0, 2, 3))]
    return found


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_acts_as_before(name: str) -> None:
    before, now = json.loads(FILE.read_text(encoding="utf-8"))[name], digest(name)
    assert before.keys() == now.keys()
    same = {key: np.isclose(now[key], before[key], rtol=1e-3, atol=5e-4) for key in now}
    # Where two choices are level, rounding decides: on another processor a few worlds may go another way.
    assert np.mean([*same.values()]) >= 0.9, f"{name} acts otherwise; if meant, write digests.json again: {same}"


def test_no_policy_is_forgotten() -> None:
    assert list(json.loads(FILE.read_text(encoding="utf-8"))) == POLICIES


if __name__ == "__main__":
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(digest(name))}" for name in POLICIES)
    FILE.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
