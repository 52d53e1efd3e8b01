"""Writes the manual's page on other simulators from the results of ``peers.py``."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

Row = dict[str, Any]

CONTENTS = {
    "posse": (
        "`smart`: 5 trackers with limits on speed and turn rate, an evasive target, swept "
        "contacts, target sensor, sonar ring, messages of team-mates, score and every "
        "metric, automatic resets; open plane, no occlusion, radio without loss"
    ),
    "posse, own kernel": (
        "the same worlds, stepped by a kernel compiled for this scenario (`own_kernel=True`) and cached on disk"
    ),
    "posse, field": (
        "as `posse`, with 6 occluding obstacles, walls, short and noisy sensing, a radio with "
        "range, delay and loss, faults and outages"
    ),
    "posse, PettingZoo": "as `posse`, one world, through PettingZoo's parallel interface",
    "mpe2 simple_tag": ("5 adversaries, 1 agent, 2 obstacles: forces, soft contacts, positions of all others"),
    "PettingZoo pursuit": "5 pursuers, 1 evader on a grid; an image of 7 x 7 x 3 each",
    "Gymnasium CartPole": "one cart with a pole; a reference for what numpy reaches",
    "VMAS simple_tag, 10 substeps": "as mpe2's, with VMAS's 10 substeps; episodes never end",
    "VMAS simple_tag, 1 substep": "the same with 1 substep, the row comparable with mpe2",
    "JaxMARL simple_tag": "as mpe2's; jit, vmap, scan; automatic resets",
    "CAMAR": (
        "5 differential-drive robots, goals, 3 obstacles and a border, made of discs; "
        "2 physics steps; jit, vmap, scan; episodes never end"
    ),
    "PufferLib Ocean target": (
        "5 agents, 1 goal: motion and positions of all others; C, including the loop over steps and worlds; no contacts"
    ),
}

WHAT_IS_TIMED = """\
An agent-step is one step of one agent that receives an action; targets moved by the simulator are
not counted. Actions are random and drawn before timing starts. Observations and rewards are
computed in every step. The JAX and C simulators keep only the latest observations; the others
return those of every step. With one thread, the process is pinned to one core.

To run it again: `make bench-peers` (needs a C compiler). `python benchmarks/peers.py --page` writes
this page from `benchmarks/results/peers.json`, which also holds every sample and the throughput per
second of processor time."""

SPEED = """\
## Throughput

Million agent-steps/s, median of {samples} samples, by number of worlds. Small figures: how many
times the throughput of `posse, own kernel` is that of the simulator, with the same number of
threads. Host load varies during a run, so this ratio is taken between ratios to mpe2, which is
sampled immediately before each sample."""

DISTURBED = """\
!!! warning "Other processes ran during the measurement"

    {spoilt} of the {taken} samples were taken while other processes used the cores, and {dropped}
    more were dropped. The ratios are more reliable than the throughput; cells with a star contain
    such samples."""


def write_page(results: dict[str, Any], path: Path) -> None:
    """Write ``docs/peers.md``."""
    rows: list[Row] = results["rows"]
    parts = [
        "# Compared with other simulators",
        _machine(results["machine"]),
        WHAT_IS_TIMED,
        _disturbance(rows),
        SPEED.format(samples=results["samples"]),
        _speed_table(rows),
        "## What each simulator computes",
        _contents(rows),
    ]
    if results["missing"]:
        missing = results["missing"].items()
        lines = [f"- {name}: {reason.strip().splitlines()[-1]}" for name, reason in missing]
        parts += ["## Missing from this run", "\n".join(lines)]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _machine(machine: dict[str, Any]) -> str:
    return (
        f"One run of `make bench-peers` on one machine: {machine['processor']}, "
        f"{machine['cores']} cores, {machine['memory_gib']} GiB, {machine['system']}, "
        f"Python {machine['python']}, {machine['date']}, commit `{machine['commit']}`."
    )


def _disturbance(rows: list[Row]) -> str:
    spoilt = sum(row["spoilt"] for row in rows)
    taken = sum(len(row["samples"]) for row in rows)
    dropped = sum(row["dropped"] for row in rows)
    if not spoilt:
        repeated = f"; {dropped} samples with other load were repeated" if dropped else ""
        return (
            f"Other processes used at most 0.15 cores during these samples{repeated}. "
            "A virtual machine cannot see the load of its host: the ratios are more reliable than "
            "the throughput."
        )
    return DISTURBED.format(spoilt=spoilt, taken=taken, dropped=dropped)


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _ratio(row: Row) -> float:
    pairs = zip(row["samples"], row["yardstick"], strict=True)
    return float(statistics.median(ours / theirs for ours, theirs in pairs))


def _lines(header: list[str], rule: list[str], body: list[list[str]]) -> str:
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, rule, *body))


def _table(rows: list[Row], cell: Callable[[Row], str]) -> str:
    batches = sorted({row["batch"] for row in rows})
    found = {(row["name"], row["threads"], row["batch"]): cell(row) for row in rows}
    kinds = dict.fromkeys((row["name"], row["threads"]) for row in rows)
    return _lines(
        ["simulator", "threads", *(f"{batch:,}" for batch in batches)],
        ["---", *["---:"] * (1 + len(batches))],
        [
            [name, str(threads), *(found.get((name, threads, batch), "") for batch in batches)]
            for name, threads in kinds
        ],
    )


def _speed_table(rows: list[Row]) -> str:
    own = {(r["threads"], r["batch"]): _ratio(r) for r in rows if r["name"] == "posse, own kernel"}

    def cell(row: Row) -> str:
        star = r"\*" if row["spoilt"] else ""
        speed = f"{statistics.median(row['samples']) / 1e6:.3g}{star}"
        ours = own.get((row["threads"], row["batch"]))
        if ours is None or row["name"].startswith("posse"):
            return speed
        return f"{speed}<br><small>{_number(ours / _ratio(row))}</small>"

    return _table(rows, cell)


def _contents(rows: list[Row]) -> str:
    first = {row["name"]: row for row in reversed(rows)}
    body = []
    for name in dict.fromkeys(row["name"] for row in rows):
        row = first[name]
        versions = ", ".join(f"{package} {version}" for package, version in row["versions"].items())
        sizes = [str(row["agents"]), str(row["observation"])]
        body.append([name, CONTENTS[name], *sizes, versions])
    return _lines(
        ["simulator", "world", "agents", "observation size", "versions"], ["---", "---", "---:", "---:", "---"], body
    )
