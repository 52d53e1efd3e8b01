"""What only a Ray cluster can show; run by ``tests/training/cluster/test_cluster.py`` where Ray is."""

import filecmp
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import ray
from numpy.testing import assert_equal
from ray.cluster_utils import Cluster
from safetensors.numpy import load_file
from tests.support.bad_policies import Watched

from posse_training import Results, evaluate
from posse_training.cli import main
from posse_training.errors import PlayError
from posse_training.evaluation import evaluation
from posse_training.parallel import WORK

SHORT: dict[str, Any] = {"horizon": 20, "settle_time": 0.5, "progress": False}
EPISODES = 45
SHARDS = 9
THERE: dict[str, Any] = {"ray": True, **SHORT}


@pytest.fixture(scope="module")
def nodes() -> Iterator[Cluster]:
    """The driver's node, and two with a worker each."""
    noticed = {"health_check_period_ms": 300, "idle_worker_killing_time_threshold_ms": 60_000}  # a dead node: in 2 s
    head = {"num_cpus": 0, "include_dashboard": False, "_system_config": noticed}
    found = Cluster(initialize_head=True, head_node_args=head)
    for _ in range(2):
        found.add_node(num_cpus=1, wait=False)
    found.wait_for_nodes(timeout=120)
    ray.init(address=found.address, log_to_driver=False, logging_level="error")
    yield found
    ray.shutdown()
    found.shutdown()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(evaluation, "WORLDS", EPISODES // SHARDS)
    return tmp_path


@pytest.fixture(scope="module")
def local() -> Results:
    return evaluate("pursuit", "smart", EPISODES, **SHORT)


def begun(folder: Path) -> int:
    return len(list(folder.glob("begun-*")))


def test_a_worker_that_dies_costs_its_shard(nodes: Cluster, local: Results, folder: Path) -> None:
    assert_equal(evaluate(Watched(folder, "die"), "smart", EPISODES, **THERE).columns, local.columns)
    assert begun(folder) == SHARDS + 1


def test_a_killed_driver_resumes(nodes: Cluster, local: Results, folder: Path) -> None:
    """The shard that waits is lost with its driver; those that were done are not played again."""
    code = (
        "from pathlib import Path\nfrom posse_training.evaluation import evaluate, evaluation\n"
        f"from tests.support.bad_policies import Watched\nevaluation.WORLDS = {EPISODES // SHARDS}\n"
        f"policy = Watched(Path({str(folder)!r}), 'wait')\n"
        f"evaluate(policy, 'smart', {EPISODES}, **{ {**THERE, 'ray': nodes.address}!r})\n"
    )
    driver = subprocess.Popen([sys.executable, "-W", "ignore", "-c", code])
    while len(list(WORK.rglob("[0-9]*.npz"))) < SHARDS - 1:  # all but the one that waits
        assert driver.poll() is None
        time.sleep(0.1)
    driver.kill()
    driver.wait()
    assert begun(folder) == SHARDS
    (folder / "go").touch()
    assert_equal(evaluate(Watched(folder, "wait"), "smart", EPISODES, **THERE).columns, local.columns)
    assert begun(folder) == SHARDS + 1
    assert not WORK.exists()


def test_a_policy_that_fails_or_kills_its_workers_is_named(nodes: Cluster, folder: Path) -> None:
    with pytest.raises(PlayError, match=r"^ValueError: no idea \(.*bad_policies.py, line"):
        evaluate(Watched(folder, "fail"), "smart", EPISODES, **THERE)
    with pytest.raises(PlayError, match="4 workers died with it"):
        evaluate(Watched(folder, "die always"), "smart", 1, **THERE)


COMPARE = "--episodes 3 --no-figures --planner-episodes"
COMMANDS = {
    f"compare idle learned-smart --scenario smart constant {COMPARE} 0": "summary.json",
    f"compare idle tests.support.bad_policies:Crashes --scenario constant {COMPARE} 1": "constant-idle.csv",
    f"compare idle --target evader --scenario duel {COMPARE} 0": "summary.json",
    "tune pngl-l-phi --scenario constant --only gain near --population 4 --worlds 2 --generations 2": "tuned.json",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_gives_the_same_file(command: str, nodes: Cluster, folder: Path) -> None:
    status = [main([*command.split(), "--out", name, *more]) for name, *more in (["here"], ["there", "--ray"])]
    assert status[0] == status[1] == int("Crashes" in command)
    assert filecmp.cmp(folder / "here" / COMMANDS[command], folder / "there" / COMMANDS[command], shallow=False)
    assert not WORK.exists()


def test_seeds_are_trained_to_the_same_weights(nodes: Cluster, folder: Path) -> None:
    command = "train --seed 1 --steps 1 --num-worlds 2 --rollout 8 --evaluate-worlds 1 --beside None --no-tensorboard"
    for name, *more in (["here"], ["there", "--ray"]):
        assert main([*command.split(), "--out", name, *more]) == 0
    here, there = (load_file(folder / name / "last.safetensors") for name in ("here", "there"))
    assert_equal(here, there)
