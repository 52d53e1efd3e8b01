"""The folder of a comparison is replaced as a whole or not at all; other files are kept."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse_training.errors import ComparisonError, SettingsError
from posse_training.files import LOCK, locked
from posse_training.reports.comparing import folder as comparison_folder
from posse_training.reports.comparing.compare import Settings, compare
from posse_training.reports.comparing.folder import MARKER, FileNames, replaced
from posse_training.reports.results import Results


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def write(out: Path, *names: str) -> None:
    """A comparison of files that hold their names."""
    with replaced(out) as folder:
        for name in names:
            (folder / name).write_text(name)


def only(out: Path) -> None:
    """No file is left next to the folder."""
    assert [path.name for path in out.parent.iterdir()] == [out.name]


def test_a_new_comparison_replaces_the_old_one_as_a_whole(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    write(out, "a.csv", "summary.json")
    assert set(contents(out)) == {"a.csv", "summary.json", MARKER}
    write(out, "b.csv", "summary.json")
    assert set(contents(out)) == {"b.csv", "summary.json", MARKER}
    only(out)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, OSError(28, "No space left")])
def test_an_interrupted_one_leaves_the_old_one(tmp_path: Path, error: Any) -> None:
    out = tmp_path / "out"
    write(out, "a.csv")
    before = contents(out)

    def interrupted() -> None:
        with replaced(out) as folder:
            (folder / "b.csv").write_text("half")
            raise error

    with pytest.raises((KeyboardInterrupt, ValueError, ComparisonError)):
        interrupted()
    assert contents(out) == before
    only(out)


def test_a_full_disk_is_named_and_the_old_one_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    given = Settings(("idle",), ("constant",), 2, out=out, figures=False, planner_episodes=0)
    compare(given)
    before = contents(out)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Results, "write", full)
    with pytest.raises(ComparisonError, match=r"No space left.*earlier comparison.*unchanged"):
        compare(given)
    assert contents(out) == before
    only(out)


def test_a_disk_that_is_full_from_the_start_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    write(out, "a.csv")

    @contextlib.contextmanager
    def full(folder: Path) -> Iterator[None]:
        folder.mkdir()
        (folder / LOCK).touch()
        raise OSError(28, "No space left on device")
        yield

    monkeypatch.setattr(comparison_folder, "locked", full)
    with pytest.raises(ComparisonError, match=r"out: No space left.*unchanged"):
        write(out, "b.csv")
    assert set(contents(out)) == {"a.csv", MARKER}
    only(out)


def test_other_peoples_files_are_refused_before_anything_is_played(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    (out / "summary.json").write_text(json.dumps({"files": ["notes.txt"]}))
    with pytest.raises(ComparisonError, match=r"'notes\.txt', for example.*move them"):
        compare(Settings(("idle",), ("constant",), 10**6, out=out, figures=False, planner_episodes=0))
    assert (out / "notes.txt").read_text() == "mine"
    only(out)


def test_a_file_added_to_a_comparison_is_never_deleted(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a.csv")
    (out / "notes.txt").write_text("mine")
    with pytest.raises(ComparisonError, match=r"notes\.txt"):
        write(out, "b.csv")
    (out / "notes.txt").unlink()

    def meanwhile() -> None:
        with replaced(out) as folder:
            (folder / "b.csv").write_text("new")
            (out / "notes.txt").write_text("mine")

    with pytest.raises(ComparisonError, match=r"notes\.txt.*The new one is in .*out-2"):
        meanwhile()
    assert (out / "notes.txt").read_text() == "mine"
    assert (out / "a.csv").exists()
    assert set(contents(tmp_path / "out-2")) == {"b.csv", MARKER}


@pytest.mark.parametrize("marker", ["", "[" * 100_000, "[]", '{"files": 3}', '{"files": [[]]}'])
def test_a_damaged_marker_owns_nothing(tmp_path: Path, marker: str) -> None:
    out = tmp_path / "out"
    write(out, "a.csv")
    (out / MARKER).write_text(marker)
    with pytest.raises(ComparisonError, match=r"a\.csv"):
        write(out, "b.csv")
    assert (out / "a.csv").exists()


def test_places_that_cannot_be_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ComparisonError, match="is a file"):
        write(tmp_path / "file", "a.csv")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ComparisonError, match="choose a folder in it"):
        write(Path(), "a.csv")
    with pytest.raises(ComparisonError, match="choose a folder in it"):
        write(Path("/"), "a.csv")  # where the working folder is
    (tmp_path / ".x.partial").mkdir()
    (tmp_path / ".x.partial" / "mine").touch()
    with pytest.raises(ComparisonError, match="is not a comparison's"):
        write(tmp_path / "x", "a.csv")
    assert (tmp_path / ".x.partial" / "mine").exists()


def test_two_at_once_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with replaced(out) as folder:
        (folder / "a.csv").touch()
        with pytest.raises(ComparisonError, match=f"process {os.getpid()} is being written"):
            write(out, "b.csv")
    assert set(contents(out)) == {"a.csv", MARKER}


def test_a_kill_between_the_two_renames_is_mended_by_the_next_call(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a.csv")
    out.rename(tmp_path / ".out.previous")  # killed here: the old one has made room
    with replaced(out):
        assert set(contents(out)) == {"a.csv", MARKER}
    write(tmp_path / "other", "b.csv")
    (tmp_path / "other").rename(tmp_path / ".out.previous")  # killed here: it was not yet removed
    write(out, "c.csv")
    assert set(contents(out)) == {"c.csv", MARKER}
    only(out)


def test_what_a_killed_one_left_is_removed(tmp_path: Path) -> None:
    partial = tmp_path / ".out.partial"
    with locked(partial):
        (partial / "half.csv").write_text("1,2")
    write(tmp_path / "out", "a.csv")
    assert set(contents(tmp_path / "out")) == {"a.csv", MARKER}
    only(tmp_path / "out")


SCRIPT = """
import sys
from pathlib import Path
from posse_training.reports.comparing.compare import Settings, compare
compare(Settings(tuple(sys.argv[2].split(",")), ("constant", "smart"), 3, out=Path(sys.argv[1]),
                 figures=False, planner_episodes=0))
"""


def start(out: Path, policies: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", SCRIPT, str(out), policies])


@pytest.mark.long
def test_kill_9_leaves_the_old_comparison_and_a_rerun_is_as_if_nothing_was(tmp_path: Path) -> None:
    out, whole = tmp_path / "out", tmp_path / "whole"
    assert start(out, "idle").wait() == 0
    old = contents(out)
    assert start(whole, "pursuit,idle,random").wait() == 0
    kills = 0
    for files in (0, 1, 3, 5):  # killed when the temporary folder holds so many
        running = start(out, "pursuit,idle,random")
        partial = tmp_path / ".out.partial"
        while running.poll() is None:
            if partial.exists() and len(list(partial.glob("*.csv"))) >= files:
                os.kill(running.pid, signal.SIGKILL)
                break
            time.sleep(0.002)
        kills += running.wait() == -signal.SIGKILL
        if contents(out) != old:
            break  # it had finished
    assert kills >= 3
    assert start(out, "pursuit,idle,random").wait() == 0
    assert contents(out) == contents(whole)


def test_files_are_readable_like_any_others(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    compare(Settings(("idle",), ("constant",), 1, out=tmp_path / "out", figures=False, planner_episodes=0))
    wanted = (tmp_path / "plain").stat().st_mode & 0o777
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "out").iterdir()} == {wanted}


class TestNames:
    @settings(derandomize=True, deadline=None)
    @given(st.lists(st.text(min_size=0, max_size=300), min_size=1, max_size=20))
    def test_distinct_labels_get_distinct_plain_names(self, labels: list[str]) -> None:
        names = FileNames("summary.json")
        stems = [names.stem(label, ".csv", ".json") for label in labels]
        assert len({stem.lower() for stem in stems}) == len(labels)
        assert all(len(stem) <= 110 and stem.isascii() for stem in stems)
        assert all(Path(f"{stem}.csv").name == f"{stem}.csv" for stem in stems)
        assert not any(stem.startswith(".") for stem in stems)
        assert "summary" not in {stem.lower() for stem in stems}

    def test_labels_that_clean_alike_are_kept_apart(self, tmp_path: Path) -> None:
        out = tmp_path / "out"
        policies = ("a/b=idle", "a:b=pursuit", "A_B=random")
        compare(Settings(policies, ("constant",), 2, out=out, figures=False, planner_episodes=0))
        summary = json.loads((out / "summary.json").read_text())
        files = {row["policy"]: row["files"] for row in summary["comparison"]}
        assert files == {"a/b": ["constant-a_b.csv"], "a:b": ["constant-a_b-2.csv"], "A_B": ["constant-A_B-3.csv"]}
        for policy, (file,) in files.items():
            played = dict(zip(("a/b", "a:b", "A_B"), ("idle", "pursuit", "random"), strict=True))
            assert played[policy] in (out / file).read_text()

    def test_settings_out_of_range(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match="sweep_episodes=-1"):
            compare(Settings(("idle",), out=tmp_path / "out", sweep_episodes=-1))
