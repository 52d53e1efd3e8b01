"""The page Policies explains each law: an equation, and a picture of its geometry and at work."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest

from posse_baselines import policy_names

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "policies.md").read_text(encoding="utf-8")


@pytest.fixture
def laws(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(DOCS / "drawing"))
    mpl.use("Agg")
    yield importlib.import_module("laws")
    for name in ("laws", "geometry"):
        sys.modules.pop(name, None)


def test_each_law_has_an_equation_and_a_picture(laws: ModuleType) -> None:
    sections = re.split(r"^### ", PAGE, flags=re.MULTILINE)
    for law in laws.LAWS:
        picture = f"media/law-{law.name}.svg"
        explained = [section for section in sections if picture in section]
        assert len(explained) == 1, law.name
        assert "$$" in explained[0], law.name
        assert (DOCS / picture).is_file()


def test_every_policy_of_the_package_is_on_the_page() -> None:
    assert [name for name in policy_names() if f"`{name}`" not in PAGE] == []
