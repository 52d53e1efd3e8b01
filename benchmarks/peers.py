"""``make bench-peers``: throughput of posse compared with other simulators, on one machine.

    python benchmarks/peers.py --only posse vmas   some of them, printed and not written

Each simulator runs in a virtual environment of its own, under ``.venv-peers/``, with the exact versions of
``peers/requirements-*.txt``. Timed are steps of a batch with actions drawn beforehand, including observations and
rewards. Writes benchmarks/peers.csv. To add one: a runner with a function ``build``, a file of pins, a row in PEERS.
"""

import csv
import hashlib
import json
import os
import statistics
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import tyro
from speed import describe

RUNNERS: Final = Path(__file__).parent / "peers"
TABLE: Final = Path(__file__).parent / "peers.csv"
ENVIRONMENTS: Final = Path(__file__).parents[1] / ".venv-peers"
BATCHES: Final = (1, 32, 1024, 16_384)
SAMPLES: Final = 5


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


PEERS: Final = (
    Peer("posse", "posse_batch", None, "smart"),
    Peer("posse, field", "posse_batch", None, "field"),
    Peer("posse, PettingZoo", "posse_pettingzoo", None, batches=(1,), threaded=False),
    Peer("mpe2 simple_tag", "mpe2_tag", "mpe2", batches=(1,), threaded=False),
    Peer("VMAS simple_tag, 10 substeps", "vmas_tag", "vmas", "10 substeps"),
    Peer("VMAS simple_tag, 1 substep", "vmas_tag", "vmas", "1 substep"),
    Peer("JaxMARL simple_tag", "jaxmarl_tag", "jaxmarl"),
)


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    only: tuple[str, ...] = ()
    """Measure only peers whose names contain one of these words, and write nothing."""


def python_of(peer: Peer) -> Path:
    """Return the interpreter of a peer's runner; its environment is made unless one with the same pins exists."""
    if peer.environment is None:
        return Path(sys.executable)
    folder = ENVIRONMENTS / peer.environment
    requirements = RUNNERS / f"requirements-{peer.environment}.txt"
    stamp, python = folder / "requirements.stamp", folder / "bin" / "python"
    digest = hashlib.sha256(requirements.read_bytes()).hexdigest()
    if not stamp.exists() or stamp.read_text(encoding="ascii") != digest:
        print(f"installing {peer.environment}", flush=True)
        folder.mkdir(parents=True, exist_ok=True)
        (ENVIRONMENTS / ".gitignore").write_text("*\n", encoding="ascii")
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", "--requirement", str(requirements)], check=True)
        stamp.write_text(digest, encoding="ascii")
    return python


def measure(peer: Peer, threads: int) -> list[dict[str, Any]]:
    """Return a row for each number of worlds; ``peers/serve.py`` describes the requests."""
    cores = ",".join(map(str, sorted(os.sched_getaffinity(0))[:threads]))
    # One thread means one core for every simulator; JAX ignores other settings.
    command = ["taskset", "-c", cores, str(python_of(peer)), str(RUNNERS / f"{peer.runner}.py")]
    rows = []
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": str(threads)},
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for worlds in peer.batches:
            agents = ask(process.stdin, process.stdout, build=worlds, variant=peer.variant)["agents"]
            found = [ask(process.stdin, process.stdout, sample=True) for _ in range(SAMPLES)]
            rates = [answer["steps"] / answer["seconds"] * agents * worlds for answer in found]
            rate = {"agent_steps": statistics.median(rates), "low": min(rates), "high": max(rates)}
            rows.append({"simulator": peer.name, "threads": threads, "worlds": worlds, **rate})
            print(f"{peer.name:30} {threads} threads {worlds:6,} worlds: {rate['agent_steps']:12,.0f}", flush=True)
        process.stdin.close()
    return rows


def ask(requests: IO[str], answers: IO[str], **request: Any) -> dict[str, Any]:
    """Return a runner's answer to a request."""
    requests.write(json.dumps(request) + "\n")
    requests.flush()
    line = answers.readline()
    while line and not line.startswith("{"):  # what a library prints when imported
        line = answers.readline()
    if not line:
        raise RuntimeError("the simulator stopped")
    answer: dict[str, Any] = json.loads(line)
    return answer


def main() -> None:
    """Measure, and write the table."""
    settings = tyro.cli(Settings, description=__doc__)
    chosen = [p for p in PEERS if not settings.only or any(w.lower() in p.name.lower() for w in settings.only)]
    about, cores, rows = describe(), len(os.sched_getaffinity(0)), []
    for peer in chosen:
        for threads in sorted({1, cores} if peer.threaded else {1}):
            try:
                rows += measure(peer, threads)
            except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
                print(f"{peer.name} left out: {error}", flush=True)
    if settings.only:
        return
    machine = "{processor} ({cores} cores) {system} Python {python} {date}".format(**about)
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*rows[0], "machine", "commit"], lineterminator="\n")
        writer.writeheader()
        for row in rows:
            rounded = {name: round(value) if isinstance(value, float) else value for name, value in row.items()}
            writer.writerow({**rounded, "machine": machine, "commit": about["commit"]})


if __name__ == "__main__":
    main()
