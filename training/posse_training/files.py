"""Folders of runs: one process at a time writes to one, and resumes only a run with its own settings."""

import contextlib
import csv
import fcntl
import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from posse_baselines.files import read_json, remove_unfinished, replacing
from posse_training.errors import RunFolderError

_LOCK: Final = "lock"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder, made if missing: no other process can hold it meanwhile.

    A file is the lock; one that a killed process leaves locks nothing. Unfinished files of such a process are removed.
    RunFolderError names the process that holds the folder already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / _LOCK).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.fstat(file.fileno()).st_nlink:
                raise OSError  # its holder has just removed it
        except OSError as error:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            raise RunFolderError(f"process {holder} uses {folder}: wait, stop it, or choose another --out") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        remove_unfinished(folder)
        try:
            yield
        finally:
            (folder / _LOCK).unlink(missing_ok=True)


def check_new(out: Path) -> None:
    """Raise if a folder is neither new nor empty."""
    if out.exists() and (not out.is_dir() or any(path.name != _LOCK for path in out.iterdir())):
        raise RunFolderError(f"{out} exists and is not an empty folder: choose another --out, or empty it")


@contextlib.contextmanager
def intact(path: Path) -> Iterator[None]:
    """Raise an error that names the file if one of a run is read that is damaged."""
    try:
        yield
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunFolderError(f"{path} is damaged, or no run's: {error!r:.200}. Choose another --out") from error


def check_held(
    path: Path, settings: Mapping[str, Any], free: Collection[str] = (), results: Collection[str] = ()
) -> None:
    """Raise if a file holds other settings of a run, but for those that are ``free``, or is missing beside results."""
    if not path.is_file():
        for name in results:
            if (path.parent / name).exists():
                raise RunFolderError(f"{path.parent} has {name}, but no {path.name} of a run: choose another --out")
        return
    wanted = json.loads(json.dumps(settings))
    with intact(path):
        theirs = read_json(path)
        other = {name: theirs[name] for name in wanted if name not in free and theirs[name] != wanted[name]}
    if other:
        shown = ", ".join(f"{name}={value!r:.60}, not {wanted[name]!r:.60}" for name, value in other.items())
        raise RunFolderError(f"{path.parent} holds a run with {shown}: choose another --out, or remove it")


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a table of one row or more, with the keys of the first as its head."""
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
