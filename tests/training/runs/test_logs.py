"""TensorBoard logs of a run."""

from __future__ import annotations

import contextlib
import resource
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.runs import small

from posse_training.runs.logs import make_logger

pytest.importorskip("tensorboard")


@contextlib.contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file grow beyond a size, as on a disk that is full in mid-file."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_full_disk_ends_the_logs_and_not_the_training(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    notes: list[str] = []
    settings = small(tmp_path / "run", "ppo", tensorboard=True)
    (tmp_path / "run").mkdir()
    logger = make_logger(tmp_path / "run", settings, notes.append)
    logger.record("before", 1.0)
    logger.dump(0)
    with largest_file(100):
        for step in range(1, 20):
            logger.record("score", 0.5)
            logger.dump(step)
    logger.record("after", 1.0)
    logger.dump(20)
    logger.close()
    (note,) = notes
    assert str(tmp_path / "run") in note
    assert "no more TensorBoard logs" in note
    assert not capfd.readouterr().err
    assert next(path.name for path in (tmp_path / "run").iterdir()).startswith("events.out")


def test_a_disk_that_is_full_from_the_start_prints_no_traceback(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    notes: list[str] = []
    with largest_file(0):
        logger = make_logger(tmp_path, small(tmp_path, "ppo", tensorboard=True), notes.append)
        for step in range(5):
            logger.record("score", 0.5)
            logger.dump(step)
    logger.close()
    assert len(notes) == 1
    assert not capfd.readouterr().err


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    notes: list[str] = []
    (tmp_path / "file").touch()
    make_logger(tmp_path / "file", small(tmp_path, "ppo", tensorboard=True), notes.append)
    assert "file" in notes[0]
