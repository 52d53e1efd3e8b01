"""The engine on a GPU, without one: in numba's simulator, beside the compiled CPU engine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.envs.cuda_cases import CASES, make, play

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
