"""Imports go from training to baselines to envs only; the tests that the manual names exist."""

import ast
import re
from pathlib import Path

import pytest
from tests.support.process import ROOT, printed

LEARNING = ("posse_training", "stable_baselines3", "tensordict", "torch")
INTERNAL = ("posse.engine", "posse.numeric.", "posse.rules.")
ROOMS = ("numeric", "declarations", "scenarios", "rules", "signals", "engine", "rendering", "adapters")
"""A room imports only rooms before it."""
ROOMS_THAT_PLAY = ("baselines", "training.demo", "training.compare.report", "training.reproduce")
FORBIDDEN: dict[str, tuple[str, ...]] = {
    "envs/posse": (*LEARNING, "matplotlib", "posse_baselines", "rich", "tyro"),
    "baselines/posse_baselines": (*LEARNING, *INTERNAL),
    "training": INTERNAL,
    **{f"envs/posse/{room}": tuple(f"posse.{each}" for each in ROOMS[k + 1 :]) for k, room in enumerate(ROOMS)},
}
"""How the names of modules begin that a folder, or a file, must not import."""


def imported(source: Path) -> set[str]:
    """The modules that a file imports when it is run or type-checked, at whatever depth of its code."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"), str(source))):
        if isinstance(node, ast.Import):
            modules.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            modules.add(node.module)
    return modules


@pytest.mark.parametrize("place", FORBIDDEN)
def test_imports_run_one_way(place: str) -> None:
    sources = sorted((ROOT / place).rglob("*.py")) or [ROOT / f"{place}.py"]
    found = [(str(source), module) for source in sources for module in imported(source)]
    assert [each for each in found if each[1].startswith(FORBIDDEN[place])] == []


@pytest.mark.parametrize("package", ["posse", *map("posse_{}".format, ROOMS_THAT_PLAY)])
def test_playing_does_not_load_the_learning_libraries(package: str) -> None:
    others = set(LEARNING) - {package.partition(".")[0]}
    code = f"import sys, {package}; print(*sorted(set(sys.modules) & {others!r}))"
    assert printed("-c", code).split() == []


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
    promised = page.partition("## Not promised")[0]
    assert [path for path in re.findall(r"`(tests/[^`]+)`", promised) if not (ROOT / path).is_file()] == []
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
