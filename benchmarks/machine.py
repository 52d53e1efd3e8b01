"""Description of the machine, and detection of other load."""

from __future__ import annotations

import datetime as dt
import os
import platform
import time
from pathlib import Path
from typing import Any

from posse_training.provenance import commit

STAT = Path("/proc/stat")
IDLE, IO_WAIT = 3, 4
"""Indices of the idle times in the first line of STAT."""


def describe() -> dict[str, Any]:
    """Return machine, date and commit."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(_memory() / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "date": dt.date.today().isoformat(),
        "commit": commit(),
        "load_average": os.getloadavg()[0],
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _memory() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


class OtherWork:
    """Measures the processor time used by other processes since its creation.

    From the system's accounting of processor time, including stolen time of a virtual machine.
    Where that is not available the result is 0; :func:`describe` also reports the load average.
    """

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._busy = _busy_seconds()

    def cores(self, own_seconds: float) -> float:
        """Return the number of cores used by others, given our own processor time."""
        elapsed = time.perf_counter() - self._began
        return max(0.0, (_busy_seconds() - self._busy - own_seconds) / elapsed)


def _busy_seconds() -> float:
    try:
        first = STAT.read_text(encoding="ascii").split("\n", 1)[0]
    except OSError:
        return 0.0
    times = [int(number) for number in first.split()[1:9]]  # the following columns are already included in others
    ticks = sum(times) - times[IDLE] - times[IO_WAIT]
    return ticks / os.sysconf("SC_CLK_TCK")
