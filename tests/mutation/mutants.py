"""Mutants of a source file, made by cosmic-ray's operators."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

SOURCES: Final = Path("baselines")
FOLDERS: Final = ("posse_baselines/laws", "posse_baselines/ddcs")

_BINARY: Final = (
    "Add_Sub",
    "Sub_Add",
    "Mul_Div",
    "Div_Mul",
    "FloorDiv_Mul",
    "Mod_Mul",
    "Pow_Mul",
    "BitAnd_BitOr",
    "BitOr_BitAnd",
    "LShift_RShift",
    "RShift_LShift",
)
_COMPARISONS: Final = (
    "Lt_LtE",
    "Lt_GtE",
    "LtE_Lt",
    "LtE_Gt",
    "Gt_GtE",
    "Gt_LtE",
    "GtE_Gt",
    "GtE_Lt",
    "Eq_NotEq",
    "NotEq_Eq",
    "Is_IsNot",
    "IsNot_Is",
)
OPERATORS: Final = (
    *(f"core/ReplaceBinaryOperator_{name}" for name in _BINARY),
    *(f"core/ReplaceComparisonOperator_{name}" for name in _COMPARISONS),
    "core/ReplaceUnaryOperator_Delete_USub",
    "core/ReplaceUnaryOperator_Delete_Not",
    "core/AddNot",
    "core/ReplaceAndWithOr",
    "core/ReplaceOrWithAnd",
    "core/ReplaceTrueWithFalse",
    "core/ReplaceFalseWithTrue",
    "core/ReplaceBreakWithContinue",
    "core/ReplaceContinueWithBreak",
    "core/ZeroIterationForLoop",
    "core/NumberReplacer",
)
"""One or two replacements of each operator, where cosmic-ray's full set has up to eleven."""

_DATA: Final = ("number", "tuned", "choice")
"""Calls that declare a setting: its default and range are data, not logic."""


@dataclass(frozen=True)
class Mutant:
    """A change of one place of one file."""

    path: str
    operator: str
    occurrence: int
    line: int

    @property
    def module(self) -> str:
        """The name under which the file is imported."""
        return self.path.removesuffix(".py").replace("/", ".")

    def original(self) -> str:
        """The text of the file."""
        return (SOURCES / self.path).read_text(encoding="utf-8")

    def code(self) -> str:
        """The text of the changed file."""
        changed = mutate_code(self.original(), _operator(self.operator), self.occurrence)
        assert changed is not None, self
        return str(changed)

    def change(self) -> tuple[str, str]:
        """The line before and after, or the first of several."""
        before, after = self.original().splitlines(), self.code().splitlines()
        pairs = zip(before, after, strict=False)
        return next(((a.strip(), b.strip()) for a, b in pairs if a != b), ("", ""))


@cache
def _operator(name: str) -> Any:
    return get_operator(name)()


def _left_out(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Ranges (line, column) that are not mutated: annotations, decorators, declared settings."""
    nodes: list[ast.expr] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            nodes += [*node.decorator_list, *([node.returns] if node.returns else [])]
        elif isinstance(node, ast.ClassDef):
            nodes += node.decorator_list
        elif isinstance(node, (ast.arg, ast.AnnAssign)) and node.annotation is not None:
            nodes.append(node.annotation)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") in _DATA:
            nodes.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno or n.lineno, n.end_col_offset or 0)) for n in nodes]


def mutants_of(path: str) -> Iterator[Mutant]:
    """Yield the mutants of a file, named from the sources' root."""
    text = (SOURCES / path).read_text(encoding="utf-8")
    nodes, left_out = list(ast_nodes(get_ast(text))), _left_out(text)
    for name in OPERATORS:
        places = (place for node in nodes for place in _operator(name).mutation_positions(node))
        for occurrence, (start, _) in enumerate(places):
            if not any(first <= start < last for first, last in left_out):
                yield Mutant(path, name, occurrence, start[0])


def all_mutants() -> list[Mutant]:
    """Return every mutant of every file."""
    files = sorted(file for folder in FOLDERS for file in (SOURCES / folder).rglob("*.py"))
    return [m for file in files for m in mutants_of(file.relative_to(SOURCES).as_posix())]
