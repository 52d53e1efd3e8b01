"""The public interface is the stored list: a removal is decided, not overlooked.

After a wanted change: ``python tests/package/test_public_interface.py`` writes the list anew. A
name that goes is deprecated for one minor version before.
"""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import Any

import pytest

LIST = Path(__file__).with_name("public_interface.txt")
MODULES = (
    "posse",
    "posse_baselines",
    "posse_baselines.learned",
    "posse_training",
    "posse_training.datasets",
    "posse_training.replay",
    "posse_training.sb3",
    "posse_training.torchrl",
)


def described(name: str, thing: Any) -> list[str]:
    """Return a line for a name, and one for each public method or property of a class of ours."""
    if isinstance(thing, type) and thing.__module__.startswith("posse"):
        members = [
            f"{name}.{key}"
            for key, value in vars(thing).items()
            if not key.startswith("_") and (callable(value) or isinstance(value, property))
        ]
        return [name, *sorted(members)]
    if inspect.isfunction(thing):
        parameters = ", ".join(
            f"{'*' * (each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD))}{each.name}"
            for each in inspect.signature(thing).parameters.values()
        )
        return [f"{name}({parameters})"]
    return [name]


def interface() -> list[str]:
    """Return every public name, sorted by module."""
    lines = []
    for module in MODULES:
        found = importlib.import_module(module)
        for name in sorted(found.__all__):
            lines += described(f"{module}.{name}", getattr(found, name))
    return lines


def test_it_is_the_stored_list() -> None:
    stored = LIST.read_text(encoding="utf-8").splitlines()
    now = interface()
    assert not sorted(set(stored) - set(now)), "gone: deprecate it first, or change it back"
    assert not sorted(set(now) - set(stored)), f"new: run python {Path(__file__).name}"


@pytest.mark.parametrize("module", MODULES)
def test_every_function_is_typed(module: str) -> None:
    found = importlib.import_module(module)
    for name in found.__all__:
        thing = getattr(found, name)
        if inspect.isfunction(thing):
            signature = inspect.signature(thing)
            assert signature.return_annotation is not inspect.Signature.empty, name
            for parameter in signature.parameters.values():
                assert parameter.annotation is not inspect.Parameter.empty, (name, parameter)


if __name__ == "__main__":
    LIST.write_text("\n".join(interface()) + "\n", encoding="utf-8")
