"""What only a Ray cluster can show; run by ``tests/training/cluster/test_ray.py`` where Ray is."""

from __future__ import annotations

import filecmp
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ray
from ray.cluster_utils import Cluster as Nodes
from safetensors.numpy import load_file
from tests.support.ray_policies import Watched

from posse_baselines import load
from posse_training import Results, evaluate
from posse_training.cli import main
from posse_training.cluster import Cluster
from posse_training.reports.failures import PlayError
from posse_training.train.settings import LAST

SHORT: dict[str, Any] = {"horizon": 20, "settle_time": 0.5, "progress": False}
EPISODES = 45
WORLDS = 5  # nine shards


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    """Three nodes: one for the driver, two with a worker each."""
    head = {
        "num_cpus": 0,
        "include_dashboard": False,
        "_system_config": {
            "health_check_period_ms": 300,  # a dead node is noticed in 2 s, not 15
            "idle_worker_killing_time_threshold_ms": 60_000,  # a new worker imports for seconds
        },
    }
    found = Nodes(initialize_head=True, head_node_args=head)
    for _ in range(2):
        found.add_node(num_cpus=1, wait=False)
    found.wait_for_nodes()
    ray.init(address=found.address, log_to_driver=False, logging_level="error")
    yield found
    ray.shutdown()
    found.shutdown()


@pytest.fixture(scope="module")
def local() -> Results:
    return evaluate("pursuit", "smart", EPISODES, **SHORT)


def same(one: Results, other: Results) -> None:
    assert list(one.columns) == list(other.columns)
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, other[name], err_msg=name)


def begun(folder: Path) -> int:
    return len(list(folder.glob("begun-*")))


def test_it_is_equal_to_a_local_run(nodes: Nodes, local: Results, tmp_path: Path) -> None:
    """Here first: workers that start with a cold cache would all compile the same kernels."""
    cluster = Cluster(work=tmp_path / "work", worlds=WORLDS)
    learned = evaluate("learned-smart", "smart", 12, **SHORT)
    same(evaluate(load("learned-smart"), "smart", 12, ray=cluster, **SHORT), learned)
    same(evaluate("pursuit", "smart", EPISODES, ray=cluster, **SHORT), local)
    assert list(tmp_path.iterdir()) == []


def test_a_worker_that_dies_costs_its_shard(nodes: Nodes, local: Results, tmp_path: Path) -> None:
    policy = Watched(tmp_path, 4, "die")
    cluster = Cluster(work=tmp_path / "work", worlds=WORLDS)
    same(evaluate(policy, "smart", EPISODES, ray=cluster, **SHORT), local)
    assert begun(tmp_path) == 9 + 1


def test_a_killed_driver_resumes(nodes: Nodes, local: Results, tmp_path: Path) -> None:
    """The shard that waits is lost with its driver; those that were done are not played again."""
    code = (
        "import sys; from pathlib import Path; from posse_training import evaluate\n"
        "from posse_training.cluster import Cluster\n"
        "from tests.support.ray_policies import Watched\n"
        f"folder = Path({str(tmp_path)!r})\n"
        f"cluster = Cluster(address={nodes.address!r}, work=folder / 'work', worlds={WORLDS})\n"
        "policy = Watched(folder, 4, 'wait')\n"
        f"evaluate(policy, 'smart', {EPISODES}, ray=cluster, **{SHORT!r})\n"
    )
    driver = subprocess.Popen([sys.executable, "-W", "ignore", "-c", code])
    done = tmp_path / "work"
    while len(list(done.rglob("*.npz"))) < EPISODES / WORLDS - 1:  # all but the one that waits
        assert driver.poll() is None
        time.sleep(0.1)
    driver.kill()
    driver.wait()
    assert begun(tmp_path) == 9
    (tmp_path / "go").touch()
    policy = Watched(tmp_path, 4, "wait")
    found = evaluate(policy, "smart", EPISODES, ray=Cluster(work=tmp_path / "work", worlds=WORLDS), **SHORT)
    same(found, local)
    assert begun(tmp_path) == 9 + 1


def test_an_error_of_a_policy_says_where(nodes: Nodes, tmp_path: Path) -> None:
    policy = Watched(tmp_path, 1, "fail")
    with pytest.raises(PlayError, match=r"^ValueError: no idea \(.*ray_policies.py, line"):
        evaluate(policy, "smart", 3, ray=Cluster(work=tmp_path / "work"), **SHORT)


def test_commands_give_the_same_files(nodes: Nodes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = {
        "compare idle pursuit --scenarios smart constant --episodes 3 "
        "--planner-episodes 0 --no-figures --out {}/compare": ("smart-idle.csv", "summary.json"),
        "compare idle --target evader --scenarios duel --episodes 3 --planner-episodes 1 --no-figures --out {}/duel": (
            "duel-idle.csv",
            "summary.json",
        ),
        "train --seeds 1 --steps 1 --num-worlds 2 --rollout 8 --evaluate-worlds 1 --beside None "
        "--advise None --imitate None --encoding plain --no-tensorboard --folder {}/train": ("seed-1/settings.json",),
    }
    for command, files in commands.items():
        name = command.split("{}/")[1]
        for place in ("here", "there"):
            words = command.format(place).split()
            assert main([*words, "--ray"] if place == "there" else words) == 0
        for file in files:
            one, other = (tmp_path / place / name / file for place in ("here", "there"))
            assert filecmp.cmp(one, other, shallow=False), file
        assert not list((tmp_path / "there").glob(".*.work"))
    for run in ("train/seed-1",):
        here, there = (load_file(tmp_path / p / run / LAST) for p in ("here", "there"))
        assert here.keys() == there.keys()
        assert all(np.array_equal(array, there[name]) for name, array in here.items()), run


def removing(nodes: Nodes, folder: Path) -> threading.Thread:
    """Start a thread that removes the node whose shard waits, and lets the others go on."""

    def remove() -> None:
        chosen = folder / "chosen"
        while not chosen.exists():
            time.sleep(0.05)
        time.sleep(0.2)
        (node,) = [n for n in nodes.worker_nodes if n.node_id == chosen.read_text()]
        nodes.remove_node(node, allow_graceful=False)
        (folder / "go").touch()

    thread = threading.Thread(target=remove)
    thread.start()
    return thread


def test_a_worker_of_two_nodes_and_a_node_of_three_die(nodes: Nodes, local: Results, tmp_path: Path) -> None:
    """The last test: it leaves two nodes."""
    for alive, deed in ((2, "die"), (3, "wait")):
        if deed == "wait":
            nodes.add_node(num_cpus=1)
        until = time.monotonic() + 30.0  # a dead node is noticed after a while
        while sum(node["Alive"] for node in ray.nodes()) != alive:
            assert time.monotonic() < until
            time.sleep(0.1)
        folder = tmp_path / deed
        folder.mkdir()
        thread = removing(nodes, folder) if deed == "wait" else None
        cluster = Cluster(work=tmp_path / "work", worlds=WORLDS)
        found = evaluate(Watched(folder, 4, deed), "smart", EPISODES, ray=cluster, **SHORT)
        same(found, local)
        if thread:
            thread.join()
        assert begun(folder) >= 9 + 1
