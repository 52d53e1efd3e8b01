"""Where a cluster is named, what its results depend on, what needs none, and two nodes of Ray."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest
from tests.support.process import printed

from posse_baselines import from_function, load
from posse_training import evaluate, provenance
from posse_training.cli import main
from posse_training.commands.train import train_on_worker
from posse_training.errors import ClusterError, MissingExtraError
from posse_training.parallel import Job, cut
from posse_training.train.settings import TrainSettings

COMMANDS = ("compare idle --episodes 2 --ray", "train --steps 1000 --seed 1 2 --ray", "tune pngl-l-phi --ray")


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
def test_what_needs_ray_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in COMMANDS:
        assert main(command.split()) == 2
        assert "pip install '.[cluster]'" in capsys.readouterr().err
    with pytest.raises(MissingExtraError, match=r"extra 'cluster' of posse-rl"):
        evaluate("idle", "smart", 2, ray=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("count", "size"), [(1, 5), (10, 5), (11, 5), (7, 1)])
def test_shards_hold_each_world_once(count: int, size: int) -> None:
    shards = cut(count, size)
    assert [world for shard in shards for world in shard] == list(range(count))
    assert max(map(len, shards)) <= size


def test_finished_shards_belong_to_what_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another policy, or other code of it, never resumes from the shards of the first."""

    def folder(policy: Any) -> Path:
        return Job(dict, (policy,), cut(9, 3)).folder

    slow, fast = (from_function(lambda o: 1.0 * o[..., :2]), from_function(lambda o: 2.0 * o[..., :2]))
    mine = tmp_path / "team_of_mine.py"
    mine.write_text("class Team: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    names: list[Any] = [slow, fast, "idle", load("idle"), load("learned-smart"), "team_of_mine:Team"]
    folders = [folder(each) for each in names]
    assert len(set(folders)) == len(names)
    assert [folder(each) for each in names] == folders
    provenance.sources.cache_clear()  # as in another process
    mine.write_text("class Team: # other\n    ...\n")
    assert [folder(each) == at for each, at in zip(names, folders, strict=True)] == [True] * 5 + [False]


def test_a_seed_twice_and_another_run_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--seed", "1", "1"]) == 2
    assert "names none, or one twice" in capsys.readouterr().err
    folder = tmp_path / "seed-1"
    folder.mkdir()
    (folder / "settings.json").write_text('{"steps": 5}')
    assert main(["train", "--seed", "1", "2", "--out", str(tmp_path)]) == 2
    assert "is damaged" in capsys.readouterr().err


def test_a_node_that_does_not_share_the_file_system_is_named(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match=r"has no folder .*elsewhere: train on a file system that all nodes share"):
        train_on_worker(TrainSettings(), tmp_path / "elsewhere")


ROOT = Path(__file__).parents[3]
ELSEWHERE = ROOT / ".venv-recipes" / "bin" / "python"


@pytest.mark.long
def test_on_a_cluster_of_two_nodes(tmp_path: Path) -> None:
    if not ELSEWHERE.exists():
        pytest.skip("Ray is not installed: make recipes")
    words = f"-W ignore -m pytest -q -p no:cacheprovider -n 0 -W ignore --basetemp {tmp_path / 'cases'}"
    printed(*words.split(), "tests/support/ray_cases.py", program=ELSEWHERE, RAY_AUTH_MODE="disabled")
