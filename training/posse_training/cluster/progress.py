"""Progress of work on a cluster: shards, time left, workers, lost shards."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from posse_training.cluster.collect import Watcher
from posse_training.cluster.shards import Job, Shard


class ClusterProgress(Watcher):
    """A bar over all shards, and a line for each that was lost.

    Args:
        title: What is done.
        disable: Show nothing.
        console: Where to show it.
    """

    def __init__(self, title: str, *, disable: bool = False, console: Console | None = None) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("shards, {task.fields[state]}"),
            TimeRemainingColumn(),
            transient=True,
            console=console,
            disable=disable,
        )
        self._task = self._bar.add_task(escape(title), total=None, state="")
        self._silent = disable
        self._deaths = 0

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        total = sum(len(job.shards) for job in jobs)
        self._bar.reset(self._task, total=total, completed=kept)
        if kept:
            self._say(f"resuming: {kept:,} of {total:,} shards are there")

    def state(self, given_out: int, workers: int) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        text = f"{workers:,} workers" if workers else "waiting for workers"
        if self._deaths:
            text += f", {self._deaths:,} lost and done again"
        self._bar.update(self._task, state=text)

    def done(self, job: Job, shard: Shard) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._bar.advance(self._task)

    def lost(self, job: Job, shard: Shard, why: str) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._deaths += 1
        last = shard.first + shard.count - 1
        self._say(f"lost, and done again: {job.name}, worlds {shard.first} to {last} ({why})")

    def failed(self, job: Job, error: Exception) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._say(f"failed: {job.name}: {error}")

    def _say(self, line: str) -> None:
        if not self._silent:
            self._bar.console.print(line, markup=False, soft_wrap=True)
