"""The Distributed Decision Control System as policies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse.numeric import MOST_THREADS, BoolArray, FloatArray, OwnArrays, Records, over_worlds
from posse.rules import beam_directions, slot_records
from posse.scenarios.formation import slot_offsets
from posse_baselines.ddcs.belief import BELIEF_SIZE
from posse_baselines.ddcs.controller import decide_all
from posse_baselines.ddcs.correction import correct_all, propose_all, write_beliefs
from posse_baselines.ddcs.memory import GRID, MATE, MIND
from posse_baselines.ddcs.messages import MESSAGE_SIZE
from posse_baselines.ddcs.settings import Settings, settings_record
from posse_baselines.laws.assignment import WORK_ROWS
from posse_baselines.laws.heading import BODY
from posse_baselines.laws.offsets import offsets_of
from posse_baselines.laws.safeguard import DISC, PLAYS
from posse_baselines.policy import Annotations, BasePolicy, Memory, check_fits, check_observations, message_size_of

_MOST_DISCS: Final = 32


@dataclass
class _Minds(OwnArrays):
    """The memory of a team in each of E worlds."""

    layout: ObservationLayout
    settings: Records
    offsets: Records
    slots: Records
    beams: FloatArray
    """(2, S), cosine and sine of each sonar beam's direction."""
    outermost: float
    minds: Records
    """(E, N) :data:`~posse_baselines.ddcs.memory.MIND`."""
    mates: Records
    """(E, N, N) :data:`~posse_baselines.ddcs.memory.MATE`."""
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
        limited = math.isfinite(scenario.sensing_range)
        memory = _Minds(
            layout,
            settings_record(self.settings_for(scenario)),
            offsets_of(layout),
            slot_records(scenario),
            beam_directions(scenario),
            max(math.hypot(x, y) for x, y in slot_offsets(scenario)),
            np.zeros((num_worlds, n), MIND),
            np.zeros((num_worlds, n, n), MATE),
            np.zeros((num_worlds, n, GRID * GRID if limited else 0), np.uint16),
        )
        return self.restart(memory, np.ones(num_worlds, np.bool_))

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Reset the memory of the worlds of a mask (E,)."""
        m: _Minds = memory
        for records in (m.minds, m.mates):
            records[mask] = np.zeros((), records.dtype)
        m.seen[mask] = 0
        for name in ("fix_step", "slot", "leader", "goal_step", "lost_step", "error"):
            m.minds[name][mask] = -1
        for name in ("step", "task", "leader", "term", "pulse", "slot"):
            m.mates[name][mask] = -1
        return m

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team."""
        m: _Minds = memory
        num_worlds, n = m.minds.shape
        observations = check_observations(self, observations, num_worlds, m.layout)
        actions = np.zeros((num_worlds, n, 2 + message_size_of(m.layout)), np.float32)
        parts = MOST_THREADS
        work = (
            np.empty((parts, n, n)),
            np.empty((parts, WORK_ROWS, n + 1)),
            m.beams,
            np.empty((parts, _MOST_DISCS), DISC),
            np.empty(parts, BODY),
            np.empty(parts, PLAYS),
        )
        over_worlds(
            decide_all,
            (m.offsets, m.settings, m.slots, m.outermost, m.minds, m.mates, m.seen, observations, *work, actions),
            num_worlds,
            n,
        )
        return actions, m

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed. The first half of
        :meth:`act`; the second half, :meth:`carry_out`, follows with the same observations.
        """
        m: _Minds = memory
        num_worlds, n = m.minds.shape
        observations = check_observations(self, observations, num_worlds, m.layout)
        proposals = np.zeros((num_worlds, n, 2), np.float32)
        parts = MOST_THREADS
        over_worlds(
            propose_all,
            (
                m.offsets,
                m.settings,
                m.slots,
                m.outermost,
                m.minds,
                m.mates,
                m.seen,
                observations,
                np.empty((parts, n, n)),
                np.empty((parts, WORK_ROWS, n + 1)),
                np.empty(parts, BODY),
                proposals,
            ),
            num_worlds,
            n,
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
        actions = np.zeros((num_worlds, n, 2 + message_size_of(m.layout)), np.float32)
        parts = MOST_THREADS
        over_worlds(
            correct_all,
            (
                m.offsets,
                m.settings,
                m.slots,
                m.minds,
                m.mates,
                observations,
                m.beams,
                np.empty((parts, _MOST_DISCS), DISC),
                np.empty(parts, BODY),
                np.empty(parts, PLAYS),
                np.ascontiguousarray(corrections, np.float32),
                actions,
            ),
            num_worlds,
            n,
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
        observations = check_observations(self, observations, num_worlds, m.layout)
        beliefs = np.empty((num_worlds, n, BELIEF_SIZE), np.float32)
        over_worlds(
            write_beliefs,
            (m.offsets, m.settings, m.slots, m.minds, m.mates, m.seen, observations, beliefs),
            num_worlds,
            n,
        )
        return beliefs

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal values of each tracker, (E, N) each; ``estimate`` is (E, N, 3).

        ``task`` (its index in ``TASKS``), ``slot`` (-1: none), ``estimate`` (x, y, θ of the target,
        common frame), ``estimate_age`` (s; -1: there is no estimate). Of the centralized model also
        ``leader`` (-1: none yet), ``term`` and ``exchanges`` (number of leader changes).
        """
        minds = memory.minds
        estimate = np.empty((*minds.shape, 3), np.float32)
        for k, name in enumerate(("now_x", "now_y", "now_theta")):
            estimate[..., k] = minds[name]
        names = ["task", "slot"]
        if self.settings.model == "centralized":
            names += ["leader", "term", "exchanges"]
        notes: Annotations = {name: minds[name].copy() for name in names}
        notes["estimate"] = estimate
        notes["estimate_age"] = np.where(minds["known"] != 0, minds["age"], np.float32(-1.0))
        return notes

    def leaders(self, memory: Memory) -> npt.NDArray[Any]:
        """Return the leader of each tracker, (E, N), -1 for none, as a view."""
        leaders: npt.NDArray[Any] = memory.minds["leader"]
        return leaders

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        m: _Minds = memory
        arrays: dict[str, npt.NDArray[Any]] = {"seen": m.seen}
        for name, records in (("minds", m.minds), ("mates", m.mates)):
            for field in records.dtype.names or ():
                arrays[f"{name}.{field}"] = records[field]
        return arrays
