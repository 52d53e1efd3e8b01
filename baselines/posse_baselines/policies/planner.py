"""The planner: a reference that reads the state and plays ahead in copies of the worlds."""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout
from posse.numeric import BoolArray, FloatArray, OwnArrays, Records
from posse.rules import config_record, slot_records
from posse_baselines.policies.planner_law import PLAN, WAY, Teams, drive
from posse_baselines.policy import BasePolicy, Memory, PolicyError

_CONTACTS: Final = ("contacts_tracker", "contacts_obstacle", "contacts_target")
_STANDARD: Final = np.array(  # ahead, left, gain
    [(0.0, 0.0, 1.5), (-0.2, 0.0, 1.5), (0.2, 0.0, 1.5), (0.0, 0.0, 0.7), (0.0, 0.0, 3.0)], WAY
)
"""Ways that whole teams play alike; the first one is played until the first planning."""
_RANGES: Final = {"ahead": (-0.25, 0.25), "left": (-0.2, 0.2), "gain": (0.7, 4.0)}
_TRIES: Final = len(_STANDARD) + 1
"""Tries in each round: the standard ways and what was kept; or the best so far, and variations."""
_REPEAT: Final = 64  # plannings after which the variations repeat
_VARIED: Final = 0.5  # share of the trackers whose way a variation changes
_SPREAD: Final = 0.2  # standard deviation of a change, as a share of the range
_SEED: Final = 0  # of the variations and of what copies draw


class PlannerSettings(NamedTuple):
    """How far the planner looks ahead, and what it tries."""

    look_ahead: float = 4.0
    """How far each try is played ahead, s."""
    keep: float = 0.5
    """How long the best is kept before the next planning, s; above 0, at most ``look_ahead``."""
    rounds: int = 4
    """Rounds of variations on the best so far, after the standard ways of playing; at least 0."""


class Search(OwnArrays):
    """Plans in a batch of E worlds: plays the law ahead in copies of them, in several ways, and keeps the best.

    ``teams`` has the ways that are kept until the next planning, and the law's memory.
    """

    def __init__(self, settings: PlannerSettings, batch: Batch) -> None:
        if not 0 < settings.keep <= settings.look_ahead < np.inf or settings.rounds < 0:
            raise PolicyError(f"{settings}: keep must be above 0 and at most look_ahead (finite), rounds at least 0")
        self.settings, self.batch = settings, batch
        dt, n = batch.scenario.control_step, batch.scenario.num_trackers
        self._steps, self._keep = (max(1, round(time / dt)) for time in (settings.look_ahead, settings.keep))
        shape, slots = (batch.num_worlds, n), [complex(slot.x, slot.y) for slot in slot_records(batch.scenario)]
        self.teams = Teams(
            config=config_record(batch.scenario),
            slots=np.array(slots, np.complex64),
            ways=np.full(shape, _STANDARD[0]),
            plans=np.full(shape, PLAN),
            late=np.zeros(n, np.float32),
        )
        self._copies: Batch | None = None
        self._later: Batch | None = None
        # Variations are drawn once, so that what is tried in a world does not depend on the others.
        rng = np.random.default_rng(_SEED)
        each = (_REPEAT, settings.rounds, _TRIES - 1, n)
        self._changed = rng.random(each) < _VARIED
        self._shifts = {name: _SPREAD * (high - low) * rng.normal(size=each) for name, (low, high) in _RANGES.items()}

    def restart(self, mask: BoolArray) -> None:
        """Forget what was planned for the worlds of a mask (E,)."""
        self.teams.ways[mask] = _STANDARD[0]
        self.teams.plans[mask] = PLAN

    def actions(self) -> FloatArray:
        """Plan in the worlds where it is due; return the actions (E, rows, 2 + m) for the present state."""
        step, worlds = self.batch.arrays.world["step"], self._when_obeyed()
        due = np.asarray(step % self._keep == 0)
        if due.any():
            self._plan(worlds, due, np.asarray(step // self._keep, np.int64))
        actions = actions_of_target(self.batch)
        drive(self.teams, worlds, np.ones(len(step), np.bool_), actions)
        return actions

    def _when_obeyed(self) -> Batch:
        """Return the worlds as they will be when a command given now is executed, after ``command_delay``."""
        delay = self.batch.scenario.command_delay
        if delay == 0:
            return self.batch
        self._later = self.batch.copies(1, seed=_SEED, into=self._later)
        unread = actions_of_target(self._later)
        for _ in range(delay):
            self._later.arrays.world["over"] = 0  # one that has ended goes on, and draws no start
            self._later.step(unread)
        late = self.batch.arrays.world["step"] >= self.batch.scenario.horizon  # robots may go on
        self._later.arrays.world["over"][late] = self.batch.arrays.world["over"][late]
        return self._later

    def _plan(self, worlds: Batch, due: BoolArray, planning: npt.NDArray[np.int64]) -> None:
        """Try ways to play from the state of the worlds, and keep the best in those that are ``due``."""
        teams, num_worlds = self.teams, self.batch.num_worlds
        standard = np.broadcast_to(_STANDARD[:, None], (num_worlds, _TRIES - 1, teams.ways.shape[1]))
        tries = np.concatenate([standard, teams.ways[:, None]], axis=1)
        everyone = np.arange(num_worlds)
        for turn in range(self.settings.rounds + 1):
            self._copies = worlds.copies(_TRIES, seed=_SEED, alike=True, into=self._copies)
            plans = np.repeat(teams.plans, _TRIES, axis=0)
            trying = teams._replace(ways=np.ascontiguousarray(tries.reshape(-1, tries.shape[2])), plans=plans)
            worth = play_ahead(trying, self._copies, self._steps)
            best = worth.reshape(num_worlds, _TRIES).argmax(axis=1)
            ways = tries[everyone, best]
            if turn < self.settings.rounds:
                tries = self._vary(ways, planning, turn)
        teams.ways[due] = ways[due]

    def _vary(self, best: Records, planning: npt.NDArray[np.int64], turn: int) -> Records:
        """Return the best ways (E, N) and variations on them, (E, tries, N).

        ``planning`` (E,) is the number of the planning in each world's episode, ``turn`` the round of it.
        """
        tries = np.repeat(best[:, None], _TRIES, axis=1)
        drawn = planning % _REPEAT, turn
        varied, changed = tries[:, 1:], self._changed[drawn]
        for name, (low, high) in _RANGES.items():
            new = np.clip(varied[name] + self._shifts[name][drawn], low, high)
            varied[name] = np.where(changed, new, varied[name])
        return tries


def play_ahead(teams: Teams, copies: Batch, steps: int) -> npt.NDArray[np.float64]:
    """Play copies ahead, with commands that act at once; return the worth of each, (C,).

    The worth is the sum of the scores up to the first contact from now on, less a price for that
    contact that no score outweighs, less the trackers' mean distance (m) from free slots in the end.
    """
    s: Any = copies.scenario
    world = copies.arrays.world
    for name in _CONTACTS:
        world[name] = 0  # those before now are the same for all
    worth = np.zeros(copies.num_worlds)
    actions = actions_of_target(copies)
    going, late = np.asarray(world["over"] == 0), np.asarray(world["step"] >= s.horizon)  # robots may go on
    for _ in range(steps):
        drive(teams, copies, going, actions)
        if s.command_delay:  # in the place of the command that is due
            due = world["step"] % s.command_delay
            copies.arrays.command[np.arange(len(world)), due] = actions[:, : s.num_trackers, :2]
        world["over"] = 0  # one that has ended goes on, uncounted, and draws no start
        _, _, terminated, truncated, infos = copies.step(actions)
        touched = going & (world[_CONTACTS[0]] + world[_CONTACTS[1]] + world[_CONTACTS[2]] > 0)
        going &= ~touched
        worth += np.where(going, infos["score"], 0.0) - 2.0 * steps * touched
        going &= ~(terminated | (truncated & ~late))
    away = copies.arrays.tracker["slot_distance"].mean(axis=1)
    return np.asarray(worth - np.where(going, away, 0.0))


def actions_of_target(batch: Batch) -> FloatArray:
    """Return actions (E, rows, 2 + m) in which a target that is an agent goes on as it moves now."""
    s, world = batch.scenario, batch.arrays.world
    # A paired batch has actions of its outside alone.
    actions = np.zeros((batch.num_worlds, s.num_agents, 2 + s.message_size), np.float32)
    if s.target_is_agent:
        actions[:, -1, 0] = np.clip(2.0 * world["speed"] / s.target_speed - 1.0, -1.0, 1.0)
        actions[:, -1, 1] = np.clip(world["turn_rate"] / s.target_turn_rate, -1.0, 1.0)
    return actions


class Planner(BasePolicy):
    """Model-predictive control with the engine as its model: a reference, no contestant.

    Every half second it plays its law ahead in copies of each world with other slots and gains, and keeps what is worth
    most: the score up to the first contact. Copies draw other noise, losses and faults than the world will.
    """

    name = "planner"
    reads_state: bool = True

    def __init__(self, settings: PlannerSettings | None = None) -> None:
        self.settings = settings or PlannerSettings()
        self._batch: Batch | None = None

    def watch(self, batch: Batch) -> None:
        """Take the batch whose state is to be read by the memories made from now on."""
        self._batch = batch

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory for the watched batch, which is to be copied only together with it.

        PolicyError if no batch, or one of other worlds, is watched.
        """
        super().begin(layout, num_worlds)
        batch = self._batch
        if batch is None or batch.num_worlds != num_worlds or batch.scenario != layout.scenario:
            watched = "none" if batch is None else f"{batch.num_worlds} worlds of {batch.scenario.name!r}"
            raise PolicyError(
                f"policy 'planner' watches {watched}, not {num_worlds} of {layout.scenario.name!r}, whose state it "
                "reads: show it their batch with watch(batch), or use posse_baselines.begin(policy, batch)"
            )
        return Search(self.settings, batch)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions for the state that the watched batch is in; observations are not read."""
        return memory.actions()[:, : memory.batch.scenario.num_trackers], memory

    def annotations(self, memory: Memory) -> dict[str, Any]:
        """Return ``slot`` (E, N), the slot that each tracker is sent to; -1: none."""
        return {"slot": memory.teams.plans["slot"].copy()}
