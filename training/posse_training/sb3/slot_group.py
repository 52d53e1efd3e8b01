"""One batch of worlds as a group of slots, one slot for each tracker of each world."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, Snapshot
from posse.numeric import BoolArray, FloatArray
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.learned.advice import MOTION, Advice, Adviser, advised
from posse_training.sb3.world_state import StateWriter

_NEVER: Final = -1
_ALL: Final = slice(None)


class SlotGroup:
    """A batch of E worlds of N trackers as E x N slots; slot ``e * N + i`` is tracker i of world e.

    Args:
        batch: The worlds.
        encoding: Which inputs are read from an observation.
        adviser: Scripted policy whose proposals are appended to the observations, if any.
        state: Writes the state of the world behind them, if given.
        first: Number of the group's first slot.

    Attributes:
        slots: The group's slots among those of all groups.
        private_size: Numbers of an observation that are the tracker's own.
        size: Numbers of an observation, the state included.
    """

    def __init__(
        self,
        batch: Batch,
        encoding: Encoding,
        adviser: Adviser | None,
        state: StateWriter | None,
        first: int,
    ) -> None:
        self.batch = batch
        worlds, trackers = batch.num_worlds, batch.scenario.num_trackers
        self.slots = slice(first, first + worlds * trackers)
        self._own_size = encoding.size
        self.private_size = encoding.size + (MOTION if adviser else 0)
        self.size = self.private_size + (state.size if state else 0)
        self._encoder = Encoder(encoding, batch.layout)
        self._state = state
        self._advice = Advice(adviser, batch) if adviser else None
        # Step at which a world's shortened first episode ends, (E,); -1 once it has ended.
        self._cut_at = np.full(worlds, _NEVER)
        # Rewards of the present episode so far, (E, N).
        self._returns = np.zeros((worlds, trackers))

    def reset(self, seed: int | None, options: Any, staggered: bool, out: FloatArray) -> None:
        """Start an episode in every world; write the observations (slots, size) to ``out``.

        ``staggered`` shortens the first episodes: the e-th of E worlds to (e + 1) / E of the
        horizon.
        """
        raw = self.batch.reset(seed=seed, options=options)
        self._returns[:] = 0
        if staggered:
            worlds, horizon = self.batch.num_worlds, self.batch.scenario.horizon
            self._cut_at = np.maximum(1, (np.arange(worlds) + 1) * horizon // worlds)
        if self._advice is not None:
            self._advice.restart(raw, np.ones(self.batch.num_worlds, np.bool_))
        self._encode(raw, out)

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
        if self._advice is not None:
            actions = advised(self._advice.proposals, actions)
        raw, reward, terminated, truncated, _ = batch.step(actions)
        rewards[:] = reward.reshape(-1)
        self._returns += reward
        over = terminated | truncated
        ended = over | (batch.worlds["step"] == self._cut_at)
        if self._advice is not None:
            self._advice.follow(raw)
        if ended.any():
            dones[:] = np.repeat(ended, batch.scenario.num_trackers)
            self._report(raw, ended, terminated, over, infos)
            raw = batch.reset(options={"reset_mask": ended})
            if self._advice is not None:
                self._advice.restart(raw, ended)
            self._returns[ended] = 0
            self._cut_at[ended] = _NEVER
        self._encode(raw, observations)

    def _encode(self, raw: FloatArray, out: FloatArray, worlds: Any = _ALL) -> None:
        """Write the observations of all slots, or of those of some worlds, to ``out``."""
        self._encoder.encode(raw[worlds], out[:, : self._own_size])
        if self._advice is not None:
            proposals = self._advice.proposals[worlds, :, :MOTION].reshape(-1, MOTION)
            out[:, self._own_size : self.private_size] = proposals
        if self._state is not None:
            self._state.write(out[:, self.private_size :], worlds)

    def _report(
        self,
        raw: FloatArray,
        ended: BoolArray,
        terminated: BoolArray,
        over: BoolArray,
        infos: list[dict[str, Any]],
    ) -> None:
        """Fill the infos of worlds whose episodes ended; ``over``: not by shortening."""
        trackers, horizon = self.batch.scenario.num_trackers, self.batch.scenario.horizon
        worlds = np.flatnonzero(ended)
        final = np.empty((len(worlds) * trackers, self.size), np.float32)
        self._encode(raw, final, worlds)
        metrics = self.batch.metrics()
        steps = self.batch.worlds["step"]
        for k, e in enumerate(worlds):
            whole = over[e] and (self._cut_at[e] == _NEVER or steps[e] == horizon)
            summary = {name: float(values[e]) for name, values in metrics.items()}
            for i in range(trackers):
                info = infos[e * trackers + i]
                # A copy: a view would keep the observations of all ended slots alive.
                info["terminal_observation"] = final[k * trackers + i].copy()
                info["TimeLimit.truncated"] = not terminated[e]
                if whole:
                    info["metrics"] = dict(summary)
                    info["episode"] = {
                        "r": float(self._returns[e, i]),
                        "l": int(steps[e]),
                        "score": summary["score"],
                    }

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return every array by name; views, not copies, without padding between fields."""
        own = {"cut_at": self._cut_at, "returns": self._returns}
        memory = self._advice.arrays() if self._advice is not None else {}
        advice = {f"advice.{name}": array for name, array in memory.items()}
        return {**self.batch.arrays.by_name(), **advice, **own}

    def resume(self) -> None:
        """Have the batch take its arrays, which were written to, as running episodes."""
        self.batch.restore(Snapshot(self.batch.scenario, self.batch.arrays.copy()))
