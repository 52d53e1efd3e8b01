"""A league's pairs played by workers: the same cells, whatever dies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import quiet
from tests.support.workers import Here

from posse_training.cluster import Cluster
from posse_training.cluster.collect import Outcome
from posse_training.cluster.store import Folder
from posse_training.league.cross_play import CrossPlay
from posse_training.league.members import TARGET, TEAM, founders
from posse_training.league.on_cluster import ClusterWork
from posse_training.league.settings import LeagueSettings
from posse_training.league.work import Work


class Killed(BaseException):
    """The driver is killed."""


def test_no_shard_is_lost_or_played_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = LeagueSettings(
        scenario="smart",
        teams=("idle", "pursuit"),
        targets=("smart", "evader"),
        episodes=4,
        overrides={"horizon": 20, "settle_time": 0.5},
        folder=tmp_path / "here",
    )
    there = replace(settings, folder=tmp_path / "there")
    for each in (settings, there):
        each.path.mkdir()
    pairs = [(a, b) for a in founders(settings, TEAM) for b in founders(settings, TARGET)]
    expected = CrossPlay(settings, Work(settings, quiet())).cells(pairs)

    def cells(backend: Here) -> Any:
        cluster = Cluster(work=tmp_path / "work", worlds=2)
        return CrossPlay(there, ClusterWork(there, quiet(), cluster, backend)).cells(pairs)

    original, writes = Folder.write, iter(range(6))

    def dying(*arguments: Any) -> None:
        if next(writes, None) is None:
            raise Killed
        original(*arguments)

    unlucky = Here(lambda job, shard, attempt: Outcome(lost="gone") if (shard.first, attempt) == (2, 1) else None)
    with monkeypatch.context() as patched:
        patched.setattr(Folder, "write", dying)
        with pytest.raises(Killed):
            cells(unlucky)
    again = Here()
    assert cells(again) == expected
    assert len(again.started) == 2 * len(pairs) - 6
    assert not (tmp_path / "work").exists()
