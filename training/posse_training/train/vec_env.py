"""Worlds as a stable-baselines3 vector environment of slots, one for each tracker of each world.

All trackers share one policy, so that E worlds of N trackers are E x N environments to a
single-agent learner. Slot ``e * N + i`` is tracker i of world e.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from posse import Batch, PairedBatch, Snapshot
from posse.numeric import BoolArray, FloatArray
from posse_baselines import Policy
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.learned.advice import MOTION, Advice, check_adviser
from posse_baselines.safeguard import Guard
from posse_training.train.world_state import StateWriter

_NEVER: Final = -1
_ALL: Final = slice(None)


class TeamVecEnv(VecEnv):
    """Batches of worlds as one vector of slots, worlds x trackers.

    Truncated slots are bootstrapped one call each, so episodes should not all end together: each
    world's *first* episode is shortened, the e-th of E worlds to (e + 1) / E of the horizon, which
    spreads all later ends evenly over time. A shortened episode is truncated and bootstrapped like
    any other, but reports neither return nor metrics.

    Every array returned is new and is never overwritten.

    Args:
        batches: Batches of worlds, made with ``autoreset="disabled"`` and equal ``message_size``;
            team sizes may differ.
        encoding: Which inputs are read from an observation.
        adviser: Policy whose proposals are appended to the observations, and corrected by the
            actions (2,) (:mod:`posse_baselines.learned.advice`).
        safeguard: Whether actions are wanted velocities, which the safeguard carries out
            (:mod:`posse_baselines.safeguard`); not with an adviser, which has one.
        see_state: Append the state of the world, for a centralized critic
            (:mod:`posse_training.train.world_state`).
        staggered: Shorten the first episodes.

    Attributes:
        action_length: Numbers of an action, 2 + m.
        size: Numbers of an observation.
        private_size: How many of them are the tracker's own; the rest is the state.

    Raises:
        ValueError: No batch, one that resets itself, a target that is an agent, batches whose actions differ in
            length, or a safeguard behind an adviser.
        PolicyError: An encoding that does not fit, or a policy that cannot be an adviser.
    """

    def __init__(
        self,
        batches: Sequence[Batch],
        encoding: Encoding,
        *,
        adviser: Policy | None = None,
        safeguard: bool = False,
        see_state: bool = False,
        staggered: bool = True,
    ) -> None:
        self.action_length = _action_length(batches, adviser, safeguard)
        self.encoding = encoding
        self.staggered = staggered
        scenarios = [batch.scenario for batch in batches]
        self._groups: list[_SlotGroup] = []
        slots = 0
        for batch in batches:
            state = StateWriter(batch, scenarios) if see_state else None
            group = _SlotGroup(batch, encoding, adviser, safeguard, state, slots)
            self._groups.append(group)
            slots = group.slots.stop
        self.private_size = self._groups[0].private_size
        self.size = self._groups[0].size
        super().__init__(
            slots,
            spaces.Box(-np.inf, np.inf, (self.size,), np.float32),
            spaces.Box(-1.0, 1.0, (self.action_length,), np.float32),
        )

    @property
    def batches(self) -> tuple[Batch, ...]:
        """The batches, in the order of their slots."""
        return tuple(group.batch for group in self._groups)

    def reset(self) -> FloatArray:
        """Start an episode in every world; return the observations (slots, size).

        A seed given by :meth:`seed` restarts the worlds from episode 0 of that seed; options given
        by :meth:`set_options` must be the same for all slots. Both are used once.
        """
        if any(options != self._options[0] for options in self._options):
            raise ValueError("slots of one world share its reset: give all slots equal options")
        observations = np.empty((self.num_envs, self.size), np.float32)
        for group in self._groups:
            out = observations[group.slots]
            group.reset(self._seeds[0], self._options[0], self.staggered, out)
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Take the actions (slots, 2 + m) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[FloatArray, FloatArray, BoolArray, list[dict[str, Any]]]:
        """Step every world; return observations, rewards, dones and infos, one row a slot.

        Where an episode ended, the observation is the first of the next episode, and the info holds
        ``terminal_observation`` (size,), ``TimeLimit.truncated``, and for whole episodes
        ``episode`` (return, length, score), ``metrics`` and ``is_success`` (the team settled).
        """
        observations = np.empty((self.num_envs, self.size), np.float32)
        rewards = np.empty(self.num_envs, np.float32)
        dones = np.zeros(self.num_envs, np.bool_)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for group in self._groups:
            s = group.slots
            mine = infos[s]
            group.step(self._actions[s], observations[s], rewards[s], dones[s], mine)
        return observations, rewards, dones, infos

    def take_terms(self) -> dict[str, float]:
        """Return each reward term per tracker, unscaled, summed over the steps since the last call.

        A term that some batches lack is averaged over the others.
        """
        sums: dict[str, tuple[float, int]] = {}
        for group in self._groups:
            count = group.slots.stop - group.slots.start
            for name, term in group.take_terms().items():
                total, slots = sums.get(name, (0.0, 0))
                sums[name] = total + count * term, slots + count
        return {name: total / slots for name, (total, slots) in sums.items()}

    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return the complete state of the vector as arrays by name."""
        return {name: np.array(array) for name, array in self._arrays().items()}

    def restore(self, saved: dict[str, npt.NDArray[Any]]) -> None:
        """Go back to the state of :meth:`save`.

        Raises:
            ValueError: The state is of other worlds. Nothing is changed.
        """
        mine = self._arrays()
        for name, array in mine.items():
            if name not in saved or saved[name].shape != array.shape:
                raise ValueError(
                    f"the saved worlds do not fit these: {name!r} is missing or not of shape {array.shape}"
                )
        for name, array in mine.items():
            array[...] = saved[name]
        for group in self._groups:
            group.resume()

    def _arrays(self) -> dict[str, npt.NDArray[Any]]:
        return {f"{k}.{name}": array for k, group in enumerate(self._groups) for name, array in group.arrays().items()}

    def close(self) -> None:
        """Do nothing: worlds hold only memory."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each slot's batch."""
        chosen = self._batches_of(indices)
        if attr_name == "render_mode":
            return [None] * len(chosen)
        return [getattr(batch, attr_name) for batch in chosen]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the slots' batches.

        Raises:
            AttributeError: A batch has no such attribute.
        """
        for batch in self._batches_of(indices):
            getattr(batch, attr_name)
            setattr(batch, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method once for each batch; return its result for each slot."""
        results: dict[int, Any] = {}
        for batch in self._batches_of(indices):
            if id(batch) not in results:
                results[id(batch)] = getattr(batch, method_name)(*method_args, **method_kwargs)
        return [results[id(batch)] for batch in self._batches_of(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return ``False`` for each slot."""
        return [False] * len(self._batches_of(indices))

    def _batches_of(self, indices: VecEnvIndices) -> list[Batch]:
        owners = [group.batch for group in self._groups for _ in range(group.slots.start, group.slots.stop)]
        return [owners[slot] for slot in self._get_indices(indices)]


def _action_length(batches: Sequence[Batch], adviser: Policy | None, safeguard: bool) -> int:
    """Return the length of an action; raise if the batches do not go together."""
    if not batches:
        raise ValueError("no batches given: a vector of slots needs at least one")
    for batch in batches:
        if batch.autoreset != "disabled":
            raise ValueError(
                f"a batch with autoreset={batch.autoreset!r} hides the last observation of an "
                'episode: make it with autoreset="disabled"'
            )
        both = batch.observation_shape[1] == batch.scenario.num_agents
        if both and batch.scenario.target_motion == "agent":
            raise ValueError(f"the target of {batch.scenario.name!r} is an agent; one policy drives one side")
    if adviser and safeguard:
        raise ValueError("an adviser safeguards by itself: leave out adviser or safeguard")
    lengths = {MOTION} if adviser else {batch.action_shape[2] for batch in batches}
    if len(lengths) > 1:
        raise ValueError(f"batches have actions of different lengths: {sorted(lengths)}")
    return lengths.pop()


class _SlotGroup:
    """A batch of E worlds of N trackers as E x N slots; slot ``e * N + i`` is tracker i of world e.

    The arguments are those of :class:`TeamVecEnv`; ``first`` is the number of the group's first slot.
    """

    def __init__(
        self,
        batch: Batch,
        encoding: Encoding,
        adviser: Policy | None,
        safeguard: bool,
        state: StateWriter | None,
        first: int,
    ) -> None:
        self.batch = batch
        worlds, trackers = batch.num_worlds, batch.action_shape[1]
        self.slots = slice(first, first + worlds * trackers)
        self._own_size = encoding.size
        self.private_size = encoding.size + check_adviser(adviser, believes=encoding.believes)
        self.size = self.private_size + (state.size if state else 0)
        self._encoder = Encoder(encoding, batch.layout)
        self._state = state
        # What makes the robots' actions of the model's.
        self._layer: Advice | Guard | None = Guard(batch.layout, worlds) if safeguard else None
        if adviser:
            self._layer = Advice(adviser, batch.layout, worlds, believes=encoding.believes)
        # Step at which a world's shortened first episode ends, (E,); -1 once it has ended.
        self._cut_at = np.full(worlds, _NEVER)
        # Rewards of the present episode so far, (E, N).
        self._returns = np.zeros((worlds, trackers))
        self._terms = np.zeros(len(batch.term_names))  # means over the trackers, summed over steps

    def reset(self, seed: int | None, options: Any, staggered: bool, out: FloatArray) -> None:
        """Start an episode in every world; write the observations (slots, size) to ``out``.

        ``staggered`` shortens the first episodes: the e-th of E worlds to (e + 1) / E of the
        horizon.
        """
        raw = self.batch.reset(seed=seed, options=options)
        worlds, horizon = self.batch.num_worlds, self.batch.scenario.horizon
        self._begin(raw, np.ones(worlds, np.bool_))
        if staggered:
            self._cut_at = np.maximum(1, (np.arange(worlds) + 1) * horizon // worlds)
        self._encode(raw, out)

    def _begin(self, raw: FloatArray, mask: BoolArray) -> None:
        """Begin an episode in the worlds of a mask (E,), whose first observations are among ``raw``."""
        if self._layer is not None:
            self._layer.restart(mask)
            self._layer.follow(raw, mask)
        self._returns[mask] = 0
        self._cut_at[mask] = _NEVER

    def step(
        self,
        actions: FloatArray,
        observations: FloatArray,
        rewards: FloatArray,
        dones: BoolArray,
        infos: list[dict[str, Any]],
    ) -> None:
        """Step every world by the actions (slots, 2 + m); fill the other arrays, one row a slot."""
        batch = self.batch
        actions = actions.reshape(*batch.action_shape[:2], -1)
        if self._layer is not None:
            actions = self._layer.actions(actions)
        raw, reward, terminated, truncated, told = batch.step(actions)
        self._returns += reward
        rewards[:] = reward.reshape(-1)
        self._terms += [float(told[f"reward/{name}"].mean()) for name in batch.term_names]
        over = terminated | truncated
        ended = over | (batch.worlds["step"] == self._cut_at)
        if self._layer is not None:
            self._layer.follow(raw)
        if ended.any():
            dones[:] = np.repeat(ended, batch.action_shape[1])
            self._report(raw, ended, terminated, over, infos)
            raw = batch.reset(options={"reset_mask": ended})
            self._begin(raw, ended)
        self._encode(raw, observations)

    def take_terms(self) -> dict[str, float]:
        """Return each reward term per tracker, summed over the steps since the last call."""
        terms = dict(zip(self.batch.term_names, self._terms.tolist(), strict=True))
        self._terms[:] = 0
        return terms

    def _encode(self, raw: FloatArray, out: FloatArray, worlds: Any = _ALL) -> None:
        """Write the observations of all slots, or of those of some worlds, to ``out``."""
        self._encoder.encode(raw[worlds], out[:, : self._own_size])
        if self._layer is not None:
            out[:, self._own_size : self.private_size] = self._layer.inputs[worlds].reshape(len(out), -1)
        if self._state is not None:
            self._state.write(out[:, self.private_size :], worlds)

    def _report(
        self, raw: FloatArray, ended: BoolArray, terminated: BoolArray, over: BoolArray, infos: list[dict[str, Any]]
    ) -> None:
        """Fill the infos of worlds whose episodes ended; ``over``: not by shortening."""
        trackers, horizon = self.batch.action_shape[1], self.batch.scenario.horizon
        worlds = np.flatnonzero(ended)
        final = np.empty((len(worlds) * trackers, self.size), np.float32)
        self._encode(raw, final, worlds)
        metrics = self.batch.metrics()
        steps = self.batch.worlds["step"]
        for k, e in enumerate(worlds):
            whole = over[e] and (self._cut_at[e] == _NEVER or steps[e] == horizon)
            settled = bool(np.isfinite(metrics["settling_time"][e]))
            summary = {name: float(values[e]) for name, values in metrics.items()}
            for i in range(trackers):
                info = infos[e * trackers + i]
                # A copy: a view would keep the observations of all ended slots alive.
                info["terminal_observation"] = final[k * trackers + i].copy()
                info["TimeLimit.truncated"] = not terminated[e]
                if whole:
                    info["metrics"] = dict(summary)
                    info["is_success"] = settled
                    info["episode"] = {
                        "r": float(self._returns[e, i]),
                        "l": int(steps[e]),
                        "score": _own_score(self.batch, summary["score"]),
                    }

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return every array by name; views, not copies, without padding between fields."""
        own = {"cut_at": self._cut_at, "returns": self._returns, "terms": self._terms}
        if self._layer is not None:
            kind = type(self._layer).__name__.lower()
            own |= {f"{kind}.{name}": array for name, array in self._layer.arrays().items()}
        return {**self.batch.arrays.by_name(), **_arrays_inside(self.batch), **own}

    def resume(self) -> None:
        """Have the batch take its arrays, which were written to, as running episodes."""
        self.batch.restore(Snapshot(self.batch.scenario, self.batch.arrays.copy()))


def _arrays_inside(batch: Batch) -> dict[str, npt.NDArray[Any]]:
    """Return the memory of the policy inside as arrays by name; views, not copies."""
    if not isinstance(batch, PairedBatch):
        return {}
    memory: dict[str, npt.NDArray[Any]] = batch.inside.arrays(batch.memory)  # type: ignore[attr-defined]
    return {f"opponent.{name}": array for name, array in memory.items()}


def _own_score(batch: Batch, score: float) -> float:
    """Return the score of the side that learns: a target's is what it denies the team."""
    return 1 - score if isinstance(batch, PairedBatch) and batch.outside == "target" else score
