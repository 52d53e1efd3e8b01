"""The wheel and the sdist are complete, and work where nothing else of posse is.

They take minutes and the package index, so that they run where POSSE_TEST_PACKAGE is set: in continuous integration.
"""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from tests.support.pages import ROOT, blocks

PACKAGES = ("envs/posse", "baselines/posse_baselines", "training/posse_training")
pytestmark = pytest.mark.skipif(
    "POSSE_TEST_PACKAGE" not in os.environ, reason="takes minutes: set POSSE_TEST_PACKAGE=1"
)


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    words, variables = [str(part) for part in command], {**kept, **environment}
    return subprocess.check_output(words, cwd=cwd, env=variables, text=True, timeout=900)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the sdist, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT, cwd=ROOT)
    return folder


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the programs of an environment with nothing but the wheel and what it requires."""
    folder = tmp_path_factory.mktemp("empty")
    run(sys.executable, "-m", "venv", "--without-pip", folder / "venv", cwd=folder)
    programs = folder / "venv" / "bin"
    wheel = next(built.glob("*.whl"))
    pip = f"-m pip --python {programs / 'python'} install --quiet -c {ROOT / 'constraints.txt'}".split()
    run(sys.executable, *pip, wheel, cwd=folder)
    return programs


def tracked(*folders: str) -> set[str]:
    """Return the files of the repository under some folders, or those of the tree without git."""
    found = subprocess.run(["git", "ls-files", "--", *folders], cwd=ROOT, capture_output=True, text=True, check=True)
    return {line for line in found.stdout.splitlines() if (ROOT / line).exists()}


def test_the_index_would_take_them(built: Path) -> None:
    run(sys.executable, "-m", "twine", "check", "--strict", *built.iterdir(), cwd=built)


def test_the_wheel_has_every_file_of_the_packages(built: Path) -> None:
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        names = set(wheel.namelist())
    assert {path.partition("/")[2] for path in tracked(*PACKAGES)} <= names


def test_the_tests_of_the_sdist_run_from_its_own_tree(built: Path, tmp_path: Path) -> None:
    subprocess.run(["tar", "-xzf", str(next(built.glob("*.tar.gz")))], cwd=tmp_path, check=True)
    tree = next(tmp_path.iterdir())
    roots = ("envs", "baselines", "training", "tests", "docs", "benchmarks", "scripts")
    inside = {str(p.relative_to(tree)) for p in tree.rglob("*") if p.is_file()}
    assert tracked(*roots) <= inside
    path = os.pathsep.join(str(tree / root) for root in ("envs", "baselines", "training"))
    pytest_ = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    run(*pytest_, "--collect-only", cwd=tree, PYTHONPATH=path)
    run(*pytest_, "tests/test_imports.py", cwd=tree, PYTHONPATH=path)


def test_the_python_of_the_readme_runs(installed: Path, tmp_path: Path) -> None:
    script = tmp_path / "readme.py"
    script.write_text("\n".join(text for kind, _, text in blocks("README.md") if kind == "python"), encoding="utf-8")
    run(installed / "python", script, cwd=tmp_path)


def test_the_installed_command_works(installed: Path, tmp_path: Path) -> None:
    assert "smart" in run(installed / "posse", "scenarios", cwd=tmp_path)
    run(installed / "posse", "replay", "idle", "--seconds", "1", cwd=tmp_path)
    assert (tmp_path / "replay.html").stat().st_size > 10_000
