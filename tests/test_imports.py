"""Imports go from training to baselines to envs only; the tests that the manual names exist."""

import ast
import re
from pathlib import Path

import pytest
from tests.support.process import ROOT, printed

LEARNING = {"posse_training", "stable_baselines3", "tensordict", "torch", "torchrl"}
FORBIDDEN = {
    "envs/posse": LEARNING | {"matplotlib", "posse_baselines", "rich", "tyro"},
    "baselines/posse_baselines": LEARNING,
}


def imported(source: Path) -> set[str]:
    """The modules that a file imports when it is run or type-checked, at whatever depth of its code."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"), str(source))):
        if isinstance(node, ast.Import):
            modules.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            modules.add(node.module)
    return modules


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_run_one_way(package: str) -> None:
    sources = sorted((ROOT / package).rglob("*.py"))
    assert sources
    packages = {str(source): {module.partition(".")[0] for module in imported(source)} for source in sources}
    assert {source: wrong for source, found in packages.items() if (wrong := found & FORBIDDEN[package])} == {}


@pytest.mark.parametrize("package", ["posse", "posse_baselines", "posse_training.demo"])
def test_playing_does_not_load_the_learning_libraries(package: str) -> None:
    others = LEARNING - {package.partition(".")[0]}
    code = f"import sys, {package}; print(*sorted(set(sys.modules) & {others!r}))"
    assert printed("-c", code).split() == []


# A room imports only rooms before it.
ROOMS = ("numeric", "registry", "declarations", "scenarios", "rules", "signals", "engine", "rendering", "adapters")
INTERNAL = ("posse.engine", "posse.numeric.", "posse.rules.")


def test_rooms_import_only_the_rooms_before_them() -> None:
    wrong = []
    for source in sorted((ROOT / "envs/posse").rglob("*.py")):
        own = source.relative_to(ROOT / "envs/posse").with_suffix("").parts[0]
        if not own.startswith("__"):
            later = tuple(f"posse.{room}" for room in ROOMS[ROOMS.index(own) + 1 :])
            wrong += [f"{source} imports {module}" for module in imported(source) if module.startswith(later)]
    assert wrong == []


@pytest.mark.parametrize("package", ["baselines", "training"])
def test_other_packages_import_only_the_public_names_of_these_rooms(package: str) -> None:
    wrong = [
        f"{source} imports {module}"
        for source in sorted((ROOT / package).rglob("*.py"))
        for module in imported(source)
        if module.startswith(INTERNAL)
    ]
    assert wrong == []


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
    promised = page.partition("## Not promised")[0]
    for path, name in re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", promised):
        found = {
            node.name
            for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef)
        }
        assert not name or name in found, f"{path}::{name}"
    rows = [line for line in promised.splitlines() if line.startswith("| ")][2:]
    assert len(rows) >= 6
    assert [row for row in rows if "`tests/" not in row] == []


def test_the_table_of_the_paper_names_functions_and_tests_that_exist() -> None:
    table = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8").partition("## Misprints")[0]
    named = re.findall(r"`(?:\w+/)?(\w+)\.(\w+)`", table)
    assert len(named) > 20
    for module, name in named:
        files = [file for room in ("envs", "baselines", "tests") for file in (ROOT / room).rglob(f"{module}.py")]
        assert files, module
        assert name == "py" or any(f"def {name}(" in file.read_text(encoding="utf-8") for file in files), name
