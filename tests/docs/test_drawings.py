"""The page Policies explains each law: an equation, and a picture of its geometry and at work."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import posse
from posse_baselines import load, play, policy_names

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


def test_a_picture_shows_the_episode(laws: ModuleType) -> None:
    law = next(law for law in laws.LAWS if law.name == "slot")
    figure = laws.draw(law)
    left, middle, right = figure.axes
    assert left.patches
    assert len(right.get_lines()) == 5
    policy = load(law.policy)
    steps = round(laws.SECONDS / 0.1)
    batch = posse.batch(
        "accelerating",
        1,
        seed=laws.SEED,
        split="test",
        autoreset="disabled",
        horizon=steps,
        start_distance=(2.0, 4.0),
        message_size=policy.message_size,
    )
    play(batch, policy)
    ends = np.array([np.asarray(line.get_xydata())[-1] for line in middle.get_lines()])
    for x, y in zip(batch.state["tracker_x"][0], batch.state["tracker_y"][0], strict=True):
        assert np.abs(ends - (x, y)).sum(axis=1).min() < 1e-4
    plt.close(figure)
