"""Python in a process of its own, which imports all packages from this tree; users' modules, run there."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


def python(
    *words: str | Path, program: str | Path = sys.executable, cwd: Path = ROOT, seconds: float = 600.0, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run Python with arguments; return what it printed, and how it ended."""
    paths = ROOT, ROOT / "envs", ROOT / "baselines", ROOT / "training", os.environ.get("PYTHONPATH", "")
    settings: dict[str, Any] = {"capture_output": True, "text": True, "timeout": seconds, "check": False}
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), **variables}
    return subprocess.run([str(program), *map(str, words)], cwd=cwd, env=variables, **settings)


def printed(*words: str | Path, **settings: Any) -> str:
    """Return what :func:`python` prints; fail with its errors."""
    done = python(*words, **settings)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    return done.stdout


def elsewhere(*words: str | Path, environment: str = "recipes", **settings: Any) -> str:
    """Return what Python prints in a virtual environment of the recipes; skip the test where there is none."""
    program = ROOT / f".venv-{environment}" / "bin" / "python"
    if not program.exists():
        pytest.skip(f"needs .venv-{environment}: make recipes")
    return printed("-W", "ignore", *words, program=program, **settings)


def run_tests_elsewhere(file: str | Path, folder: Path, **settings: Any) -> str:
    """Run a file of tests there."""
    words = f"-m pytest -q -p no:cacheprovider -n 0 -W ignore --basetemp {folder / 'cases'} {file}"
    return elsewhere(*words.split(), **settings)


def run(folder: Path, code: str, **modules: str) -> subprocess.CompletedProcess[str]:
    """Run code with a user's modules in a new process."""
    for name, source in {**modules, "main": code}.items():
        (folder / f"{name}.py").write_text(source, encoding="utf-8")
    return python("main.py", cwd=folder, PYTHONDONTWRITEBYTECODE="1")  # bytecode tells edits by their second and size
