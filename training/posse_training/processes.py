"""Scripts that start processes, which import the script again."""

from __future__ import annotations

from multiprocessing import current_process
from typing import Final

UNGUARDED: Final = (
    "this script starts processes of its own, and each of them runs the script again from its top: put what it does "
    'below a line `if __name__ == "__main__":`'
)
"""What to tell somebody whose script lacks a main guard."""


def refuse_unguarded() -> None:
    """End a process that was started by a script without a main guard, and says what to add.

    Call it before the first process is started, and before anything is written.

    Raises:
        SystemExit: This process is importing the script that started it.
    """
    if getattr(current_process(), "_inheriting", False):
        raise SystemExit(UNGUARDED)
