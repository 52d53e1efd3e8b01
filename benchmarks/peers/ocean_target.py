"""PufferLib Ocean `target`, in C on one core: 5 agents and 1 goal, as many robots as in `smart`.

The loop over steps and worlds is in C as well, as a reference for compiled code. The source is
taken from PufferLib's source distribution; see ``ocean_source`` in ``peers.py``.
"""

from __future__ import annotations

import ctypes
import random
import subprocess
import sys
from pathlib import Path

from serve import ACTION_SETS, Built, serve

HERE = Path(__file__).parent
SOURCE = Path(sys.argv[1])
AGENTS, GOALS = 5, 1


def library() -> Path:
    """Compile the simulator, once per run of the benchmark, and return the shared library."""
    path = SOURCE / "worlds.so"
    subprocess.run(
        [
            "cc",
            "-O3",
            "-march=native",
            "-DNDEBUG",
            "-w",
            "-shared",
            "-fPIC",
            f"-I{HERE / 'ocean'}",
            f"-I{SOURCE}",
            str(HERE / "ocean" / "worlds.c"),
            "-lm",
            "-o",
            str(path),
        ],
        check=True,
    )
    return path


worlds_in_c = ctypes.CDLL(str(library()))


def build(worlds: int, variant: str) -> Built:
    """Return a number of worlds; memory allocated by earlier calls is not freed."""
    size = worlds_in_c.build(worlds, AGENTS, GOALS)
    draws = random.Random(0)
    numbers = ACTION_SETS * worlds * AGENTS
    pairs = draws.choices([(turn, push) for turn in range(9) for push in range(5)], k=numbers)
    flat = [part for pair in pairs for part in pair]
    actions = (ctypes.c_int * len(flat))(*flat)

    def run(steps: int) -> None:
        worlds_in_c.run(steps, actions, ACTION_SETS)

    return Built(run, AGENTS, size)


serve(build)
