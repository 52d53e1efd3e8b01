"""The README: its table is the leaderboard's, and its links work, also on the package index."""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
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


def test_links_lead_to_files_of_the_repository() -> None:
    links = re.findall(r"\]\(([^)]+)\)", README)
    own = [link for link in links if not link.startswith("https://")]
    assert len(own) >= 5
    for link in own:
        assert (ROOT / link).is_file(), link


def test_the_package_index_gets_absolute_links() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    home = settings["project"]["urls"]["Repository"]
    raw = home.replace("github.com", "raw.githubusercontent.com")
    text = README
    for each in settings["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(each["pattern"], each["replacement"], text)
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert all(link.startswith("https://") for link in links)
    assert [link for link in links if link.startswith(f"{raw}/main/docs/media/")]
    assert [link for link in links if link.startswith(f"{home}/blob/main/docs/")]
