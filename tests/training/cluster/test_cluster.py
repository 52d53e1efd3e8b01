"""What results on a cluster depend on, what is refused, and two nodes of Ray."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest
from tests.support.process import run_tests_elsewhere

from posse_baselines import from_function, load
from posse_training import provenance
from posse_training.commands.train import train_on_worker
from posse_training.errors import ClusterError
from posse_training.parallel import Job, cut
from posse_training.train.settings import TrainSettings


def test_finished_shards_belong_to_what_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another policy, or other code of it, never resumes from the shards of the first."""

    def folder(policy: Any) -> Path:
        return Job(partial(dict, policy), cut(9, 3)).folder

    slow, fast = (from_function(lambda o: 1.0 * o[..., :2]), from_function(lambda o: 2.0 * o[..., :2]))
    for module in ("mine", "helper", "space/mine"):
        (tmp_path / f"{module}.py").parent.mkdir(exist_ok=True)
        (tmp_path / f"{module}.py").write_text("class Team: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    names: list[Any] = [slow, fast, "idle", load("idle"), load("learned-smart"), "mine:Team", "space.mine:Team"]
    folders = [folder(each) for each in names]
    assert len(set(folders)) == len(names)
    assert [folder(each) for each in names] == folders
    provenance.sources.cache_clear()  # as in another process
    for changed in ("helper", "space/mine"):
        (tmp_path / f"{changed}.py").write_text("class Team: # other\n    ...\n")
    assert [folder(each) == at for each, at in zip(names, folders, strict=True)] == [True] * 5 + [False] * 2


def test_a_node_that_does_not_share_the_file_system_is_named(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match=r"has no folder .*elsewhere: train on a file system that all nodes share"):
        train_on_worker(TrainSettings(), tmp_path / "elsewhere")


@pytest.mark.long
def test_on_a_cluster_of_two_nodes(tmp_path: Path) -> None:
    run_tests_elsewhere("tests/support/ray_cases.py", tmp_path, seconds=1800.0, RAY_AUTH_MODE="disabled")
