"""Symbolic links planted in a folder never lead a write out of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.support.runs import quiet, small

import posse
from posse_baselines import load
from posse_training.files import locked
from posse_training.film import film
from posse_training.replay import record, write_replay
from posse_training.train.train import train

PRECIOUS = b"precious"


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A file outside every folder that a test names."""
    path = tmp_path / "elsewhere" / "file"
    path.parent.mkdir()
    path.write_bytes(PRECIOUS)
    return path


def untouched(elsewhere: Path) -> bool:
    return elsewhere.read_bytes() == PRECIOUS and list(elsewhere.parent.iterdir()) == [elsewhere]


@pytest.mark.parametrize("name", ["lock", "checkpoint.pt"])
def test_a_new_run(tmp_path: Path, elsewhere: Path, name: str) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / name).symlink_to(elsewhere)
    with pytest.raises(OSError, match=f"{name}.*symbolic link|symbolic link.*{name}"):
        train(small(folder), console=quiet())
    assert untouched(elsewhere)
    assert [path.name for path in folder.iterdir()] == [name]


def test_a_subfolder_that_leads_elsewhere(tmp_path: Path, elsewhere: Path) -> None:
    """As in the folder of a league or a job, whose results lie in subfolders."""
    (tmp_path / "league").mkdir()
    (tmp_path / "league" / "cells").symlink_to(elsewhere.parent)
    with pytest.raises(OSError, match="symbolic link"), locked(tmp_path / "league"):
        pass
    assert untouched(elsewhere)


@pytest.mark.parametrize("name", ["page.html", "film.gif"])
def test_a_replay_and_a_film(tmp_path: Path, elsewhere: Path, name: str) -> None:
    path = tmp_path / name
    path.symlink_to(elsewhere)
    scenario = posse.get_scenario("constant", horizon=20, settle_time=1.0)
    write: dict[str, Callable[[], object]] = {
        "page.html": lambda: write_replay(record(["pursuit"], scenario), path),
        "film.gif": lambda: film([("a", load("idle"))], scenario, path=path, seconds=0.3, size=200),
    }
    with pytest.raises(OSError, match=f"symbolic link.*{name}"):
        write[name]()
    assert untouched(elsewhere)
