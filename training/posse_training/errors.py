"""Errors whose message is for the user: it names the value, what is allowed and the fix."""

from __future__ import annotations

import importlib
from typing import Final


class SettingsError(ValueError):
    """An invalid setting of a command."""


class RunFolderError(RuntimeError):
    """A run folder that cannot be used; the message says why and what to do."""


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written or read."""


class DivergedError(RuntimeError):
    """A training whose networks give numbers that are not finite."""


class ComparisonError(RuntimeError):
    """A comparison that cannot be written to its folder; the message says why and what to do."""


class TrainedSplitError(ValueError):
    """An evaluation on worlds that the policy was trained on."""


class TimeLimitError(RuntimeError):
    """An evaluation that exceeded its time limit."""


class ResultFileError(ValueError):
    """A claim for the leaderboard that is invalid or cannot be checked."""


class ClusterError(RuntimeError):
    """Work on a cluster that cannot begin or go on; the message says why and what to do."""


class MissingExtraError(ImportError):
    """A package that only an extra installs; the message says which."""


OWN: Final = (
    SettingsError,
    RunFolderError,
    CheckpointError,
    DivergedError,
    ComparisonError,
    TrainedSplitError,
    TimeLimitError,
    ResultFileError,
    ClusterError,
    MissingExtraError,
)
"""All errors of this module."""


def require(extra: str, *packages: str) -> None:
    """Import packages that an extra installs.

    Raises:
        MissingExtraError: One of them is not installed, or cannot be imported.
    """
    for package in packages:
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise MissingExtraError(
                f"{package} cannot be imported ({error}). Install the extra {extra!r} of posse-rl; from a clone: "
                f"pip install '.[{extra}]'"
            ) from error
