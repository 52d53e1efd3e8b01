"""Policy files are read back unchanged, and refused if damaged."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file
from tests.support.learned import observations_of, policy_for

import posse
from posse_baselines import PolicyError
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.policy_file import write_atomically


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
    assert json.loads(path.with_suffix(".json").read_text())["name"] == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["policy.json", "policy.safetensors"]


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

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(PolicyError, match="there is no policy file"):
            LearnedPolicy.from_file(tmp_path / "none.safetensors")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "policy.safetensors"
    policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
    policy.save(path)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("posse_baselines.learned.policy_file.os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        policy.save(path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2


def test_files_of_writers_at_once_are_whole(tmp_path: Path) -> None:
    path, contents = tmp_path / "file", [bytes([k]) * 200_000 for k in range(4)]
    path.write_bytes(contents[0])

    def write(content: bytes) -> None:
        for _ in range(20):
            write_atomically(path, content)

    writers = [threading.Thread(target=write, args=(content,)) for content in contents]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert path.read_bytes() in contents
    assert path.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_no_part_of_the_next(tmp_path: Path) -> None:
    (tmp_path / ".file.partial").write_bytes(b"half of something longer")
    write_atomically(tmp_path / "file", b"whole")
    assert (tmp_path / "file").read_bytes() == b"whole"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_an_error_names_the_file_that_could_not_be_written(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"none/file'") as caught:
        write_atomically(tmp_path / "none" / "file", b"")
    assert caught.value.filename == str(tmp_path / "none" / "file")
