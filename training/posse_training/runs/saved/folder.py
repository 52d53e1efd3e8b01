"""A run's folder: its files, its lock, and how a run is opened in it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from posse_baselines.files import write_atomically
from posse_training.errors import RunFolderError
from posse_training.files import InUseError, locked
from posse_training.runs.saved.checkpoint import CHECKPOINT, Arrays, read_checkpoint
from posse_training.runs.settings import TrainSettings

SETTINGS: Final = "settings.json"
BEST: Final = "best.safetensors"
LAST: Final = "last.safetensors"
CURVE: Final = "curve.csv"


@contextlib.contextmanager
def locked_run(folder: Path) -> Iterator[None]:
    """Hold a run folder, made if missing.

    Raises:
        RunFolderError: Another process holds it (the message names it), or it cannot be written to.
    """
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(locked(folder))
        except InUseError as error:
            raise RunFolderError(f"run folder {error}: wait for it, stop it, or choose another --folder") from error
        except OSError as error:
            raise RunFolderError(f"cannot write to run folder {folder}: {error}") from error
        yield


def open_run(folder: Path, settings: TrainSettings, resume: bool) -> tuple[Arrays, dict[str, Any]] | None:
    """Write the settings to a run folder; return its checkpoint, or ``None`` to start from scratch.

    Raises:
        RunFolderError: It holds a run that is not to be resumed, or it cannot be written to.
        CheckpointError: Its checkpoint is damaged.
    """
    saved = None
    if resume:
        # A run killed before its first checkpoint starts again, with the same result.
        if (folder / CHECKPOINT).exists():
            saved = read_checkpoint(folder)
    elif (folder / SETTINGS).exists():
        raise RunFolderError(
            f"{folder} already holds a run: resume it (posse train --resume {folder}), remove it, "
            "or choose another --folder"
        )
    text = json.dumps({**settings.to_dict(), "folder": None}, indent=2) + "\n"
    try:
        write_atomically(folder / SETTINGS, text.encode())
    except OSError as error:
        raise RunFolderError(f"cannot write to run folder {folder}: {error}") from error
    return saved
