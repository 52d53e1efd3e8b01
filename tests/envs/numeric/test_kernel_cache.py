"""Kernels kept on disk are never stale, and nothing that is wrong with a file does harm."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.support.forks import forks_of

import posse

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

REGISTRY_KERNEL = """
from numba.extending import overload
from posse.numeric import kernel

FUNCTIONS = []

def call(x):
    raise NotImplementedError

def made():
    chosen = FUNCTIONS[0]

    @overload(call)
    def _(x):
        return lambda x: chosen(x)

    @kernel(sources=FUNCTIONS)
    def total(x):
        return call(x) + 1.0

    return total
"""

REGISTRY_MAIN = """
from herd.kernels import FUNCTIONS, made
from {module} import mine

FUNCTIONS.append(mine)
total = made()
print(total(1.0), sum(total.stats.cache_hits.values()), 0)
"""

USERS_FUNCTION = """
from posse.numeric import compiled

@compiled
def mine(x):
    return x + {step}
"""

SCRIPT = """
import os
from posse.numeric import compiled, kernel

NUMBER = float(os.environ["NUMBER"])

@compiled
def shifted(x):
    return x + NUMBER

@kernel
def total(x):
    return shifted(x)

print(total(1.0), sum(total.stats.cache_hits.values()), 0)
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
        variables = {**clean, "POSSE_CACHE_DIR": str(cache), **environment}
        done = (
            subprocess.run(  # since they matter before posse is imported
                [sys.executable, "-W", "error", "-c", self.main],
                cwd=self.root,
                env=variables,
                capture_output=True,
                text=True,
                check=False,
            )
            if environment.keys() & {"PYTHONPATH", "NUMBA_DISABLE_JIT"}
            else forks_of("posse.numeric", options=("-W", "error")).run(self.main, self.root, variables)
        )
        assert done.returncode == 0, done.stderr
        answer, hits, misses = done.stdout.split()
        return Run(float(answer), int(hits), int(misses), done.stderr)


def snapshot(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def herd(tmp_path: Path) -> Herd:
    package = tmp_path / "sources" / "herd"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "kernels.py").write_text(KERNEL)
    herd = Herd(package.parent)
    herd.write_helper(step=1)
    return herd


def test_a_kernel_is_compiled_once_and_again_when_a_helper_in_another_file_changes(herd: Herd, tmp_path: Path) -> None:
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


@pytest.mark.long
def test_a_kernel_from_disk_does_not_wait_for_the_compiler_which_still_works(herd: Herd, tmp_path: Path) -> None:
    Herd(herd.root, ONE_MAIN).run(tmp_path / "cache")
    loaded = Herd(herd.root, LOADED_MAIN).run(tmp_path / "cache")
    ready_when_loaded, ready_after_compiling = loaded.hits, loaded.misses
    assert loaded.answer == 6.0
    assert (ready_when_loaded, ready_after_compiling) == (0, 1)


def test_kernels_with_other_constants_are_not_taken_for_each_other(herd: Herd, tmp_path: Path) -> None:
    """As for own kernels: one source, with the scenario's numbers as constants."""
    (herd.root / "herd" / "kernels.py").write_text(CLOSURE_KERNEL)
    for number, hits in ((2, 0), (5, 0), (2, 1), (5, 1)):
        run = Herd(herd.root, CLOSURE_MAIN.format(number=number)).run(tmp_path / "cache")
        assert (run.answer, run.hits) == (number + 1, hits)


@pytest.mark.long
def test_sources_that_change_while_a_process_runs_are_not_filed_under_the_old_stamp(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    kernels = herd.root / "herd" / "kernels.py"
    # The module rewrites its helper file after the import, as an edit would.
    kernels.write_text(
        KERNEL
        + "\nfrom pathlib import Path\n"
        + "path = Path(__file__).with_name('helpers.py')\n"
        + "path.write_text(path.read_text().replace('x + 1', 'x + 2'))\n"
    )
    assert herd.run(cache).answer == 6.0
    kernels_after = herd.run(cache)
    assert (kernels_after.answer, kernels_after.hits) == (9.0, 0)


@pytest.mark.long
def test_an_edit_of_a_room_without_kernels_recompiles_nothing(herd: Herd, tmp_path: Path) -> None:
    """Edits of rendering and adapters keep kernels; an edit of a rule does not."""
    copy = tmp_path / "posse"
    shutil.copytree(Path(posse.__file__).parent, copy)
    cache = tmp_path / "cache"
    runs = []
    for room in ("", "rendering", "adapters", "rules", "numeric"):
        if room:
            with (copy / room / "__init__.py").open("a") as file:
                file.write("# edited\n")
        runs.append(herd.run(cache, PYTHONPATH=str(tmp_path)).hits)
    assert runs == [0, 1, 1, 0, 0]


def test_an_edit_of_another_package_that_a_kernel_calls_compiles_it_again(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    other = herd.root / "flock"
    other.mkdir()
    (other / "__init__.py").write_text("")
    (herd.root / "herd" / "kernels.py").write_text(KERNEL.replace("herd.helpers", "flock.helpers"))
    for step, hits in ((1, 0), (1, 1), (2, 0)):
        (other / "helpers.py").write_text(HELPER.format(step=step))
        run = herd.run(cache)
        assert (run.answer, run.hits) == (3.0 + 3.0 * step, hits)


@pytest.mark.parametrize("file", ["mine.py", "mine/__init__.py"])
def test_an_edit_of_a_function_given_as_a_source_compiles_the_kernel_again(
    herd: Herd, tmp_path: Path, file: str
) -> None:
    """A user's function reaches the kernel through a registry filled at run time."""
    cache = tmp_path / "cache"
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    (herd.root / file).parent.mkdir(exist_ok=True)
    (herd.root / "herd" / "kernels.py").write_text(REGISTRY_KERNEL)
    main = Herd(herd.root, REGISTRY_MAIN.format(module=module))
    for step, hits in ((1, 0), (1, 1), (7, 0)):
        (herd.root / file).write_text(USERS_FUNCTION.format(step=step))
        run = main.run(cache)
        assert (run.answer, run.hits) == (2.0 + step, hits)


def test_a_script_of_the_user_is_cached_and_compiled_again_when_a_constant_changes(herd: Herd, tmp_path: Path) -> None:
    """Even if its file does not, since constants of compiled code can come from elsewhere."""
    cache = tmp_path / "cache"
    script = herd.root / "script.py"
    script.write_text(SCRIPT)
    main = Herd(herd.root, f"import runpy; runpy.run_path({str(script)!r})")
    for number, hits in ((1, 0), (1, 1), (5, 0)):
        run = main.run(cache, NUMBER=str(number))
        assert (run.answer, run.hits) == (number + 1, hits)
    script.write_text(SCRIPT.replace("x + NUMBER", "x + NUMBER + 1"))
    assert main.run(cache, NUMBER="1").answer == 3.0


def test_a_cache_directory_that_cannot_be_written_costs_time_only(herd: Herd, tmp_path: Path) -> None:
    in_the_way = tmp_path / "file"  # not a matter of permissions, which root ignores
    in_the_way.write_text("")
    run = herd.run(in_the_way / "cache")
    assert (run.answer, run.hits, run.misses) == (6.0, 0, 1)
    assert run.stderr.count("\n") == 1
    assert "cannot write" in run.stderr


def test_the_cache_directory_is_the_users_alone(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    herd.run(cache)
    assert cache.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in cache.iterdir()} == {0o600}


@pytest.mark.parametrize("mode", [0o770, 0o702])
def test_a_directory_that_others_can_write_to_is_not_used(herd: Herd, tmp_path: Path, mode: int) -> None:
    cache = tmp_path / "cache"
    herd.run(cache)
    before = snapshot(cache)
    cache.chmod(mode)
    run = herd.run(cache)
    assert (run.answer, run.hits, run.misses) == (6.0, 0, 1)
    assert run.stderr.count("\n") == 1
    assert f"{cache} is not used, since others can write to it" in run.stderr
    assert snapshot(cache) == before
    cache.chmod(0o755)
    assert herd.run(cache).hits == 1


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="needs root to give away")
@pytest.mark.parametrize("all_of_it", [True, False])
def test_what_belongs_to_another_user_is_not_used(herd: Herd, tmp_path: Path, all_of_it: bool) -> None:
    cache = tmp_path / "cache"
    herd.run(cache)
    for path in [cache] if all_of_it else list(cache.iterdir()):
        os.chown(path, 12345, -1)
    run = herd.run(cache)
    assert (run.answer, run.hits) == (6.0, 0)
    assert ("belongs to another user" in run.stderr) == all_of_it


def test_a_file_that_others_can_write_to_is_not_read(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    herd.run(cache)
    for path in cache.iterdir():
        path.chmod(0o666)
    assert herd.run(cache).hits == 0


def test_a_planted_file_runs_nothing(herd: Herd, tmp_path: Path) -> None:
    """Even under the right name: its hash is wrong, and is checked before anything is unpickled."""
    cache, witness = tmp_path / "cache", tmp_path / "witness"
    herd.run(cache)
    for path in cache.iterdir():
        head = path.read_bytes()[:56]
        path.write_bytes(head + b"cos\nsystem\n(S'touch " + str(witness).encode() + b"'\ntR.")
    run = herd.run(cache)
    assert (run.answer, run.hits) == (6.0, 0)
    assert not witness.exists()


def test_a_full_disk_costs_time_only(herd: Herd, tmp_path: Path) -> None:
    """With a limit of the file size, writing fails half way."""
    resource = pytest.importorskip("resource")
    cache = tmp_path / "cache"
    limit = f"import resource as r\nr.setrlimit(r.RLIMIT_FSIZE, (1000, {resource.RLIM_INFINITY}))\n"
    run = Herd(herd.root, limit + MAIN).run(cache)
    assert (run.answer, run.hits, run.misses) == (6.0, 0, 1)
    assert list(cache.iterdir()) == [], "nothing half written is left"


@pytest.mark.long
def test_files_not_used_for_longest_are_dropped_and_nothing_else(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o700)
    for number in range(300):
        for name in (f"{number}.kernel", f"{number}.tmp", f"{number}.txt"):
            (cache / name).touch()
            os.utime(cache / name, (number, number))
    herd.run(cache)
    names = {path.name for path in cache.iterdir()}
    assert sum(name.endswith(".kernel") for name in names) == 256
    assert "0.kernel" not in names
    assert "299.kernel" in names
    assert not any(name.endswith(".tmp") for name in names), "left by processes that were killed"
    assert sum(name.endswith(".txt") for name in names) == 300


def test_without_the_compiler_the_plain_functions_run(herd: Herd, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    run = herd.run(cache, NUMBA_DISABLE_JIT="1")
    assert (run.answer, run.hits) == (6.0, -1)
    assert run.stderr == ""
    assert not cache.exists()
