"""Playing ahead: what a team scores in copies of the worlds, for each of several ways to play."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, Scenario
from posse.numeric import BoolArray, FloatArray, OwnArrays, Records, over_worlds
from posse.rules import config_record, slot_records
from posse_baselines.policies.planner.law import WAY, Played, drive_all, work_for

_CONTACTS: Final = ("contacts_tracker", "contacts_obstacle", "contacts_target")
_PATH: Final = ("x", "y", "frame_cos", "frame_sin")
_STANDARD: Final = (
    # ahead, left, gain, foresees
    (0.0, 0.0, 1.5, 0.0),
    (-0.2, 0.0, 1.5, 0.0),
    (0.2, 0.0, 1.5, 0.0),
    (0.0, 0.0, 0.7, 0.0),
    (0.0, 0.0, 3.0, 0.0),
    (0.0, 0.0, 1.5, 1.0),
    (0.0, 0.0, 3.0, 1.0),
)
RANGES: Final = {"ahead": (-0.25, 0.25), "left": (-0.2, 0.2), "gain": (0.7, 4.0)}
TRIES: Final = len(_STANDARD) + 1
"""Tries in each round: the standard ways and what was kept; or the best so far, and variations."""


def standard_ways(num_trackers: int) -> Records:
    """Return the ways that whole teams play alike, (TRIES - 1, N) :data:`WAY`."""
    ways = np.array(list(_STANDARD), WAY)
    return np.repeat(ways[:, None], num_trackers, axis=1)


@dataclass
class Foresight(OwnArrays):
    """The path that the target took in each world when it was played ahead."""

    paths: FloatArray
    """(E, T, 4): the target's x, y and the slot frame's cosine and sine."""
    begun: npt.NDArray[np.int64]
    """(E,) control step at which the path begins; -1: there is none."""


class Law(OwnArrays):
    """The planner's law for the teams of one scenario, with the memory that it works in."""

    def __init__(self, scenario: Scenario) -> None:
        self._config, self._slots = config_record(scenario), slot_records(scenario)
        self._work = work_for(scenario.num_trackers)

    def drive(
        self, batch: Batch, going: BoolArray, ways: Records, plans: Records, seen: Foresight, actions: FloatArray
    ) -> None:
        """Write actions (E, rows, 2 + m) for the trackers of those worlds that are ``going`` (E,).

        Args:
            batch: E worlds: those of ``seen``, or the same number of copies of each.
            going: Which worlds.
            ways: (E, N) :data:`~posse_baselines.policies.planner.law.WAY`.
            plans: (E, N) :data:`~posse_baselines.policies.planner.law.PLAN`, brought up to
                date.
            seen: What was foreseen.
            actions: What is written to.
        """
        arrays = batch.arrays
        played = Played(
            self._config,
            self._slots,
            arrays.world,
            arrays.tracker,
            arrays.obstacle,
            going,
            ways,
            plans,
            seen.paths,
            seen.begun,
        )
        arguments = (played, self._work, batch.num_worlds // len(seen.begun), actions)
        over_worlds(drive_all, arguments, batch.num_worlds, batch.scenario.num_trackers)


def play_ahead(
    law: Law, copies: Batch, ways: Records, plans: Records, seen: Foresight, steps: int, distance_cost: float
) -> tuple[npt.NDArray[np.float64], FloatArray]:
    """Play copies ahead; return what each is worth, (C,), and the target's path, (C, steps + 1, 4).

    The worth is the sum of the scores up to the first contact from now on, less a price for that
    contact that no score outweighs, less ``distance_cost`` for each metre of the trackers' mean
    distance from free slots in the end.
    """
    world = copies.arrays.world
    for name in _CONTACTS:
        world[name] = 0  # those before now are the same for all
    worth = np.zeros(copies.num_worlds)
    paths = np.empty((copies.num_worlds, steps + 1, len(_PATH)), np.float32)
    actions = _held_actions(copies)
    going = np.asarray(world["over"] == 0)
    _note(world, paths, 0)
    for step in range(1, steps + 1):
        law.drive(copies, going, ways, plans, seen, actions)
        _, _, terminated, truncated, infos = copies.step(actions)
        _note(world, paths, step)
        touched = going & (world[_CONTACTS[0]] + world[_CONTACTS[1]] + world[_CONTACTS[2]] > 0)
        going &= ~touched
        worth += np.where(going, infos["score"], 0.0) - 2.0 * steps * touched
        going &= ~(terminated | truncated)
    away = copies.arrays.tracker["slot_distance"].mean(axis=1)
    return worth - np.where(going, distance_cost * away, 0.0), paths


def _note(world: Records, paths: FloatArray, step: int) -> None:
    for k, name in enumerate(_PATH):
        paths[:, step, k] = world[name]


def _held_actions(copies: Batch) -> FloatArray:
    """Return actions in which a target that is an agent goes on as it moves now."""
    s: Any = copies.scenario
    actions = np.zeros(copies.action_shape, np.float32)
    if s.num_agents > s.num_trackers:
        world = copies.arrays.world
        actions[:, -1, 0] = np.clip(2.0 * world["speed"] / s.target_speed - 1.0, -1.0, 1.0)
        actions[:, -1, 1] = np.clip(world["turn_rate"] / s.target_turn_rate, -1.0, 1.0)
    return actions
