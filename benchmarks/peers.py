"""Throughput of posse compared with other simulators, on one machine.

    make bench-peers                               everything: installs, measures, writes the page
    python benchmarks/peers.py --only posse vmas   some of them, printed and not written

Each simulator runs in a virtual environment of its own, under ``.venv-peers/``, with the exact
versions of ``peers/requirements-*.txt``. Timed are steps of a batch with actions drawn beforehand,
including observations and rewards. Samples of a simulator alternate with samples of mpe2, so that
each has a ratio measured under the same load. A sample with other load on the machine is dropped
and repeated within a time limit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from machine import OtherWork, describe
from peers_report import write_page

HERE = Path(__file__).parent
ROOT = HERE.parent
RUNNERS = HERE / "peers"
ENVIRONMENTS = ROOT / ".venv-peers"
RESULTS = HERE / "results" / "peers.json"
PAGE = ROOT / "docs" / "peers.md"

BATCHES = (1, 32, 1024, 16_384)
SAMPLES = 5
UNDISTURBED = 0.15
"""Cores that others may use during a valid sample."""
PUFFERLIB = "3.0.0"


@dataclass(frozen=True)
class Peer:
    """One row of the table."""

    name: str
    runner: str
    """Script in ``peers/``, without its ending."""
    environment: str | None
    """Name of its requirements; ``None``: this project's environment."""
    variant: str = ""
    batches: tuple[int, ...] = BATCHES
    threaded: bool = True
    """Whether it can use more than one core."""


PEERS = (
    Peer("posse", "posse_batch", None, "smart"),
    Peer("posse, field", "posse_batch", None, "field"),
    Peer("posse, PettingZoo", "posse_pettingzoo", None, batches=(1,), threaded=False),
    Peer("mpe2 simple_tag", "mpe2_tag", "mpe2", batches=(1,), threaded=False),
    Peer("PettingZoo pursuit", "pursuit", "pettingzoo", batches=(1,), threaded=False),
    Peer("Gymnasium CartPole", "cartpole", "gymnasium", threaded=False),
    Peer("VMAS simple_tag, 10 substeps", "vmas_tag", "vmas", "10 substeps"),
    Peer("VMAS simple_tag, 1 substep", "vmas_tag", "vmas", "1 substep"),
    Peer("JaxMARL simple_tag", "jaxmarl_tag", "jaxmarl"),
    Peer("CAMAR", "camar_grid", "camar"),
    Peer("PufferLib Ocean target", "ocean_target", "ocean", threaded=False),
)
YARDSTICK = next(peer for peer in PEERS if peer.environment == "mpe2")


@dataclass
class Row:
    """Measurements of one simulator, number of threads and batch size."""

    name: str
    threads: int
    batch: int
    agents: int
    observation: int
    warm_up_seconds: float
    versions: dict[str, str]
    samples: list[float] = field(default_factory=list)
    """Agent-steps per second."""
    yardstick: list[float] = field(default_factory=list)
    """mpe2's agent-steps per second, just before each sample."""
    per_core: list[float] = field(default_factory=list)
    """Agent-steps per second of processor time, all threads counted."""
    spoilt: int = 0
    """Number of kept samples with other load."""
    dropped: int = 0


@dataclass(frozen=True)
class Sample:
    """Some steps of a batch, timed."""

    rate: float
    """Steps per second."""
    core_rate: float
    """Steps per second of processor time."""
    spoilt: bool
    """Whether there was other load."""


class Patience:
    """Time limit for repeating samples with other load, for the whole run, s."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds


class Runner:
    """A runner's process, used as a context; ``peers/serve.py`` describes the requests."""

    def __init__(self, peer: Peer, threads: int) -> None:
        self._peer = peer
        cores = sorted(os.sched_getaffinity(0))[:threads]
        command = [str(python_of(peer)), str(RUNNERS / f"{peer.runner}.py")]
        if peer.environment == "ocean":
            command.append(str(ENVIRONMENTS / "ocean"))
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        self._errors = tempfile.TemporaryFile(mode="w+")  # noqa: SIM115 (closed in __exit__)
        # One thread means one core for every simulator; JAX ignores other settings.
        self._process = subprocess.Popen(
            ["taskset", "-c", ",".join(map(str, cores)), *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=environment,
        )

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
        self._errors.close()

    def ask(self, **request: Any) -> dict[str, Any]:
        """Return the answer to a request."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            line = ""
        else:
            line = self._process.stdout.readline()
            while line and not line.startswith("{"):  # what a library prints when imported
                line = self._process.stdout.readline()
        if not line:
            self._errors.seek(0)
            raise RuntimeError(f"{self._peer.name} stopped: {self._errors.read()[-2000:]}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def build(self, batch: int) -> dict[str, Any]:
        """Build and warm up a batch."""
        return self.ask(build=batch, variant=self._peer.variant)

    def sample(self) -> Sample:
        """Take a sample."""
        watch = OtherWork()
        answer = self.ask(sample=True)
        busy = answer["processor_seconds"]
        return Sample(
            answer["steps"] / answer["seconds"], answer["steps"] / max(busy, 1e-9), watch.cores(busy) > UNDISTURBED
        )


def python_of(peer: Peer) -> Path:
    """Return the interpreter that a peer's runner runs with."""
    if peer.environment is None or peer.environment == "ocean":
        return Path(sys.executable)
    return ENVIRONMENTS / peer.environment / "bin" / "python"


def install(name: str) -> None:
    """Create a peer's virtual environment, unless one with the same pins exists."""
    requirements = RUNNERS / f"requirements-{name}.txt"
    stamp = ENVIRONMENTS / name / "requirements.stamp"
    digest = hashlib.sha256(requirements.read_bytes()).hexdigest()
    if stamp.exists() and stamp.read_text(encoding="ascii") == digest:
        return
    print(f"installing {name}", flush=True)
    ENVIRONMENTS.mkdir(exist_ok=True)
    (ENVIRONMENTS / ".gitignore").write_text("*\n", encoding="ascii")
    subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENTS / name)], check=True)
    python = str(ENVIRONMENTS / name / "bin" / "python")
    subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement", str(requirements)],
        check=True,
    )
    stamp.write_text(digest, encoding="ascii")


def ocean_source() -> None:
    """Put Ocean's ``target.h`` into ``.venv-peers/ocean``.

    pip unpacks the source distribution before it runs the build script, which fails because
    packages are missing that this header does not need; the unpacked source is kept and searched.
    """
    directory = ENVIRONMENTS / "ocean"
    if (directory / "target.h").exists():
        return
    print("fetching the source of PufferLib's Ocean", flush=True)
    directory.mkdir(parents=True, exist_ok=True)
    (ENVIRONMENTS / ".gitignore").write_text("*\n", encoding="ascii")
    with tempfile.TemporaryDirectory() as scratch:
        subprocess.run(
            [
                sys.executable,
                "-m",
                "pip",
                "download",
                "--quiet",
                "--no-clean",
                "--no-deps",
                "--no-build-isolation",
                "--no-binary",
                ":all:",
                "--dest",
                scratch,
                f"pufferlib=={PUFFERLIB}",
            ],
            env={**os.environ, "TMPDIR": scratch},
            capture_output=True,
            check=False,
        )
        found = list(Path(scratch).rglob("ocean/target/target.h"))
        if not found:
            raise RuntimeError("no target.h in PufferLib's source distribution")
        shutil.copy(found[0], directory)


def measure(runner: Runner, row: Row, yardstick: Runner, yardstick_agents: int, patience: Patience) -> None:
    """Take the samples of one row, each immediately after a sample of mpe2."""
    while len(row.samples) < SAMPLES:
        began = time.perf_counter()
        reference, sample = yardstick.sample(), runner.sample()
        spoilt = sample.spoilt or reference.spoilt
        if spoilt and patience.left > 0:
            row.dropped += 1
            time.sleep(0.2)
            patience.left -= time.perf_counter() - began
            continue
        agents = row.batch * row.agents
        row.samples.append(sample.rate * agents)
        row.per_core.append(sample.core_rate * agents)
        row.yardstick.append(reference.rate * yardstick_agents)
        row.spoilt += spoilt


def run(peers: list[Peer], patience: Patience) -> tuple[list[Row], dict[str, str]]:
    """Measure every peer; return the rows, and the reasons for missing ones."""
    rows: list[Row] = []
    missing: dict[str, str] = {}
    cores = len(os.sched_getaffinity(0))
    with Runner(YARDSTICK, cores) as yardstick:
        agents = yardstick.build(1)["agents"]
        for peer in peers:
            for threads in (1, cores) if peer.threaded and cores > 1 else (1,):
                try:
                    with Runner(peer, threads) as runner:
                        for batch in peer.batches:
                            built = runner.build(batch)
                            row = Row(peer.name, threads, batch, **built)
                            if peer.environment == "ocean":
                                row.versions["pufferlib"] = PUFFERLIB
                            measure(runner, row, yardstick, agents, patience)
                            rows.append(row)
                            report(row)
                except RuntimeError as error:
                    missing[peer.name] = str(error)
                    print(error, flush=True)
    return rows, missing


def report(row: Row) -> None:
    """Print a row."""
    middle = statistics.median(row.samples)
    spread = (max(row.samples) - min(row.samples)) / middle
    ratios = [a / b for a, b in zip(row.samples, row.yardstick, strict=True)]
    print(
        f"{row.name:30} {row.threads} thread{'s' if row.threads > 1 else ' '} "
        f"batch {row.batch:6,}: {middle:12,.0f} agent-steps/s  spread {spread:4.0%}  "
        f"{statistics.median(row.per_core):12,.0f} per core  "
        f"{statistics.median(ratios):10,.1f} x mpe2  "
        f"(disturbed {row.spoilt}, dropped {row.dropped})",
        flush=True,
    )


def prepare(peers: list[Peer]) -> tuple[list[Peer], dict[str, str]]:
    """Install the peers; return those that can run, and the reasons why others cannot."""
    ready: list[Peer] = []
    missing: dict[str, str] = {}
    install("mpe2")
    for peer in peers:
        try:
            if peer.environment == "ocean":
                ocean_source()
            elif peer.environment is not None:
                install(peer.environment)
        except (subprocess.CalledProcessError, RuntimeError) as error:
            missing[peer.name] = f"cannot be installed: {error}"
            print(f"{peer.name} {missing[peer.name]}", flush=True)
        else:
            ready.append(peer)
    return ready, missing


def main() -> None:
    """Measure, then write the results and the page of the manual."""
    parser = argparse.ArgumentParser(description="Throughput compared with other simulators.")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="only peers whose names contain this word")
    parser.add_argument(
        "--patience",
        type=float,
        default=120.0,
        metavar="S",
        help="time limit for repeating samples with other load, s (default 120)",
    )
    parser.add_argument("--page", action="store_true", help="write the page from the last results, without measuring")
    arguments = parser.parse_args()
    if arguments.page:
        write_page(json.loads(RESULTS.read_text(encoding="utf-8")), PAGE)
        return
    words = [word.lower() for word in arguments.only or [""]]
    chosen = [peer for peer in PEERS if any(word in peer.name.lower() for word in words)]
    machine = describe()
    ready, missing = prepare(chosen)
    rows, stopped = run(ready, Patience(arguments.patience))
    if arguments.only:
        return
    results = {
        "machine": machine,
        "samples": SAMPLES,
        "rows": [asdict(row) for row in rows],
        "missing": missing | stopped,
    }
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    write_page(results, PAGE)


if __name__ == "__main__":
    main()
