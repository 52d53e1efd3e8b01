"""A policy that a test kills, stops and counts, played by the workers of a cluster."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from posse.numeric import FloatArray
from posse_baselines import BasePolicy, Memory, load


class Watched(BasePolicy):
    """``pursuit``, which in one shard does a deed: it ends the process, waits for the file ``go``, or fails.

    Each shard leaves the node that plays it in ``begun-N``, N from 1 on. The first one from N = 4 on does the deed, and
    leaves its node in ``chosen``; with ``"die always"`` each ends its process.
    """

    name = "watched"
    reads_state = False

    def __init__(self, folder: Path, deed: str) -> None:
        self._folder, self._deed, self._pursuit = folder, deed, load("pursuit")

    def begin(self, layout: Any, num_worlds: int) -> Memory:
        import ray

        node = ray.get_runtime_context().get_node_id()
        number = next(n for n in range(1, 1000) if _claim(self._folder / f"begun-{n}", node))
        chosen = self._deed == "die always" or (number >= 4 and _claim(self._folder / "chosen", node))
        deed = self._deed if chosen else ""
        if deed.startswith("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        if deed == "fail":
            raise ValueError("no idea")
        until = time.monotonic() + 60.0
        while deed == "wait" and not (self._folder / "go").exists() and time.monotonic() < until:
            time.sleep(0.05)
        return self._pursuit.begin(layout, num_worlds)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        return self._pursuit.act(observations, memory)


def _claim(path: Path, content: str) -> bool:
    try:
        with path.open("x") as file:
            file.write(content)
    except FileExistsError:
        return False
    return True
