"""The README: its table is the leaderboard's."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def readme_table(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "drawing"))
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "hooks"))
    yield importlib.import_module("readme_table")
    for name in ("readme_table", "standings", "declared_tables"):
        sys.modules.pop(name, None)


def test_the_table_is_made_from_the_result_files(readme_table: ModuleType) -> None:
    assert readme_table.with_table(README) == README
