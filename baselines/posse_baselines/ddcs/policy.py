"""The Distributed Decision Control System as policies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse.numeric import BoolArray, FloatArray, OwnArrays, kernel, over_worlds
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.ddcs.belief import BELIEF_SIZE, write_belief
from posse_baselines.ddcs.memory import (
    GRID,
    MATE,
    MATE_AT_START,
    MIND,
    MIND_AT_START,
    Minds,
    Team,
    Work,
    team_of,
    work_for,
)
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE
from posse_baselines.ddcs.settings import Settings
from posse_baselines.ddcs.step import carry_out, correct, plan
from posse_baselines.laws.offsets import in_units, unit_of
from posse_baselines.policy import Annotations, BasePolicy, Memory, PolicyError, check_fits, check_observations


@dataclass
class _Memory(OwnArrays):
    layout: ObservationLayout
    minds: Minds


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

    @classmethod
    def of(cls, name: str) -> DDCS:
        """Return a member of the DDCS family by name, such as ``"pngl-l-phi"``.

        Raises:
            PolicyError: No member of that name.
        """
        if name not in FAMILY:
            raise PolicyError(f"policy {name!r} has no settings; those that have: {', '.join(FAMILY)}")
        return DDCS(FAMILY[name], name)

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
        minds = Minds(
            team_of(layout, self.settings_for(scenario)),
            np.empty((num_worlds, n), MIND),
            np.empty((num_worlds, n, n), MATE),
            np.empty((num_worlds, n, cells), np.uint16),
        )
        memory = _Memory(layout, minds)
        return self.restart(memory, np.ones(num_worlds, np.bool_))

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Reset the memory of the worlds of a mask (E,)."""
        minds: Minds = memory.minds
        minds.me[mask], minds.mates[mask], minds.seen[mask] = MIND_AT_START, MATE_AT_START, 0
        return memory

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose`, then :meth:`carry_out`."""
        proposals, memory = self.propose(observations, memory)
        return self.carry_out(observations, memory, np.zeros_like(proposals))

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed. The first half of
        :meth:`act`; the second half, :meth:`carry_out`, follows with the same observations.
        """
        return self._over_worlds(_propose, observations, memory, 2), memory

    def carry_out(self, observations: FloatArray, memory: Memory, corrections: FloatArray) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) that realise the wanted velocities plus corrections.

        Corrections (E, N, 2) are in the unit of :meth:`propose`; the safeguard follows them. Zeros
        give the actions of :meth:`act`.
        """
        size = 2 + memory.layout.scenario.message_size
        return self._over_worlds(_carry_out, observations, memory, size, corrections), memory

    def _over_worlds(
        self, kernel: Any, observations: FloatArray, memory: Memory, size: int, given: FloatArray | None = None
    ) -> FloatArray:
        """Return what a kernel writes for each tracker, (E, N, size), over the numbers that are ``given``, if any."""
        minds: Minds = memory.minds
        num_worlds, n = minds.me.shape
        observations = in_units(memory.layout, check_observations(self, observations, num_worlds, memory.layout))
        out = np.zeros((num_worlds, n, size), np.float32)
        if given is not None:
            out[..., : given.shape[-1]] = given
        over_worlds(kernel, (minds, work_for(n), observations, out), num_worlds, n)
        return out

    def belief(self, memory: Memory) -> FloatArray:
        """Return what each tracker believes after :meth:`propose`, (E, N, BELIEF_SIZE).

        The order is that of :mod:`posse_baselines.ddcs.belief`.
        """
        minds: Minds = memory.minds
        beliefs = np.empty((*minds.me.shape, BELIEF_SIZE), np.float32)
        over_worlds(_believe, (minds, beliefs), *minds.me.shape)
        return beliefs

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal values of each tracker, (E, N) each; ``estimate`` is (E, N, 3).

        ``task`` (its index in ``TASKS``), ``slot`` (-1: none), ``estimate`` (x, y, θ of the target,
        common frame; with a command delay, when the command will be executed), ``estimate_age`` (s;
        -1: there is no estimate). Of the centralized model also ``leader`` (-1: none yet), ``term``
        and ``exchanges`` (number of leader changes).
        """
        me, unit = memory.minds.me, np.float32(unit_of(memory.layout.scenario))
        names = ["task", "slot"]
        if self.settings.model == "centralized":
            names += ["leader", "term", "exchanges"]
        notes: Annotations = {name: me[name].copy() for name in names}
        notes["estimate"] = np.stack([me["target"].real * unit, me["target"].imag * unit, me["target_theta"]], axis=-1)
        notes["estimate_age"] = np.where(me["known"] != 0, me["fix_age"], np.float32(-1.0))
        return notes

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        minds: Minds = memory.minds
        return minds.arrays()


@kernel
def _propose(
    minds: Minds, work: Work, observations: FloatArray, proposals: FloatArray, thread: int, first: int, end: int
) -> None:
    """Plan in a share of worlds; write the wanted velocities (E, N, 2), ahead and left, in shares of the top speed."""
    shared = minds.team
    team = Team(shared.at[0], shared.world[0], shared.settings[0], shared.slots, shared.outermost, shared.beams)
    mine = Work(work.cost[thread], work.assigning[thread], work.discs[thread], work.plays[thread])
    for e in range(first, end):
        for i in range(observations.shape[1]):
            me = minds.me[e, i]
            plan(team, me, minds.mates[e, i], minds.seen[e, i], observations[e, i], mine)
            own = me.wish * me.heading.conjugate()
            proposals[e, i, 0], proposals[e, i, 1] = own.real / me.max_speed, own.imag / me.max_speed


@kernel
def _carry_out(
    minds: Minds, work: Work, observations: FloatArray, actions: FloatArray, thread: int, first: int, end: int
) -> None:
    """Carry out the plans of a share of worlds, corrected by what stands in the actions' first two numbers."""
    shared = minds.team
    team = Team(shared.at[0], shared.world[0], shared.settings[0], shared.slots, shared.outermost, shared.beams)
    mine = Work(work.cost[thread], work.assigning[thread], work.discs[thread], work.plays[thread])
    for e in range(first, end):
        for i in range(observations.shape[1]):
            me, action = minds.me[e, i], actions[e, i]
            correct(me, complex(float(action[0]), float(action[1])))
            carry_out(team, me, minds.mates[e, i], observations[e, i], mine, action)


@kernel
def _believe(minds: Minds, beliefs: FloatArray, thread: int, first: int, end: int) -> None:
    """Write the beliefs (E, N, BELIEF_SIZE) of a share of worlds."""
    shared = minds.team
    team = Team(shared.at[0], shared.world[0], shared.settings[0], shared.slots, shared.outermost, shared.beams)
    for e in range(first, end):
        for i in range(minds.me.shape[1]):
            write_belief(team, minds.me[e, i], minds.mates[e, i], minds.seen[e, i], beliefs[e, i])
