"""Policies with every kind of failure."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from posse_baselines import BasePolicy


class _Still(BasePolicy):
    """Returns zero actions."""

    name = "still"

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        worlds, trackers = observations.shape[:2]
        width = 2 + memory.scenario.message_size
        return np.zeros((worlds, trackers, width), np.float32), memory


class Raises(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        raise ZeroDivisionError("[bold]by zero[/bold]")


class RaisesUnpicklable(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        class LocalError(Exception):
            def __reduce__(self) -> Any:
                raise TypeError("never pickled")

        raise LocalError("local")


class Nan(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        actions, memory = super().act(observations, memory)
        return actions * np.float32(np.nan), memory


class Sleeps(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        while True:
            time.sleep(1)


class SleepsInC(_Still):
    """Hangs in native code that holds the interpreter's lock, so no thread can stop it."""

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        ctypes.PyDLL(None).sleep(600)
        raise AssertionError


class HangsWithPid(SleepsInC):
    """Hangs, after writing its process id."""

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        Path(os.environ["PID_FILE"]).write_text(str(os.getpid()))
        return super().act(observations, memory)


class Slow(_Still):
    """Takes too long in total, but not in a single step."""

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        time.sleep(0.3)
        return super().act(observations, memory)


class Exits(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        sys.exit(0)


class Crashes(_Still):
    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        os._exit(9)


class RaisesOnLoad(_Still):
    def __init__(self) -> None:
        raise LookupError("no weights")
