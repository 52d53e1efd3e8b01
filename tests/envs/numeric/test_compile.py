"""Compiled functions: what they calculate, and that a kernel kept on disk is never stale or damaged."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba.core import caching, codegen, compiler, registry
from tests.support.process import python

from posse.numeric import ONE, UNCOMPILED, WIDTH, ZERO, FloatArray, choose, compiled, kernel, load, store

pytestmark = pytest.mark.skipif(UNCOMPILED, reason="nothing is compiled")


def test_numba_has_the_inner_parts_that_are_overridden() -> None:
    """Where one is called, its lack fails by itself."""
    overridden: dict[Any, str] = {
        caching.NullCache: "load_overload save_overload",
        codegen.JITCPUCodegen: "set_env",
        codegen.JITCodeLibrary: "_optimize_final_module _finalize_final_module",
        compiler.CompilerBase: "define_pipelines",
        compiler.Flags: "forceinline no_cpython_wrapper",
        registry.CPUDispatcher: "_numba_type_",
    }
    for part, names in overridden.items():
        lacking = [f"{part.__name__}.{name}" for name in names.split() if not hasattr(part, name)]
        assert not lacking, f"numba {numba.__version__} lacks {lacking}, which posse.numeric overrides"


@kernel
def write_not_equal(values: FloatArray, found: FloatArray) -> None:
    x = load(values, 0)
    store(found, 0, choose(x != x, ONE, ZERO))


def test_nan_in_lanes_differs_from_itself_as_a_single_number_does() -> None:
    values, found = np.ones(WIDTH, np.float32), np.zeros(WIDTH, np.float32)
    values[3] = np.nan
    write_not_equal(values, found)
    assert found.tolist() == (values != values).tolist()


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


# Plays each folder's main.py as a new process would, as ``__main__`` without a file, with a cache of its own.
PLAY = """
import os, sys
for folder, cache in zip(sys.argv[1::2], sys.argv[2::2]):
    for name in ("gains", "deep", "deep.gains", "pairs", "lists", "plain"):
        sys.modules.pop(name, None)
    os.chdir(folder)
    os.environ["POSSE_CACHE_DIR"] = cache
    with open("main.py") as main:
        exec(main.read())
"""


def write(folder: Path, name: str = "gains", old: str = "", new: str = "") -> Path:
    """Write the modules into a folder, one of them changed."""
    texts = {**MODULES, "main": MAIN}
    assert old in texts[name]
    texts[name] = texts[name].replace(old, new)
    for module, text in texts.items():
        (folder / module).parent.mkdir(exist_ok=True, parents=True)
        (folder / f"{module}.py").write_text(text)
    return folder


def play(*folders: tuple[Path, Path]) -> tuple[list[list[str]], str]:
    """Run the main.py of folders with their caches in a new process; return what each prints, and the errors."""
    done = python("-B", "-W", "error", "-c", PLAY, *(path for pair in folders for path in pair))
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()], done.stderr


@pytest.mark.long
def test_a_kernel_is_compiled_again_when_what_it_reaches_changes_and_only_then(tmp_path: Path) -> None:
    first, cache = write(tmp_path / "first"), tmp_path / "cache"
    [printed], said = play((first, cache))
    assert printed[1:] == ["True", "0"]
    assert said.count("\n") == 1
    assert "compiling kernels" in said
    assert play((first, cache)) == ([[printed[0], "True", "1"]], "")
    played, _ = play(*((write(tmp_path / what, *edit), cache) for what, edit in EDITS.items()))
    hits = {what: printed[1:] for what, printed in zip(EDITS, played, strict=True)}
    assert hits == {what: ["True", "1" if "not reach" in what else "0"] for what in EDITS}


@pytest.mark.long
def test_a_damaged_file_is_compiled_again(tmp_path: Path) -> None:
    other = write(tmp_path / "other", "gains", "A = 1.0", "A = 3.0"), tmp_path / "other-cache"
    mine = write(tmp_path / "mine"), tmp_path / "cache"
    play(other, mine)
    (path,), (another,) = mine[1].iterdir(), other[1].iterdir()
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(flipped) // 2] ^= 8
    caches = [tmp_path / name for name in ("flipped", "short", "another")]
    for cache, damaged in zip(caches, (bytes(flipped), whole[:-100], another.read_bytes()), strict=True):
        cache.mkdir()
        (cache / path.name).write_bytes(damaged)
    for hits in "01":
        assert [printed[1:] for printed in play(*((mine[0], cache) for cache in caches))[0]] == [["True", hits]] * 3


def test_processes_share_a_folder(tmp_path: Path) -> None:
    write(tmp_path)
    command, variables = [sys.executable, "main.py"], {**os.environ, "POSSE_CACHE_DIR": str(tmp_path / "cache")}
    calls = [subprocess.Popen(command, cwd=tmp_path, env=variables, stdout=subprocess.PIPE, text=True) for _ in "ab"]
    assert [call.communicate()[0].split()[1] for call in calls] == ["True", "True"]
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".kernel"], "nothing unfinished is left"


def test_a_folder_that_cannot_be_written_costs_time_only(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "file").write_text("")
    [printed], said = play((tmp_path, tmp_path / "file" / "cache"))
    assert printed[1:] == ["True", "0"]
    assert "set POSSE_CACHE_DIR" in said
