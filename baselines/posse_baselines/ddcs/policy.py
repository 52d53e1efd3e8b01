"""The Distributed Decision Control System as policies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse.numeric import BoolArray, FloatArray, OwnArrays, Records, over_worlds
from posse_baselines.ddcs.belief import BELIEF_SIZE
from posse_baselines.ddcs.memory import GRID, MATE, MATE_AT_START, MIND, MIND_AT_START, Team, team_of, work_for
from posse_baselines.ddcs.messages import MESSAGE_SIZE
from posse_baselines.ddcs.settings import Settings
from posse_baselines.ddcs.step import carry_out_all, propose_all, write_beliefs
from posse_baselines.policy import Annotations, BasePolicy, Memory, check_fits, check_observations


@dataclass
class _Minds(OwnArrays):
    """The memory of a team in each of E worlds."""

    layout: ObservationLayout
    team: Team
    minds: Records
    """(E, N) :data:`~posse_baselines.ddcs.memory.MIND`."""
    mates: Records
    """(E, N, N) :data:`~posse_baselines.ddcs.memory.MATE`, the second N by the mate's number."""
    seen: npt.NDArray[np.uint16]
    """(E, N, GRID²): own step + 1 at which a cell was last covered; (E, N, 0) if not needed."""


class DDCS(OwnArrays, BasePolicy):
    """Three layers, four tasks, from observations and messages alone.

    Args:
        settings: Settings of the team.
        name: Name in results; default: by the model.
    """

    message_size = MESSAGE_SIZE

    def __init__(self, settings: Settings | None = None, name: str | None = None) -> None:
        self.settings = settings or Settings()
        self.name = name or f"ddcs-{self.settings.model}"

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return the settings that are played on a scenario."""
        return self.settings

    def with_settings(self, **values: Any) -> DDCS:
        """Return a policy with some settings changed.

        Raises:
            ValueError: A value out of its range.
        """
        return DDCS(self.settings.replace(**values), self.name)

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` teams at the start of an episode.

        Raises:
            PolicyError: The scenario's messages are too small.
        """
        check_fits(self, layout)
        scenario = layout.scenario
        n = scenario.num_trackers
        cells = GRID * GRID if math.isfinite(scenario.sensing_range) else 0
        memory = _Minds(
            layout,
            team_of(layout, self.settings_for(scenario)),
            np.empty((num_worlds, n), MIND),
            np.empty((num_worlds, n, n), MATE),
            np.empty((num_worlds, n, cells), np.uint16),
        )
        return self.restart(memory, np.ones(num_worlds, np.bool_))

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Reset the memory of the worlds of a mask (E,)."""
        m: _Minds = memory
        m.minds[mask], m.mates[mask], m.seen[mask] = MIND_AT_START, MATE_AT_START, 0
        return m

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose`, then :meth:`carry_out`."""
        proposals, m = self.propose(observations, memory)
        return self.carry_out(observations, m, np.zeros_like(proposals))

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed. The first half of
        :meth:`act`; the second half, :meth:`carry_out`, follows with the same observations.
        """
        m: _Minds = memory
        num_worlds, n = m.minds.shape
        observations = check_observations(self, observations, num_worlds, m.layout)
        proposals = np.zeros((num_worlds, n, 2), np.float32)
        over_worlds(
            propose_all, (m.team, m.minds, m.mates, m.seen, observations, work_for(n), proposals), num_worlds, n
        )
        return proposals, m

    def carry_out(self, observations: FloatArray, memory: Memory, corrections: FloatArray) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) that realise the wanted velocities plus corrections.

        Corrections (E, N, 2) are in the unit of :meth:`propose`; the safeguard follows them. Zeros
        give the actions of :meth:`act`.
        """
        m: _Minds = memory
        num_worlds, n = m.minds.shape
        observations = check_observations(self, observations, num_worlds, m.layout)
        corrections = np.ascontiguousarray(corrections, np.float32)
        actions = np.zeros((num_worlds, n, 2 + m.layout.scenario.message_size), np.float32)
        over_worlds(
            carry_out_all, (m.team, m.minds, m.mates, observations, work_for(n), corrections, actions), num_worlds, n
        )
        return actions, m

    @property
    def belief_size(self) -> int:
        """Numbers in a belief."""
        return BELIEF_SIZE

    def belief(self, observations: FloatArray, memory: Memory) -> FloatArray:
        """Return what each tracker believes after :meth:`propose`, (E, N, belief_size).

        The order is that of :mod:`posse_baselines.ddcs.belief`.
        """
        m: _Minds = memory
        num_worlds, n = m.minds.shape
        beliefs = np.empty((num_worlds, n, BELIEF_SIZE), np.float32)
        over_worlds(write_beliefs, (m.team, m.minds, m.mates, m.seen, beliefs), num_worlds, n)
        return beliefs

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal values of each tracker, (E, N) each; ``estimate`` is (E, N, 3).

        ``task`` (its index in ``TASKS``), ``slot`` (-1: none), ``estimate`` (x, y, θ of the target,
        common frame), ``estimate_age`` (s; -1: there is no estimate). Of the centralized model also
        ``leader`` (-1: none yet), ``term`` and ``exchanges`` (number of leader changes).
        """
        minds = memory.minds
        estimate = np.empty((*minds.shape, 3), np.float32)
        for k, name in enumerate(("target_x", "target_y", "target_theta")):
            estimate[..., k] = minds[name]
        names = ["task", "slot"]
        if self.settings.model == "centralized":
            names += ["leader", "term", "exchanges"]
        notes: Annotations = {name: minds[name].copy() for name in names}
        notes["estimate"] = estimate
        notes["estimate_age"] = np.where(minds["known"] != 0, minds["fix_age"], np.float32(-1.0))
        return notes

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        m: _Minds = memory
        arrays: dict[str, npt.NDArray[Any]] = {"seen": m.seen}
        for name, records in (("minds", m.minds), ("mates", m.mates)):
            for field in records.dtype.names or ():
                arrays[f"{name}.{field}"] = records[field]
        return arrays
