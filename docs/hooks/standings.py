"""Who scores what: tables from ``benchmarks/*.csv`` and from the cards of the shipped policies."""

import csv
import functools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from mkdocs.exceptions import PluginError

import posse
from declared_tables import code, table
from posse_baselines import load, policy_names
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import shipped
from posse_training.errors import SettingsError
from posse_training.evaluation import evaluate
from posse_training.leaderboard import WORLDS, Standing, read_standings

RESULTS: Final = Path(__file__).parents[2] / "benchmarks"
STANDINGS: Final = RESULTS / "standings.csv"
LEAGUES: Final = tuple(sorted((RESULTS / "league").glob("*.csv")))
"""The matrix of a league of `duel` for each seed, as ``posse league`` writes it."""
SCENARIOS: Final = tuple(n for n in posse.scenario_names() if not n.startswith("paper"))


@functools.cache
def standings(path: Path) -> tuple[Standing, ...]:
    """Return the rows of the present scenarios, the best first."""
    try:
        rows = read_standings(path)
    except SettingsError as error:
        raise PluginError(str(error)) from error
    versions = {name: posse.get_scenario(name).version for name in SCENARIOS}
    known = [row for row in rows if versions.get(row.scenario) == row.version]
    return tuple(sorted(known, key=lambda row: -row.safe_score))


def is_reference(row: Standing) -> bool:
    """Return whether a row stands beside the ranks: it reads the state, or is too slow for enough worlds."""
    return row.reads_state or row.policy == "belief-planner"


def of_scenario(scenario: str) -> list[Standing]:
    """Return the rows of a scenario: references first, then teams with enough worlds, the best first."""
    mine = [row for row in standings(STANDINGS) if row.scenario == scenario]
    ranked = [row for row in mine if not is_reference(row) and row.worlds >= WORLDS]
    return [row for row in mine if is_reference(row)] + ranked


def leaderboard() -> str:
    """Return the leaderboard: a table for each scenario."""
    parts = []
    for scenario in SCENARIOS:
        rows, rank = [], 0
        for row in of_scenario(scenario):
            rank += not is_reference(row)
            place = "" if is_reference(row) else rank
            worlds = (f"{row.worlds:,}", row.seed, code(row.commit[:7]))
            rows.append((place, _name(row), _score(row), f"{row.contact_free:.1%}", *worlds))
        header = ("", "team", "safe score [95 %]", "contact-free", "worlds", "seed", "commit")
        best = next((f"{row[1]} {row[2]}" for row in rows if row[0] == 1), "No results yet")
        summary = f"<summary markdown='span'>{best}</summary>"
        parts.append(f"### {scenario}\n\n<details markdown>{summary}\n\n{table(header, rows)}\n</details>\n")
    return "\n".join(parts)


def results() -> str:
    """Return the safe scores of all ranked teams and references, teams by scenarios."""
    found = {(row.label, name): row for name in SCENARIOS for row in of_scenario(name)}
    labels = list(dict.fromkeys(label for label, _ in found))
    rows = [
        (code(label), *(f"{found[label, n].safe_score:.3f}" if (label, n) in found else "" for n in SCENARIOS))
        for label in labels
    ]
    return table(("team", *SCENARIOS), rows)


@functools.cache
def tuned_beside(scenario: str, worlds: int, seed: int) -> float:
    """Return the safe score of `ddcs-tuned` on worlds of the leaderboard."""
    played = evaluate("ddcs-tuned", scenario, worlds, seed, split="test", progress=False)
    return float(played["safe_score"].mean())


def headroom() -> str:
    """Return what separates the tuned script from the planners on the worlds that these played."""
    rows = []
    for name in SCENARIOS:
        found = {row.label: row for row in of_scenario(name)}
        belief, planner = found["belief-planner"], found["planner"]
        script = tuned_beside(name, belief.worlds, belief.seed)
        gains = belief.safe_score - script, planner.safe_score - belief.safe_score
        rows.append((code(name), f"{script:.3f}", *(f"{gain:+.3f}" for gain in gains), f"{planner.safe_score:.3f}"))
    return table(("scenario", "`ddcs-tuned`", "control", "information", "planner"), rows)


def test_scores(row: Standing) -> list[float]:
    """Return the safe score of every training seed of a shipped team, where the row is of the scenario it learned."""
    card = LearnedPolicy.from_file(shipped()[row.policy]).card if row.policy in shipped() else {"scenarios": []}
    if [scenario["name"] for scenario in card["scenarios"]] != [row.scenario]:
        return []
    return [run["test"]["safe_score"]["value"] for run in card["training_seeds"] if "test" in run]


def training_seeds() -> str:
    """Return the safe score of every training seed of the shipped teams, from their cards."""
    rows = []
    for name in policy_names():
        card = getattr(load(name), "card", None) or {}
        seeds = [run["safe_score"] for run in card.get("training_seeds", ()) if "safe_score" in run]
        if seeds:
            shown = ", ".join(f"{s['value']:.3f}&nbsp;[{s['low']:.3f},&nbsp;{s['high']:.3f}]" for s in seeds)
            rows.append((code(name), seeds[0]["count"], shown))
    return table(("team", "worlds", "safe score of each training seed [95 % over worlds]"), rows)


def algorithms() -> str:
    """Return what algorithms reach from nothing: the mean of their seeds and its range; of one seed, the interval."""
    runs = _rows(RESULTS / "algorithms.csv")
    rows = []
    names = ("scenario", "algorithm", "safeguard")
    for which in sorted({tuple(run[name] for name in names) for run in runs}):
        mine = [run for run in runs if tuple(run[name] for name in names) == which]
        safe = [float(run["safe_score"]) for run in mine]
        least, greatest = (min(safe), max(safe)) if len(safe) > 1 else (float(mine[0][end]) for end in ("low", "high"))
        score, contact = (_mean(float(run[name]) for run in mine) for name in ("score", "contact_free"))
        layer = "safeguard" if which[2] == "True" else "bare"
        steps = f"{float(mine[0]['steps']) / 1e6:.0f} M"
        numbers = (f"{_mean(safe):.3f} [{least:.3f}, {greatest:.3f}]", f"{score:.3f}", f"{1 - contact:.1%}")
        rows.append((code(which[0]), which[1], layer, steps, len(mine), *numbers))
    header = ("scenario", "algorithm", "behind", "steps", "seeds", "safe score", "score", "worlds with contact")
    return table(header, rows)


def duel_script() -> str:
    """Return what the tuned script scores in `duel` against scripted targets and those that read nothing."""
    found = _league(LEAGUES[0])
    names = [target for team, target in found if team == "ddcs-tuned" and not target.startswith("target-")]
    rows = []
    for name in names:
        run = found["ddcs-tuned", name]
        share = f"{1 - float(run['contact_free']):.1%}"
        rows.append((code(name), f"{float(run['safe_score']):.3f}", f"{float(run['score']):.3f}", share))
    return table(("target", "safe score", "score", "worlds with contact"), rows)


def duel_leagues() -> str:
    """Return what the script and the last team of each league score against its targets."""
    rows = []
    for path in LEAGUES:
        found = {pair: float(run["safe_score"]) for pair, run in _league(path).items()}
        for team in ("ddcs-tuned", "trackers-4"):
            of = {target: score for (each, target), score in found.items() if each == team}
            worst = min(of, key=lambda name: of[name])
            shown = (f"{of[name]:.3f}" for name in ("smart", "target-1", "target-4"))
            rows.append((path.stem, code(team), *shown, f"{of[worst]:.3f}, {code(worst)}"))
    targets = (code(name) for name in ("smart", "target-1", "target-4"))
    return table(("seed", "team", *targets, "lowest, and against whom"), rows)


def _league(path: Path) -> dict[tuple[str, str], dict[str, str]]:
    """Return the rows of a league's matrix by team and target."""
    return {(run["team"], run["target"]): run for run in _rows(path)}


def peers() -> str:
    """Return the throughput of simulators by number of worlds, million agent-steps/s."""
    runs = _rows(RESULTS / "peers.csv")
    batches = sorted({int(run["worlds"]) for run in runs})
    found = {(run["simulator"], run["threads"], int(run["worlds"])): run for run in runs}
    rows = []
    for name, threads in dict.fromkeys((run["simulator"], run["threads"]) for run in runs):
        cells = [found.get((name, threads, batch)) for batch in batches]
        rows.append((name, threads, *("" if c is None else f"{float(c['agent_steps']) / 1e6:.3g}" for c in cells)))
    return f"{runs[0]['machine']}.\n\n" + table(("simulator", "threads", *(f"{batch:,}" for batch in batches)), rows)


def _rows(path: Path) -> Sequence[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _mean(values: Iterable[float]) -> float:
    found = list(values)
    return sum(found) / len(found)


def _name(row: Standing) -> str:
    """Return a label, whose letters ``Standing`` has checked."""
    shown = code(row.label) if row.label == row.policy else row.label
    return shown + (" (reference)" if is_reference(row) else "")


def _score(row: Standing) -> str:
    """Return a safe score whose interval is not broken across lines."""
    return f"{row.safe_score:.3f}&nbsp;[{row.low:.3f},&nbsp;{row.high:.3f}]"
