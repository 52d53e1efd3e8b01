"""The policies' modules as plain Python, so that small functions are tested without compiling."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import posse.numeric

_ROOMS = ("posse_baselines.laws", "posse_baselines.ddcs")


def undecorated(function: Callable[..., Any] | None = None, **_: Any) -> Any:
    """Stands for the decorators that compile."""
    return undecorated if function is None else function


def _worlds_of(_: int, blocks: posse.numeric.Blocks) -> range:
    return range(int(blocks[-1]))


PLAIN: dict[str, Any] = {"compiled": undecorated, "kernel": undecorated, "worlds_of": _worlds_of}


@cache
def plain(name: str) -> Any:
    """Import a module, such as ``"ddcs.slots"``, as plain Python, with all that it imports of both.

    The compiled ones stay as they are.
    """
    numeric = {word: getattr(posse.numeric, word) for word in PLAIN}
    package = importlib.import_module("posse_baselines")
    others = _taken()
    rooms = {room: getattr(package, room) for room in ("laws", "ddcs")}
    try:
        vars(posse.numeric).update(PLAIN)
        sys.modules.update(_plain)
        return importlib.import_module(f"posse_baselines.{name}")
    finally:
        _plain.update(_taken())
        vars(posse.numeric).update(numeric)
        sys.modules.update(others)
        vars(package).update(rooms)


def _taken() -> dict[str, Any]:
    names = [name for name in sys.modules if name.startswith(_ROOMS)]
    return {name: sys.modules.pop(name) for name in names}


_plain: dict[str, Any] = {}
