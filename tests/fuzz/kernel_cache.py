"""Damage the files of the kernel cache at random: every kernel still gives the right numbers.

Run it for as long as you like::

    python -m tests.fuzz.kernel_cache --minutes 30 --seed 1

Each case damages files of a cache that holds two kernels, then has a forked process call both.
Whatever is wrong with a file, the kernel has to be compiled again, without an error.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

KERNELS = """
from posse.numeric import compiled, kernel

@compiled
def helper(x):
    return x + 1.0

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
RIGHT = [5151.0, 7.0]
LIMIT_S = 60


def flip_bits(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(rng.choice((1, 1, 1, 8, 100))):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def flip_a_bit_of_the_head(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[rng.randrange(80)] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def truncate(path: Path, rng: random.Random) -> None:
    os.truncate(path, rng.randrange(path.stat().st_size))


def truncate_to_the_head(path: Path, rng: random.Random) -> None:
    os.truncate(path, rng.randrange(64))


def overwrite(path: Path, rng: random.Random) -> None:
    path.write_bytes(rng.randbytes(rng.choice((1, 60, 5000))))


def overwrite_a_block(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    first = rng.randrange(len(content))
    content[first : first + 512] = bytes(len(content[first : first + 512]))
    path.write_bytes(content)


def lengthen(path: Path, rng: random.Random) -> None:
    path.write_bytes(path.read_bytes() + rng.randbytes(rng.randrange(1, 100)))


def remove(path: Path, rng: random.Random) -> None:
    path.unlink()


def replace_by_a_directory(path: Path, rng: random.Random) -> None:
    path.unlink()
    path.mkdir()


def replace_by_a_pipe(path: Path, rng: random.Random) -> None:
    path.unlink()
    os.mkfifo(path)


def replace_by_a_link(path: Path, rng: random.Random) -> None:
    path.unlink()
    path.symlink_to(rng.choice(("nowhere", path.name, "/dev/zero", "/")))


def swap(path: Path, rng: random.Random) -> None:
    first, second = sorted(path.parent.glob("*.kernel"))
    content = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(content)


DAMAGES = (
    flip_bits,
    flip_bits,
    flip_bits,
    flip_a_bit_of_the_head,
    truncate,
    truncate_to_the_head,
    overwrite,
    overwrite_a_block,
    lengthen,
    remove,
    replace_by_a_directory,
    replace_by_a_pipe,
    replace_by_a_link,
)


def damage(cache: Path, seed: int, case: int) -> tuple[str, int]:
    """Damage one file or both; return how, and how many are whole still."""
    rng = random.Random(f"{seed} {case}")
    files = sorted(cache.glob("*.kernel"))
    assert len(files) == 2
    if rng.random() < 0.05:
        swap(files[0], rng)
        return "swap", 0
    chosen = rng.sample(files, rng.choice((1, 2)))
    ways = [rng.choice(DAMAGES) for _ in chosen]
    for path, way in zip(chosen, ways, strict=True):
        way(path, rng)
    return " and ".join(way.__name__ for way in ways), 2 - len(chosen)


def answers_and_hits() -> tuple[list[float], int]:
    """Call both kernels; return what they say, and how many were loaded."""
    from fuzzed import kernels  # type: ignore[import-not-found]

    answers = [kernels.total(101), kernels.doubled(2.5)]
    hits = sum(sum(k.stats.cache_hits.values()) for k in (kernels.total, kernels.doubled))
    return answers, hits


def call_kernels() -> str:
    """Call both kernels; return how many were loaded, or what went wrong."""
    answer, error = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(error[1], 2)
        status = 1
        try:
            os.write(answer[1], json.dumps(answers_and_hits()).encode())
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    for pipe in (answer, error):
        os.close(pipe[1])
    end = time.monotonic() + LIMIT_S
    while not (ended := os.waitpid(child, os.WNOHANG))[0]:
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return "hangs"
        time.sleep(0.002)
    with os.fdopen(answer[0], "rb") as said, os.fdopen(error[0], "rb") as wrong:
        text, message = said.read(), wrong.read().decode()
    if ended[1]:
        return f"ends with {os.waitstatus_to_exitcode(ended[1])}: {message[-300:]}"
    answers, hits = json.loads(text)
    if answers != RIGHT:
        return f"wrong numbers: {answers}"
    return f"{hits} of 2 loaded"


def play(folder: Path, seed: int, first: int, cases: int, seconds: float) -> None:
    """Play cases in this process; print one line of JSON each."""
    cache, whole = folder / "cache", folder / "whole"
    for expected in ("0 of 2 loaded", "2 of 2 loaded"):
        found = call_kernels()
        assert found == expected, found
    shutil.copytree(cache, whole)
    end = time.monotonic() + seconds
    for case in range(first, first + cases):
        shutil.rmtree(cache)
        shutil.copytree(whole, cache)
        how, whole_still = damage(cache, seed, case)
        found = call_kernels()
        good = found == f"{whole_still} of 2 loaded"
        sys.stdout.write(json.dumps([case, how, found, good]) + "\n")
        if time.monotonic() > end:
            break


def campaign(
    folder: Path, seed: int, first: int = 0, cases: int = 10**9, seconds: float = 10**9
) -> tuple[Counter[str], list[str]]:
    """Play cases from a seed, until there were enough; return how many ended how, and the failures.

    A damaged file that is loaded all the same is a failure, too.
    """
    package = folder / "fuzzed"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "kernels.py").write_text(KERNELS)
    worker = (
        "import sys, pathlib, posse.numeric\n"
        "from tests.fuzz.kernel_cache import play\n"
        "folder, seed, first, cases, seconds = sys.argv[1:]\n"
        "sys.path.insert(0, folder)\n"
        "play(pathlib.Path(folder), int(seed), int(first), int(cases), float(seconds))\n"
    )
    root = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", worker, str(folder), *map(str, (seed, first, cases, seconds))],
        env={**os.environ, "PYTHONPATH": path, "POSSE_CACHE_DIR": str(folder / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    counts: Counter[str] = Counter()
    failures = []
    for line in done.stdout.splitlines():
        case, how, found, good = json.loads(line)
        counts[found if good else "failed"] += 1
        if not good:
            failures.append(f"seed {seed}, case {case}, {how}: {found}")
    return counts, failures


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="the first case, to play one again")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counts, failures = campaign(Path(folder), chosen.seed, chosen.first, seconds=60 * chosen.minutes)
    sys.stdout.write("\n".join([*failures, f"{sum(counts.values())} cases: {dict(counts)}", ""]))
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
