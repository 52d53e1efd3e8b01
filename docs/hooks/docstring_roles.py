"""Docstrings for the manual: roles such as :class:`Batch`, literal blocks and tables become Markdown."""

import re
from typing import Any, Final

import griffe

from declared_tables import table

_ROLE: Final = re.compile(r":(?:class|func|meth|mod|attr|data|exc):`~?\.?([^`]+)`")
_LITERAL: Final = re.compile(r"::$", re.MULTILINE)
_TABLE: Final = re.compile(r"^=+ [= ]+\n(?:.+\n)+?=+ [= ]+$(?!\n\S)", re.MULTILINE)


class DocstringRoles(griffe.Extension):
    """Rewrites docstrings before they are rendered."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a module, class, function or attribute."""
        if obj.docstring:
            text = _ROLE.sub(r"`\1`", _TABLE.sub(_markdown, obj.docstring.value))
            obj.docstring.value = _LITERAL.sub(":", text)


def _markdown(found: re.Match[str]) -> str:
    """Return a table between rulers of ``=``, two, or three with a header, as Markdown."""
    ruler, *lines, _ = found[0].splitlines()
    starts = [each.start() for each in re.finditer("=+", ruler)]
    ends = [*starts[1:], None]
    rows: list[list[str]] = []
    for line in lines:
        cells = [line[start:end].strip() for start, end in zip(starts, ends, strict=True)]
        if cells[0]:
            rows.append(cells)
        else:  # goes on
            rows[-1] = [f"{above} {cell}".strip() for above, cell in zip(rows[-1], cells, strict=True)]
    header = [""] * len(starts)
    if len(rows) > 1 and set(rows[1][0]) == {"="}:
        header, _, *rows = rows
    return table(header, rows)
