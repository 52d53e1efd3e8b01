"""Imports run one way: training, then baselines, then envs; and playing needs no torch."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LEARNING = {"posse_training", "stable_baselines3", "tensordict", "torch", "torchrl"}
FORBIDDEN = {
    "envs/posse": LEARNING | {"matplotlib", "posse_baselines", "rich", "tyro"},
    "baselines/posse_baselines": LEARNING,
}


def imported_packages(source: Path) -> set[str]:
    """The top-level packages that a file imports, at whatever depth of its code."""
    packages: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"), str(source))):
        if isinstance(node, ast.Import):
            packages.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            packages.add(node.module.partition(".")[0])
    return packages


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_run_one_way(package: str) -> None:
    sources = sorted((ROOT / package).rglob("*.py"))
    assert sources
    wrong = {
        str(source.relative_to(ROOT)): sorted(found)
        for source in sources
        if (found := imported_packages(source) & FORBIDDEN[package])
    }
    assert not wrong


@pytest.mark.parametrize("package", ["posse", "posse_baselines"])
def test_playing_does_not_load_the_learning_libraries(package: str) -> None:
    code = f"import sys, {package}; print(*sorted(set(sys.modules) & {LEARNING!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
