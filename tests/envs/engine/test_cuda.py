"""The GPU engine in numba's simulator, compared with the compiled CPU engine."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.support.cuda_cases import CASES, WORLDS, actions_for, make, on_host, play, run_in_simulator

import posse

SUPPORT = Path(__file__).parents[2] / "support"


def test_the_cases_hold_what_they_are_for() -> None:
    made = {case: play(make(case, "cpu")) for case in CASES}
    assert all(made[case]["ended"] > 0 for case in ("smart", "leader-loss", "field", "target"))
    assert made["smart"]["metric_tracker_contacts"].sum() > 0
    assert made["target"]["terminated"].any()
    assert made["leader-loss"]["state_world_episode"].min() >= 2
    assert (made["radio"]["state_heard_step"] > 0).any()


@pytest.mark.long
def test_in_the_simulator(tmp_path: Path) -> None:
    for case in CASES:
        np.savez(tmp_path / case, **play(make(case, "cpu")))  # type: ignore[arg-type]
    run_in_simulator(SUPPORT / "cuda_simulated.py", POSSE_TEST_EXPECTED=str(tmp_path))


def complaint(**environment: str) -> str:
    """Return the last line that a process says that asks for a GPU."""
    code = "import posse; posse.batch('no such scenario', -1, device='cuda')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "CUDA_VISIBLE_DEVICES": "", **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    return done.stderr


def test_what_is_missing_is_said_before_anything_else() -> None:
    told = complaint()
    assert "pip install 'posse[cuda]'" in told
    assert "ImportError: device='cuda'" in told or "RuntimeError: device='cuda'" in told
    assert "NUMBA_DISABLE_JIT=1 too" in complaint(NUMBA_ENABLE_CUDASIM="1")


def test_an_unknown_device() -> None:
    with pytest.raises(ValueError, match="unknown device 'tpu'; devices are: cpu, cuda"):
        posse.batch("smart", device="tpu")


@pytest.mark.skipif(importlib.util.find_spec("numba_cuda") is None, reason="needs posse[cuda], though no GPU")
def test_the_kernels_compile_for_a_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the assembly of an H100; a function that a GPU lacks, or a call left over, would show."""
    import numba.cuda.dispatcher  # only now: it looks for a driver

    from posse.engine import cuda_kernels
    from posse.engine.kernels import Results
    from posse.signals.parts import built_in_parts

    device = SimpleNamespace(compute_capability=(9, 0))
    monkeypatch.setattr(numba.cuda.dispatcher, "get_current_device", lambda: device)
    batch = make("field", "cpu")
    observations = batch.reset()
    _, rewards, *_, infos = batch.step(np.zeros(batch.action_shape, np.float32))
    flags = np.zeros((3, WORLDS), np.bool_)
    terms = np.zeros((*rewards.shape, len(infos["reward_terms"])), np.float32)
    orders, report = np.zeros(WORLDS, np.uint8), np.zeros(3, np.int64)
    actions = np.zeros(batch.action_shape, np.float32)
    kernels = {
        cuda_kernels.stepping(built_in_parts()): (
            batch._tables,
            batch.arrays,
            actions,
            Results(observations, rewards, terms, flags),
            infos["score"],
            orders,
            report,
        ),
        cuda_kernels.check_actions: (batch.worlds, actions, actions.copy(), report, True),
        cuda_kernels.choose_worlds: (batch.worlds, flags[0], orders, True, np.uint64(5), 0, 0),
    }
    for kernel, arguments in kernels.items():
        types = (numba.typeof(argument) for argument in arguments)  # type: ignore[no-untyped-call]
        signature = numba.types.void(*types)
        assembly, _ = cuda_kernels.cuda.compile(kernel.py_func, signature, device=False, abi="numba", cc=(9, 0))
        assert ".entry" in assembly
        assert not re.search(r"^\s*(@\S+\s+)?call", assembly, re.MULTILINE)
        if out := os.environ.get("POSSE_TEST_ASSEMBLY"):
            Path(out, f"{kernel.py_func.__name__}.ptx").write_text(assembly)


@pytest.mark.parametrize("case", CASES)
def test_on_a_gpu(case: str) -> None:
    """Ten steps: integers as on the CPU, float32 within rounding; torch accepts the results."""
    try:
        batch = make(case, "cuda")
    except (ImportError, RuntimeError) as error:
        pytest.skip(str(error))
    other = make(case, "cpu")
    np.testing.assert_allclose(on_host(batch.reset()), other.reset(), 1e-4, 1e-4)
    for step in range(10):
        actions = actions_for(other, step)
        made, expected = batch.step(actions), other.step(actions)
        for one, two in zip(made[:4], expected[:4], strict=True):
            np.testing.assert_allclose(on_host(one), on_host(two), 1e-4, 1e-4)
    for name, array in other.state.items():
        if np.issubdtype(array.dtype, np.integer):
            np.testing.assert_array_equal(batch.state[name], array, err_msg=name)
    torch = pytest.importorskip("torch")
    if torch.cuda.is_available():
        given: Any = made[0]
        tensor = torch.as_tensor(given, device="cuda")
        assert tensor.data_ptr() == given.__cuda_array_interface__["data"][0]
        np.testing.assert_array_equal(tensor.cpu().numpy(), on_host(made[0]))
        action = torch.from_numpy(actions).cuda()
        again = make(case, "cuda")
        again.reset()
        for step in range(9):
            again.step(actions_for(other, step))
        np.testing.assert_array_equal(on_host(again.step(action)[0]), on_host(made[0]))
