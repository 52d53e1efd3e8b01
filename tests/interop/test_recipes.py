"""Every recipe of *Use it with* runs as it stands."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from tests.support.process import printed

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "docs" / "recipes"
OWN_ENVIRONMENT = dict.fromkeys(
    ("benchmarl_smart", "onnx_policy", "pufferlib_vector", "rllib_shared", "robotarium", "skrl_both"), "recipes"
) | {"agilerl_ippo": "agilerl"}
"""Recipes with libraries that pin other versions than ours, or that are not ours: the virtual environment of each."""
LONG = {"record_video", "supersuit_vector", "gymnasium_vector", "minari_clone", "torchrl_batch", "torchrl_gym"}
LONG |= {f"sb3_{kind}" for kind in ("recurrent", "shared", "solo", "team")}
"""Recipes that train, film or start processes."""


def run(name: str, folder: Path, python: Path | str = sys.executable, arguments: Sequence[str] = ()) -> str:
    recipe = RECIPES / f"{name}.py"
    return printed("-W", "ignore", recipe, *arguments, program=python, cwd=folder, seconds=300)


def names() -> list[str]:
    return sorted(path.stem for path in RECIPES.glob("*.py"))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.long] if name in LONG else [])
        for name in names()
        if name not in OWN_ENVIRONMENT
    ],
)
def test_a_recipe_runs(name: str, tmp_path: Path) -> None:
    run(name, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(OWN_ENVIRONMENT))
def test_a_recipe_runs_in_an_environment_of_its_own(name: str, tmp_path: Path) -> None:
    folder = OWN_ENVIRONMENT[name]
    python = ROOT / f".venv-{folder}" / "bin" / "python"
    if not python.exists():
        pytest.skip(f"needs .venv-{folder}: make recipes")
    run(name, tmp_path, python)


@pytest.mark.long
@pytest.mark.parametrize("team", ["pngl-l-phi", "ddcs-distributed"])
def test_late_robots_of_the_robotarium_form_up(team: str, tmp_path: Path) -> None:
    python = ROOT / ".venv-recipes" / "bin" / "python"
    if not python.exists():
        pytest.skip("needs .venv-recipes: make recipes")
    lines = run("robotarium", tmp_path, python, [team, "0.5", "3"]).splitlines()
    settled, clean = (int(part.split()[0]) for part in lines[-1].split(", "))
    assert settled >= 19
    assert clean == 20


@pytest.mark.parametrize("name", names())
def test_a_recipe_is_on_a_page(name: str) -> None:
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    assert f'--8<-- "docs/recipes/{name}.py"' in pages
