"""A process that makes one call at a time and can be ended."""

from __future__ import annotations

import faulthandler
import signal
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from posse_training.errors import SettingsError, TimeLimitError
from posse_training.processes import UNGUARDED

_GRACE: Final = 2.0  # s beyond the limit, in which the call may notice it by itself
_ORPHAN: Final = 4.0  # s beyond the limit, after which the process ends without its parent


class Worker:
    """A process that is started by the first call, and again after it was ended."""

    def __init__(self) -> None:
        self._process: Any = None
        self._connection: Connection | None = None

    def call(
        self,
        function: Callable[..., Any],
        arguments: tuple[Any, ...],
        time_limit: float,
        report: Callable[[int], object] = lambda steps: None,
    ) -> Any:
        """Return ``function(report, *arguments)``, computed in the process.

        Args:
            function: Of a module; its first argument is a function that passes numbers on to
                ``report``.
            arguments: Can be pickled.
            time_limit: s; the process is killed ``_GRACE`` later.
            report: Called with each number.

        Raises:
            TimeLimitError: The process was killed.
            EOFError: The process ended unexpectedly.
            SettingsError: It could not begin, as in a script without a main guard.
            Exception: As raised by the function.
        """
        connection = self._start()
        ends = time.monotonic() + time_limit + _GRACE
        try:
            connection.send((function, arguments, time_limit + _ORPHAN))
            while True:
                if not connection.poll(max(0.0, ends - time.monotonic())):
                    raise TimeLimitError(f"it exceeded the time limit of {time_limit:g} s, and its process was ended")
                kind, value = connection.recv()
                if kind == "progress":
                    report(value)
                elif kind == "raised":
                    raise value
                else:
                    return value
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._process.join(_GRACE)
            status = self._process.exitcode
            self.end()
            raise EOFError(f"its process ended unexpectedly, with exit code {status}") from None
        except (KeyboardInterrupt, TimeLimitError):
            self.end()
            raise

    def end(self) -> None:
        """Kill the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = None

    def _start(self) -> Connection:
        if self._connection is not None:
            return self._connection
        context = get_context("spawn")  # a fork would inherit the locks of running threads
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other,), daemon=True)
        self._process.start()
        other.close()
        try:
            self._connection.recv()
        except EOFError:
            self.end()
            raise SettingsError(
                "the process that plays package.module:Class ended before it could begin. If a script "
                f"started it: {UNGUARDED}"
            ) from None
        return self._connection


def _serve(connection: Connection) -> None:
    """Make calls until the parent closes the connection."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this
    connection.send("ready")
    nowhere = Path("/dev/null" if Path("/dev/null").exists() else "NUL").open("w")  # noqa: SIM115
    while True:
        try:
            function, arguments, longest = connection.recv()
        except EOFError:
            return
        # Its thread needs no interpreter lock: it ends a hanging process whose parent was killed.
        faulthandler.dump_traceback_later(longest, exit=True, file=nowhere)
        try:
            value = function(lambda steps: connection.send(("progress", steps)), *arguments)
            connection.send(("returned", value))
        except Exception as error:
            connection.send(("raised", error))
        finally:
            faulthandler.cancel_dump_traceback_later()
