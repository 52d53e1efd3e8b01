"""One batch of worlds as a group of slots, one slot for each tracker of each world."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, Snapshot
from posse.numeric import BoolArray, FloatArray
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.learned.advice import Advice, Advising
from posse_training.sb3.opponents import arrays_inside, own_score
from posse_training.sb3.world_state import StateWriter

_NEVER: Final = -1
_ALL: Final = slice(None)


class SlotGroup:
    """A batch of E worlds of N trackers as E x N slots; slot ``e * N + i`` is tracker i of world e.

    Args:
        batch: The worlds.
        encoding: Which inputs are read from an observation.
        advising: Adviser whose proposals are appended to the observations, if any.
        state: Writes the state of the world behind them, if given.
        first: Number of the group's first slot.

    Attributes:
        slots: The group's slots among those of all groups.
        private_size: Numbers of an observation that are the tracker's own.
        size: Numbers of an observation, the state included.
        contact_cost: Subtracted from a tracker's reward for each contact that it makes.
    """

    def __init__(
        self, batch: Batch, encoding: Encoding, advising: Advising | None, state: StateWriter | None, first: int
    ) -> None:
        self.batch = batch
        worlds, trackers = batch.num_worlds, batch.action_shape[1]
        self.slots = slice(first, first + worlds * trackers)
        self._own_size = encoding.size
        self.private_size = encoding.size + (advising.inputs if advising else 0)
        self.size = self.private_size + (state.size if state else 0)
        self._encoder = Encoder(encoding, batch.layout)
        self._state = state
        self._advice = Advice(advising, batch) if advising else None
        # Step at which a world's shortened first episode ends, (E,); -1 once it has ended.
        self._cut_at = np.full(worlds, _NEVER)
        # Rewards of the present episode so far, (E, N), without the cost of contacts.
        self._returns = np.zeros((worlds, trackers))
        self.contact_cost = 0.0
        self._touched = np.zeros(worlds, np.bool_)  # whether the present episode had a contact
        self._counted = np.zeros(2, np.int64)  # first contacts, and steps of worlds
        self._terms = np.zeros(len(batch.term_names))  # means over the trackers, summed over steps

    def reset(self, seed: int | None, options: Any, staggered: bool, out: FloatArray) -> None:
        """Start an episode in every world; write the observations (slots, size) to ``out``.

        ``staggered`` shortens the first episodes: the e-th of E worlds to (e + 1) / E of the
        horizon.
        """
        raw = self.batch.reset(seed=seed, options=options)
        self._returns[:] = 0
        self._touched[:] = False
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
            actions = self._advice.actions(actions)
        raw, reward, terminated, truncated, told = batch.step(actions)
        self._returns += reward
        contacts = told["reward/contact"]
        rewards[:] = (reward - np.float32(self.contact_cost) * contacts).reshape(-1)
        self._count(contacts)
        self._terms += [float(told[f"reward/{name}"].mean()) for name in batch.term_names]
        over = terminated | truncated
        ended = over | (batch.worlds["step"] == self._cut_at)
        if self._advice is not None:
            self._advice.follow(raw)
        if ended.any():
            dones[:] = np.repeat(ended, batch.action_shape[1])
            self._report(raw, ended, terminated, over, infos)
            raw = batch.reset(options={"reset_mask": ended})
            if self._advice is not None:
                self._advice.restart(raw, ended)
            self._returns[ended] = 0
            self._touched[ended] = False
            self._cut_at[ended] = _NEVER
        self._encode(raw, observations)

    def _count(self, contacts: FloatArray) -> None:
        """Count the worlds whose episode has its first contact in this step."""
        touching = np.asarray((contacts > 0).any(axis=1))
        self._counted += np.array([np.sum(touching & ~self._touched), len(touching)])
        self._touched |= touching

    def take_contacts(self) -> tuple[int, float]:
        """Return how many episodes had their first contact since the last call.

        And how many whole episodes the steps since then amount to.
        """
        first, steps = (int(number) for number in self._counted)
        self._counted[:] = 0
        return first, steps / self.batch.scenario.horizon

    def take_terms(self) -> tuple[dict[str, float], float]:
        """Return each reward term per tracker and step, summed over the steps since the last call.

        And the number of trackers, by which groups are weighted.
        """
        terms = dict(zip(self.batch.term_names, self._terms.tolist(), strict=True))
        self._terms[:] = 0
        return terms, float(self.slots.stop - self.slots.start)

    def _encode(self, raw: FloatArray, out: FloatArray, worlds: Any = _ALL) -> None:
        """Write the observations of all slots, or of those of some worlds, to ``out``."""
        self._encoder.encode(raw[worlds], out[:, : self._own_size])
        if self._advice is not None:
            further = self._advice.inputs[worlds]
            out[:, self._own_size : self.private_size] = further.reshape(-1, further.shape[-1])
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
                        "score": own_score(self.batch, summary["score"]),
                    }

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return every array by name; views, not copies, without padding between fields."""
        own = {
            "cut_at": self._cut_at,
            "returns": self._returns,
            "touched": self._touched,
            "counted": self._counted,
            "terms": self._terms,
        }
        memory = self._advice.arrays() if self._advice is not None else {}
        advice = {f"advice.{name}": array for name, array in memory.items()}
        return {**self.batch.arrays.by_name(), **arrays_inside(self.batch), **advice, **own}

    def resume(self) -> None:
        """Have the batch take its arrays, which were written to, as running episodes."""
        self.batch.restore(Snapshot(self.batch.scenario, self.batch.arrays.copy()))
