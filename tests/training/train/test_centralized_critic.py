"""MAPPO: the state of the world influences values, but not actions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from tests.support.runs import small

from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.worlds import make_env


def test_the_actor_reads_its_own_observation_alone(tmp_path: Path) -> None:
    settings = small(tmp_path, "mappo")
    env = make_env(settings)
    model = ALGORITHMS[settings.algorithm].make(settings, env)
    rows = torch.from_numpy(env.reset())
    other = rows.clone()
    other[:, env.private_size :] += 5.0
    policy: Any = model.policy
    with torch.no_grad():
        a, b = (policy.get_distribution(x).distribution.mean for x in (rows, other))
        u, v = policy.predict_values(rows), policy.predict_values(other)
    assert torch.equal(a, b)
    assert (u - v).abs().max() > 1e-4
    own = rows.clone()
    own[:, : env.private_size] += 5.0
    with torch.no_grad():
        assert not torch.equal(policy.get_distribution(own).distribution.mean, a)


def test_no_gradient_leads_from_an_action_to_the_state(tmp_path: Path) -> None:
    settings = small(tmp_path, "mappo")
    env = make_env(settings)
    policy: Any = ALGORITHMS[settings.algorithm].make(settings, env).policy
    rows = torch.from_numpy(env.reset()).requires_grad_()
    policy.get_distribution(rows).distribution.mean.sum().backward()
    assert not rows.grad[:, env.private_size :].any()  # type: ignore[index]
    assert rows.grad[:, : env.private_size].any()  # type: ignore[index]
