"""The command line starts without the libraries of its commands, and suggests."""

from __future__ import annotations

import subprocess
import sys

import pytest

from posse_training.cli import main

HEAVY = ("numpy", "numba", "torch", "tyro", "rich", "matplotlib", "posse")


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom posse_training.cli import main\nmain(['--help'])\n"
        f"found = sorted(set({HEAVY!r}) & set(sys.modules))\n"
        "assert not found, found"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("typed", "meant"), [("comprae", "compare"), ("trian", "train")])
def test_a_typing_error_gets_a_suggestion(typed: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([typed]) == 2
    assert f"unknown command {typed!r}: did you mean {meant!r}?" in capsys.readouterr().err


def test_the_module_is_the_command_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "posse", "--version"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("posse 0.")
