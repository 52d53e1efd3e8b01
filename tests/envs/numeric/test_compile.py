"""Compiled functions: what they calculate, and that a kernel kept on disk is never stale or damaged."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import pytest
from tests.support.process import python

from posse.numeric import UNCOMPILED, compiled, kernel

pytestmark = pytest.mark.skipif(UNCOMPILED, reason="nothing is compiled")


# What is overridden; what is called fails by itself.
PARTS = """
numba.core.caching NullCache.load_overload NullCache.save_overload
numba.core.codegen JITCodeLibrary._optimize_final_module JITCPUCodegen.set_env
numba.core.codegen JITCodeLibrary._finalize_final_module
numba.core.compiler CompilerBase.define_pipelines Flags.forceinline Flags.no_cpython_wrapper
numba.core.registry CPUDispatcher._numba_type_
"""


def test_numba_has_the_inner_parts_that_are_used() -> None:
    for module, *names in map(str.split, PARTS.strip().splitlines()):
        for name in names:
            part: Any = importlib.import_module(module)
            for each in name.split("."):
                part = getattr(part, each, None)
            assert part is not None, f"numba {numba.__version__} lacks {module}.{name}, which posse.numeric uses"


@compiled
def twice(x: float) -> float:
    """A function of a module."""
    return x + x


@pytest.mark.parametrize("decorate", [kernel, compiled, numba.njit], ids=["kernel", "compiled", "njit"])
def test_a_function_is_linked_with_all_that_it_calls(decorate: Any) -> None:
    """Also where numba itself links, in functions of a user and those called from Python."""

    @compiled
    def both(x: float) -> float:
        return twice(x) + twice(twice(x))

    def outer(x: float) -> float:
        return both(x) - twice(x) + max(x, 2.0)

    assert decorate(outer)(1.0) == 6.0
    assert both(1.0) == 6.0, "Python can call it, too"


MODULES = {
    "gains": "A = 1.0\nB = 2.0\n",
    "deep/__init__": "",
    "deep/gains": "from posse.numeric import compiled\n\nC = 1.0\n\n@compiled\ndef helper(x):\n    return x + 4.0\n",
    "pairs": "from typing import NamedTuple\n\nclass Pair(NamedTuple):\n    a: float\n    b: float\n",
    "lists": "LIMITS = ((1.0, (2.0, 3.0)), 4.0)\n",
    "plain": "import numba\n\nSHIFT = 1.0\n\n@numba.njit\ndef shift(x):\n    return x + SHIFT\n",
}
MAIN = """
import deep.gains, gains, plain
from lists import LIMITS
from pairs import Pair
from posse.numeric import compiled, kernel

NESTED = 1.0

@compiled
def first(x):
    return x * gains.A * deep.gains.C

@compiled
def second(x, step=0.5):
    return x * gains.B + LIMITS[0][1][1] + step

@kernel
def total(x, pair):
    made = Pair(x, 2 * x)
    def outer(y):
        def inner(z):
            return z * NESTED
        return inner(y)
    return outer(x) + first(x) + second(x) + deep.gains.helper(x) + 100 * made.a + 1000 * pair.a + plain.shift(x)

answer = total(1.0, Pair(1.0, 7.0))
print(answer, answer == total.py_func(1.0, Pair(1.0, 7.0)), sum(total.stats.cache_hits.values()))
"""
EDITS = {
    "the second of two attributes of a module": ("gains", "B = 2.0", "B = 20.0"),
    "a helper of a module that was named before": ("deep/gains", "x + 4.0", "x + 5.0"),
    "the order of a named tuple's fields": ("pairs", "    a: float\n    b: float", "    b: float\n    a: float"),
    "a constant in nested tuples": ("lists", "(2.0, 3.0)", "(2.0, 30.0)"),
    "a global of a function of numba's own": ("plain", "SHIFT = 1.0", "SHIFT = 11.0"),
    "a global of a function within an inner one": ("main", "NESTED = 1.0", "NESTED = 2.0"),
    "a default": ("main", "step=0.5", "step=1.5"),
    "a comment and a number that it does not reach": ("gains", "A = 1.0", "# A comment.\nUNUSED = 3.0\nA = 1.0"),
}


def write(folder: Path) -> None:
    for name, text in {**MODULES, "main": MAIN}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / f"{name}.py").write_text(text)


def play(folder: Path, cache: Path) -> tuple[list[str], str]:
    """Run main.py in a new process, as ``__main__`` without a file; return what it prints, and the errors."""
    command = ("-B", "-W", "error", "-c", (folder / "main.py").read_text())
    done = python(*command, cwd=folder, POSSE_CACHE_DIR=str(cache))
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


@pytest.fixture(scope="module")
def cached(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a kernel in its cache."""
    folder = tmp_path_factory.mktemp("cached")
    write(folder)
    printed, said = play(folder, folder / "cache")
    assert printed[1:] == ["True", "0"]
    assert said.count("\n") == 1
    assert "compiling kernels" in said
    assert play(folder, folder / "cache") == ([printed[0], "True", "1"], "")
    return folder


@pytest.mark.parametrize("what", EDITS)
def test_a_kernel_is_compiled_again_when_what_it_reaches_changes_and_only_then(
    what: str, cached: Path, tmp_path: Path
) -> None:
    write(tmp_path)
    name, old, new = EDITS[what]
    path = tmp_path / f"{name}.py"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    assert play(tmp_path, cached / "cache")[0][1:] == ["True", "1" if "not reach" in what else "0"]


def test_a_damaged_file_is_compiled_again(tmp_path: Path) -> None:
    """Also one that holds another kernel."""
    write(tmp_path)
    whole = []
    for gain in ("A = 3.0", "A = 1.0"):
        (tmp_path / "gains.py").write_text(MODULES["gains"].replace("A = 1.0", gain))
        play(tmp_path, tmp_path / "cache")
        (path,) = (each for each in (tmp_path / "cache").iterdir() if each.read_bytes() not in whole)
        whole.append(path.read_bytes())
    flipped = bytearray(whole[1])
    flipped[len(flipped) // 2] ^= 8
    for damaged in (flipped, whole[1][:-100], whole[0]):
        path.write_bytes(damaged)
        assert play(tmp_path, tmp_path / "cache")[0][1:] == ["True", "0"]
    assert play(tmp_path, tmp_path / "cache")[0][1:] == ["True", "1"]


def test_processes_share_a_folder(tmp_path: Path) -> None:
    write(tmp_path)
    command, variables = [sys.executable, "main.py"], {**os.environ, "POSSE_CACHE_DIR": str(tmp_path / "cache")}
    calls = [subprocess.Popen(command, cwd=tmp_path, env=variables, stdout=subprocess.PIPE, text=True) for _ in "ab"]
    assert [call.communicate()[0].split()[1] for call in calls] == ["True", "True"]
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".kernel"], "nothing unfinished is left"


def test_a_folder_that_cannot_be_written_costs_time_only(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "file").write_text("")
    printed, said = play(tmp_path, tmp_path / "file" / "cache")
    assert printed[1:] == ["True", "0"]
    assert "set POSSE_CACHE_DIR" in said
