"""Common part of the runners: build a simulator, time some of its steps, report.

A runner is a small script, executed by the interpreter of its own virtual environment. It
communicates with ``peers.py`` over its standard streams, one JSON object per line, and blocks
between requests:

===================================  ============================================================
``{"build": B, "variant": name}``    builds B worlds, warms up, determines the number of steps of a
                                     sample; answers with a description
``{"sample": true}``                 steps the worlds; answers with number of steps and time
===================================  ============================================================

This file requires only Python, since it runs in every peer's environment.
"""

import importlib.metadata
import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ACTION_SETS = 16
"""Random actions per agent, drawn before timing starts and then repeated."""
SAMPLE_SECONDS = 0.25


@dataclass(frozen=True)
class Built:
    """B worlds of one simulator, ready for stepping."""

    run: Callable[[int], None]
    """Makes a number of steps with new actions each, and returns when they are done."""
    agents: int
    """Number of agents in a world that receive an action."""
    observation: int
    """Length of an agent's observation, the longest one if they differ."""
    chunk: int = 1
    """The number of steps is a multiple of this."""


def serve(build: Callable[[int, str], Built], *packages: str) -> None:
    """Answer requests until the standard input ends.

    Args:
        build: Makes a number of worlds in a named variant.
        packages: Whose versions are reported.
    """
    answers, sys.stdout = sys.stdout, sys.stderr  # what libraries print goes elsewhere
    built: Built | None = None
    steps = 0
    for line in sys.stdin:
        request: dict[str, Any] = json.loads(line)
        if "build" in request:
            built = None  # lets go of the last one's memory first
            began = time.perf_counter()
            built = build(request["build"], request["variant"])
            built.run(built.chunk)
            warm_up = time.perf_counter() - began
            steps = _steps_of_a_sample(built)
            answer: dict[str, Any] = {
                "agents": built.agents,
                "observation": built.observation,
                "warm_up_seconds": warm_up,
                "versions": {name: importlib.metadata.version(name) for name in packages},
            }
        else:
            assert built is not None
            processor = _processor_seconds()
            began = time.perf_counter()
            built.run(steps)
            seconds = time.perf_counter() - began
            answer = {"steps": steps, "seconds": seconds, "processor_seconds": _processor_seconds() - processor}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _steps_of_a_sample(built: Built) -> int:
    """Return how many steps take about SAMPLE_SECONDS, found by doubling."""
    steps = built.chunk
    while True:
        began = time.perf_counter()
        built.run(steps)
        seconds = time.perf_counter() - began
        if seconds >= SAMPLE_SECONDS / 4:
            wanted = steps * SAMPLE_SECONDS / seconds
            return max(1, round(wanted / built.chunk)) * built.chunk
        steps *= 2


def _processor_seconds() -> float:
    """Return the processor time of this process, all threads, user and system."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
