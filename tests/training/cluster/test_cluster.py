"""Where a cluster is named, and what needs none."""

from __future__ import annotations

import importlib.util
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posse_baselines import against, from_function, load, load_target
from posse_training import evaluate
from posse_training.cli import main
from posse_training.cluster import Cluster
from posse_training.cluster.evaluation import sent
from posse_training.cluster.identity import policy_identity
from posse_training.cluster.settings import as_cluster, check_reachable, of_option
from posse_training.cluster.shards import Shard
from posse_training.errors import ClusterError, MissingExtraError, SettingsError
from posse_training.train.seeds import train_on_worker
from posse_training.train.settings import TrainSettings

without_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
COMMANDS = (
    "compare idle --scenarios smart --episodes 2 --no-figures --planner-episodes 0 --ray",
    "train --steps 1000 --seeds 1 2 --ray",
)


@without_ray
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_names_the_extra(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(command.split()) == 2
    assert "pip install '.[cluster]'" in capsys.readouterr().err


@without_ray
@pytest.mark.parametrize("ray", [True, "auto", Cluster()])
def test_evaluate_names_the_extra(ray: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MissingExtraError, match=r"extra 'cluster' of posse-rl"):
        evaluate("idle", "smart", 2, ray=ray)
    assert list(tmp_path.iterdir()) == []


def test_which_cluster() -> None:
    assert as_cluster(False) is None
    assert as_cluster(True) == Cluster()
    assert as_cluster("auto") == Cluster(address="auto")
    assert of_option(None, Path()) is None
    assert of_option((), Path("w")) == Cluster(work=Path("w"))
    assert of_option(("10.0.0.1:6379",), Path("w")) == Cluster(address="10.0.0.1:6379", work=Path("w"))
    with pytest.raises(SettingsError, match="one address at most, not 'auto smart'"):
        of_option(("auto", "smart"), Path())
    with pytest.raises(SettingsError, match="worlds=0 is out of range: 1 to"):
        Cluster(worlds=0)
    with pytest.raises(SettingsError, match="attempts=0 is out of range: 1 to"):
        Cluster(attempts=0)


def test_nothing_answers_at_an_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        check_reachable(address)
    with pytest.raises(ClusterError, match=f"no Ray cluster at '{address}': .*ray start --head"):
        check_reachable(address)
    for name in (None, "auto", "local"):
        check_reachable(name)


def test_policies_are_told_apart_by_what_they_do(tmp_path: Path) -> None:
    slow, fast = (from_function(lambda o: 1.0 * o[..., :2]), from_function(lambda o: 2.0 * o[..., :2]))
    assert policy_identity(slow) != policy_identity(fast)
    assert policy_identity(load("learned-smart")) == policy_identity(load("learned-smart"))
    assert policy_identity(load("ddcs-tuned")) != policy_identity(load("ddcs-distributed"))


def test_files_are_sent_as_policies_and_names_as_names() -> None:
    idle = load("idle")
    assert sent("idle", idle) == "idle"
    assert sent("some.module:Team", idle) == "some.module:Team"
    assert sent("runs/best.safetensors", idle) is idle


def test_a_policys_module_is_part_of_its_identity(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    source = tmp_path / "team_of_mine.py"
    text = "class Still:\n    def begin(s, *a): ...\n    act = restart = begin\n"
    source.write_text(text)
    target = load_target("team_of_mine:Still")
    given: Any = ("team_of_mine:Team", target, against(load("idle"), target))
    before = [policy_identity(each) for each in given]
    assert [policy_identity(each) for each in given] == before
    source.write_text(f"{text}# other\n")
    for each, was in zip(given, before, strict=True):
        assert policy_identity(each) != was


@pytest.mark.parametrize(
    ("seeds", "folder", "expected"),
    [
        ("3 4", [], ["runs/train/smart-ppo-3", "runs/train/smart-ppo-4"]),
        ("3 4", ["--folder", "f"], ["f/seed-3", "f/seed-4"]),
    ],
)
def test_each_seed_has_a_folder_of_its_own(
    seeds: str, folder: list[str], expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[tuple[str, int]] = []

    def train_seeds(runs: list[TrainSettings], cluster: Cluster | None) -> list[Path]:
        found.extend((str(run.run_folder), run.seed) for run in runs)
        assert cluster is None
        return []

    monkeypatch.setattr("posse_training.train.seeds.train_seeds", train_seeds)
    assert main(["train", "--seeds", *seeds.split(), *folder]) == 0
    assert found == [(path, seed) for path, seed in zip(expected, (3, 4), strict=True)]


def test_a_seed_twice_and_another_run_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--seeds", "1", "1"]) == 2
    assert "names one twice" in capsys.readouterr().err
    folder = tmp_path / "seed-1"
    folder.mkdir()
    (folder / "settings.json").write_text('{"steps": 5}')
    assert main(["train", "--seeds", "1", "--folder", str(tmp_path)]) == 2
    assert "holds a run with another" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["/nowhere/team.safetensors", "../team.safetensors"])
def test_a_policy_file_is_not_written_outside_of_the_workers_folder(name: str) -> None:
    named = {name: np.zeros(1, np.uint8)}
    with pytest.raises(ClusterError, match=f"has no {name}, which the training reads: name it by"):
        train_on_worker("seed 1", TrainSettings(), {}, named, Shard(1, 1))
