"""Learned policies: a network, its encoding, and a card that says where it comes from."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import MOST_THREADS, BoolArray, FloatArray, OwnArrays, over_worlds
from posse_baselines.learned.advice import MOTION, Adviser, Advising, check_adviser
from posse_baselines.learned.card import check_card, side_of
from posse_baselines.learned.encoder import Encoder
from posse_baselines.learned.encoding import Encoding
from posse_baselines.learned.features import SCRATCH
from posse_baselines.learned.forward import act
from posse_baselines.learned.network import Network
from posse_baselines.learned.policy_file import read_policy_file, write_policy_file
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import Annotations, BasePolicy, Memory, PolicyError, check_observations, message_size_of
from posse_baselines.safeguard import Guard

FORMAT: Final = 1
"""Version of the policy file's format."""


@dataclass
class _Memory(OwnArrays):
    """What a learned policy remembers of its worlds; changed in place."""

    layout: ObservationLayout
    num_worlds: int
    robots: int
    encoder: Encoder
    adviser: Memory
    guard: Guard | None


class LearnedPolicy(OwnArrays, BasePolicy):
    """A learned policy, played from plain numbers.

    Args:
        network: Computes the actions.
        encoding: The network's inputs.
        card: Describes the policy: ``name``, ``trained_splits``, and anything else on record.
        adviser: Scripted policy whose proposals the network refines, if any
            (:mod:`posse_baselines.learned.advice`).
        correction: What the network's output corrects: ``"motion"`` or ``"velocity"``.
        safeguard: Whether its actions are wanted velocities, which the safeguard carries out
            (:mod:`posse_baselines.safeguard`).

    Attributes:
        trained_splits: Splits whose worlds it was trained on; evaluations refuse them.
        side: What it moves, ``"trackers"`` or ``"target"``.

    Raises:
        PolicyError: Network and encoding do not fit each other, or an invalid card.
    """

    def __init__(
        self,
        network: Network,
        encoding: Encoding,
        card: Mapping[str, Any],
        adviser: Adviser | None = None,
        correction: str = "motion",
        safeguard: bool = False,
    ) -> None:
        network.check()
        if adviser is None and encoding.believes:
            raise PolicyError("a policy that reads an adviser's belief needs an adviser")
        self._advising = None if adviser is None else Advising(adviser, correction, believes=encoding.believes)
        size = encoding.size + (0 if self._advising is None else self._advising.inputs)
        if network.inputs != size:
            raise PolicyError(f"the network takes {network.inputs} numbers, its encoding gives {size}")
        if network.outputs < MOTION:
            raise PolicyError(f"the network gives {network.outputs} numbers, an action has {MOTION} or more")
        self.network = network
        self.encoding = encoding
        self._set_card(card)
        self.message_size = max(network.outputs - MOTION, encoding.message_size)
        self.adviser = adviser
        self.safeguard = safeguard
        if adviser is not None:
            if network.outputs != MOTION:
                raise PolicyError(
                    f"a network with an adviser gives {MOTION} numbers, this one gives "
                    f"{network.outputs}: the adviser sends the messages"
                )
            self.message_size = max(self.message_size, adviser.message_size)
        self._numbers = network.flat()

    def _set_card(self, card: Mapping[str, Any]) -> None:
        self.name, self.trained_splits = check_card(card)
        self.side = side_of(card)
        self.card = dict(card)

    def with_card(self, card: Mapping[str, Any]) -> LearnedPolicy:
        """Return the same policy with another card.

        Raises:
            PolicyError: An invalid card.
        """
        other = copy.copy(self)
        other._set_card(card)
        return other

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` worlds: the adviser's.

        Raises:
            PolicyError: The layout lacks a field that the network reads, or has another size of it.
        """
        super().begin(layout, num_worlds)
        encoder = Encoder(self.encoding, layout)
        robots = 1 if self.side == "target" else layout.scenario.num_trackers
        adviser_memory = None if self.adviser is None else self.adviser.begin(layout, num_worlds)
        guard = Guard(layout, num_worlds) if self.safeguard else None
        return _Memory(layout, num_worlds, robots, encoder, adviser_memory, guard)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the most likely actions (E, N, 2 + m) for observations (E, N, F).

        One that moves the target takes (E, 1, F).
        """
        m: _Memory = memory
        observations = check_observations(self, observations, m.num_worlds, m.layout, m.robots)
        length = MOTION + message_size_of(m.layout)
        actions = np.empty((m.num_worlds, m.robots, length), np.float32)
        scratch = np.empty((MOST_THREADS, SCRATCH + 2 * self.network.widest), np.float32)
        proposals = inputs = actions[..., :0]
        if self._advising is not None:
            proposals, inputs, m.adviser = self._advising.ask(observations, m.adviser)
        over_worlds(
            act,
            (observations, *m.encoder.tables, np.ascontiguousarray(inputs), *self._numbers, scratch, actions),
            m.num_worlds,
            m.robots,
        )
        if self._advising is not None:
            actions, m.adviser = self._advising.answer(observations, proposals, actions[..., :MOTION], m.adviser)
        if m.guard is not None:
            m.guard.follow(observations)
            actions = m.guard.actions(actions)
        return actions, m

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with adviser and safeguard restarted in the worlds of a mask (E,)."""
        m: _Memory = memory
        if m.guard is not None:
            m.guard.restart(mask)
        if self.adviser is not None:
            m.adviser = self.adviser.restart(m.adviser, mask)
        return m

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the memory of adviser or safeguard as arrays by name; views, not copies."""
        if memory.guard is not None:
            found: dict[str, npt.NDArray[Any]] = memory.guard.arrays()
            return found
        return {} if self.adviser is None else self.adviser.arrays(memory.adviser)

    def annotations(self, memory: Memory) -> Annotations:
        """Return the adviser's annotations."""
        return {} if self.adviser is None else self.adviser.annotations(memory.adviser)

    def save(self, path: Path) -> None:
        """Write the policy and its card as one file, which replaces an old one atomically.

        Raises:
            OSError: It could not be written; an old file of that name is unchanged.
        """
        description = {
            "format": FORMAT,
            "limit": self.network.limit,
            "activation": self.network.activation,
            "output": self.network.output,
            "encoding": self.encoding.to_dict(),
            "card": self.card,
            "adviser": None if self.adviser is None else self.adviser.name,
            "correction": "motion" if self._advising is None else self._advising.correction,
            "safeguard": self.safeguard,
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        write_policy_file(path, self.network.tensors(), description)

    @classmethod
    def from_file(cls, path: str | Path) -> LearnedPolicy:
        """Return the policy of a file.

        Raises:
            PolicyError: There is no such file, or it is damaged, truncated, or not a policy file.
        """
        path = Path(path)
        tensors, description = read_policy_file(path)
        try:
            return cls._from_parts(tensors, description)
        except PolicyError as error:
            raise PolicyError(f"{path}: {error}") from error
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise PolicyError(f"{path} is damaged: {error!r:.200}") from error

    @classmethod
    def _from_parts(cls, tensors: Mapping[str, FloatArray], description: Mapping[str, Any]) -> LearnedPolicy:
        if description["format"] != FORMAT:
            raise PolicyError(
                f"its format is {description['format']!r:.80}, this version reads {FORMAT}: "
                "install the version that wrote it"
            )
        count = sum(name.endswith(".weight") for name in tensors)
        network = Network(
            mean=tensors["normaliser.mean"],
            scale=tensors["normaliser.scale"],
            limit=float(description["limit"]),
            weights=tuple(tensors[f"layers.{k}.weight"] for k in range(count)),
            biases=tuple(tensors[f"layers.{k}.bias"] for k in range(count)),
            activation=str(description["activation"]),
            output=str(description["output"]),
        )
        encoding = Encoding.from_dict(description["encoding"])
        return cls(
            network,
            encoding,
            description["card"],
            _adviser(description["adviser"]),
            str(description["correction"]),
            bool(description.get("safeguard", False)),
        )


def _adviser(name: str | None) -> Adviser | None:
    """Return a scripted policy of this package as adviser; a file never names other code."""
    if name is None:
        return None
    if name not in SCRIPTED:
        raise PolicyError(
            f"its adviser {name!r:.80} is none of {', '.join(SCRIPTED)}: install the version that wrote it"
        )
    return check_adviser(name, SCRIPTED[name]())
