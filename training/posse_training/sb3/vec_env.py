"""Worlds as stable-baselines3 sees them: a vector of slots, one for each tracker of each world.

All trackers share one policy, so that to a single-agent learner a batch of E worlds of N trackers
is a vector of E x N environments. Slot ``e * N + i`` is tracker i of world e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from posse import Batch
from posse.numeric import BoolArray, FloatArray
from posse_baselines.learned.advice import MOTION, Advice, Adviser, advised
from posse_baselines.learned import Encoder, Encoding
from posse_training.sb3.world_state import StateWriter

_NEVER: Final = -1
_ALL: Final = slice(None)


@dataclass
class _Part:
    """One batch and its share of the slots."""

    batch: Batch
    encoder: Encoder
    state: StateWriter | None
    advice: Advice | None
    slots: slice
    cut_at: npt.NDArray[np.int64]
    """Step at which a world's shortened first episode ends, (E,); -1 once it is over."""
    returns: npt.NDArray[np.float64]
    """Rewards of the present episode so far, (E, N)."""


class TeamVecEnv(VecEnv):
    """Batches of worlds as one vector of slots, worlds x trackers.

    Episodes end together unless something keeps them apart, and the learner bootstraps each
    truncated slot by a call of its own: so each world's *first* episode is shortened, the e-th of E
    worlds to (e + 1) / E of the horizon, and from then on ends are spread evenly over time. A
    shortened episode ends by truncation like any other, and is bootstrapped; being no whole
    episode, it reports no return and no metrics.

    What stable-baselines3 keeps is never overwritten: every array returned is a new one.

    Args:
        batches: Batches of worlds, made with ``autoreset="disabled"`` and with equal
            ``message_size``; their team sizes may differ.
        encoding: What of an observation the policy is given.
        adviser: A scripted policy whose proposals are appended to the observations, and which the
            actions (2,) are added to (:mod:`posse_baselines.learned.advice`).
        see_state: Append the state of the world, for a centralized critic
            (:mod:`posse_training.sb3.world_state`).
        staggered: Shorten the first episodes.

    Raises:
        ValueError: No batch, one that resets itself, targets that are agents, or batches whose
            actions differ in length.
        PolicyError: An encoding that does not fit.
    """

    def __init__(
        self,
        batches: Sequence[Batch],
        encoding: Encoding,
        *,
        adviser: Adviser | None = None,
        see_state: bool = False,
        staggered: bool = True,
    ) -> None:
        if not batches:
            raise ValueError("a vector of slots needs at least one batch of worlds")
        for batch in batches:
            if batch.autoreset != "disabled":
                raise ValueError(
                    f"a batch with autoreset={batch.autoreset!r} hides the last observation of an "
                    'episode: make it with autoreset="disabled"'
                )
            if batch.scenario.num_agents != batch.scenario.num_trackers:
                raise ValueError(
                    f"the target of {batch.scenario.name!r} is an agent; one policy drives trackers"
                )
        lengths = {MOTION} if adviser else {batch.action_shape[2] for batch in batches}
        if len(lengths) > 1:
            raise ValueError(f"batches have actions of different lengths: {sorted(lengths)}")
        self.encoding = encoding
        self.staggered = staggered
        self._parts: list[_Part] = []
        slots = 0
        places = max(batch.scenario.num_trackers for batch in batches)
        obstacles = max(batch.scenario.num_obstacles for batch in batches)
        for batch in batches:
            count = batch.num_worlds * batch.scenario.num_trackers
            self._parts.append(
                _Part(
                    batch,
                    Encoder(encoding, batch.layout),
                    StateWriter(batch, places, obstacles) if see_state else None,
                    Advice(adviser, batch) if adviser else None,
                    slice(slots, slots + count),
                    np.full(batch.num_worlds, _NEVER),
                    np.zeros((batch.num_worlds, batch.scenario.num_trackers)),
                )
            )
            slots += count
        state = self._parts[0].state
        self.private_size = encoding.size + (MOTION if adviser else 0)
        """Numbers of an observation that are the tracker's own; the rest is the world's state."""
        self._size = self.private_size + (state.size if state else 0)
        self._actions = np.zeros((slots, *lengths), np.float32)
        super().__init__(
            slots,
            spaces.Box(-np.inf, np.inf, (self._size,), np.float32),
            spaces.Box(-1.0, 1.0, tuple(lengths), np.float32),
        )

    @property
    def observation_size(self) -> int:
        """Numbers in an observation, the world's state included where it is appended."""
        return self._size

    @property
    def action_shape(self) -> tuple[int, ...]:
        """Shape of one slot's action, (2 + m,)."""
        return self._actions.shape[1:]

    @property
    def batches(self) -> tuple[Batch, ...]:
        """The batches, in the order of their slots."""
        return tuple(part.batch for part in self._parts)

    def reset(self) -> FloatArray:
        """Start an episode in every world; return the observations (slots, size).

        A seed given by :meth:`seed` starts the worlds over from episode 0 of that seed; options
        given by :meth:`set_options` must be the same for all slots. Both are used once.
        """
        if any(options != self._options[0] for options in self._options):
            raise ValueError("slots of one world share its reset: give all slots equal options")
        seed, options = self._seeds[0], self._options[0]
        observations = np.empty((self.num_envs, self._size), np.float32)
        for part in self._parts:
            raw = part.batch.reset(seed=seed, options=options)
            part.returns[:] = 0
            if self.staggered:
                worlds, horizon = part.batch.num_worlds, part.batch.scenario.horizon
                part.cut_at = np.maximum(1, (np.arange(worlds) + 1) * horizon // worlds)
            if part.advice is not None:
                part.advice.restart(raw, np.ones(part.batch.num_worlds, np.bool_))
            self._encode(part, raw, observations[part.slots])
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Take the actions (slots, 2 + m) of the next step."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[FloatArray, FloatArray, BoolArray, list[dict[str, Any]]]:
        """Step every world; return observations, rewards, dones and infos, one of each a slot.

        Where an episode ended, the observation is the first of the next episode, and the info holds
        ``terminal_observation`` (size,), ``TimeLimit.truncated``, and for whole episodes
        ``episode`` (return, length, score) and ``metrics``.
        """
        observations = np.empty((self.num_envs, self._size), np.float32)
        rewards = np.empty(self.num_envs, np.float32)
        dones = np.zeros(self.num_envs, np.bool_)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for part in self._parts:
            batch, slots = part.batch, part.slots
            actions = self._actions[slots].reshape(*batch.action_shape[:2], -1)
            if part.advice is not None:
                actions = advised(part.advice.proposals, actions)
            raw, reward, terminated, truncated, _ = batch.step(actions)
            rewards[slots] = reward.reshape(-1)
            part.returns += reward
            cut = batch.worlds["step"] == part.cut_at
            over = terminated | truncated
            ended = over | cut
            if part.advice is not None:
                part.advice.follow(raw)
            if ended.any():
                dones[slots] = np.repeat(ended, batch.scenario.num_trackers)
                self._report(part, raw, ended, terminated, over, infos)
                raw = batch.reset(options={"reset_mask": ended})
                if part.advice is not None:
                    part.advice.restart(raw, ended)
                part.returns[ended] = 0
                part.cut_at[ended] = _NEVER
            self._encode(part, raw, observations[slots])
        return observations, rewards, dones, infos

    def _encode(self, part: _Part, raw: FloatArray, out: FloatArray, worlds: Any = _ALL) -> None:
        """Write the observations of all slots, or of those of some worlds, to ``out``."""
        part.encoder.encode(raw[worlds], out[:, : self.encoding.size])
        if part.advice is not None:
            proposals = part.advice.proposals[worlds, :, :MOTION].reshape(-1, MOTION)
            out[:, self.encoding.size : self.private_size] = proposals
        if part.state is not None:
            part.state.write(out[:, self.private_size :], worlds)

    def _report(
        self,
        part: _Part,
        raw: FloatArray,
        ended: BoolArray,
        terminated: BoolArray,
        over: BoolArray,
        infos: list[dict[str, Any]],
    ) -> None:
        """Fill the infos of worlds whose episodes ended; ``over``: not by shortening."""
        trackers = part.batch.scenario.num_trackers
        worlds = np.flatnonzero(ended)
        final = np.empty((len(worlds) * trackers, self._size), np.float32)
        self._encode(part, raw, final, worlds)
        metrics = part.batch.metrics()
        steps = part.batch.worlds["step"]
        for k, e in enumerate(worlds):
            whole = over[e] and (
                part.cut_at[e] == _NEVER or steps[e] == part.batch.scenario.horizon
            )
            summary = {name: float(values[e]) for name, values in metrics.items()}
            for i in range(trackers):
                info = infos[part.slots.start + e * trackers + i]
                # A copy: a view would keep those of all slots that ended alive.
                info["terminal_observation"] = final[k * trackers + i].copy()
                info["TimeLimit.truncated"] = not terminated[e]
                if whole:
                    info["metrics"] = dict(summary)
                    info["episode"] = {
                        "r": float(part.returns[e, i]),
                        "l": int(steps[e]),
                        "score": summary["score"],
                    }

    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that the vector would need to go on from here, as plain arrays by name."""
        return {
            f"{k}.{name}": np.array(array)
            for k, part in enumerate(self._parts)
            for name, array in self._arrays(part).items()
        }

    def restore(self, saved: dict[str, npt.NDArray[Any]]) -> None:
        """Go back to where :meth:`save` was called.

        Raises:
            ValueError: What was saved is of other worlds. Nothing is changed.
        """
        mine = {
            f"{k}.{name}": array
            for k, part in enumerate(self._parts)
            for name, array in self._arrays(part).items()
        }
        for name, array in mine.items():
            if name not in saved or saved[name].shape != array.shape:
                raise ValueError(
                    f"the worlds saved do not fit these: {name!r} is missing or of "
                    f"another shape than {array.shape}"
                )
        for name, array in mine.items():
            array[...] = saved[name]
        for part in self._parts:
            # The batch has its arrays already; this has it take them as running episodes.
            part.batch.restore(part.batch.save())

    @staticmethod
    def _arrays(part: _Part) -> dict[str, npt.NDArray[Any]]:
        """Return every array of a part by name; fields alone, without the padding between them."""
        own = {"cut_at": part.cut_at, "returns": part.returns}
        thoughts = part.advice.arrays() if part.advice is not None else {}
        advice = {f"advice.{name}": array for name, array in thoughts.items()}
        return {**part.batch.arrays.by_name(), **advice, **own}

    def close(self) -> None:
        """Do nothing: worlds hold nothing but memory."""

    def get_images(self) -> Sequence[npt.NDArray[Any] | None]:
        """Return no pictures: :mod:`posse.rendering.renderer` draws batches."""
        return [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the batch that each slot belongs to."""
        chosen = self._batches_of(indices)
        if attr_name == "render_mode":
            return [None] * len(chosen)
        return [getattr(batch, attr_name) for batch in chosen]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the batches that the slots belong to.

        Raises:
            AttributeError: A batch has no such attribute.
        """
        for batch in self._batches_of(indices):
            getattr(batch, attr_name)
            setattr(batch, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of the batches, once for each batch; return its result for each slot."""
        results: dict[int, Any] = {}
        for batch in self._batches_of(indices):
            if id(batch) not in results:
                results[id(batch)] = getattr(batch, method_name)(*method_args, **method_kwargs)
        return [results[id(batch)] for batch in self._batches_of(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Say that no slot is wrapped."""
        return [False] * len(self._batches_of(indices))

    def _batches_of(self, indices: VecEnvIndices) -> list[Batch]:
        owners = [
            part.batch for part in self._parts for _ in range(part.slots.start, part.slots.stop)
        ]
        return [owners[slot] for slot in self._get_indices(indices)]
