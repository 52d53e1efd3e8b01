"""The planner: a reference that reads the state and plays ahead in copies of the worlds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout
from posse.numeric import BoolArray, FloatArray, OwnArrays, Records
from posse_baselines.fields import check, number
from posse_baselines.policies.planner.law import PLAN
from posse_baselines.policies.planner.model import RANGES, TRIES, Foresight, Law, play_ahead, standard_ways
from posse_baselines.policy import BasePolicy, Memory, PolicyError, check_fits, check_observations, message_size_of

_REPEAT: Final = 64  # plannings after which the variations repeat


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """How far the planner looks ahead, and what it tries. Units and ranges: each field's metadata.

    Raises:
        ValueError: A number out of its range.
    """

    look_ahead: float = number(4.0, "s", 0.1, 20.0)
    """How far each try is played ahead."""
    keep: float = number(0.5, "s", 0.01, 20.0)
    """How long the best is kept before the next planning; no longer than ``look_ahead``."""
    rounds: int = number(2, "", 0, 20)
    """Rounds of variations on the best so far, after the standard ways of playing."""
    varied: float = number(0.5, "", 0.0, 1.0)
    """Share of the trackers whose way a variation changes."""
    spread: float = number(0.2, "", 0.01, 1.0)
    """Standard deviation of a change, as a share of the range."""
    distance_cost: float = number(1.0, "1/m", 0.0, 100.0)
    """What a metre of mean distance from free slots at the end of a try costs, in steps' scores."""
    seed: int = number(0, "", 0, 2**63 - 1)
    """Of the variations and of what copies draw."""

    def __post_init__(self) -> None:
        check(self)
        if self.keep > self.look_ahead:
            raise ValueError(
                f"keep={self.keep!r} must be at most look_ahead={self.look_ahead!r}: what comes "
                "after it was not played ahead"
            )


class Variations:
    """Changes to try on the ways of a team, the same for all worlds at the same planning.

    They are drawn once, so that what is tried in a world does not depend on the others.
    """

    def __init__(self, settings: PlannerSettings, num_trackers: int) -> None:
        rng = np.random.default_rng(settings.seed)
        shape = (_REPEAT, settings.rounds, TRIES - 1, num_trackers)
        self._changed = rng.random(shape) < settings.varied
        self._shifts = {
            name: settings.spread * (high - low) * rng.normal(size=shape) for name, (low, high) in RANGES.items()
        }
        self._foresees = rng.random(shape) < 0.5

    def of(self, best: Records, planning: npt.NDArray[np.int64], turn: int) -> Records:
        """Return the best ways (E, N) and variations on them, (E, TRIES, N).

        Args:
            best: (E, N) :data:`WAY`.
            planning: (E,) number of the planning in each world's episode.
            turn: Which round of it.
        """
        tries = np.repeat(best[:, None], TRIES, axis=1)
        drawn = planning % _REPEAT, turn
        varied, changed = tries[:, 1:], self._changed[drawn]
        for name, (low, high) in RANGES.items():
            new = np.clip(varied[name] + self._shifts[name][drawn], low, high)
            varied[name] = np.where(changed, new, varied[name])
        varied["foresees"] = np.where(changed, self._foresees[drawn], varied["foresees"])
        return tries


@dataclass
class _Memory(OwnArrays):
    batch: Batch
    law: Law
    variations: Variations
    standard: Records
    """(TRIES - 1, N) :data:`~posse_baselines.policies.planner.law.WAY`."""
    ways: Records
    """(E, N) what is kept until the next planning."""
    plans: Records
    """(E, N) :data:`~posse_baselines.policies.planner.law.PLAN`."""
    seen: Foresight
    copies: Batch | None = None


class Planner(BasePolicy):
    """Model-predictive control with the engine as its model: a reference, no contestant.

    Every half second it copies each world several times, plays its law ahead in the copies with
    other slots and gains, and keeps what is worth most: the score up to the first contact. Copies
    draw other noise, losses and faults than the world will.

    Args:
        settings: How far it looks ahead, and what it tries.
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
        """Return the memory for the batch that is being watched.

        Raises:
            PolicyError: No batch was shown to it, or one of another scenario or size.
        """
        check_fits(self, layout)
        batch = self._batch
        if batch is None:
            raise PolicyError(
                "policy 'planner' plays ahead in copies of the worlds, and observations do not "
                "hold their state: show it the batch with watch(batch), or use "
                "posse_baselines.begin(policy, batch)"
            )
        if batch.num_worlds != num_worlds or batch.scenario != layout.scenario:
            raise PolicyError(
                f"policy 'planner' watches {batch.num_worlds} worlds of {batch.scenario.name!r}, "
                f"not {num_worlds} of {layout.scenario.name!r}: call watch(batch) before begin()"
            )
        n = layout.scenario.num_trackers
        standard = standard_ways(n)
        steps = self._steps(batch, self.settings.look_ahead)
        memory = _Memory(
            batch,
            Law(layout.scenario),
            Variations(self.settings, n),
            standard,
            np.repeat(standard[:1], num_worlds, axis=0),
            np.zeros((num_worlds, n), PLAN),
            Foresight(np.zeros((num_worlds, steps + 1, 4), np.float32), np.zeros(num_worlds, np.int64)),
        )
        return self.restart(memory, np.ones(num_worlds, np.bool_))

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions for the state that the watched batch is in; observations are not read."""
        m: _Memory = memory
        layout, num_worlds = m.batch.layout, m.batch.num_worlds
        check_observations(self, observations, num_worlds, layout)
        keep, step = self._steps(m.batch, self.settings.keep), m.batch.worlds["step"]
        due = np.asarray(step % keep == 0)
        if due.any():
            self._plan(m, due, np.asarray(step // keep, np.int64))
        actions = np.zeros((*m.plans.shape, 2 + message_size_of(layout)), np.float32)
        m.law.drive(m.batch, np.ones(num_worlds, np.bool_), m.ways, m.plans, m.seen, actions)
        return actions, m

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Forget the plans of the worlds of a mask (E,)."""
        m: _Memory = memory
        m.ways[mask] = m.standard[0]
        m.plans[mask] = np.zeros((), PLAN)
        m.plans["slot"][mask] = -1
        m.seen.begun[mask] = -1
        return m

    def annotations(self, memory: Memory) -> dict[str, Any]:
        """Return ``slot`` (E, N), the slot that each tracker is sent to; -1: none."""
        return {"slot": memory.plans["slot"].copy()}

    def _plan(self, m: _Memory, due: BoolArray, planning: npt.NDArray[np.int64]) -> None:
        """Try ways to play, and keep the best in the worlds that are ``due``."""
        s, num_worlds = self.settings, m.batch.num_worlds
        steps = self._steps(m.batch, s.look_ahead)
        standard = np.broadcast_to(m.standard, (num_worlds, *m.standard.shape))
        tries = np.concatenate([standard, m.ways[:, None]], axis=1)
        everyone = np.arange(num_worlds)
        for turn in range(s.rounds + 1):
            m.copies = m.batch.copies(TRIES, seed=s.seed, alike=True, into=m.copies)
            worth, paths = play_ahead(
                m.law,
                m.copies,
                np.ascontiguousarray(tries.reshape(-1, tries.shape[2])),
                np.repeat(m.plans, TRIES, axis=0),
                m.seen,
                steps,
                s.distance_cost,
            )
            best = worth.reshape(num_worlds, TRIES).argmax(axis=1)
            ways = tries[everyone, best]
            if turn < s.rounds:
                tries = m.variations.of(ways, planning, turn)
        m.ways[due] = ways[due]
        m.seen.paths[due] = paths[everyone * TRIES + best][due]
        m.seen.begun[due] = m.batch.worlds["step"][due]

    @staticmethod
    def _steps(batch: Batch, time: float) -> int:
        """Return a time (s) in control steps, at least one."""
        return max(1, round(time / batch.scenario.control_step))
