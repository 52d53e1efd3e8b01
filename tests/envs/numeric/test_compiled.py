"""Kernels kept on disk are never stale, and the cache never stands in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

HELPER = """
from posse.numeric.compiling import compiled

@compiled
def helper(x):
    return x + {step}
"""

KERNEL = """
from posse.numeric.compiling import kernel
from herd.helpers import helper

@kernel
def total(n):
    result = 0.0
    for i in range(n):
        result += helper(i)
    return result

@kernel
def doubled(x):
    return 2.0 * helper(x)
"""

CLOSURE_KERNEL = """
import numpy as np
from posse.numeric.compiling import kernel
from herd.helpers import helper

def made_for(number):
    table = np.full(1, number, np.dtype([("x", "f4")]))

    @kernel
    def fill(out):
        out[0] = helper(table[0].x)

    return fill
"""

CLOSURE_MAIN = """
import numpy as np
from herd.kernels import made_for

out = np.zeros(1)
fill = made_for({number})
fill(out)
print(out[0], sum(fill.stats.cache_hits.values()), sum(fill.stats.cache_misses.values()))
"""

ONE_MAIN = """
from herd.kernels import total

print(total(3), 0, 0)
"""

LOADED_MAIN = """
import sys
import numba
import numpy as np
from herd.kernels import doubled, total

answer = total(3)
ready = int("numba.np.arraymath" in sys.modules)
assert sum(total.stats.cache_hits.values()) == 1

assert doubled(2.0) == 6.0
assert sum(doubled.stats.cache_misses.values()) == 1
assert numba.njit(lambda a: np.sort(a * np.arange(3.0)).sum())(np.ones(3)) == 3.0
print(answer, ready, int("numba.np.arraymath" in sys.modules))
"""

MAIN = """
from herd.kernels import doubled, total

answer = total(3)
assert doubled(0.0) > 0.0
stats = getattr(total, "stats", None)
hits = sum(stats.cache_hits.values()) if stats else -1
misses = sum(stats.cache_misses.values()) if stats else -1
print(answer, hits, misses)
"""


@dataclass(frozen=True)
class Run:
    answer: float
    hits: int
    misses: int
    stderr: str


@dataclass(frozen=True)
class Herd:
    """A throw-away package with a kernel in one module and its helper in another."""

    root: Path
    main: str = MAIN

    def write_helper(self, step: int) -> None:
        (self.root / "herd" / "helpers.py").write_text(HELPER.format(step=step))

    def run(self, cache: Path, **environment: str) -> Run:
        clean = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", self.main],
            cwd=self.root,
            env={**clean, "POSSE_CACHE_DIR": str(cache), **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        answer, hits, misses = done.stdout.split()
        return Run(float(answer), int(hits), int(misses), done.stderr)


@pytest.fixture
def herd(tmp_path: Path) -> Herd:
    package = tmp_path / "sources" / "herd"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "kernels.py").write_text(KERNEL)
    herd = Herd(package.parent)
    herd.write_helper(step=1)
    return herd


def test_a_kernel_is_compiled_once_and_again_when_a_helper_in_another_file_changes(
    herd: Herd, tmp_path: Path
) -> None:
    cache = tmp_path / "cache"

    first = herd.run(cache)
    assert (first.answer, first.hits, first.misses) == (6.0, 0, 1)
    assert first.stderr.count("\n") == 1, "one line, though two kernels were compiled"
    assert str(cache) in first.stderr

    second = herd.run(cache)
    assert (second.answer, second.hits, second.misses) == (6.0, 1, 0)
    assert second.stderr == ""

    herd.write_helper(step=10)
    third = herd.run(cache)
    assert (third.answer, third.hits, third.misses) == (33.0, 0, 1)

    herd.write_helper(step=1)
    back = herd.run(cache)
    assert (back.answer, back.hits) == (6.0, 1), "the first version is still filed under its stamp"


def test_a_kernel_from_disk_does_not_wait_for_the_compiler_which_still_works(
    herd: Herd, tmp_path: Path
) -> None:
    Herd(herd.root, ONE_MAIN).run(tmp_path / "cache")
    loaded = Herd(herd.root, LOADED_MAIN).run(tmp_path / "cache")
    ready_when_loaded, ready_after_compiling = loaded.hits, loaded.misses
    assert loaded.answer == 6.0
    assert (ready_when_loaded, ready_after_compiling) == (0, 1)


def test_kernels_with_other_constants_are_not_taken_for_each_other(
    herd: Herd, tmp_path: Path
) -> None:
    """As kernels of their own are made: one source, the scenario's numbers built in."""
    (herd.root / "herd" / "kernels.py").write_text(CLOSURE_KERNEL)
    for number, hits in ((2, 0), (5, 0), (2, 1), (5, 1)):
        run = Herd(herd.root, CLOSURE_MAIN.format(number=number)).run(tmp_path / "cache")
        assert (run.answer, run.hits) == (number + 1, hits)


def test_sources_that_change_while_a_process_runs_are_not_filed_under_the_old_stamp(
    herd: Herd, tmp_path: Path
) -> None:
    cache = tmp_path / "cache"
    kernels = herd.root / "herd" / "kernels.py"
    # The module rewrites its own helper file after import, as an editor might.
    kernels.write_text(
        KERNEL
        + "\nfrom pathlib import Path\n"
        + "path = Path(__file__).with_name('helpers.py')\n"
        + "path.write_text(path.read_text().replace('x + 1', 'x + 2'))\n"
    )
    assert herd.run(cache).answer == 6.0
    kernels_after = herd.run(cache)
    assert (kernels_after.answer, kernels_after.hits) == (9.0, 0)


def test_a_cache_directory_that_cannot_be_written_costs_time_only(
    herd: Herd, tmp_path: Path
) -> None:
    in_the_way = tmp_path / "file"  # not a matter of permissions, which root ignores
    in_the_way.write_text("")
    run = herd.run(in_the_way / "cache")
    assert (run.answer, run.hits, run.misses) == (6.0, 0, 1)
    assert "cannot write" in run.stderr


def test_a_damaged_cache_is_compiled_again(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    herd.run(cache)
    damaged = list(cache.rglob("*.nb[ic]"))
    assert damaged
    for path in damaged:
        path.write_bytes(path.read_bytes()[:10])
    run = herd.run(cache)
    assert (run.answer, run.hits, run.misses) == (6.0, 0, 1)


def test_old_stamps_are_dropped_and_nothing_else(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    for number in range(20):
        old = cache / f"kernels-{number:020x}"
        old.mkdir(parents=True)
        os.utime(old, (number, number))
    (cache / "notes").mkdir()
    herd.run(cache)
    names = {path.name for path in cache.iterdir()}
    assert "notes" in names
    assert len(names - {"notes"}) == 16
    assert f"kernels-{0:020x}" not in names


def test_without_the_compiler_the_plain_functions_run(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    run = herd.run(cache, NUMBA_DISABLE_JIT="1")
    assert (run.answer, run.hits) == (6.0, -1)
    assert run.stderr == ""
    assert not cache.exists()
