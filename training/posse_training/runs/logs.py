"""TensorBoard and Weights & Biases logs of a run, where they are installed."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat

from posse_training.errors import SettingsError
from posse_training.runs.settings import TrainSettings


def check_wandb(settings: TrainSettings) -> None:
    """Raise if a run is to be logged to Weights & Biases, which is not installed.

    Raises:
        SettingsError: The message says what to install.
    """
    if settings.wandb is not None and importlib.util.find_spec("wandb") is None:
        raise SettingsError(f"wandb={settings.wandb!r} needs Weights & Biases: pip install wandb, or leave it out")


def make_logger(folder: Path, settings: TrainSettings, note: Callable[[str], None]) -> Logger:
    """Return stable-baselines3's logger, which writes TensorBoard files if it is installed.

    Weights & Biases copies these files. Where they cannot be written, as on a full disk, ``note``
    is called with a line that says so, and the training goes on without them.
    """
    if settings.wandb is not None:
        wandb: Any = importlib.import_module("wandb")
        wandb.init(
            project=settings.wandb,
            name=folder.name,
            dir=folder,
            config=settings.to_dict(),
            sync_tensorboard=True,
            resume="allow",
        )
    installed = importlib.util.find_spec("tensorboard") is not None
    wanted = settings.tensorboard and installed
    return Logger(str(folder), [_TensorBoard(folder, note)] if wanted else [])


class _TensorBoard(KVWriter):
    """TensorBoard files, until they cannot be written."""

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self._folder, self._note = folder, note
        self._files: TensorBoardOutputFormat | None = None
        with _silent_threads():
            try:
                self._files = TensorBoardOutputFormat(str(folder))
            except OSError as error:
                self._stop(error)

    def write(self, *arguments: Any, **named: Any) -> None:
        """Write the values of one step."""
        if self._files is not None:
            try:
                self._files.write(*arguments, **named)
            except OSError as error:
                self._stop(error)

    def close(self) -> None:
        """Close the files."""
        if self._files is not None:
            try:
                self._files.close()
            except OSError as error:
                self._stop(error)

    def _stop(self, error: OSError) -> None:
        self._files = None
        reason = error.strerror or error
        self._note(f"no more TensorBoard logs, {self._folder} cannot be written: {reason}")


@contextlib.contextmanager
def _silent_threads() -> Iterator[None]:
    """Print no traceback of threads begun here that cannot write; the next write raises it."""
    others, before = threading.excepthook, set(threading.enumerate())
    begun: set[threading.Thread] | None = None  # once known: a thread can fail before that

    def hook(arguments: threading.ExceptHookArgs) -> None:
        thread = arguments.thread
        mine = thread not in before if begun is None else thread in begun
        if not (mine and isinstance(arguments.exc_value, OSError)):
            others(arguments)

    threading.excepthook = hook
    try:
        yield
    finally:
        begun = set(threading.enumerate()) - before
