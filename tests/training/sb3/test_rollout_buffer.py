"""The buffer gives every row once, its parts together, as the library's own does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import RolloutBuffer

from posse_training.sb3.rollout_buffer import FlatRolloutBuffer


def filled(kind: type[RolloutBuffer]) -> Any:
    box = spaces.Box(-1, 1, (3,), np.float32)
    buffer = kind(6, box, spaces.Box(-1, 1, (2,), np.float32), "cpu", 0.9, 0.8, n_envs=4)
    generator = np.random.default_rng(0)
    for _ in range(6):
        draw = generator.normal(size=(4, 9)).astype(np.float32)
        buffer.add(
            draw[:, :3], draw[:, 3:5], draw[:, 5], draw[:, 6] > 1,
            torch.from_numpy(draw[:, 7:8]), torch.from_numpy(draw[:, 8]),
        )  # fmt: skip
    buffer.compute_returns_and_advantage(torch.ones(4), np.array([True, False, False, True]))
    return buffer


def rows(buffer: Any, size: int | None) -> Any:
    parts = [
        np.concatenate([np.asarray(p).reshape(len(batch.observations), -1) for p in batch], axis=1)
        for batch in buffer.get(size)
    ]
    together = np.concatenate(parts)
    return together[np.lexsort(together.T)], [len(part) for part in parts]


@pytest.mark.parametrize("size", [None, 24, 8, 7])
def test_rows_are_those_of_the_library(size: int | None) -> None:
    mine, sizes = rows(filled(FlatRolloutBuffer), size)
    theirs, wanted = rows(filled(RolloutBuffer), size)
    np.testing.assert_array_equal(mine, theirs)
    assert sizes == wanted


def test_passes_differ_in_order() -> None:
    buffer = filled(FlatRolloutBuffer)
    first, second = (next(buffer.get(24)).observations for _ in range(2))
    assert not torch.equal(first, second)


def test_an_incomplete_rollout_is_refused() -> None:
    box = spaces.Box(-1, 1, (3,), np.float32)
    with pytest.raises(RuntimeError, match="complete"):
        next(FlatRolloutBuffer(6, box, box).get(2))
