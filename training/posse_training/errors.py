"""Errors whose message is for the user: it names the value, what is allowed and the fix."""

import importlib
import importlib.util
import os
import traceback
from pathlib import Path
from typing import Any


class UserError(Exception):
    """An error that the command line shows without a traceback."""


class SettingsError(UserError, ValueError):
    """An invalid setting of a command."""


class RunFolderError(UserError, RuntimeError):
    """A run that cannot go on, or whose folder cannot be used; the message says why and what to do."""


class PlayError(UserError, RuntimeError):
    """A policy that raised, returned invalid actions, exceeded the time limit or crashed."""


class TimeLimitError(PlayError):
    """A policy that exceeded the time limit."""


class ClusterError(UserError, RuntimeError):
    """Work on a cluster that cannot begin or go on; the message says why and what to do."""


class MissingExtraError(UserError, ImportError):
    """A package that only an extra installs; the message says which."""


def require(extra: str, *packages: str) -> None:
    """Import packages that an extra installs, or raise MissingExtraError."""
    for package in packages:
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise MissingExtraError(
                f"{package} cannot be imported ({error}). Install the extra {extra!r} of posse-rl; from a clone: "
                f"pip install '.[{extra}]'"
            ) from error


def check_settings(settings: Any) -> None:
    """Raise a ``SettingsError`` for a field of a settings class that is not as it declares itself."""
    from posse_baselines.fields import check  # not at the start of the command line

    try:
        check(settings)
    except ValueError as error:
        raise SettingsError(str(error)) from error


def describe(error: BaseException) -> str:
    """Return an error in one line: its message, and where in the policy's code it was raised."""
    found = [importlib.util.find_spec(name) for name in ("posse", "posse_baselines", "posse_training")]
    ours = tuple(f"{Path(spec.origin).parent}{os.sep}" for spec in found if spec is not None and spec.origin)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith(ours)]
    where = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    # Not str(error), which may fail; of a SyntaxError the last line is its message.
    told = traceback.format_exception_only(error)[-1 if isinstance(error, SyntaxError) else 0]
    return f"{type(error).__name__}: {' '.join(told.partition(': ')[2].split()):.300}{where}"
