"""What threads tell each other through memory while they hold no interpreter's lock.

Two things. *Turns*: who takes which worlds next. *Bells*: that there is work, or that it is done.

To hand each other the interpreter's lock takes threads longer than a hundred worlds take for a
step, so parts are taken, and bells rung, by compiled code.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba.core import types
from numba.extending import intrinsic

from posse.numeric.compiling import compiled, kernel

Numbers = npt.NDArray[np.int64]

# Turns are a row for each thread, (threads, TURN): the worlds that it takes first.
NEXT: Final = 0  # world that the next part begins with; at the front, for _add
SIZE: Final = 1  # worlds of a part; 0: there is one thread, and one part
END: Final = 2  # world after the last
TURN: Final = 16  # numbers of a row: no two threads' share a line of the cache

# A bell, (BELL,). At its front, for _add and _read, how often it was rung.
ASLEEP: Final = 1  # 1 if who waits has to be woken
BELL: Final = 2
NO_BELL: Final = np.zeros(0, np.int64)

NOTHING: Final = 0
HEARD: Final = 1
WAKE: Final = 2


def _atomic(operation: str) -> Any:
    """Return (array, value) -> the array's first number before the operation, for compiled code."""

    def typed(typing: Any, array: Any, value: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, values[0]).data
            return builder.atomic_rmw(operation, data, values[1], "seq_cst")

        return types.int64(array, types.int64), emit

    return intrinsic(typed)


def _reading(typing: Any, array: Any) -> Any:
    """Read the first number of an array from memory, where another thread may have written it."""

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, values[0]).data
        return builder.load_atomic(data, "acquire", 8)

    return types.int64(array), emit


_add: Any = _atomic("add")
_exchange: Any = _atomic("xchg")
_read: Any = intrinsic(_reading)


@compiled
def parts_of(thread: int, turns: Numbers) -> Iterator[tuple[int, int]]:
    """Yield the parts of the worlds that are a thread's turn, until all are taken: first, end.

    A thread takes its own worlds first, part after part, which lie in its core's cache from the
    step before; then others'.

    Args:
        thread: Which of them asks.
        turns: Of this step, (threads, TURN).
    """
    if turns[0, SIZE] == 0:
        yield 0, turns[0, END]
    else:
        threads = len(turns)
        for k in range(threads):
            turn = turns[(thread + k) % threads]
            while turn[NEXT] < turn[END]:
                first = _add(turn, turn[SIZE])
                if first < turn[END]:
                    yield first, min(first + turn[SIZE], turn[END])


@compiled
def worlds_of(thread: int, turns: Numbers) -> Iterator[int]:
    """Yield the worlds that are a thread's turn, one by one (:func:`parts_of`)."""
    for first, end in parts_of(thread, turns):
        for e in range(first, end):  # noqa: UP028 (compiled code knows no yield from)
            yield e


@kernel
def ring(bell: Numbers) -> bool:
    """Ring a bell; say whether who waits for it has to be woken."""
    _add(bell, 1)
    return bool(_exchange(bell[ASLEEP:], 0) != 0)


@kernel
def look_out(bell: Numbers, before: int, looks: int, pause: int, answer: Numbers) -> int:
    """Ring another bell, if it is not NO_BELL, and look until this one is rung.

    At most ``looks`` times, and ``pause`` times more after it was.

    Returns:
        HEARD; NOTHING, and it is written down that this thread sleeps; or WAKE at once, where who
        waits for the answer has to be woken first.
    """
    if len(answer) > 0:
        _add(answer, 1)
        if _exchange(answer[ASLEEP:], 0) != 0:
            return WAKE
    for _ in range(looks):
        if _read(bell) != before:
            for _ in range(pause):
                _read(bell)
            return HEARD
    _exchange(bell[ASLEEP:], 1)
    # Once more: it may have been rung before it could be seen that this thread sleeps.
    if _read(bell) != before and _exchange(bell[ASLEEP:], 0) != 0:
        return HEARD
    return NOTHING
