"""Write the figures of the campaigns into docs/reliability.md.

After ``make fuzz MINUTES=30``::

    python -m tests.fuzz.page
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.fuzz.campaigns import CAMPAIGNS

PAGE = Path(__file__).parents[2] / "docs" / "reliability.md"
BEGIN = "<!-- figures of campaigns: `python -m tests.fuzz.page` writes what follows -->"
END = "<!-- end of the figures -->"


def table(figures: Mapping[str, Any]) -> str:
    """Return the table of figures, a row for each campaign."""
    lines = [
        "| Campaign | Tries | Failures | Minutes | Seed | Commit | Date |",
        "| --- | ---: | ---: | ---: | ---: | --- | --- |",
    ]
    for name in CAMPAIGNS:
        row = figures.get(name)
        if row is None:
            lines.append(f"| `{name}` | not yet played | | | | | |")
            continue
        lines.append(
            f"| `{name}` | {row['tries']:,} | {row['failures']:,} | {row['minutes']:g} | "
            f"{row['seed']} | {row['commit']} | {row['date']} |"
        )
    return "\n".join(lines)


def with_figures(page: str, figures: Mapping[str, Any]) -> str:
    """Return the page with these figures in the place of the old ones."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE} lacks the lines {BEGIN!r} and {END!r}")
    return f"{before}{BEGIN}\n\n{table(figures)}\n\n{END}{after}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("figures", nargs="?", type=Path, default=Path("runs/fuzz.json"))
    figures = json.loads(parser.parse_args().figures.read_text())
    PAGE.write_text(with_figures(PAGE.read_text(), figures))


if __name__ == "__main__":
    main()
