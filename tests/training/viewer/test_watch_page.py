"""The page about watching names the keys that there are."""

from __future__ import annotations

from pathlib import Path

from posse_training.viewer.keys import BINDINGS, MOUSE

PAGE = Path(__file__).parents[3] / "docs/watch.md"


def test_the_table_of_keys_is_that_of_the_viewer() -> None:
    keys = [*((binding.keys, binding.text) for binding in BINDINGS), *MOUSE]
    table = "| key | what it does |\n|---|---|\n"
    table += "".join(f"| {name} | {text} |\n" for name, text in keys)
    assert table in PAGE.read_text(encoding="utf-8"), table
