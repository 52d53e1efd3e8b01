"""From the results of ``peers.py`` to the page of the manual."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

Row = dict[str, Any]

CONTENTS = {
    "posse": (
        "`smart`: 5 trackers with limits on speed and turn rate, an evasive target, swept "
        "contacts, target sensor, sonar ring, what team-mates tell, score and every metric, "
        "automatic resets; open plane and a perfect radio, so nothing to occlude and nothing lost"
    ),
    "posse, own kernel": (
        "the same worlds, stepped by a kernel that is compiled for this scenario alone "
        "(`own_kernel=True`), once, and kept on disk"
    ),
    "posse, field": (
        "as `posse`, and 6 obstacles that occlude, walls, short and noisy sensing, a radio with "
        "range, delay and loss, faults and outages"
    ),
    "posse, PettingZoo": "as `posse`, one world, through PettingZoo's parallel interface",
    "mpe2 simple_tag": (
        "5 adversaries, 1 agent, 2 obstacles: forces, soft contacts, places of all others"
    ),
    "PettingZoo pursuit": "5 pursuers, 1 evader on a grid; a picture of 7 x 7 x 3 each",
    "Gymnasium CartPole": "one cart with a pole; a yardstick of what numpy reaches",
    "VMAS simple_tag, 10 substeps": "as mpe2's, with VMAS's own 10 substeps; episodes never end",
    "VMAS simple_tag, 1 substep": "the same with 1 substep, the like-for-like row",
    "JaxMARL simple_tag": "as mpe2's; jit, vmap, scan; automatic resets",
    "CAMAR": (
        "5 robots with differential drive, goals, 3 obstacles and a border, made of discs; "
        "2 physics steps; jit, vmap, scan; episodes never end"
    ),
    "PufferLib Ocean target": (
        "5 agents, 1 goal: motion and places of all others, in C, the loop over steps and worlds "
        "too; no contacts"
    ),
}

WHAT_IS_TIMED = """\
An agent-step is one step of one agent that is given an action; targets that the simulator moves
itself are not counted. Actions are random and drawn before the clock starts, for all; observations
and rewards are computed in every step, by all. The simulators in JAX and in C keep the latest
observations alone; the others hand over those of every step. One thread means that the process is
held to one core."""

SPEED = """\
## Million agent-steps a second

The median of {samples} samples; beneath it their spread, greatest less least, as a share of it. A
column is a number of worlds."""

CORE_FOR_CORE = """\
## Core for core

Million agent-steps for each second of processor time, all threads counted; the median. Work that
only took turns with a simulator leaves this alone."""

TIMES_MPE2 = """\
## Times mpe2

Each sample over one of mpe2's made just before it; the median. mpe2 has one world and one thread
throughout."""

OURS_OVER_THEIRS = """\
## Ours over theirs

Our ratio to mpe2 over theirs, with the same number of threads."""

DISTURBED = """\
!!! warning "Other work ran on the machine"

    {spoilt} of the {taken} samples were taken while something else kept the machine busy, and
    {dropped} more were dropped. Read the ratios rather than the speeds; cells with a star have such
    samples."""


def write_page(results: dict[str, Any], path: Path) -> None:
    """Write ``docs/peers.md``."""
    rows: list[Row] = results["rows"]
    parts = [
        "# Beside other simulators",
        _machine(results["machine"]),
        WHAT_IS_TIMED,
        _disturbance(rows),
        SPEED.format(samples=results["samples"]),
        _table(rows, _speed),
        CORE_FOR_CORE,
        _table(rows, lambda row: f"{statistics.median(row['per_core']) / 1e6:.3g}"),
        TIMES_MPE2,
        _table(rows, lambda row: _number(_ratio(row))),
        *_ours_over_theirs(rows),
        "## What each computes",
        _contents(rows),
    ]
    if results["missing"]:
        missing = results["missing"].items()
        lines = [f"- {name}: {reason.strip().splitlines()[-1]}" for name, reason in missing]
        parts += ["## Missing from this run", "\n".join(lines)]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _machine(machine: dict[str, Any]) -> str:
    return (
        f"Made by `make bench-peers`, from one run on one machine: {machine['processor']}, "
        f"{machine['cores']} cores, {machine['memory_gib']} GiB, {machine['system']}, "
        f"Python {machine['python']}, {machine['date']}, commit `{machine['commit']}`."
    )


def _disturbance(rows: list[Row]) -> str:
    spoilt = sum(row["spoilt"] for row in rows)
    taken = sum(len(row["samples"]) for row in rows)
    dropped = sum(row["dropped"] for row in rows)
    if not spoilt:
        others = f"; {dropped} others were disturbed, and repeated" if dropped else ""
        return (
            f"Nothing else that the machine knows of kept it busy during these samples{others}. "
            "A virtual machine does not know what its host does: read the ratios rather than the "
            "speeds."
        )
    return DISTURBED.format(spoilt=spoilt, taken=taken, dropped=dropped)


def _speed(row: Row) -> str:
    samples = row["samples"]
    middle = statistics.median(samples)
    spread = (max(samples) - min(samples)) / middle
    star = r"\*" if row["spoilt"] else ""
    return f"{middle / 1e6:.3g}{star}<br><small>{spread:.0%}</small>"


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


def _ours_over_theirs(rows: list[Row]) -> list[str]:
    parts = [OURS_OVER_THEIRS]
    theirs = [row for row in rows if not row["name"].startswith("posse")]
    for name in ("posse", "posse, own kernel"):
        ours = {(row["threads"], row["batch"]): _ratio(row) for row in rows if row["name"] == name}

        def cell(row: Row, ours: dict[tuple[int, int], float] = ours) -> str:
            mine = ours.get((row["threads"], row["batch"]))
            return "" if mine is None else _number(mine / _ratio(row))

        parts += [f"`{name}`:", _table(theirs, cell)]
    single = [_ratio(row) for row in rows if row["name"] == "posse, PettingZoo"]
    if single:
        parts += [f"Through PettingZoo's own interface: {_number(single[0])} times mpe2."]
    return parts


def _contents(rows: list[Row]) -> str:
    first = {row["name"]: row for row in reversed(rows)}
    body = []
    for name in dict.fromkeys(row["name"] for row in rows):
        row = first[name]
        versions = ", ".join(f"{package} {version}" for package, version in row["versions"].items())
        sizes = [str(row["agents"]), str(row["observation"])]
        body.append([name, CONTENTS[name], *sizes, versions])
    return _lines(
        ["simulator", "a world", "agents", "numbers observed", "versions"],
        ["---", "---", "---:", "---:", "---"],
        body,
    )
