"""Tests of the GPU engine that run in numba's CUDA simulator: test_cuda.py starts them."""

from __future__ import annotations

import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from gymnasium.error import ResetNeeded
from tests.support.cuda_cases import CASES, WORLDS, actions_for, make, on_host, play

import posse
from posse.engine.cuda import CudaBatch
from posse.engine.cuda_kernels import cuda


@pytest.mark.parametrize("case", CASES)
def test_the_worlds_are_those_of_the_cpu(case: str) -> None:
    """Compared with the CPU engine: integers are equal, float32 differ by rounding."""
    folder = Path(os.environ["POSSE_TEST_EXPECTED"])
    with np.load(folder / f"{case}.npz") as expected:
        made = play(make(case, "cuda"))
        assert made.keys() == set(expected)
        for name, array in made.items():
            if np.issubdtype(array.dtype, np.floating):
                np.testing.assert_allclose(array, expected[name], 1e-4, 1e-5, err_msg=name)
            else:
                np.testing.assert_array_equal(array, expected[name], err_msg=name)


def assert_same(one: Any, other: Any) -> None:
    np.testing.assert_allclose(on_host(one), on_host(other), 1e-4, 1e-5)


def test_same_step_starts_the_next_episode_at_once() -> None:
    device, cpu = (make("leader-loss", d, autoreset="same_step") for d in ("cuda", "cpu"))
    assert_same(device.reset(), cpu.reset())
    for step in range(12):
        actions = actions_for(cpu, step)
        made, expected = device.step(actions), cpu.step(actions)
        for one, other in zip(made[:4], expected[:4], strict=True):
            assert_same(one, other)
        assert made[4].keys() == expected[4].keys()
        if "final_obs" in expected[4]:
            assert step == 9
            assert_same(made[4]["final_obs"], expected[4]["final_obs"])
            np.testing.assert_array_equal(on_host(made[4]["_final_obs"]), [True] * WORLDS)
            for name, metric in expected[4]["final_info"]["metrics"].items():
                np.testing.assert_allclose(made[4]["metrics"][name], metric, 1e-4, err_msg=name)


@pytest.mark.parametrize("where", ["host", "device"])
def test_with_autoreset_disabled_the_caller_resets(where: str) -> None:
    device, cpu = (make("smart", d, autoreset="disabled", horizon=3) for d in ("cuda", "cpu"))
    device.reset()
    cpu.reset()
    for step in range(3):
        actions = actions_for(cpu, step)
        assert_same(device.step(actions)[0], cpu.step(actions)[0])
    before = device.state
    with pytest.raises(ResetNeeded, match=r"end of world 0.*reset_mask"):
        device.step(actions)
    assert_unchanged(device, before)
    mask = np.array([True, False, True])
    told = cuda.to_device(mask) if where == "device" else mask
    observations = device.reset(options={"reset_mask": told})
    assert_same(observations, cpu.reset(options={"reset_mask": mask}))
    assert on_host(as_cuda(device).truncated).tolist() == [False, True, False]
    with pytest.raises(ResetNeeded, match="end of world 1"):
        device.step(actions)
    assert_same(device.reset(options={"reset_mask": ~mask}), cpu.reset(options={"reset_mask": ~mask}))
    assert_same(device.step(actions)[0], cpu.step(actions)[0])


def as_cuda(batch: posse.Batch) -> CudaBatch:
    assert isinstance(batch, CudaBatch)
    return batch


def assert_unchanged(batch: posse.Batch, before: dict[str, npt.NDArray[Any]]) -> None:
    for name, array in batch.state.items():
        np.testing.assert_array_equal(array, before[name], err_msg=name)


@pytest.mark.parametrize("bad", [np.nan, 1.5])
@pytest.mark.parametrize("where", ["host", "device"])
def test_a_bad_action_is_named_and_changes_nothing(where: str, bad: float) -> None:
    batch = make("smart", "cuda")
    batch.reset()
    actions = actions_for(batch, 0)
    kept = batch.step(actions)[0]
    before, seen = batch.state, on_host(kept)
    wrong = actions.copy()
    wrong[1, 2, 1] = bad
    wrong[2, 0, 0] = bad
    told = cuda.to_device(wrong) if where == "device" else wrong
    with pytest.raises(ValueError, match=rf"actions\[1, 2, 1\] = {bad} is not a number in"):
        batch.step(told)
    assert_unchanged(batch, before)
    np.testing.assert_array_equal(on_host(kept), seen)
    batch.step(actions)
    assert batch.state["world_step"].tolist() == [2, 2, 2]


@pytest.mark.parametrize("where", ["host", "device"])
def test_an_action_just_outside_is_the_bound_s(where: str) -> None:
    one, other = make("smart", "cuda"), make("smart", "cuda")
    one.reset()
    other.reset()
    bounds = np.sign(actions_for(one, 0))
    given = bounds * np.float32(1 + 1e-6)
    told = cuda.to_device(given) if where == "device" else given
    np.testing.assert_array_equal(on_host(one.step(told)[0]), on_host(other.step(bounds)[0]))
    np.testing.assert_array_equal(on_host(told), bounds * np.float32(1 + 1e-6))


def test_actions_may_lie_on_the_device() -> None:
    one, other = make("smart", "cuda"), make("smart", "cuda")
    one.reset()
    other.reset()
    actions = actions_for(one, 0)
    np.testing.assert_array_equal(on_host(one.step(cuda.to_device(actions))[0]), on_host(other.step(actions)[0]))
    with pytest.raises(ValueError, match="float64 of shape"):
        one.step(cuda.to_device(actions.astype(np.float64)))
    with pytest.raises(ValueError, match=r"shape \(3, 5, 1\), wanted"):
        one.step(cuda.to_device(actions[:, :, :1].copy()))
    with pytest.raises(ValueError, match="not contiguous"):
        one.step(cuda.to_device(np.zeros((3, 5, 4), np.float32))[:, :, ::2])
    with pytest.raises(ValueError, match="actions have shape"):
        one.step(actions[0])


def test_what_a_step_returns_is_kept_until_the_second_call_after() -> None:
    batch = make("smart", "cuda")
    first = batch.reset()
    seen = on_host(first)
    second = batch.step(actions_for(batch, 0))[0]
    np.testing.assert_array_equal(on_host(first), seen)
    third = batch.step(actions_for(batch, 1))[0]
    np.testing.assert_array_equal(on_host(first), on_host(third))
    assert not np.array_equal(on_host(first), on_host(second))


def test_a_step_that_does_not_wait_is_the_same_step() -> None:
    one, other = make("smart", "cuda", horizon=2), make("smart", "cuda", horizon=2)
    one.reset()
    other.reset()
    for step in range(4):
        actions = actions_for(one, step)
        made, expected = as_cuda(one).step(actions, check=False), other.step(actions)
        for a, b in zip(made[:4], expected[:4], strict=True):
            np.testing.assert_array_equal(on_host(a), on_host(b))
        assert "metrics" not in made[4]
        assert ("metrics" in expected[4]) == (step == 1)
    metrics = one.metrics()
    for name, metric in other.metrics().items():
        np.testing.assert_array_equal(metrics[name], metric)


def test_start_poses_snapshots_and_pickles() -> None:
    device, cpu = make("smart", "cuda"), make("smart", "cpu")
    poses: dict[str, Any] = {"target_pose": (0.5, 0.0, 1.0), "tracker_pose": [(i, 2.0, 0.1) for i in range(5)]}
    assert_same(device.reset(options=poses), cpu.reset(options=poses))
    with pytest.raises(ValueError, match="overlap"):
        device.reset(options={**poses, "target_pose": (0.0, 2.0, 0.0)})
    actions = actions_for(cpu, 0)
    assert_same(device.step(actions)[0], cpu.step(actions)[0])
    saved = device.save()
    copy = pickle.loads(pickle.dumps(device))  # noqa: S301 (our own)
    expected = on_host(device.step(actions)[0])
    assert_same(copy.step(actions)[0], expected)
    cpu.restore(saved)
    assert_same(cpu.step(actions)[0], expected)
    device.restore(saved)
    assert_same(device.step(actions)[0], expected)
    assert_same(device.reset(seed=8), cpu.reset(seed=8))
    assert device.seed == 8
    assert device.worlds["seed"].tolist() == [8, 8, 8]


def test_what_is_refused() -> None:
    batch = make("smart", "cuda")
    with pytest.raises(ResetNeeded, match="before reset"):
        batch.step(actions_for(batch, 0))
    mask = np.array([True, False, True])
    for told in (mask, cuda.to_device(mask)):
        with pytest.raises(ResetNeeded, match="first reset"):
            batch.reset(options={"reset_mask": told})
    batch.reset(options={"reset_mask": cuda.to_device(mask | True)})
    with pytest.raises(ValueError, match="reset_mask must be a bool array"):
        batch.reset(options={"reset_mask": cuda.to_device(mask.astype(np.int32))})
    with pytest.raises(ValueError, match="unknown option"):
        batch.reset(options={"mask": mask})
    with pytest.raises(NotImplementedError, match="call step"):
        batch.stepper(*[actions_for(batch, 0)] * 4)
    with pytest.raises(ValueError, match="num_threads=2 is for device='cpu'"):
        make("smart", "cuda", num_threads=2)
    with pytest.raises(ValueError, match="own_kernel=True is for device='cpu'"):
        make("smart", "cuda", own_kernel=True)
