"""Fields give columns, and a transposition writes them to the observations' rows.

A column is one number of a field for eight observers. Where in an observation each belongs follows
from the order of the declarations. Eight consecutive columns that never change are transposed only
once, into scratch memory, and copied from there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from posse.numeric import WIDTH, FloatArray, Lanes, compiled, eight, load, store, transpose, written
from posse.rules.discs import natural
from posse.signals.observation.fields import FieldDeclaration
from posse.signals.scratch import FIXED_BLOCKS

_FEW: Final = 2
"""Number of columns up to which writing single numbers is faster than a transposition."""

Declarations = Sequence[FieldDeclaration]


class Observers(NamedTuple):
    """At most eight robots, the first of them robot i of world e.

    They are one robot of several worlds (``across`` is 1) or several of one world (0).
    """

    e: int
    i: int
    number: int
    across: int


class Rows(NamedTuple):
    """Where to write in the observations of eight robots."""

    observers: Observers
    observations: FloatArray
    """(E, rows, F)."""
    start: int
    """Place in an observation that the first column goes to."""
    starts: FloatArray
    """(8,) or more: of each observer by itself, to be added where ``scattered``."""
    scattered: bool


def width_of(declarations: Declarations) -> int:
    """Return the total size of fields."""
    return sum(d.size for d in declarations)


def row_writer(declarations: Declarations, parameters: tuple[str, ...]) -> Callable[..., Any]:
    """Return a compiled function (*parameters, s, rows), which writes what the fields give.

    Args:
        declarations: The fields; those about a setting may stand anywhere among them.
        parameters: ``("c", "v")``, or ``("c", "v", "m")`` for fields of a team-mate. Then comes
            scratch memory. Fixed blocks are read from there (:func:`fixed_writer`).
    """
    names: dict[str, Any] = {
        "block": _write_block,
        "copy": _copy_block,
        "one": _write_column,
        "keep": store,
        "WIDTH": WIDTH,
    }
    blocks = _blocks(declarations)
    given, columns = _evaluation(declarations, parameters, names)
    copied = {q for b in blocks if b.number is not None for q in range(b.first, b.first + WIDTH)}
    lines: list[str] = []
    width = width_of(declarations)
    rest = blocks[-1].first + WIDTH if blocks else 0
    last_block: int | None = None
    for k, field in enumerate(declarations):
        mine = range(columns[k], columns[k] + field.size)
        if not copied.issuperset(mine):
            lines += given[k]
        # As soon as there are eight, so that few have to be kept at a time.
        while blocks and blocks[0].first + WIDTH <= mine.stop:
            first, number = blocks.pop(0)
            if number is not None:
                lines.append(f"copy({number}, {first}, s, rows)")
            elif blocks or rest == width:
                lines.append(f"block({_listed(first)}, {first}, 0, s, rows)")
            else:
                last_block = first
    if last_block is not None:
        # With the columns after it, so that the rows' places are computed only once.
        lines += [f"keep(s.column, WIDTH * {q - rest}, column_{q})" for q in range(rest, width)]
        lines.append(f"block({_listed(last_block)}, {last_block}, {width - rest}, s, rows)")
    else:
        lines += [f"one(column_{q}, {q}, s, rows)" for q in range(rest, width)]
    return written("write_rows", (*parameters, "s", "rows"), lines, names)


def fixed_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return a compiled function (c, v, s, observers), which writes the fixed blocks of robots."""
    names: dict[str, Any] = {"keep": _keep_block, "transpose": transpose}
    given, columns = _evaluation(declarations, ("c", "v"), names)
    lines = []
    for first, number in _blocks(declarations):
        if number is not None:
            for k, field in enumerate(declarations):
                if columns[k] < first + WIDTH and columns[k] + field.size > first:
                    lines += given[k]
            lines.append(f"keep(transpose({_listed(first)}), {number}, s, observers)")
    return written("keep_fixed", ("c", "v", "s", "observers"), lines, names)


def _evaluation(
    declarations: Declarations, parameters: tuple[str, ...], names: dict[str, Any]
) -> tuple[list[list[str]], list[int]]:
    """Return lines that compute the columns of each field, and the first of its columns.

    Adds to ``names`` what the lines use.
    """
    names |= {"np": np, "eight": eight}
    given, firsts, columns = [], [], 0
    for k, field in enumerate(declarations):
        names[f"field_{k}"] = field.function
        parts = [f"column_{columns + q}" for q in range(field.size)]
        arguments = "c" if field.subject == "setting" else ", ".join(parameters)
        lines = [f"{', '.join(parts)} = field_{k}({arguments})"]
        if field.subject == "setting":
            lines += [f"{part} = eight(np.float32({part}))" for part in parts]
        given.append(lines)
        firsts.append(columns)
        columns += field.size
    return given, firsts


class _Block(NamedTuple):
    """Eight columns."""

    first: int
    number: int | None
    """Among the blocks that never change; None: it may change."""


def _blocks(declarations: Declarations) -> list[_Block]:
    """Return the blocks of columns; the last one repeats some rather than leave over ``_FEW``."""
    fixed = [d.fixed for d in declarations for _ in range(d.size)]
    blocks: list[_Block] = []
    count = 0
    for first in range(0, len(fixed) - WIDTH + 1, WIDTH):
        kept = count < FIXED_BLOCKS and all(fixed[first : first + WIDTH])
        blocks.append(_Block(first, count if kept else None))
        count += kept
    # Columns of a block that never changes are not at hand to be repeated.
    if blocks and blocks[-1].number is None and len(fixed) % WIDTH > _FEW:
        blocks.append(_Block(len(fixed) - WIDTH, None))
    return blocks


def _listed(first: int) -> str:
    return ", ".join(f"column_{first + q}" for q in range(WIDTH))


def empty_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return a compiled function (o, k), which writes an empty place of a team-mate from k on."""
    values = [float(d.unknown or 0.0) for d in declarations for _ in range(d.size)]
    lines = [f"o[k + {q}] = np.float32({value})" for q, value in enumerate(values)]
    return written("write_empty", ("o", "k"), lines, {"np": np})


@compiled
def _write_block(
    a: Lanes,
    b: Lanes,
    c: Lanes,
    d: Lanes,
    f: Lanes,
    g: Lanes,
    h: Lanes,
    j: Lanes,
    first: int,
    more: int,
    s: Any,
    rows: Rows,
) -> None:
    """Write eight columns, the first of them column ``first``, and ``more`` from scratch memory."""
    a, b, c, d, f, g, h, j = transpose(a, b, c, d, f, g, h, j)
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    _write_row(a, 0, first, more, s, rows)
    _write_row(b, 1, first, more, s, rows)
    _write_row(c, 2, first, more, s, rows)
    _write_row(d, 3, first, more, s, rows)
    _write_row(f, 4, first, more, s, rows)
    _write_row(g, 5, first, more, s, rows)
    _write_row(h, 6, first, more, s, rows)
    _write_row(j, 7, first, more, s, rows)


@compiled
def _write_row(row: Lanes, lane: int, first: int, more: int, s: Any, rows: Rows) -> None:
    """Write eight numbers of one observer and ``more``, if there are so many observers."""
    if lane < rows.observers.number:
        o = rows.observations[world_of(rows.observers, lane), robot_of(rows.observers, lane)]
        start = _start(rows, lane) + first
        store(o, start, row)
        for q in range(more):
            o[start + WIDTH + q] = s.column[WIDTH * q + lane]


@compiled
def _copy_block(number: int, first: int, s: Any, rows: Rows) -> None:
    """Write a fixed block, the first of its columns column ``first``."""
    for lane in range(rows.observers.number):
        world, robot = world_of(rows.observers, lane), robot_of(rows.observers, lane)
        block = load(s.fixed, WIDTH * (FIXED_BLOCKS * robot + number))
        store(rows.observations[world, robot], _start(rows, lane) + first, block)


@compiled
def _keep_block(block: tuple[Lanes, ...], number: int, s: Any, observers: Observers) -> None:
    """Write a fixed block, eight numbers for each robot, to scratch memory."""
    for lane, row in enumerate(block):
        if lane < observers.number:
            robot = robot_of(observers, lane)
            store(s.fixed, WIDTH * (FIXED_BLOCKS * robot + number), row)


@compiled
def _write_column(column: Lanes, number: int, s: Any, rows: Rows) -> None:
    """Write one column."""
    store(s.column, 0, column)
    for lane in range(rows.observers.number):
        o = rows.observations[world_of(rows.observers, lane), robot_of(rows.observers, lane)]
        o[_start(rows, lane) + number] = s.column[lane]


@compiled
def world_of(observers: Observers, lane: int) -> int:
    """Return the world of the robot in a lane."""
    return natural(observers.e + lane * observers.across)


@compiled
def robot_of(observers: Observers, lane: int) -> int:
    """Return the number of the robot in a lane."""
    return natural(observers.i + lane * (1 - observers.across))


@compiled
def _start(rows: Rows, lane: int) -> int:
    scattered = natural(int(rows.starts[lane])) if rows.scattered else 0
    return natural(rows.start) + scattered
