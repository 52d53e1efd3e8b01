"""A batch in which a policy moves some robots: the target, the trackers, or all trackers but one."""

import copy
import itertools
import reprlib
from typing import Any, Protocol, runtime_checkable

import numpy as np

from posse.engine.arguments import as_float32, in_box
from posse.engine.batch import Batch, of_batch
from posse.engine.kernels import Orders, Results
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Family, Scenario, ScenarioError, get_scenario
from posse.scenarios.family import scenario_or_family
from posse.scenarios.setting import check_choice, check_count, fail
from posse.signals.layout import ObservationLayout


@runtime_checkable
class TargetPolicy(Protocol):
    """Moves the target of every world; it observes the trackers without error.

    A policy of one robot: what the target observes has the fields of a tracker's observation, with
    the nearest ``num_neighbours`` trackers in the places of team-mates: by default all but the farthest, at most
    eight; one tracker alone is not observed. What the policy remembers is in its memory.
    """

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory for the first step of ``num_worlds`` worlds."""

    def act(self, observations: FloatArray, memory: Any) -> tuple[FloatArray, Any]:
        """Return actions (E, 1, 2 or more) in [-1, 1] for observations (E, 1, F), and the memory.

        The first two numbers of an action are the target's speed and turn rate.
        """

    def restart(self, memory: Any, mask: BoolArray) -> Any:
        """Return the memory with the worlds of a mask (E,) reset to those of :meth:`begin`."""


class PairedBatch(Batch):
    """A batch in which a policy inside moves the target, the trackers, or the team-mates of one tracker.

    Observations, actions, rewards and infos have a row for each robot that is moved from outside only. All else is as
    in :class:`Batch`; copies of the worlds are a plain batch, and a snapshot has no memory of the policy.

    Args:
        scenario: Settings of the worlds, or a name; the target becomes an agent if one side is moved from outside.
        num_worlds: E, at least 1.
        inside: Moves the others; ``begin``, ``act`` and ``restart`` as :class:`TargetPolicy` has them, with a row for
            each robot that it moves. The team-mates of a tracker are moved by a policy of the whole team, whose action
            for that tracker is not executed. One with ``watch`` is given this batch, whose state it may read.
        outside: ``"trackers"``, ``"target"``, or the number of a tracker.
        settings: Further arguments of :class:`Batch`.

    Attributes:
        memory: Memory of the policy inside, which is restarted when it acts in a world that is at its start.
        everyone: Actions of all robots in the last step, and what came of them (:class:`Results`), with the present
            observations; the target's row last.
        observation_shape: (E, rows, F).
        action_shape: (E, N, 2 + message_size); (E, 1, 2) for the target or one tracker, which send no messages.
    """

    def __init__(
        self, scenario: str | Scenario, num_worlds: int, inside: TargetPolicy, *, outside: str | int, **settings: Any
    ) -> None:
        scenario, one = get_scenario(scenario), not isinstance(outside, str)
        if one and check_count("outside", outside, 0) >= scenario.num_trackers:
            raise ScenarioError(f"outside={outside} is not in the team: trackers are 0 to {scenario.num_trackers - 1}")
        if one and scenario.target_is_agent:
            raise ScenarioError(f"outside={outside} leaves nothing to move the target: choose another target_motion")
        if not one:
            check_choice("outside", outside, ("trackers", "target"))
        super().__init__(scenario if one else scenario.replace(target_motion="agent"), num_worlds, **settings)
        self.inside, self.outside = inside, outside
        self.everyone = np.zeros(self.action_shape, np.float32), self._new_results()
        worlds, _, length = self.action_shape
        n = scenario.num_trackers
        row = int(outside) if one else n  # of the single robot: a tracker among its team-mates, or the target
        team, single = (slice(0, n), (worlds, n, length)), (slice(row, row + 1), (worlds, 1, 2))
        mine, theirs = (team, single) if outside == "trackers" else (single, team)
        (self._mine, self.action_shape), (self._theirs, self._their_shape) = mine, theirs
        self.observation_shape = (*self.action_shape[:2], self.layout.size)
        if hasattr(inside, "watch"):
            inside.watch(self)
        self.memory: Any = inside.begin(self.layout, worlds)

    def __copy__(self) -> "PairedBatch":
        return copy.deepcopy(self)  # its memory, too

    @property
    def working(self) -> BoolArray:
        """(E, N) whether each tracker works; if one tracker alone is moved from outside, whether it works, (E, 1)."""
        working = super().working
        return working if isinstance(self.outside, str) else working[:, self._mine]

    def _advance(self, actions: FloatArray, results: Results, orders: Orders | None = None) -> None:
        """Advance every world by valid actions of this side and those of the policy inside.

        If the policy's actions are invalid, neither the worlds nor its memory change.
        """
        whole, came = self.everyone
        if orders is None:
            whole, self.memory = self._with_theirs(actions)
        observations, rewards, terms = (np.empty_like(array) for array in self.everyone[1][:3])
        every = results._replace(observations=observations, rewards=rewards, terms=terms)
        super()._advance(whole, every, orders)
        # Other orders replace what is observed, not what came of the last step.
        self.everyone = whole, every if orders is None else came._replace(observations=observations)
        for mine, array in zip(results[:3], every[:3], strict=True):
            mine[...] = array[:, self._mine]

    def _with_theirs(self, mine: FloatArray) -> tuple[FloatArray, Any]:
        """Return the actions of all robots, and the memory of the policy inside."""
        who = "target's" if self.outside == "trackers" else "team's"
        seen = self.everyone[1].observations[:, self._theirs].copy()
        begun = self.arrays.world["step"] == 0
        chosen, memory = self.inside.act(seen, self.inside.restart(self.memory, begun) if begun.any() else self.memory)
        array, wanted = as_float32(f"what the {who} policy returned", chosen), self._their_shape
        if array.ndim != 3 or array.shape[:2] != wanted[:2] or array.shape[2] < wanted[2]:
            raise ValueError(f"the {who} policy returned actions of shape {array.shape}, wanted {wanted}")
        theirs = np.ascontiguousarray(array[:, :, : wanted[2]])
        whole = np.zeros_like(self.everyone[0])
        whole[:, self._theirs, : wanted[2]] = in_box(
            theirs, self.clip_actions, f"the {who} policy returned actions, of which [{{}}, {{}}, {{}}]".format
        )
        whole[:, self._mine] = 0
        whole[:, self._mine, : mine.shape[2]] = mine
        return whole, memory


def batch(
    scenario: str | Scenario = "constant",
    num_worlds: int = 1,
    *,
    target_policy: TargetPolicy | None = None,
    team_policy: TargetPolicy | None = None,
    **settings: Any,
) -> Batch:
    """Return a batch of worlds, on which all environments are built.

    ``settings`` are further arguments of :class:`Batch`, or any field of :class:`posse.Scenario`.

    With ``target_policy`` that policy moves the target of every world; observations, actions and rewards are those of
    the trackers. With ``team_policy`` that policy moves the trackers; observations, actions and rewards are those of
    the target: one row, and actions of two numbers. Both return a :class:`PairedBatch`; they exclude each other.
    """
    own = of_batch(settings)
    found = get_scenario(scenario, **settings)
    if target_policy is not None and team_policy is not None:
        raise ValueError("target_policy= and team_policy= exclude each other: give one of them")
    inside: Any
    inside, side = (team_policy, "team") if target_policy is None else (target_policy, "target")
    if inside is None:
        return Batch(found, num_worlds, **own)
    if not isinstance(inside, TargetPolicy) or isinstance(inside, type):
        raise TypeError(f"{side}_policy={reprlib.repr(inside)} lacks begin, act or restart (posse.TargetPolicy)")
    outside = "trackers" if side == "target" else "target"
    return PairedBatch(found, num_worlds, inside, outside=outside, **own)


def batches(
    scenario: str | Scenario | Family,
    num_worlds: int,
    *,
    scenarios: int = 16,
    seed: int = 0,
    split: str = "train",
    first_world: int = 0,
    **settings: Any,
) -> list[Batch]:
    """Return batches that hold so many worlds together: of a family one for each of ``scenarios`` drawn scenarios.

    A world depends on seed, split and its number alone; so does scenario k on seed, split and k. The other settings
    are those of :func:`batch`.
    """
    for name, count in (("num_worlds", num_worlds), ("scenarios", scenarios)):
        check_count(name, count, 1)
    given = scenario_or_family(scenario)
    drawn = [given.draw(k, seed, split) for k in range(scenarios)] if isinstance(given, Family) else [given]
    if num_worlds < len(drawn):
        fail("num_worlds", num_worlds, f"it must be at least {len(drawn)}, one for each scenario")
    ends = [num_worlds * k // len(drawn) for k in range(len(drawn) + 1)]
    return [
        batch(one, end - first, seed=seed, split=split, first_world=first_world + first, **settings)
        for one, (first, end) in zip(drawn, itertools.pairwise(ends), strict=True)
    ]
