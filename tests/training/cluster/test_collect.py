"""Shards are done once each whatever dies, and those of a killed driver are found again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.support.workers import Here

from posse_training.cluster.collect import Outcome, Watcher, collect
from posse_training.cluster.shards import Arrays, Job, Shard, cut, joined
from posse_training.cluster.store import Folder, Memory, Store
from posse_training.errors import ClusterError


def squares(offset: int, shard: Shard) -> Arrays:
    worlds = np.arange(shard.first, shard.first + shard.count)
    return {"square": (worlds + offset) ** 2.0}


def job(offset: int = 0, count: int = 23, identity: object = None) -> Job:
    shards = cut(count, 4)
    return Job(f"squares {offset}", squares, (offset,), shards, identity or {"offset": offset})


class Killed(BaseException):
    """The driver is killed."""


@pytest.mark.parametrize(("count", "size", "first"), [(1, 5, 0), (10, 5, 3), (11, 5, 0), (7, 1, 2)])
def test_shards_hold_each_world_once(count: int, size: int, first: int) -> None:
    shards = cut(count, size, first)
    worlds = [w for s in shards for w in range(s.first, s.first + s.count)]
    assert worlds == list(range(first, first + count))
    assert max(shard.count for shard in shards) <= size


@pytest.mark.parametrize("kind", ["memory", "folder"])
def test_results_stand_in_the_order_of_the_worlds(kind: str, tmp_path: Path) -> None:
    store: Store = Memory() if kind == "memory" else Folder(tmp_path)
    one, other = job(), job(5)
    assert collect([one, other], Here(), store, Watcher()) == {}
    for each, offset in ((one, 0), (other, 5)):
        np.testing.assert_array_equal(joined(store.read(each))["square"], (np.arange(23) + offset) ** 2)


def test_a_worker_that_dies_costs_its_shard_only() -> None:
    lost: list[Shard] = []

    class Counting(Watcher):
        def lost(self, job: Job, shard: Shard, why: str) -> None:
            assert why == "node gone"
            lost.append(shard)

    unlucky = Shard(8, 4)
    backend = Here(lambda _, shard, attempt: Outcome(lost="node gone") if shard == unlucky and attempt < 3 else None)
    store, one = Memory(), job()
    assert collect([one], backend, store, Counting()) == {}
    np.testing.assert_array_equal(joined(store.read(one))["square"], np.arange(23) ** 2)
    assert lost == [unlucky, unlucky]
    assert sorted(shard for _, shard in backend.started) == sorted([*one.shards, *lost])


def test_a_shard_that_kills_every_worker_ends_its_job_alone() -> None:
    bad, good = job(1), job(2)
    backend = Here(lambda of, shard, _: Outcome(lost="crash") if of is bad else None)
    store = Memory()
    failed = collect([bad, good], backend, store, Watcher(), attempts=3)
    assert list(failed) == [bad]
    assert isinstance(failed[bad], ClusterError)
    assert "3 workers died with worlds" in str(failed[bad])
    assert "crash" in str(failed[bad])
    assert store.missing(good) == []


def test_an_error_of_the_work_itself_is_not_tried_again() -> None:
    bad, good = job(1), job(2)
    error = ValueError("no")
    backend = Here(lambda of, *_: Outcome(error=error) if of is bad else None)
    store = Memory()
    assert collect([bad, good], backend, store, Watcher()) == {bad: error}
    assert store.missing(good) == []
    assert len(set(backend.started)) == len(backend.started)


def kill_after(done: int) -> Callable[[Job, Shard, int], Outcome | None]:
    count = iter(range(done))

    def fate(*_: object) -> None:
        if next(count, None) is None:
            raise Killed

    return fate


def test_a_killed_driver_resumes(tmp_path: Path) -> None:
    with pytest.raises(Killed):
        collect([job()], Here(kill_after(4)), Folder(tmp_path), Watcher())
    again, backend = job(), Here()
    assert len(Folder(tmp_path).missing(again)) == 2
    collect([again], backend, Folder(tmp_path), Watcher())
    assert len(backend.started) == 2
    whole = joined(Folder(tmp_path).read(again))["square"]
    np.testing.assert_array_equal(whole, np.arange(23) ** 2)


def test_results_of_other_work_are_not_taken_for_these(tmp_path: Path) -> None:
    collect([job()], Here(), Folder(tmp_path), Watcher())
    assert Folder(tmp_path).missing(job(identity={"offset": 0})) == []
    for other in (job(1), job(identity={"offset": 0, "seed": 2})):
        assert len(Folder(tmp_path).missing(other)) == len(other.shards)
    assert Folder(tmp_path).missing(job(count=24)) == [Shard(20, 4)]  # more of the same


def test_a_damaged_file_is_done_again(tmp_path: Path) -> None:
    one = job()
    store = Folder(tmp_path)
    collect([one], Here(), store, Watcher())
    first, second, *_ = sorted(tmp_path.rglob("*.npz"))
    content = bytearray(first.read_bytes())
    content[len(content) // 2] ^= 0xFF
    first.write_bytes(content)
    second.write_bytes(second.read_bytes()[:40])
    assert len(store.missing(one)) == 2
    with pytest.raises(ClusterError, match="is missing or damaged"):
        store.read(one)


def test_two_processes_cannot_collect_the_same(tmp_path: Path) -> None:
    with Folder(tmp_path).held(job()), pytest.raises(ClusterError, match="wait for it"), Folder(tmp_path).held(job()):
        pass
    with Folder(tmp_path).held(job(1)), Folder(tmp_path).held(job()):
        pass


def test_only_what_is_ours_is_removed(tmp_path: Path) -> None:
    store, one = Folder(tmp_path / "work"), job()
    collect([one], Here(), store, Watcher())
    (tmp_path / "work" / "notes").mkdir()
    (tmp_path / "work" / "notes" / "mine.txt").touch()
    store.clear()
    assert [path.name for path in (tmp_path / "work").iterdir()] == ["notes"]
