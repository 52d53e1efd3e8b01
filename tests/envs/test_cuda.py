"""The engine on a GPU, without one: in numba's simulator, beside the compiled CPU engine."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.envs.cuda_cases import CASES, WORLDS, make, play

import posse

HERE = Path(__file__).parent


def test_the_cases_hold_what_they_are_for() -> None:
    made = {case: play(make(case, "cpu")) for case in CASES}
    assert all(made[case]["ended"] > 0 for case in ("smart", "leader-loss", "field", "target"))
    assert made["smart"]["metric_tracker_contacts"].sum() > 0
    assert made["target"]["terminated"].any()
    assert made["leader-loss"]["state_world_episode"].min() >= 2
    assert (made["radio"]["state_heard_step"] > 0).any()


def test_in_the_simulator(tmp_path: Path) -> None:
    for case in CASES:
        np.savez(tmp_path / case, **play(make(case, "cpu")))  # type: ignore[arg-type]
    done = subprocess.run(
        [
            sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider",
            # numpy's integers tell of the overflow that the random draws rest on.
            "-W", "ignore:overflow encountered:RuntimeWarning",
            str(HERE / "cuda_simulated.py"),
        ],
        env={
            **os.environ,
            "NUMBA_ENABLE_CUDASIM": "1",
            "NUMBA_DISABLE_JIT": "1",
            "POSSE_TEST_EXPECTED": str(tmp_path),
        },
        cwd=HERE.parents[1], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def complaint(**environment: str) -> str:
    """Return the last line that a process says that asks for a GPU."""
    code = "import posse; posse.batch('no such scenario', -1, device='cuda')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "CUDA_VISIBLE_DEVICES": "", **environment},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
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


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("numba_cuda") is None, reason="needs posse[cuda], though no GPU"
)
def test_the_kernels_compile_for_a_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the assembly of an H100; a function that a GPU lacks, or a call left over, would show."""
    import numba.cuda.dispatcher  # only now: it looks for a driver

    from posse import cuda

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
        cuda._advance: (
            *batch._fixed, actions, observations, rewards, terms, flags, infos["score"], orders,
            report,
        ),
        cuda._check: (batch.worlds, actions, report, True),
        cuda._choose: (batch.worlds, flags[0], orders, True, np.uint64(5), 0, 0),
    }  # fmt: skip
    for kernel, arguments in kernels.items():
        types = (numba.typeof(argument) for argument in arguments)  # type: ignore[no-untyped-call]
        signature = numba.types.void(*types)
        assembly, _ = cuda.cuda.compile(
            kernel.py_func, signature, device=False, abi="numba", cc=(9, 0)
        )
        assert ".entry" in assembly
        assert "call" not in assembly
        if out := os.environ.get("POSSE_TEST_ASSEMBLY"):
            Path(out, f"{kernel.py_func.__name__}.ptx").write_text(assembly)
