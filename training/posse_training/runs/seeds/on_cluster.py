"""Trainings on a cluster, one task each: files of a run folder go out and come back."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace

from posse_training.errors import CheckpointError
from posse_training.parallel import on_ray
from posse_training.runs.saved.files import named_files, read_files, write_files
from posse_training.runs.saved.folder import locked_run
from posse_training.runs.seeds.on_worker import train_on_worker
from posse_training.runs.settings import TrainSettings


def train_on_cluster(runs: Mapping[str, TrainSettings]) -> dict[str, Exception]:
    """Train every run, or resume it where its folder holds it; return those that failed.

    What a run's folder holds, and the policy files that its settings name, are sent to the worker;
    what the worker's folder holds comes back when the run is finished.

    Args:
        runs: Settings by label.

    Raises:
        RunFolderError: A folder is in use.
        CheckpointError: A folder cannot be written to.
    """
    failed: dict[str, Exception] = {}
    with contextlib.ExitStack() as stack:
        for settings in runs.values():
            stack.enter_context(locked_run(settings.run_folder))
        calls = [
            (label, replace(settings, folder=None), read_files(settings.run_folder), named_files(settings))
            for label, settings in runs.items()
        ]
        for k, result in on_ray(train_on_worker, calls):
            if isinstance(result, Exception):
                failed[calls[k][0]] = result
                continue
            try:
                write_files(runs[calls[k][0]].run_folder, result)
            except OSError as error:
                raise CheckpointError(
                    f"cannot write {error.filename}: {error.strerror or error}. Make room, then run "
                    "the same command again: it resumes"
                ) from error
    return failed
