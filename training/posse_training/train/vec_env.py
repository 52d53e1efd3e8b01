"""Worlds as a stable-baselines3 vector environment of slots, one for each tracker of each world.

All trackers share one policy, so that E worlds of N trackers are E x N environments to a
single-agent learner. Slot ``e * N + i`` is tracker i of world e.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from posse import Batch, PairedBatch, Scenario, Snapshot
from posse.numeric import BoolArray, FloatArray
from posse_baselines import PolicyError
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.safeguard import Guard, check_room
from posse_training.train.world_state import StateReader

_NEVER: Final = -1


class TeamVecEnv(VecEnv):
    """Batches of worlds as one vector of slots, worlds x trackers.

    Truncated slots are bootstrapped one call each, so episodes should not all end together: each world's *first*
    episode is shortened, the e-th of E worlds to (e + 1) / E of the horizon, which spreads all later ends evenly over
    time; the worlds of several batches take turns. A shortened episode is truncated and bootstrapped like any other,
    but reports neither return nor metrics.

    Every array returned is new and is never overwritten.

    Args:
        batches: Batches of worlds, made with ``autoreset="disabled"`` and equal ``message_size``;
            team sizes may differ.
        encoding: Which inputs are read from an observation.
        safeguard: Whether actions are wanted velocities, which the safeguard carries out
            (:mod:`posse_baselines.safeguard`).
        see_state: Append the state of the world, for a centralized critic (:mod:`posse_training.train.world_state`).

    Attributes:
        batches: The batches, in the order of their slots.
        encoding: As given.
        action_length: Numbers of an action, 2 + m, without those of a message that the safeguard adds.
        size: Numbers of an observation; behind the encoding's is the state.

    Raises:
        ValueError: A batch that resets itself, a target that is an agent, or batches whose actions differ in length.
        PolicyError: An encoding that does not fit; a safeguard of a target, or without room for its messages.
    """

    def __init__(
        self, batches: Sequence[Batch], encoding: Encoding, *, safeguard: bool = False, see_state: bool = False
    ) -> None:
        self.batches, self.encoding = tuple(batches), encoding
        self.action_length = _action_length(batches)
        seen = [batch.scenario for batch in batches] if see_state else []
        self._groups = [SlotGroup(batch, encoding, seen, safeguard) for batch in batches]
        self._said = max(0 if group.guard is None else group.guard.said for group in self._groups)
        self.action_length -= self._said
        self._owners = [batch for batch in batches for _ in range(batch.num_worlds * batch.action_shape[1])]
        self.size = self._groups[0].size
        self._terms: dict[str, list[float]] = {}  # sum over slots and steps, and of how many
        super().__init__(
            len(self._owners),
            spaces.Box(-np.inf, np.inf, (self.size,), np.float32),
            spaces.Box(-1.0, 1.0, (self.action_length,), np.float32),
        )

    def reset(self) -> FloatArray:
        """Start an episode in every world; return the observations (slots, size).

        A seed given by :meth:`seed` restarts the worlds from episode 0 of that seed, once, and options given by
        :meth:`set_options` are those of :meth:`posse.Batch.reset` but ``reset_mask``, once.
        """
        seed, options, count = self._seeds[0], self._options[0], len(self._groups)
        begun = [group.reset(seed, options, (k + 1) / count) for k, group in enumerate(self._groups)]
        self._reset_seeds()
        self._reset_options()
        return np.concatenate(begun)

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Take the actions (slots, 2 + m) of the next step; ValueError as for :meth:`posse.Batch.step`."""
        actions = np.asarray(actions)
        if actions.shape != (self.num_envs, self.action_length):
            raise ValueError(f"actions have shape {actions.shape}, wanted {(self.num_envs, self.action_length)}")
        actions = np.pad(actions, ((0, 0), (0, self._said)))
        parts = np.split(actions, np.cumsum([group.num_slots for group in self._groups])[:-1])
        self._actions = [
            batch.actions_of(part.reshape(batch.action_shape)) for batch, part in zip(self.batches, parts, strict=True)
        ]

    def step_wait(self) -> tuple[FloatArray, FloatArray, BoolArray, list[dict[str, Any]]]:
        """Step every world; return observations, rewards, dones and infos, one row a slot.

        Where an episode ended, the observation is the first of the next episode, and the info holds
        ``terminal_observation`` (size,), ``TimeLimit.truncated``, and for whole episodes
        ``episode`` (return, length, score), ``metrics`` and ``is_success`` (the team settled).
        """
        steps = [group.step(part) for group, part in zip(self._groups, self._actions, strict=True)]
        observations, rewards, dones, infos, terms = zip(*steps, strict=True)
        for name, values in (item for told in terms for item in told.items()):
            total = self._terms.setdefault(name, [0.0, 0])
            total[0] += float(values.sum())
            total[1] += values.size
        return np.concatenate(observations), np.concatenate(rewards), np.concatenate(dones), [*chain(*infos)]

    def take_terms(self) -> dict[str, float]:
        """Return the mean of each reward term, unscaled, over its slots and the steps since the last call."""
        means = {name: total / count for name, (total, count) in self._terms.items()}
        self._terms.clear()
        return means

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the complete state of the vector between two rollouts as arrays by name; views, not copies."""
        return {f"{k}.{name}": array for k, group in enumerate(self._groups) for name, array in group.arrays().items()}

    def restore(self, saved: dict[str, npt.NDArray[Any]]) -> None:
        """Go back to the state of :meth:`arrays`; KeyError or ValueError if it is of other worlds."""
        for name, array in self.arrays().items():
            array[...] = saved[name]
        if any(array.tobytes() != saved[name].tobytes() for name, array in self.arrays().items()):
            raise ValueError("an opponent is not restored: its arrays() must return no copies")
        for batch in self.batches:  # which takes the arrays that were written to as running episodes
            batch.restore(Snapshot(batch.scenario, batch.arrays.copy()))

    def close(self) -> None:
        """Do nothing: worlds hold only memory."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each slot's batch; there is no ``render_mode``."""
        none = [None] * (attr_name == "render_mode")
        return [getattr(batch, attr_name, *none) for batch in self._batches_of(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the slots' batches."""
        for batch in self._batches_of(indices):
            setattr(batch, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method once for each batch; return its result for each slot."""
        owners = self._batches_of(indices)
        results = {batch: getattr(batch, method_name)(*method_args, **method_kwargs) for batch in dict.fromkeys(owners)}
        return [results[batch] for batch in owners]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Return ``True`` for SB3's ``Monitor``: an info tells of a whole episode when it ends."""
        return [wrapper_class is Monitor] * len(self._batches_of(indices))

    def _batches_of(self, indices: VecEnvIndices) -> list[Batch]:
        return [self._owners[slot] for slot in self._get_indices(indices)]


def _action_length(batches: Sequence[Batch]) -> int:
    """Return the length of the batches' actions; raise if they do not go together."""
    for batch in batches:
        if batch.autoreset != "disabled":
            raise ValueError(f"autoreset={batch.autoreset!r} hides last observations: make batches with 'disabled'")
        both = batch.observation_shape[1] == batch.scenario.num_agents
        if both and batch.scenario.target_motion == "agent":
            raise ValueError(f"the target of {batch.scenario.name!r} is an agent; one policy drives one side")
    lengths = {batch.action_shape[2] for batch in batches}
    if len(lengths) != 1:
        raise ValueError(f"batches must have actions of one length, these have {sorted(lengths)}")
    return lengths.pop()


class SlotGroup:
    """A batch of E worlds of N trackers as E x N slots; slot ``e * N + i`` is tracker i of world e.

    The state of the world is appended if ``seen`` has the scenarios of all groups (:class:`StateReader`).
    """

    def __init__(self, batch: Batch, encoding: Encoding, seen: Sequence[Scenario], safeguard: bool) -> None:
        self.batch = batch
        worlds, trackers = batch.num_worlds, batch.action_shape[1]
        if safeguard and trackers != batch.scenario.num_trackers:
            raise PolicyError("safeguard=True is for trackers, not for a target moved from outside: leave it out")
        if safeguard:
            check_room(batch.scenario)
        self.num_slots = worlds * trackers
        self._encoder = Encoder(encoding, batch.layout, worlds, trackers)
        self._state = StateReader(batch, seen) if seen else None
        self.size = encoding.size + (self._state.size if self._state else 0)
        # What makes the robots' actions of the model's, and the observations that it reads.
        self.guard = Guard(batch.layout, worlds) if safeguard else None
        self._seen = np.zeros(batch.observation_shape, np.float32)
        # Step at which a world's shortened first episode ends, (E,); -1 once it has ended.
        self._cut_at = np.full(worlds, _NEVER)
        # Rewards of the present episode so far, (E, N).
        self._returns = np.zeros((worlds, trackers))

    def reset(self, seed: int | None, options: dict[str, Any] | None = None, share: float = 1.0) -> FloatArray:
        """Start a shortened episode in every world; return the observations (slots, size).

        The e-th of E worlds ends at (e + ``share``) / E of the horizon: shares of several groups interleave their ends.
        """
        if isinstance(options, Mapping) and options.get("reset_mask") is not None:
            raise ValueError("reset_mask leaves episodes running, and slots all begin one: leave it out")
        raw = self.batch.reset(seed=seed, options=options)
        worlds, horizon = self.batch.num_worlds, self.batch.scenario.horizon
        self.restart(np.ones(worlds, np.bool_))
        self._seen = raw
        self._cut_at = np.maximum(1, ((np.arange(worlds) + share) * horizon / worlds).astype(np.int64))
        return self.encode(raw)

    def restart(self, mask: BoolArray) -> None:
        """Begin an episode in the worlds of a mask (E,)."""
        self._encoder.restart(mask)
        if self.guard is not None:
            self.guard.restart(mask)
        self._returns[mask] = 0
        self._cut_at[mask] = _NEVER

    def step(
        self, actions: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, list[dict[str, Any]], dict[str, FloatArray]]:
        """Step every world by valid actions (E, N, 2 + m).

        Returns observations, rewards, dones and infos, one row a slot, and the reward's terms.
        """
        batch = self.batch
        if self.guard is not None:
            actions = self.guard.actions(self._seen, actions)
        raw, reward, terminated, truncated, told = batch.step(actions)
        self._returns += reward
        over = terminated | truncated
        ended = over | (batch.arrays.world["step"] == self._cut_at)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_slots)]
        if ended.any():
            self._report(raw, ended, terminated, over, infos)
            raw = batch.reset(options={"reset_mask": ended})
            self.restart(ended)
        self._seen = raw
        terms = {name: told[f"reward/{name}"] for name in batch.term_names}
        return self.encode(raw), reward.reshape(-1), np.repeat(ended, batch.action_shape[1]), infos, terms

    def encode(self, raw: FloatArray, worlds: Any = ...) -> FloatArray:
        """Return the observations (slots, size) of all slots, or of those of some worlds; call it once a step."""
        rows = self._encoder.encode(raw[worlds], self.guard, worlds)
        return rows if self._state is None else np.hstack([rows, self._state.read(worlds)])

    def _report(
        self, raw: FloatArray, ended: BoolArray, terminated: BoolArray, over: BoolArray, infos: list[dict[str, Any]]
    ) -> None:
        """Fill the infos of worlds whose episodes ended; ``over``: not by shortening."""
        trackers, horizon = self.batch.action_shape[1], self.batch.scenario.horizon
        worlds = np.flatnonzero(ended)
        final = self.encode(raw, worlds)
        metrics = self.batch.metrics()
        steps = self.batch.arrays.world["step"]
        # A target's score is what it denies the team.
        denies = isinstance(self.batch, PairedBatch) and self.batch.outside == "target"
        for k, e in enumerate(worlds):
            whole = over[e] and (self._cut_at[e] == _NEVER or steps[e] == horizon)
            settled = bool(np.isfinite(metrics["settling_time"][e]))
            summary = {name: float(values[e]) for name, values in metrics.items()}
            score = 1 - summary["score"] if denies else summary["score"]
            for i in range(trackers):
                info = infos[e * trackers + i]
                # A copy: a view would keep the observations of all ended slots alive.
                info["terminal_observation"] = final[k * trackers + i].copy()
                info["TimeLimit.truncated"] = not terminated[e]
                if whole:
                    info["metrics"] = dict(summary)
                    info["is_success"] = settled
                    info["episode"] = {"r": float(self._returns[e, i]), "l": int(steps[e]), "score": score}

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return every array by name; views, not copies, without padding between fields."""
        own = {**self.batch.arrays.by_name(), **self._encoder.arrays()}
        own |= {"cut_at": self._cut_at, "returns": self._returns}
        if self.guard is not None:
            own |= {"seen": self._seen, **self.guard.arrays()}
        if isinstance(self.batch, PairedBatch):  # the memory of the policy inside
            inside: Any = self.batch.inside
            own |= {f"opponent.{name}": array for name, array in inside.arrays(self.batch.memory).items()}
        return own
