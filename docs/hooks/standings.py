"""Who scores what, from the result files in the repository, and the replays that show it."""

from __future__ import annotations

import functools
import html
from pathlib import Path
from typing import Final

from mkdocs.exceptions import PluginError

import posse
from declared_tables import code, table
from posse_training.errors import ResultFileError
from posse_training.leaderboard import ResultFile, read_result
from posse_training.leaderboard.submit import SEED, WORLDS
from posse_training.replay import read_replay
from posse_training.reports.statistics import Estimate, mean, share

ROOT: Final = Path(__file__).parents[2]
FOLDER: Final = ROOT / "benchmarks" / "leaderboard"
MEDIA: Final = ROOT / "docs" / "media"
SCENARIOS: Final = tuple(n for n in posse.scenario_names() if not n.startswith("paper"))
SUMMARY: Final = {
    "constant": "a target that runs straight on",
    "accelerating": "a target that weaves",
    "smart": "an evader, slower and more agile than the trackers",
    "search": "find the target first, with short sight",
    "obstacles": "discs block paths and the view",
    "radio": "messages are late and get lost",
    "leader-loss": "the only one that sees the target breaks",
    "field": "all of it at once, with noise",
    "duel": "a target that may have learned to escape",
}


@functools.cache
def results() -> tuple[ResultFile, ...]:
    """Return the results in the repository of the present scenarios, the best first."""
    found = []
    for path in sorted(FOLDER.glob("*.json")):
        try:
            result = read_result(path)
        except ResultFileError as error:
            raise PluginError(str(error)) from error
        known = result.scenario in SCENARIOS and result.split == "test" and result.seed == SEED
        if known and result.scenario_version == posse.get_scenario(result.scenario).version:
            found.append(result)
    return tuple(sorted(found, key=lambda r: -r.column("safe_score").mean()))


def of_scenario(scenario: str) -> list[ResultFile]:
    """Return the results on a scenario: references first, then teams, the best first."""
    mine = [r for r in results() if r.scenario == scenario]
    ranked = [r for r in mine if not r.reads_state and r.worlds >= WORLDS]
    return [r for r in mine if r.reads_state] + ranked


@functools.cache
def players(file: str) -> tuple[str, ...]:
    """Return who plays in a replay of the manual; nobody where there is none."""
    path = MEDIA / "replays" / f"{file}.html"
    return tuple(player.name for player in read_replay(path).players) if path.is_file() else ()


def replay(scenario: str) -> str:
    """Return a replay of a scenario in a frame, with a link to it alone."""
    address = f"site:media/replays/{scenario}.html"
    teams = " and ".join(code(name) for name in players(scenario))
    return (
        f'<iframe class="replay" src="{address}" loading="lazy" title="Replay of {scenario}">'
        f'</iframe>\n\n{teams} in the same world. <a href="{address}">Open the replay alone</a>; '
        "<kbd>?</kbd> in it lists its keys.\n"
    )


def gallery() -> str:
    """Return a card for each scenario: picture, name, what it is about."""
    cards = [
        f'- <a href="site:scenarios/{name}/"><img src="site:media/scenarios/{name}.png" '
        f'alt="A team on {name}" loading="lazy"></a>\n\n'
        f'    <a href="site:scenarios/{name}/"><strong>{name}</strong></a>: {SUMMARY[name]}\n'
        for name in SCENARIOS
    ]
    return '<div class="cards" markdown>\n\n' + "\n".join(cards) + "\n</div>\n"


def scores(scenario: str) -> str:
    """Return a table of who scores what on a scenario."""
    mine = of_scenario(scenario)
    if not mine:
        return "No results of this version yet: `make results` makes them.\n"
    best = max((r.column("safe_score").mean() for r in mine if r.reads_state), default=None)
    rows = []
    for result in mine:
        value = mean(result.column("safe_score"))
        of_planner = "" if best is None or result.reads_state else f"{value.value / best:.2f}"
        rows.append((_name(result), _whole(value), of_planner, _contact_free(result)))
    header = ("team", "safe score [95 %]", "of the planner's", "contact-free")
    return table(header, rows) + "\n" + _made_of(mine)


def leaderboard() -> str:
    """Return the leaderboard: a table for each scenario."""
    parts = []
    for scenario in SCENARIOS:
        rows, rank = [], 0
        for result in of_scenario(scenario):
            rank += not result.reads_state
            rows.append(
                (
                    "" if result.reads_state else rank,
                    _name(result),
                    _whole(mean(result.column("safe_score"))),
                    _contact_free(result),
                    f"{result.worlds:,}",
                    result.seed,
                    code((result.commit or "")[:7]),
                    replay_link(result),
                )
            )
        header = ("", "team", "safe score [95 %]", "contact-free", "worlds", "seed", "commit", "replay")
        parts.append(f"### {scenario}\n\n" + (table(header, rows) if rows else "No results yet.\n"))
    return "\n".join(parts)


def _name(result: ResultFile) -> str:
    name = html.escape(result.label).replace("|", "&#124;").replace("`", "&#96;")
    shown = f'<code class="team">{name}</code>' if result.label == result.policy else f"<span>{name}</span>"
    return shown + (" (reference)" if result.reads_state else "")


def _whole(value: Estimate) -> str:
    """Return an estimate whose interval is not broken across lines."""
    return str(value).replace(", ", ",&nbsp;")


def _contact_free(result: ResultFile) -> str:
    return f"{100 * share(result.column('contact_free') == 1).value:.1f} %"


def replay_link(result: ResultFile) -> str:
    """Return a link to a replay of the team, or the command that writes one."""
    if result.replay:
        return f'<a href="{html.escape(result.replay)}">replay</a>'
    further = sorted(path.stem for path in (MEDIA / "replays").glob(f"{result.scenario}-others*"))
    for file in (result.scenario, *further):
        if result.policy_kind == "shipped" and result.policy in players(file):
            return f'<a href="site:media/replays/{file}.html">replay</a>'
    return code(f"posse replay {result.policy} --scenario {result.scenario}")


def _made_of(shown: list[ResultFile]) -> str:
    commits = sorted({r.commit or "unknown" for r in shown})
    return (
        f"{WORLDS:,} worlds of the `test` split, seed {SEED} (references: as many as stated on the "
        f"[leaderboard](../leaderboard.md)), commit {', '.join(map(code, commits))}. Rows come "
        "from `benchmarks/leaderboard`.\n"
    )
