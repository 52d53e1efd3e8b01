"""Kernels of policies over all worlds of a batch."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from posse.numeric import by_turns, threads_for

MOST_THREADS: Final = os.cpu_count() or 1
"""Threads that :func:`over_worlds` uses at most."""


def over_worlds(
    kernel: Callable[..., None], arguments: tuple[Any, ...], num_worlds: int, num_trackers: int
) -> None:
    """Call ``kernel(*arguments, thread, turns)`` once for each thread.

    Threads are numbered from 0 to at most ``MOST_THREADS`` - 1, for kernels that need a place
    of their own to work in.
    """
    threads = threads_for(num_worlds, num_trackers, MOST_THREADS)
    by_turns(partial(kernel, *arguments), num_worlds, threads)
