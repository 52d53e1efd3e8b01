"""The baseline, PNGL + l-φ: its policy, its settings and those of its family, and one control step in order.

A step of one tracker is :func:`propose`, monitoring and tracking, then :func:`carry_out`, actuation. Between the two, a
wanted velocity may be corrected: before the safeguard, so that a corrected team avoids contact as well as the team
itself does. What ``pngl-l-phi`` does, with equation numbers of the paper:

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

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from posse import SENSORS, ObservationLayout, Scenario
from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.actuation import correct, execute_safely, surround
from posse_baselines.ddcs.memory import Minds, Team, for_each, is_due, pair, unit_of
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE, monitor, write_message
from posse_baselines.ddcs.motion import move, next_task, want
from posse_baselines.ddcs.roles import REPLAN_TIME, choose_slot, settle_lead
from posse_baselines.ddcs.settings import NO_EXCHANGE, Settings
from posse_baselines.laws.geometry import length, scaled
from posse_baselines.laws.steering import Work
from posse_baselines.policy import Annotations, BasePolicy, Memory, PolicyError

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

    def settings_for(self, scenario: Scenario) -> Settings:
        """Return the settings that are played on a scenario."""
        return self.settings

    def with_settings(self, **values: Any) -> DDCS:
        """Return a policy with some settings changed; ValueError if a value is out of its range."""
        return DDCS(replace(self.settings, **values), self.name)

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` teams at the start; PolicyError if the scenario does not fit."""
        super().begin(layout, num_worlds)
        scenario = layout.scenario
        if SENSORS[scenario.sensor].fix == "bearing":
            why = f"sensor={scenario.sensor!r} measures bearings alone"
            raise PolicyError(f"policy {self.name!r} follows positions of the target, and {why}: choose another sensor")
        return Minds(layout, self.settings_for(scenario), num_worlds, scenario.num_trackers)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose`, then :meth:`carry_out`."""
        proposals, memory = self.propose(observations, memory)
        return self.carry_out(observations, memory, np.zeros_like(proposals))

    def propose(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed. The first half of :meth:`act`; the
        second half, :meth:`carry_out`, follows with the same observations.
        """
        proposals = np.zeros((*memory.me.shape, 2), np.float32)
        memory.run(propose_all, observations, proposals)
        return proposals, memory

    def carry_out(self, observations: FloatArray, memory: Memory, corrections: FloatArray) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) that realise the wanted velocities plus corrections, safely.

        Corrections (E, N, 2) are in the unit of :meth:`propose`; the safeguard follows. Zeros give :meth:`act`.
        """
        actions = np.zeros((*memory.me.shape, 2 + memory.layout.scenario.message_size), np.float32)
        actions[..., :2] = corrections
        memory.run(carry_out_all, observations, actions)
        return actions, memory

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
def propose(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, proposal: FloatArray) -> None:
    """Monitor and track: write the velocity that one tracker wants, ahead and left, in shares of its top speed."""
    monitor(team, me, mates, row)
    if team.settings.centralized:
        settle_lead(team, me, mates)
    if me.known == 0:
        me.slot = -1
    elif me.slot < 0 or is_due(team, me, REPLAN_TIME):
        choose_slot(team, me, mates, work)
    me.task = next_task(team, me, mates)
    move(team, me, mates)
    own = me.wish * me.heading.conjugate()
    proposal[0], proposal[1] = own.real / me.max_speed, own.imag / me.max_speed


@compiled
def carry_out(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Actuate: write the action (2 + m,) of one tracker, whose first two numbers are a correction of what it wants."""
    correct(me, complex(float(action[0]), float(action[1])))
    execute_safely(team, me, work.discs[: surround(team, me, mates, row, work.discs)], action)
    write_message(team, me, row, action)


@compiled
def guard(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Make a wanted velocity safe that is not the script's: it stands in the action (2 + m,), which is overwritten.

    It is relative to the observed heading, and carried out from the pose at which the command is executed.
    """
    monitor(team, me, mates, row)
    wanted = complex(float(action[0]), float(action[1]))
    wanted = scaled(wanted * pair(row, team.at.heading), me.max_speed / max(1.0, length(wanted)))
    want(me, wanted)
    execute_safely(team, me, work.discs[: surround(team, me, mates, row, work.discs)], action)


propose_all, carry_out_all, guard_all = for_each(propose), for_each(carry_out), for_each(guard)
