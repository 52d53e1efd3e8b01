"""The baseline, PNGL + l-φ: its policy, its settings and those of its family, and one control step in order.

A step of one tracker is :func:`decide`: monitor, track, actuate. What it wants may be corrected before it actuates, so
that the safeguard keeps a corrected team from contact, too. What ``pngl-l-phi`` does, with the paper's equations:

===============================  ======================================================  =======================
who, when                        law                                                     where
===============================  ======================================================  =======================
everyone, target unknown         drives ahead, away from team-mates and borders          ``motion.explore``,
                                                                                         ``laws.steering``
leader, far (converging)         PNGL, θ = K σ + c, at full speed: (5), (6), (12)        ``motion.pursue``,
                                                                                         ``laws.guidance``
leader, near (flocking)          PNGL, the speed of (13) with a correction of the range  ``motion.pursue``
follower, far (converging)       intercepts its place on the leader at full speed        ``motion.take_place``,
                                                                                         ``laws.steering``
follower, near (flocking)        l-φ on the leader, figure 6                             ``motion.follow``,
                                                                                         ``laws.formation``
everyone, leader exchanged       holds the flock's course until it hears the new leader  ``motion.move``
everyone, always                 regulates its heading, section 3.3; avoids contact      ``laws.guidance``,
                                                                                         ``laws.safeguard``
===============================  ======================================================  =======================

The leader is the tracker nearest to the target (nearest-neighbour rule); it takes the first slot, and the
others take slots by least total time (:mod:`~posse_baselines.ddcs.roles`).
"""

import copy
from dataclasses import replace
from typing import Any, Final, Self

import numpy as np

from posse import ObservationLayout, Scenario
from posse.numeric import FloatArray, Record, Records, compiled, kernel
from posse_baselines.ddcs.actuation import correct, execute_safely, surround
from posse_baselines.ddcs.memory import Minds, Team, is_due, pair, unit_of
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE, monitor, write_message
from posse_baselines.ddcs.motion import guide_of, move, next_task, want
from posse_baselines.ddcs.roles import REPLAN_TIME, choose_slot, settle_lead
from posse_baselines.ddcs.settings import NO_EXCHANGE, Settings
from posse_baselines.fields import changed
from posse_baselines.laws.geometry import length, scaled
from posse_baselines.laws.steering import Work, work_of
from posse_baselines.policy import Annotations, BasePolicy, Memory

BASELINE: Final = Settings(
    model="centralized",
    guidance="pngl",
    navigation_constant=1.1,  # K, at the upper end of the paper's range
    deviation="occupant",  # c = the heading of the slot's occupant - K σ_d, so that the leader holds its slot
    follower_frame="slot-frame",  # φ_d is constant in the slot frame, not in the leader's: the wedge stays behind
)
"""The settings of PNGL + l-φ; the others keep their defaults (:class:`~posse_baselines.ddcs.settings.Settings`)."""

_CENTRALIZED: Final[dict[str, Any]] = {"model": "centralized", "follower_frame": "slot-frame"}

FAMILY: Final[dict[str, Settings]] = {
    "pngl-l-phi": BASELINE,
    # As printed: c = 0, and φ from the leader's heading. The leader then follows from any side and the wedge turns with
    # it, so that only a target that drives straight ahead is held.
    "pngl-l-phi-literal": replace(BASELINE, deviation="none", follower_frame="leader"),
    "pngl": Settings(guidance="pngl", spread=0.1),
    "deviated-pursuit": Settings(guidance="pngl"),
    "velocity-pursuit": Settings(guidance="pngl", deviation="none"),
    "ddcs-centralized-pursuit": Settings(guidance="pngl", deviation="none", **_CENTRALIZED),
    "ddcs-distributed": Settings(),
    "ddcs-centralized": Settings(**_CENTRALIZED),
    "ddcs-centralized-no-exchange": Settings(forbidden=NO_EXCHANGE, **_CENTRALIZED),
    "ddcs-no-radio": Settings(radio=False),
}
"""The members of the DDCS family, the baseline first."""


class DDCS(BasePolicy):
    """Three layers, four tasks, from observations and messages alone; by default it is named by its model."""

    message_size = MESSAGE_SIZE

    def __init__(self, settings: Settings | None = None, name: str | None = None) -> None:
        self.settings = settings or Settings()
        self.name = name or f"ddcs-{self.settings.model}"
        self._changes: dict[str, Any] = {}

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return the settings that are played on a scenario."""
        return self.settings

    def with_settings(self, **values: Any) -> Self:
        """Return a policy with some settings changed; ValueError for an unknown one, or a value out of its range."""
        other = copy.copy(self)
        other.settings = changed(self.settings, values)
        other._changes = {**self._changes, **{name: getattr(other.settings, name) for name in values}}
        return other

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` teams at the start; PolicyError if the scenario does not fit."""
        super().begin(layout, num_worlds)
        return Minds(layout, self.settings_for(layout.scenario), num_worlds, layout.scenario.num_trackers)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose` and :meth:`carry_out` in one."""
        return self._decide(ACT, observations, memory, 0.0)

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed. The first half of :meth:`act`; the
        second half, :meth:`carry_out`, follows with the same observations.
        """
        out, memory = self._decide(PROPOSE, observations, memory, 0.0)
        return out[..., :2].copy(), memory

    def carry_out(self, observations: FloatArray, memory: Memory, corrections: FloatArray) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) that realise the wanted velocities plus corrections, safely.

        Corrections (E, N, 2) are in the unit of :meth:`propose`; the safeguard follows. Zeros give :meth:`act`.
        """
        return self._decide(CARRY_OUT, observations, memory, corrections)

    def _decide(self, part: int, observations: FloatArray, memory: Memory, given: Any) -> tuple[FloatArray, Memory]:
        """Do a part of a control step (:func:`decide`), which reads ``given`` (E, N, 2); return what it writes."""
        out = np.zeros((*memory.me.shape, 2 + memory.layout.scenario.message_size), np.float32)
        out[..., :2] = given
        memory.run(decide_all, part, observations, out)
        return out, memory

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal values of each tracker, (E, N) each; ``estimate`` is (E, N, 3).

        ``task`` (its index in ``TASKS``), ``slot`` (-1: none), ``estimate`` (x, y, θ of the target,
        common frame; with a command delay, when the command will be executed), ``estimate_age`` (s;
        -1: there is no estimate). Of the centralized model also ``leader`` (-1: none yet), ``term``
        and ``exchanges`` (number of leader changes).
        """
        me, unit = memory.me, np.float32(unit_of(memory.layout.scenario))
        names = ["task", "slot"]
        if self.settings.model == "centralized":
            names += ["leader", "term", "exchanges"]
        notes: Annotations = {name: me[name].copy() for name in names}
        notes["estimate"] = np.stack([me["target"].real * unit, me["target"].imag * unit, me["target_theta"]], axis=-1)
        notes["estimate_age"] = np.where(me["known"] != 0, me["fix_age"], np.float32(-1.0))
        return notes


@compiled
def track(team: Team, me: Record, mates: Records, work: Work) -> None:
    """Decide who leads, take a slot, choose the task, and set the motion that its law wants."""
    if team.settings.centralized:
        settle_lead(team, me, mates)
    if me.known == 0:
        me.slot = -1
    elif me.slot < 0 or is_due(team, me, REPLAN_TIME):
        choose_slot(team, me, mates, work)
    guide = guide_of(team, me, mates)  # read only by who has a slot
    me.task = next_task(team, me, guide)
    move(team, me, mates, guide)


ACT, PROPOSE, CARRY_OUT, GUARD = range(4)
"""Parts of a control step, of :func:`decide`."""


@compiled
def decide(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, out: FloatArray, part: int) -> None:
    """Do a part of a control step of one tracker; the first two numbers of ``out`` (2 + m,) are ahead and to the left.

    ============ =======================================================================================
    ACT          the whole step: monitor, track, actuate; writes the action
    PROPOSE      monitor and track; writes the wanted velocity, in shares of the greatest speed
    CARRY_OUT    actuate after PROPOSE: reads a correction of the wanted velocity, writes the action
    GUARD        monitor and actuate: reads a wanted velocity that is not the script's, relative to the
                 observed heading, and overwrites it by speed and turn rate; the message stays
    ============ =======================================================================================
    """
    given = complex(float(out[0]), float(out[1]))
    if part != CARRY_OUT:
        monitor(team, me, mates, row)
    if part in (ACT, PROPOSE):
        track(team, me, mates, work)
    elif part == CARRY_OUT:
        correct(me, given)
    else:
        want(me, scaled(given * pair(row, team.at.heading), me.max_speed / max(1.0, length(given))))
    if part == PROPOSE:
        own = me.wish * me.heading.conjugate()
        out[0], out[1] = own.real / me.max_speed, own.imag / me.max_speed
        return
    execute_safely(team, me, work.discs[: surround(team, me, mates, row, work.discs)], out)
    if team.at.message_size >= MESSAGE_SIZE:
        write_message(team, me, row, out[len(out) - MESSAGE_SIZE :])


@kernel
def decide_all(minds: Any, works: Work, arrays: Any, part: int, thread: int, first: int, end: int) -> None:
    """Call :func:`decide` for every tracker of the worlds ``first`` to ``end``."""
    (shared, me, mates), (rows, out) = minds, arrays
    team = Team(shared.at[0], shared.world[0], shared.settings[0], shared.slots, shared.beams)
    work = work_of(works, thread)
    for e in range(first, end):
        for i in range(rows.shape[1]):
            decide(team, me[e, i], mates[e, i], rows[e, i], work, out[e, i], part)
