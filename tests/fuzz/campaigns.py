"""The campaigns by name, with what one try of each is."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final

from tests.fuzz.campaign import campaign

Outcome = tuple[int, list[str]]


@dataclass(frozen=True)
class Campaign:
    """A campaign of a module ``tests.fuzz.NAME``.

    Attributes:
        one_try: What a try is.
        play: Plays for so many seconds from a seed, at most so many tries; returns how many, and
            the failures.
    """

    one_try: str
    play: Callable[[int, float, int], Outcome]


def _of_cases(name: str) -> Callable[[int, float, int], Outcome]:
    def play(seed: int, seconds: float, cases: int) -> Outcome:
        case = import_module(f"tests.fuzz.{name}").case
        return campaign(case, seed, cases=cases, seconds=seconds)

    return play


def _kernel_cache(seed: int, seconds: float, cases: int) -> Outcome:
    from tests.fuzz import kernel_cache

    with tempfile.TemporaryDirectory() as folder:
        counts, failures = kernel_cache.campaign(Path(folder), seed, cases=cases, seconds=seconds)
    return sum(counts.values()), failures


def _interrupts(seed: int, seconds: float, cases: int) -> Outcome:
    from tests.fuzz import interrupts

    counts, failures = interrupts.campaign(seed, cases=cases, seconds=seconds)
    return sum(counts.values()), failures


CAMPAIGNS: Final[dict[str, Campaign]] = {
    "worlds": Campaign(
        "a scenario with settings drawn from all there are; 24 worlds, 60 steps of a team that "
        "chases or crowds the target; judged in float64",
        _of_cases("worlds"),
    ),
    "calls": Campaign(
        "8 sequences of up to 30 calls to one kind of environment each (`Batch`, PettingZoo's two, "
        "Gymnasium's two, their vectors, TorchRL), valid and invalid; a second environment gets "
        "the valid ones only; their states are compared field by field",
        _of_cases("calls"),
    ),
    "threads": Campaign(
        "8 Python threads at once, each with a batch, a policy or an environment of its own", _of_cases("threads")
    ),
    "processes": Campaign(
        "an environment in mid-episode is pickled (in or out of band), forked, or sent to a "
        "spawned or forkserver process, and both go on",
        _of_cases("processes"),
    ),
    "interrupts": Campaign(
        "a step of 4,096 worlds is interrupted at a random moment, once or many times in a row", _interrupts
    ),
    "kernel_cache": Campaign("files of a cache are damaged, and its kernels called", _kernel_cache),
    "forged": Campaign(
        "a policy file, replay page, settings file or checkpoint has bytes changed, or other "
        "contents with a digest that is right, and is used",
        _of_cases("forged"),
    ),
    "kills": Campaign(
        "a training (PPO or SAC), league, tuning, comparison, replay page, policy file or kernel "
        "cache is written by a process that is killed (`kill -9`) up to three times, resumed or "
        "repeated, and compared bit for bit with an undisturbed one",
        _of_cases("kills"),
    ),
    "full_disk": Campaign(
        "the same, on a disk with too little room (tmpfs, or a limit on file sizes)", _of_cases("full_disk")
    ),
    "together": Campaign("two processes write the same at once, or one soon after the other", _of_cases("together")),
}
