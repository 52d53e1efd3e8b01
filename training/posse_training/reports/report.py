"""The report of a comparison: one HTML file with tables, figures and replays that loads nothing.

Names, cards and errors of policies are written as text or data, never as markup or code, and the
page's Content-Security-Policy forbids all code but its own and that of replays.
"""

from __future__ import annotations

import html
import json
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

import posse
from posse_training.provenance import commit
from posse_training.replay import Replay
from posse_training.replay.page import as_data, content_policy, contents, digest, in_letters, shell
from posse_training.reports.comparing.comparison import Comparison
from posse_training.reports.comparing.extremes import Extreme
from posse_training.reports.pictures.figures import CAPTIONS
from posse_training.reports.pictures.inline import Sheet, inline
from posse_training.reports.pivots import Pivot, pivots
from posse_training.reports.statistics import Estimate

_COLUMNS: Final = {
    "safe_score": "safe score",
    "score": "score",
    "contact_free": "contact-free",
    "of_planner": "of the planner's",
    "bound": "bound",
    "settled": "settled",
    "difference": "difference",
    "improvement": "better in",
    "interquartile_mean": "IQM",
}


@dataclass(frozen=True)
class Shown:
    """A world that the report replays; without a replay, ``why`` says why."""

    extreme: Extreme
    replay: Replay | None
    why: str = ""


def report(
    found: Comparison, facts: dict[str, str], figures: Sequence[Path], wins: Sequence[Shown], losses: Sequence[Shown]
) -> str:
    """Return the page.

    Args:
        found: The results.
        facts: What was played, by name.
        figures: SVG files to show.
        wins: The largest wins against the baseline.
        losses: The largest losses against it.
    """
    sheet = Sheet()
    drawn = {path.stem: _figure(path, sheet) for path in figures}
    tables = pivots(found)
    packed: list[tuple[str, str, str]] = []
    sections = [
        _section("Scores", drawn.pop("scenarios", ""), *map(_table, tables[:1])),
        _replays(found, wins, losses, packed),
        _section("Contacts, planner, baseline", *map(_table, tables[1:])) if tables[1:] else "",
        _section("Figures", *drawn.values()) if drawn else "",
        _section("All estimates", _details(found)),
        _problems(found),
    ]
    style = f"{sheet.css()}\n{_file('report.css')}"
    script = _file("report.js")
    scenarios = list(dict.fromkeys(row["scenario"] for row in found.rows))
    heading = f"{len({row['policy'] for row in found.rows})} policies on {_several(scenarios)}"
    known = facts | {f"posse {posse.__version__}": commit() or "unknown commit"}
    values = {
        "title": html.escape(f"{heading}: comparison with {found.reference}"),
        "policy": _policy(script, style),
        "style": style,
        "heading": html.escape(heading),
        "facts": "".join(
            f"<div><dt>{html.escape(name)}</dt><dd>{html.escape(text)}</dd></div>" for name, text in known.items()
        ),
        "sections": "\n".join(sections),
        "shell": in_letters(zlib.compress(json.dumps(shell()).encode(), 9)) if packed else "",
        "replays": as_data(json.dumps(packed)),
        "script": script,
    }
    # In one pass, so that inserted text is not searched again.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: values[place[1]], _file("report.html"))


def _policy(script: str, style: str) -> str:
    """Return the Content-Security-Policy: the page's own code and style, and those of replays."""
    of_replays = content_policy()
    allowed = {
        **of_replays,
        "script-src": f"'{digest(script)}' {of_replays['script-src']}",
        "style-src": f"'{digest(style)}' {of_replays['style-src']}",
    }
    parts = {"default-src": "'none'", **allowed, "base-uri": "'none'", "form-action": "'none'"}
    return "; ".join(f"{name} {value}" for name, value in parts.items())


def _several(names: Sequence[str]) -> str:
    if len(names) > 3:
        return f"{len(names)} scenarios"
    first, last = names[:-1], names[-1:]
    return " and ".join(part for part in (", ".join(first), *last) if part) or "no scenario"


def _section(title: str, *parts: str) -> str:
    return f"<section><h2>{html.escape(title)}</h2>\n" + "\n".join(parts) + "</section>"


def _figure(path: Path, sheet: Sheet) -> str:
    caption = html.escape(CAPTIONS[path.stem])
    return (
        f'<figure><div class="figure" tabindex="0">{inline(path, sheet)}</div>'
        f'<figcaption id="{path.stem}-caption">{caption}</figcaption></figure>'
    )


def _table(pivot: Pivot) -> str:
    """Return a table of policies by scenarios; the best of each scenario is bold."""
    head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in pivot.scenarios)
    rows = []
    for policy, cells in pivot.rows:
        shown = "".join(
            f"<td{' class=best' if cell.best else ''}>{cell.value}"
            + (f'<span class="interval">{cell.interval}</span>' if cell.interval else "")
            + "</td>"
            for cell in cells
        )
        rows.append(f'<tr><th scope="row">{html.escape(policy)}</th>{shown}</tr>')
    meaning = f'<p class="note">{html.escape(pivot.meaning)}</p>'
    return _scrolled(f"<h3>{html.escape(pivot.title)}</h3>{meaning}", head, rows)


def _scrolled(before: str, head: str, rows: Sequence[str]) -> str:
    return (
        f'{before}<div class="scroll" tabindex="0"><table><thead><tr><td></td>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _replays(
    found: Comparison, wins: Sequence[Shown], losses: Sequence[Shown], packed: list[tuple[str, str, str]]
) -> str:
    """Return the replays' section, and add their contents to ``packed``."""
    if not wins and not losses:
        return ""
    note = (
        "Worlds in which the safe score of a policy lies farthest above and below that of the "
        f"baseline {found.reference}: at most one of each for a policy on a scenario. They are the "
        "extremes, not the rule."
    )
    parts = [f'<p class="note">{html.escape(note)}</p>']
    for title, some in (("Largest wins", wins), ("Largest losses", losses)):
        if some:
            parts.append(f"<h3>{title}</h3>")
        parts += [_card(found, shown, packed) for shown in some]
    return _section("Replays", *parts)


def _card(found: Comparison, shown: Shown, packed: list[tuple[str, str, str]]) -> str:
    """Return what tells of a replay, with its button."""
    one = shown.extreme
    scenario = html.escape(one.scenario)
    if shown.replay is None:
        button = f'<p class="note">{html.escape(shown.why)}</p>'
    else:
        button = f'<button type="button" data-replay="{len(packed)}">Play</button>'
        packed.append(contents(shown.replay))
    policy, baseline = html.escape(one.policy), html.escape(found.reference)
    return (
        f'<article><div class="row"><div><h3>{policy} on {scenario}, world {one.world}</h3>'
        f'<p><span class="gain">{one.gain:+.3f}</span>: safe score {one.mine:.3f}, {baseline} '
        f"{one.baseline:.3f}</p></div>{button}</div></article>"
    )


def _details(found: Comparison) -> str:
    """Return every estimate, folded."""
    head = "".join(f'<th scope="col">{name}</th>' for name in _COLUMNS.values())
    rows = []
    for row in found.rows:
        name = html.escape(f"{row['scenario']}: {row['policy']}")
        cells = "".join(f"<td>{_estimate(row[column])}</td>" for column in _COLUMNS)
        rows.append(f'<tr><th scope="row">{name}</th>{cells}</tr>')
    note = (
        '<p class="note">95 % intervals. IQM: mean of the middle half of the worlds. Better in: '
        "share of worlds with a higher safe score than the baseline's, ties counted half. Bound: "
        "the score if every tracker moved straight to a slot and stayed.</p>"
    )
    return f"<details><summary>Every estimate</summary>{_scrolled(note, head, rows)}</details>"


def _estimate(value: Any) -> str:
    if isinstance(value, Estimate):
        return f'{value.value:.3f}<span class="interval">[{value.low:.3f}, {value.high:.3f}]</span>'
    return "" if value is None else f"{value:.2f}"


def _problems(found: Comparison) -> str:
    """Return who was left out and who failed."""
    parts = []
    for title, some in (("Left out", found.left_out), ("Failed", found.failed)):
        lines = [
            f"<li>{html.escape(out['policy'])} on {html.escape(out['what'])}: {html.escape(out['why'])}</li>"
            for out in some
        ]
        parts.append(_section(title, f"<ul>{''.join(lines)}</ul>") if lines else "")
    return "\n".join(part for part in parts if part)


def _file(name: str) -> str:
    return (resources.files(__package__) / "web" / name).read_text(encoding="utf-8")
