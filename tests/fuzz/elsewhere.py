"""Commands in processes of their own, which start quickly: forks of one that has imported all.

A command is the arguments of ``posse``, or of one of :data:`CALLS`: what has no command.
"""

from __future__ import annotations

import functools
import multiprocessing
import os
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

CONTEXT: Final = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["tests.fuzz.warm"])
LIMIT_S: Final = 300.0


def save_policy(path: str, scenario: str) -> int:
    """Write a policy file whose numbers are always the same."""
    from tests.support.learned import any_policy

    try:
        any_policy(scenario).save(Path(path))
    except OSError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


def compile_kernels(cache: str, code: str) -> int:
    """Call two kernels that are kept in a directory; print how many were there."""
    from tests.fuzz.kernel_cache import RIGHT, answers_and_hits

    sys.path.insert(0, code)
    os.environ["POSSE_CACHE_DIR"] = cache
    answers, hits = answers_and_hits()
    sys.stdout.write(f"{hits} of 2 loaded\n")
    return int(answers != RIGHT)


CALLS: Final[dict[str, Callable[..., int]]] = {"save-policy": save_policy, "compile-kernels": compile_kernels}


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit status, negative for a signal, and all that it printed."""

    status: int
    printed: str


class Running:
    """A command that runs.

    Args:
        arguments: The command.
        file_limit: Bytes that any file may have, at most: a disk that is full in mid-file.
    """

    def __init__(self, arguments: list[str], file_limit: int | None = None) -> None:
        handle, name = tempfile.mkstemp()
        os.close(handle)
        self._log = Path(name)
        self._process: Any = CONTEXT.Process(target=_call, args=(arguments, name, file_limit), daemon=False)
        self._process.start()

    def kill(self) -> None:
        """Kill it, as ``kill -9``."""
        self._process.kill()

    def wait(self, seconds: float) -> bool:
        """Wait at most so long; return whether it has ended."""
        self._process.join(seconds)
        return self._process.exitcode is not None

    def ended(self) -> Ended:
        """Wait until it has ended."""
        if not self.wait(LIMIT_S):
            self.kill()
            self._process.join()
            raise AssertionError(f"hangs: {self._log.read_text()[-500:]}")
        printed = self._log.read_text(errors="replace")
        self._log.unlink()
        return Ended(self._process.exitcode, printed)


def run(arguments: list[str], file_limit: int | None = None) -> Ended:
    """Run a command to its end."""
    return Running(arguments, file_limit).ended()


def timed(arguments: list[str]) -> tuple[Ended, float]:
    """Run a command to its end; return how long it took, too, s."""
    _warm()
    began = time.monotonic()
    return run(arguments), time.monotonic() - began


@functools.cache
def _warm() -> None:
    """Start the process that has imported all."""
    run(["--version"])


def _call(arguments: list[str], log: str, file_limit: int | None) -> None:
    read, write = os.pipe()  # a limit of file sizes is none of a pipe's
    keeper = os.fork()
    if keeper == 0:
        os.close(write)
        with open(log, "wb") as file:  # noqa: PTH123
            while content := os.read(read, 65536):
                file.write(content)
                file.flush()
        os._exit(0)
    os.close(read)
    os.dup2(write, 1)
    os.dup2(write, 2)
    os.close(write)
    if file_limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_limit, file_limit))
    sys.argv = ["posse", *arguments]
    status = 1
    try:
        if arguments[0] in CALLS:
            status = CALLS[arguments[0]](*arguments[1:])
        else:
            from posse_training.cli import main

            status = main(arguments)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for handle in (1, 2):
            os.close(handle)
        os.waitpid(keeper, 0)
        os._exit(status)
