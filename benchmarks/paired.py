"""Throughput of this version compared with an earlier commit, by interleaved runs.

A process for each version plays the same worlds in turns of a tenth of a second, so that a change
of the host's load meets both. The fastest chunk of a millisecond of all turns counts: other load
only adds to it. Where a process lies in memory changes its speed by some percent, so that both are
started several times. The earlier version is taken out of the repository's history.

    python benchmarks/paired.py --against d79ea81
"""

from __future__ import annotations

import io
import json
import statistics
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro
from machine import describe
from rich.console import Console
from rich.progress import track
from rich.table import Table

ROOT = Path(__file__).parents[1]
WORKER = Path(__file__).with_name("paired_worker.py")


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    against: str = "d79ea81"
    """Commit of the earlier version."""
    scenarios: tuple[str, ...] = ("smart", "field")
    worlds: tuple[int, ...] = (1024, 4096, 16384)
    threads: tuple[int, ...] = (1, 2)
    kernels: tuple[str, ...] = ("general", "own")
    starts: int = 5
    """Pairs of processes."""
    pairs: int = 6
    """Pairs of runs of each figure in each pair of processes."""
    seconds: float = 0.1
    """Length of a run, s."""
    single: bool = True
    """Also measure the environments of one world."""


@dataclass(frozen=True)
class Case:
    """What is measured: ``kind`` is ``batch``, ``pettingzoo`` or ``team``."""

    kind: str
    scenario: str = "smart"
    worlds: int = 1
    threads: int = 1
    kernel: str = "general"


class Version:
    """A process that plays the worlds of one version."""

    def __init__(self, root: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(WORKER), str(root)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def time(self, case: Case, seconds: float) -> float:
        """Return the time of a step in one run, s."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps({"case": asdict(case), "seconds": seconds}) + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())


def extract(commit: str, folder: Path) -> None:
    """Write the tree of ``commit`` into ``folder``."""
    tree = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True)
    with tarfile.open(fileobj=io.BytesIO(tree.stdout)) as archive:
        archive.extractall(folder, filter="data")


def cases(s: Settings) -> list[Case]:
    """Return all that is measured."""
    batches = [
        Case("batch", scenario, worlds, threads, kernel)
        for scenario in s.scenarios
        for worlds in s.worlds
        for kernel in s.kernels
        for threads in s.threads
    ]
    return [*batches, *([Case("pettingzoo"), Case("team")] if s.single else [])]


def ratio(earlier: Version, present: Version, case: Case, s: Settings) -> float:
    """Return the speed of the present version as a share of the earlier one's."""
    least = {earlier: float("inf"), present: float("inf")}
    for turn in range(-1, s.pairs):  # the first compiles, and reaches the steady state
        for version in (earlier, present) if turn % 2 else (present, earlier):
            least[version] = min(least[version], version.time(case, s.seconds))
    return least[earlier] / least[present]


def main() -> None:
    """Measure and print a table in Markdown's form."""
    s = tyro.cli(Settings, description=__doc__)
    ratios: dict[Case, list[float]] = {case: [] for case in cases(s)}
    with tempfile.TemporaryDirectory() as folder:
        extract(s.against, Path(folder))
        for _ in track(range(s.starts), console=Console(stderr=True)):
            earlier, present = Version(Path(folder)), Version(ROOT)
            for case, found in ratios.items():
                found.append(ratio(earlier, present, case, s))
            for version in (earlier, present):
                version.process.terminate()
    table = Table("", "worlds", "kernel", "threads", f"ratio to {s.against} [least, greatest]")
    for case, found in ratios.items():
        name = case.scenario if case.kind == "batch" else case.kind
        table.add_row(
            name,
            f"{case.worlds:,}",
            case.kernel,
            str(case.threads),
            f"{statistics.median(found):.2f} [{min(found):.2f}, {max(found):.2f}]",
        )
    console = Console(width=None if sys.stdout.isatty() else 120)
    console.print(describe())
    console.print(table)


if __name__ == "__main__":
    main()
