"""A batch in which a policy moves one side: the target, or the trackers."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any, Final, Protocol, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse.engine.arguments import as_float32, checked_actions, in_box, real_numbers
from posse.engine.batch import Batch, Snapshot, Step
from posse.engine.kernels import Results
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Scenario
from posse.signals.layout import ObservationLayout

_OF_THE_BATCH: Final = (
    *("scenario", "num_worlds", "layout", "term_names", "autoreset", "seed", "split", "first_world", "clip_actions"),
    *("state", "worlds", "arrays", "score", "terminated", "truncated", "working", "metrics", "save"),
)


@runtime_checkable
class TargetPolicy(Protocol):
    """Moves the target of every world; it observes the trackers without error.

    A policy of one robot: what the target observes has the fields of a tracker's observation, with
    the trackers in the places of team-mates. What the policy remembers is in its memory.
    """

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory for the first step of ``num_worlds`` worlds."""
        ...

    def act(self, observations: FloatArray, memory: Any) -> tuple[FloatArray, Any]:
        """Return actions (E, 1, 2 or more) in [-1, 1] for observations (E, 1, F), and the memory.

        The first two numbers of an action are the target's speed and turn rate.
        """
        ...

    def restart(self, memory: Any, mask: BoolArray) -> Any:
        """Return the memory with the worlds of a mask (E,) reset to those of :meth:`begin`."""
        ...


class PairedBatch:
    """A batch whose target, or whose trackers, are moved by a policy inside.

    Observations, actions, rewards and infos have a row for each robot of the other side only.
    :meth:`reset` and :meth:`step` are those of :class:`Batch`; so are ``scenario``, ``layout``, ``worlds``,
    ``metrics()`` and the other attributes that do not depend on a side. A snapshot has no memory of the policy.

    Args:
        batch: The worlds; their target is an agent.
        inside: Moves its side; ``begin``, ``act`` and ``restart`` as :class:`TargetPolicy` has
            them, with a row for each robot that it moves.
        moves_target: Whether its side is the target, else the trackers.

    Attributes:
        memory: Memory of the policy inside.
        observation_shape: (E, rows, F).
        action_shape: (E, rows, 2 + message_size); (E, 1, 2) for the target, which sends no messages.
    """

    def __init__(self, batch: Batch, inside: TargetPolicy, *, moves_target: bool) -> None:
        self.batch, self.inside, self.moves_target = batch, inside, moves_target
        worlds, rows, length = batch.action_shape
        trackers, target = slice(0, rows - 1), slice(rows - 1, rows)
        self._mine, self._theirs = (trackers, target) if moves_target else (target, trackers)
        shapes = (worlds, rows - 1, length), (worlds, 1, 2)
        self.action_shape, self._their_shape = shapes if moves_target else shapes[::-1]
        self.observation_shape = (*self.action_shape[:2], batch.layout.size)
        self.memory = inside.begin(batch.layout, worlds)
        self._seen = np.zeros((*self._their_shape[:2], batch.layout.size), np.float32)

    def __getattr__(self, name: str) -> Any:
        if name not in _OF_THE_BATCH:
            raise AttributeError(f"a batch with a policy inside has no {name!r}; its worlds are .batch")
        return getattr(self.batch, name)

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> FloatArray:
        """Start an episode in every world; see :meth:`Batch.reset`."""
        observations = self.batch.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        return self._look(observations, np.ones(self.num_worlds, np.bool_) if mask is None else np.asarray(mask))

    def step(self, actions: npt.ArrayLike) -> Step:
        """Advance every world by one control step; see :meth:`Batch.step`.

        Raises:
            ValueError: As :meth:`Batch.step`, or invalid actions of the policy inside. Nothing is changed,
                nor is the memory, unless the policy itself writes to it.
        """
        self.batch.check_running()
        whole, memory = self._act(self.check_actions(actions))
        restarted = self.worlds["over"] != 0
        observations, rewards, terminated, truncated, infos = self.batch._step(whole)
        self.memory = memory
        for name, values in infos.items():
            if name.startswith("reward/") or name == "final_obs":
                infos[name] = np.ascontiguousarray(values[:, self._mine])
        restarted = terminated | truncated if self.autoreset == "same_step" else restarted
        mine = np.ascontiguousarray(rewards[:, self._mine])
        return self._look(observations, restarted), mine, terminated, truncated, infos

    def check_actions(self, actions: npt.ArrayLike) -> FloatArray:
        """Return the actions of this side as the kernel takes them, or raise ValueError."""
        return checked_actions(actions, self.action_shape, self.clip_actions)

    def observe(self) -> FloatArray:
        """Return the current observations, (E, rows, F)."""
        return self._look(self.batch.observe())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Restore a snapshot; see :meth:`Batch.restore`."""
        return self._look(self.batch.restore(snapshot))

    def _advance(self, actions: FloatArray, results: Results) -> int:
        """Advance every world by valid actions of this side; see :meth:`Batch._advance`."""
        whole, memory = self._act(actions)
        restarted, every = self.worlds["over"] != 0, self.batch._new_results()
        over = self.batch._advance(whole, every)
        self.memory = memory
        for mine, array in zip(results[:3], every[:3], strict=True):
            mine[...] = array[:, self._mine]
        results.flags[...] = every.flags
        self._look(every.observations, restarted)
        return over

    def _act(self, mine: FloatArray) -> tuple[FloatArray, Any]:
        """Return the actions of all robots, and the memory of the policy inside."""
        who = "target's" if self.moves_target else "team's"
        chosen, memory = self.inside.act(self._seen, self.memory)
        array, wanted = real_numbers(f"what the {who} policy returned", chosen), self._their_shape
        if array.ndim != 3 or array.shape[:2] != wanted[:2] or array.shape[2] < wanted[2]:
            raise ValueError(f"the {who} policy returned actions of shape {array.shape}, wanted {wanted}")
        theirs = as_float32(array[:, :, : wanted[2]])
        whole = np.zeros(self.batch.action_shape, np.float32)
        whole[:, self._mine, : mine.shape[2]] = mine
        whole[:, self._theirs, : wanted[2]] = in_box(
            theirs, self.clip_actions, f"the {who} policy returned actions, of which [{{}}, {{}}, {{}}]".format
        )
        return whole, memory

    def _look(self, observations: FloatArray, restarted: BoolArray | None = None) -> FloatArray:
        """Keep what the policy inside observes; return the other observations, (E, rows, F)."""
        if restarted is not None and restarted.any():
            self.memory = self.inside.restart(self.memory, restarted)
        self._seen = np.ascontiguousarray(observations[:, self._theirs])
        return np.ascontiguousarray(observations[:, self._mine])


def batch_with(
    scenario: Scenario,
    num_worlds: int,
    target_policy: TargetPolicy | None = None,
    team_policy: TargetPolicy | None = None,
    **settings: Any,
) -> Batch:
    """Return a batch, one side of which is moved by a policy if there is one.

    A :class:`PairedBatch` is typed as a batch, since it has what users of one side call.

    Raises:
        TypeError: ``target_policy`` or ``team_policy`` lacks a method.
        ValueError: Both are given, or as :class:`Batch`.
    """
    if target_policy is not None and team_policy is not None:
        raise ValueError("target_policy= and team_policy= exclude each other: give one of them")
    inside, side = (team_policy, "team") if target_policy is None else (target_policy, "target")
    if inside is None:
        return Batch(scenario, num_worlds, **settings)
    missing = [name for name in ("begin", "act", "restart") if not hasattr(inside, name)]
    if missing:
        raise TypeError(
            f"{side}_policy={reprlib.repr(inside)} is not the policy of a {side}: it has no "
            f"{', '.join(missing)} (posse.TargetPolicy)"
        )
    batch = Batch(scenario.replace(target_motion="agent"), num_worlds, **settings)
    return cast("Batch", PairedBatch(batch, inside, moves_target=side == "target"))
