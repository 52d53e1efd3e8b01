"""The tests named on the page docs/reliability.md exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from tests.fuzz.campaigns import CAMPAIGNS
from tests.fuzz.page import BEGIN, END

ROOT = Path(__file__).parents[1]


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "reliability.md").read_text()
    rows = [line for line in page.splitlines() if "tests/" in line and line.startswith("|")]
    assert len(rows) > 10
    for path, name in re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", "\n".join(rows)):
        tree = ast.parse((ROOT / path).read_text())
        found = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert name in found, f"{path}::{name}"


def test_the_page_says_what_each_campaign_plays() -> None:
    page = (ROOT / "docs" / "reliability.md").read_text()
    for name, campaign in CAMPAIGNS.items():
        assert f"| `{name}` | {campaign.one_try} |" in page
    assert 0 < page.index(BEGIN) < page.index(END)
