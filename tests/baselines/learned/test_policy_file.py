"""Policy files are read back unchanged, and refused if damaged."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file
from tests.support.learned import observations_of, policy_for

import posse
from posse_baselines import PolicyError
from posse_baselines.learned import LearnedPolicy


def test_a_file_gives_back_the_policy(tmp_path: Path) -> None:
    batch, observations = observations_of("smart")
    policy = policy_for(batch.layout)
    path = tmp_path / "policy.safetensors"
    policy.save(path)
    again = LearnedPolicy.from_file(path)
    assert again.name == "mine"
    assert again.trained_splits == ("train",)
    assert again.encoding == policy.encoding
    mine, _ = policy.act(observations, policy.begin(batch.layout, 6))
    theirs, _ = again.act(observations, again.begin(batch.layout, 6))
    np.testing.assert_array_equal(mine, theirs)
    assert again.card == policy.card
    assert list(tmp_path.iterdir()) == [path]


def test_playing_a_file_needs_no_torch(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    policy_for(posse.ObservationLayout(posse.get_scenario("smart"))).save(path)
    code = (
        "import sys, posse; from posse_baselines.learned import LearnedPolicy;"
        f"p = LearnedPolicy.from_file({str(path)!r}); b = posse.batch('smart', 2);"
        "p.act(b.reset(), p.begin(b.layout, 2)); print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "False"


class _Planted:
    """Makes a file when it is unpickled."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self._file,)


class TestDamage:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        path = tmp_path / "policy.safetensors"
        policy_for(posse.ObservationLayout(posse.get_scenario("smart"))).save(path)
        return path

    @pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
    def test_a_file_cut_short(self, path: Path, share: float) -> None:
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(PolicyError, match="truncated"):
            LearnedPolicy.from_file(path)

    def test_a_file_of_something_else(self, tmp_path: Path) -> None:
        path = tmp_path / "other.safetensors"
        save_file({"a": np.zeros(3)}, path)
        with pytest.raises(PolicyError, match="holds no policy"):
            LearnedPolicy.from_file(path)

    def test_a_pickle_is_refused_and_not_run(self, tmp_path: Path) -> None:
        path = tmp_path / "pickled.safetensors"
        path.write_bytes(pickle.dumps(_Planted(tmp_path / "it_ran")))
        with pytest.raises(PolicyError, match="not a policy file"):
            LearnedPolicy.from_file(path)
        assert list(tmp_path.iterdir()) == [path]

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(PolicyError, match="there is no policy file"):
            LearnedPolicy.from_file(tmp_path / "none.safetensors")
