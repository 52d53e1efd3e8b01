"""Runs every command once when it is imported, so that processes forked from here are quick."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

from tests.fuzz.commands import COMMANDS

from posse_training.cli import main

with (
    tempfile.TemporaryDirectory() as _temporary,
    contextlib.redirect_stdout(io.StringIO()),
    contextlib.redirect_stderr(io.StringIO()),
):
    for _number, _command in enumerate(COMMANDS.values()):
        _folder = Path(_temporary) / f"{_number}"
        _folder.mkdir()
        if not _command.is_call:
            main(_command.first(_folder))
