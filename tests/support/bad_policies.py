"""Policies with every kind of failure."""

import ctypes
import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from posse import DeclarationError, get_scenario
from posse_baselines.policies.simple import Idle, Pursuit


class Raises(Idle):
    """Raises what cannot be pickled, with a message that looks like markup."""

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        class LocalError(Exception):
            def __reduce__(self) -> Any:
                raise TypeError("never pickled")

        raise LocalError("[bold]local[/bold]")


class Nan(Idle):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        actions, memory = super().act(observations, memory)
        return actions * np.float32(np.nan), memory


class Builds(Idle):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        raise get_scenario("nope")  # type: ignore[misc]


class Declares(Idle):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        raise DeclarationError("mine")


class Untold(Idle):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        raise type("Untold", (Exception,), {"__str__": lambda self: self.detail})


class Hangs(Idle):
    """Writes its process id, and hangs in native code that holds the interpreter's lock: no thread can stop it."""

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        Path(os.environ["PID_FILE"]).write_text(str(os.getpid()))
        ctypes.PyDLL(None).sleep(600)
        raise AssertionError


class Leaves(Idle):
    """Leaves a thread and a pool of processes behind."""

    def begin(self, layout: Any, num_worlds: int) -> Any:
        self.pool = ProcessPoolExecutor(1)
        assert self.pool.submit(abs, -3).result() == 3
        threading.Thread(target=time.sleep, args=(600.0,)).start()
        return super().begin(layout, num_worlds)


class Crashes(Idle):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        os._exit(9)


class Watched(Pursuit):
    """``pursuit``, which in one shard does a deed: it ends the process, waits for the file ``go``, or fails.

    Each shard leaves a file ``begun-N``, N from 1 on. The first one from N = 4 on does the deed; with ``"die always"``
    each ends its process.
    """

    name = "watched"

    def __init__(self, folder: Path, deed: str) -> None:
        self._folder, self._deed = folder, deed

    def begin(self, layout: Any, num_worlds: int) -> Any:
        number = next(n for n in range(1, 1000) if _claim(self._folder / f"begun-{n}"))
        chosen = self._deed == "die always" or (number >= 4 and _claim(self._folder / "chosen"))
        deed = self._deed if chosen else ""
        if deed.startswith("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        if deed == "fail":
            raise ValueError("no idea")
        until = time.monotonic() + 60.0
        while deed == "wait" and not (self._folder / "go").exists() and time.monotonic() < until:
            time.sleep(0.05)
        return super().begin(layout, num_worlds)


def _claim(path: Path) -> bool:
    with suppress(FileExistsError):
        path.touch(exist_ok=False)
        return True
    return False
