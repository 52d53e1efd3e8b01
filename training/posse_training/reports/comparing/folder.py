"""The folder of a comparison: replaced as a whole, and never mixed with other files."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from posse_training.errors import ComparisonError
from posse_training.files import LOCK, InUseError, locked

MARKER: Final = ".posse-comparison"
"""File that marks a folder as a comparison's own, and lists its files."""


class FileNames:
    """Hands out distinct file names for distinct labels, also on disks that ignore case."""

    def __init__(self, *taken: str) -> None:
        self._taken = {name.lower() for name in taken}

    def stem(self, wanted: str, *suffixes: str) -> str:
        """Return a name of letters, digits and ``._-`` under which no file of a suffix exists."""
        clean = re.sub(r"[^A-Za-z0-9._-]", "_", wanted)[:100].lstrip(".") or "_"
        stem, count = clean, 1
        while any(f"{stem}{suffix}".lower() in self._taken for suffix in suffixes):
            count += 1
            stem = f"{clean}-{count}"
        self._taken |= {f"{stem}{suffix}".lower() for suffix in suffixes}
        return stem


@contextlib.contextmanager
def replaced(out: Path) -> Iterator[Path]:
    """Yield a new folder next to ``out`` that replaces it when the block ends without an error.

    On an error or a kill the folder ``out`` stays as it was. A process that is killed between the
    two renames at the end leaves the old one as ``.NAME.previous``, from where the next call
    restores it.

    Raises:
        ComparisonError: ``out`` holds files that no comparison wrote, is in use, or cannot be
            written, for example because the disk is full.
    """
    out = out.resolve()
    _check_place(out)
    partial, previous = (out.with_name(f".{out.name}.{end}") for end in ("partial", "previous"))
    with contextlib.ExitStack() as stack:
        try:
            _refuse_foreign(out)
            _refuse_foreign(previous)
            if partial.exists() and any(partial.iterdir()) and not (partial / LOCK).exists():
                raise ComparisonError(f"{partial} is not a comparison's: move it, or change --out")
            stack.enter_context(locked(partial))
            _empty(partial)
            if previous.exists():
                _recover(out, previous)
        except InUseError as error:
            raise ComparisonError(
                f"a comparison of process {error.holder} is being written to {out}: wait for it, "
                "or choose another --out"
            ) from error
        except OSError as error:
            _drop_unused(partial)
            raise _cannot_write(out, error) from error
        try:
            yield partial
            _seal(partial)
            try:
                _refuse_foreign(out)
            except ComparisonError as error:  # files appeared meanwhile: keep both
                raise ComparisonError(f"{error}. The new one is in {_keep(partial, out)}") from None
            _swap(partial, out, previous)
        except OSError as error:
            raise _cannot_write(out, error) from error
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def _check_place(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise ComparisonError(f"{out} is a file: choose another --out")
    if Path.cwd().is_relative_to(out) or os.path.ismount(out):
        raise ComparisonError(
            f"{out} cannot be replaced as a whole: choose a folder in it, for example --out {out / 'comparison'}"
        )


def _refuse_foreign(folder: Path) -> None:
    """Raise if a folder holds anything that is not of a comparison.

    Raises:
        ComparisonError: It does; the message names it.
    """
    if not folder.exists():
        return
    found = {path.name for path in folder.iterdir()}
    if not found:
        return
    foreign = sorted(found - _files(folder) - {MARKER, LOCK})
    if MARKER not in found or foreign:
        example = (foreign or sorted(found))[0]
        raise ComparisonError(
            f"{folder} holds files that no comparison wrote ({example!r:.80}, for example), and a "
            "comparison replaces its folder as a whole: move them, or choose another --out"
        )


def _files(folder: Path) -> set[str]:
    """Return the names that the marker of a folder lists."""
    try:
        names = json.loads((folder / MARKER).read_text(encoding="utf-8"))["files"]
        return {name for name in names if isinstance(name, str)}
    except (OSError, ValueError, TypeError, KeyError, RecursionError):  # none, or not one of ours
        return set()


def _empty(folder: Path) -> None:
    """Remove what a killed comparison left in its temporary folder."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


def _drop_unused(folder: Path) -> None:
    """Remove a temporary folder that a full disk left with nothing in it but an empty lock."""
    with contextlib.suppress(OSError):
        if all(path.name == LOCK and not path.stat().st_size for path in folder.iterdir()):
            shutil.rmtree(folder)


def _recover(out: Path, previous: Path) -> None:
    """Finish what a kill interrupted: restore the old folder, or remove what was replaced."""
    if out.exists() and any(out.iterdir()):
        shutil.rmtree(previous)
    else:
        if out.exists():
            out.rmdir()
        previous.rename(out)


def _seal(partial: Path) -> None:
    """Write the marker, and bring all files to the disk."""
    names = sorted(path.name for path in partial.iterdir() if path.name != LOCK)
    (partial / MARKER).write_text(json.dumps({"files": names}, indent=2) + "\n", encoding="utf-8")
    for path in partial.iterdir():
        with path.open("rb") as file:
            os.fsync(file.fileno())


def _swap(partial: Path, out: Path, previous: Path) -> None:
    """Put a new folder in the place of the old one."""
    if out.exists():
        out.rename(previous)
    try:
        partial.rename(out)
    except BaseException:
        if previous.exists():
            previous.rename(out)
        raise
    (out / LOCK).unlink(missing_ok=True)
    if previous.exists():
        shutil.rmtree(previous)


def _keep(partial: Path, out: Path) -> Path:
    """Rename a finished comparison to an unused name next to ``out``."""
    kept = next(path for k in range(2, 10_000) if not (path := out.with_name(f"{out.name}-{k}")).exists())
    partial.rename(kept)
    (kept / LOCK).unlink(missing_ok=True)
    return kept


def _cannot_write(out: Path, error: OSError) -> ComparisonError:
    kept = "; the earlier comparison in it is unchanged" if (out / MARKER).exists() else ""
    return ComparisonError(
        f"cannot write the comparison to {out}: {error.strerror or error}{kept}. Make room or choose another --out"
    )
