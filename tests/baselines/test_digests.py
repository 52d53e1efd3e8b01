"""What every policy does in every scenario is what it did when ``digests.json`` was written.

Of the actions of 60 steps, three means are compared; with tolerances, since another processor rounds otherwise. After a
change that is meant, ``PYTHONPATH=envs:baselines python tests/baselines/test_digests.py`` writes the file again. The
planner, which plays copies of the world, has tests of its own.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import posse
from posse_baselines import begin, load, policy_names

FILE = Path(__file__).with_name("digests.json")
POLICIES = [name for name in policy_names() if name != "planner"]
WORLDS, STEPS = 4, 60


def digest(name: str) -> dict[str, list[float]]:
    """Return means of speeds and turn rates, and of all actions under drawn weights, by scenario and team size."""
    policy, found = load(name), {}
    for scenario in posse.scenario_names():
        for trackers in (posse.get_scenario(scenario).num_trackers, 3, 8):
            batch = posse.batch(scenario, WORLDS, message_size=policy.message_size, num_trackers=trackers)
            observations, memory = batch.reset(seed=11), begin(policy, batch)
            played = np.zeros((STEPS, *batch.action_shape[:2], 2))
            for step in range(STEPS):
                actions, memory = policy.act(observations, memory)
                played[step] = actions[..., :2]
                observations = batch.step(actions)[0]
            weights = np.random.default_rng(0).uniform(-1, 1, played.shape)
            means = [*played.mean(axis=(0, 1, 2)), 10 * (weights * played).mean()]
            found[f"{scenario} {trackers}"] = [round(float(mean), 5) for mean in means]
    return found


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_acts_as_before(name: str) -> None:
    before, now = json.loads(FILE.read_text(encoding="utf-8"))[name], digest(name)
    assert before.keys() == now.keys()
    moved = [row for row in now if not np.allclose(now[row], before[row], rtol=1e-3, atol=5e-4)]
    # Where two choices are level, rounding decides, and one world goes another way: hence one row may differ.
    assert len(moved) <= 1, f"{name} acts otherwise in {moved}; if that is meant, write digests.json again"


def test_no_policy_is_forgotten() -> None:
    assert list(json.loads(FILE.read_text(encoding="utf-8"))) == POLICIES


if __name__ == "__main__":
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(digest(name))}" for name in POLICIES)
    FILE.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
