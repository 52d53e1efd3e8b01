"""Every recipe of *Use it with* runs as it stands."""

from pathlib import Path

import pytest
from tests.support.process import ROOT, elsewhere, printed

RECIPES = ROOT / "docs" / "recipes"
OWN_ENVIRONMENT = dict.fromkeys(
    ("benchmarl_smart", "onnx_policy", "pufferlib_vector", "rllib_shared", "robotarium", "skrl_both"), "recipes"
) | {"agilerl_ippo": "agilerl"}
"""Recipes with libraries that pin other versions than ours, or that are not ours: the virtual environment of each."""
LONG = {"record_video", "supersuit_vector", "gymnasium_vector", "minari_clone", "torchrl_batch", "torchrl_gym"}
LONG |= {f"sb3_{kind}" for kind in ("recurrent", "shared", "solo", "team")}
"""Recipes that train, film or start processes."""

NAMES = sorted(path.stem for path in RECIPES.glob("*.py"))
OURS = [name for name in NAMES if name not in OWN_ENVIRONMENT]


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name in LONG)) for name in OURS])
def test_a_recipe_runs(name: str, tmp_path: Path) -> None:
    printed("-W", "ignore", RECIPES / f"{name}.py", cwd=tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(OWN_ENVIRONMENT))
def test_a_recipe_runs_in_an_environment_of_its_own(name: str, tmp_path: Path) -> None:
    alone = {"RAY_ADDRESS": "local"}  # of another test there may be a cluster
    elsewhere(RECIPES / f"{name}.py", environment=OWN_ENVIRONMENT[name], cwd=tmp_path, **alone)


@pytest.mark.long
@pytest.mark.parametrize("team", ["pngl-l-phi", "ddcs-distributed"])
def test_late_robots_of_the_robotarium_form_up(team: str, tmp_path: Path) -> None:
    shown = elsewhere(RECIPES / "robotarium.py", team, "0.5", "3", cwd=tmp_path)
    settled, clean = (int(part.split()[0]) for part in shown.splitlines()[-1].split(", "))
    assert settled >= 19
    assert clean == 20


@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_is_on_a_page(name: str) -> None:
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    assert f'--8<-- "docs/recipes/{name}.py"' in pages
