"""The command line starts without the libraries of its commands, suggests, and completes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from posse_training.cli import COMMANDS, main

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


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_is_for_a_shell_that_is_named(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "complete -o default -F _posse posse" in capsys.readouterr().out
    assert main(["completion", "fish"]) == 2
    assert "name one of bash, zsh" in capsys.readouterr().err


def test_bash_completes_commands_and_options(tmp_path: Path) -> None:
    posse = tmp_path / "posse"
    posse.write_text(f"#!/bin/sh\nexec '{sys.executable}' -m posse_training.cli \"$@\"\n")
    posse.chmod(0o755)
    script = (
        'eval "$(posse completion bash)"\n'
        "COMP_WORDS=(posse '') COMP_CWORD=1; _posse; echo ${COMPREPLY[@]}\n"
        "COMP_WORDS=(posse scenarios --he) COMP_CWORD=2; _posse; echo ${COMPREPLY[@]}\n"
    )
    done = subprocess.run(
        ["bash", "-c", script],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
    )
    commands, options = done.stdout.splitlines()
    assert set(COMMANDS) <= set(commands.split())
    assert options == "--help"
