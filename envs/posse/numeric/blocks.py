"""Worlds in blocks, which the threads of a step claim in compiled code."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric.compiling import compiled
from posse.numeric.simd import atomics
from posse.numeric.simd.lanes import WIDTH

Blocks = npt.NDArray[np.int64]
"""Unclaimed worlds: a row for each thread, (threads, 16)."""

NEXT: Final = 0  # first world of the next block; first in its row, for atomics
SIZE: Final = 1  # worlds of a block; 0: one thread and one block
END: Final = 2  # world after the last
_BLOCKS_EACH: Final = 16


@functools.lru_cache(maxsize=64)
def divide(num_worlds: int, threads: int) -> Blocks:
    """Return unclaimed blocks of worlds; those for one thread are never modified."""
    # Multiples of eight where possible, since eight worlds are observed together.
    grain = WIDTH if num_worlds >= threads * _BLOCKS_EACH * WIDTH // 2 else 1
    edges = [num_worlds * k // (threads * grain) * grain for k in range(threads)] + [num_worlds]
    blocks = np.zeros((threads, 16), np.int64)  # no two threads' rows share a cache line
    blocks[:, NEXT], blocks[:, END] = edges[:-1], edges[1:]
    if threads > 1:
        blocks[:, SIZE] = max(1, num_worlds // (threads * _BLOCKS_EACH * grain)) * grain
    return blocks


@compiled
def blocks_of(thread: int, blocks: Blocks) -> Iterator[tuple[int, int]]:
    """Claim and yield blocks (first world, end); the thread's own first, which are cached."""
    if blocks[0, SIZE] == 0:
        yield 0, blocks[0, END]
    else:
        for k in range(len(blocks)):
            row = blocks[(thread + k) % len(blocks)]
            while row[NEXT] < row[END]:
                first = atomics.add(row, row[SIZE])
                if first < row[END]:
                    yield first, min(first + row[SIZE], row[END])


@compiled
def worlds_of(thread: int, blocks: Blocks) -> Iterator[int]:
    """Yield the worlds of :func:`blocks_of`, one by one."""
    for first, end in blocks_of(thread, blocks):
        for e in range(first, end):  # noqa: UP028 (compiled code knows no yield from)
            yield e
