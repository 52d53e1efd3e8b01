"""The tests named on the page docs/reliability.md exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
    promised = page.partition("## Not promised")[0]
    for path, name in re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", promised):
        found = {
            node.name
            for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef)
        }
        assert not name or name in found, f"{path}::{name}"
    rows = [line for line in promised.splitlines() if line.startswith("| ")][2:]
    assert len(rows) >= 6
    assert [row for row in rows if "`tests/" not in row] == []
