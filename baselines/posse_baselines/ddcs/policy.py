"""The Distributed Decision Control System as policies."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout, Scenario
from posse.numeric import BoolArray, FloatArray, OwnArrays
from posse_baselines.ddcs.baseline import FAMILY, carry_out_all, propose_all
from posse_baselines.ddcs.belief import BELIEF, believe_all
from posse_baselines.ddcs.memory import Kernel, Minds, unit_of
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE
from posse_baselines.ddcs.settings import Settings
from posse_baselines.policy import Annotations, BasePolicy, Memory, PolicyError, check_observations


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
        super().begin(layout, num_worlds)
        scenario = layout.scenario
        return Minds(layout, self.settings_for(scenario), num_worlds, scenario.num_trackers)

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Reset the memory of the worlds of a mask (E,)."""
        memory.restart(mask)
        return memory

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) of every team: :meth:`propose`, then :meth:`carry_out`."""
        proposals, memory = self.propose(observations, memory)
        return self.carry_out(observations, memory, np.zeros_like(proposals))

    def propose(self, observations: FloatArray, memory: Memory, *, believes: bool = False) -> tuple[FloatArray, Memory]:
        """Return the wanted velocities (E, N, 2) of every team, before the safeguard.

        Ahead and to the left of each tracker, as shares of its greatest speed; with ``believes`` followed by what it
        believes, a :data:`~posse_baselines.ddcs.belief.BELIEF`: (E, N, 2 + BELIEF_SIZE). The first half of
        :meth:`act`; the second half, :meth:`carry_out`, follows with the same observations.
        """
        shape = memory.me.shape
        proposals = self._run(propose_all, observations, memory, np.zeros((*shape, 2), np.float32))
        if believes:
            beliefs = self._run(believe_all, observations, memory, np.zeros(shape, BELIEF))
            proposals = np.concatenate([proposals, beliefs.view(np.float32).reshape(*shape, -1)], axis=-1)
        return proposals, memory

    def carry_out(self, observations: FloatArray, memory: Memory, corrections: FloatArray) -> tuple[FloatArray, Memory]:
        """Return the actions (E, N, 2 + m) that realise the wanted velocities plus corrections.

        Corrections (E, N, 2) are in the unit of :meth:`propose`; the safeguard follows them. Zeros
        give the actions of :meth:`act`.
        """
        actions = np.zeros((*memory.me.shape, 2 + memory.layout.scenario.message_size), np.float32)
        actions[..., :2] = corrections
        return self._run(carry_out_all, observations, memory, actions), memory

    def _run(self, kernel: Kernel, observations: FloatArray, memory: Memory, out: FloatArray) -> FloatArray:
        memory.run(kernel, check_observations(self, observations, len(memory.me), memory.layout), out)
        return out

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

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the trackers' memory, field by field, as views."""
        arrays: dict[str, npt.NDArray[Any]] = memory.arrays()
        return arrays
