"""Policies as plain Python on compiled environments, and one of their modules changed.

``NUMBA_DISABLE_JIT=1`` would slow the environments down, too.
"""

from __future__ import annotations

import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType
from typing import Any

from tests.support.plain import PLAIN

import posse.numeric


class _Loader(SourceFileLoader):
    """Loads a module from another text."""

    def __init__(self, name: str, path: str, text: str) -> None:
        super().__init__(name, path)
        self.text = text

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.text, self.path, "exec", dont_inherit=True)


class _Finder(MetaPathFinder):
    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path) if fullname == self.name else None
        if spec is not None:
            spec.loader = _Loader(fullname, str(spec.origin), self.text)
        return spec


def import_changed(name: str, text: str) -> None:
    """Have a module, not imported yet, load from a text instead of its file."""
    sys.meta_path.insert(0, _Finder(name, text))


def leave_uncompiled() -> None:
    """Have modules that are imported from now on run as plain Python."""
    vars(posse.numeric).update(PLAIN)
