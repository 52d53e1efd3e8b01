"""Learned policies: a network, its encoding, and a card that says where it comes from."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse import ObservationLayout
from posse.numeric import MOST_THREADS, BoolArray, FloatArray, OwnArrays, over_worlds
from posse_baselines.learned.advice import MOTION, Adviser, Advising, check_adviser
from posse_baselines.learned.card import check_card
from posse_baselines.learned.encoder import Encoder
from posse_baselines.learned.encoding import Encoding
from posse_baselines.learned.features import SCRATCH
from posse_baselines.learned.forward import act
from posse_baselines.learned.network import Network
from posse_baselines.learned.policy_file import (
    read_policy_file,
    write_atomically,
    write_policy_file,
)
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import (
    Annotations,
    BasePolicy,
    Memory,
    PolicyError,
    check_observations,
    message_size_of,
)

FORMATS: Final = (1, 2)
"""Formats of policy files. 2: with a correction, or a belief, that format 1 does not know."""


class LearnedPolicy(OwnArrays, BasePolicy):
    """A learned policy, played from plain numbers.

    Args:
        network: Computes the actions.
        encoding: The network's inputs.
        card: Describes the policy: ``name``, ``trained_splits``, and anything else on record.
        adviser: Scripted policy whose proposals the network refines, if any
            (:mod:`posse_baselines.learned.advice`).
        correction: What the network's output corrects: ``"motion"`` or ``"velocity"``.

    Attributes:
        trained_splits: Splits whose worlds it was trained on; evaluations refuse them.

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
    ) -> None:
        network.check()
        if adviser is None and encoding.believes:
            raise PolicyError("a policy that reads an adviser's belief needs an adviser")
        self._advising = (
            None if adviser is None else Advising(adviser, correction, believes=encoding.believes)
        )
        size = encoding.size + (0 if self._advising is None else self._advising.inputs)
        if network.sizes[0] != size:
            raise PolicyError(
                f"the network takes {network.sizes[0]} numbers, its encoding gives {size}"
            )
        if network.sizes[-1] < MOTION:
            raise PolicyError(
                f"the network gives {network.sizes[-1]} numbers, an action has {MOTION} or more"
            )
        self.network = network
        self.encoding = encoding
        self._set_card(card)
        self.message_size = max(network.sizes[-1] - MOTION, encoding.message_size)
        self.adviser = adviser
        if adviser is not None:
            if network.sizes[-1] != MOTION:
                raise PolicyError(
                    f"a network with an adviser gives {MOTION} numbers, this one gives "
                    f"{network.sizes[-1]}: the adviser sends the messages"
                )
            self.message_size = max(self.message_size, adviser.message_size)
        self._numbers = network.flat()

    def _set_card(self, card: Mapping[str, Any]) -> None:
        self.name, self.trained_splits = check_card(card)
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
        """Return the memory of ``num_worlds`` worlds.

        Raises:
            PolicyError: The layout lacks a field that the network reads, or has another size of it.
        """
        super().begin(layout, num_worlds)
        encoder = Encoder(self.encoding, layout)
        adviser_memory = None if self.adviser is None else self.adviser.begin(layout, num_worlds)
        return layout, num_worlds, encoder, adviser_memory

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the most likely actions (E, N, 2 + m) for observations (E, N, F)."""
        layout, num_worlds, encoder, adviser_memory = memory
        observations = check_observations(self, observations, num_worlds, layout)
        trackers = observations.shape[1]
        actions = np.empty((num_worlds, trackers, MOTION + message_size_of(layout)), np.float32)
        scratch = np.empty((MOST_THREADS, SCRATCH + 2 * max(self.network.sizes)), np.float32)
        proposals = inputs = actions[..., :0]
        if self._advising is not None:
            proposals, inputs, adviser_memory = self._advising.ask(observations, adviser_memory)
        over_worlds(
            act,
            (
                observations, *encoder.tables, np.ascontiguousarray(inputs),
                *self._numbers, scratch, actions,
            ),
            num_worlds,
            trackers,
        )  # fmt: skip
        if self._advising is not None:
            actions, adviser_memory = self._advising.answer(
                observations, proposals, actions[..., :MOTION], adviser_memory
            )
        return actions, (layout, num_worlds, encoder, adviser_memory)

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with the adviser restarted in a mask's worlds; the network has none."""
        if self.adviser is None:
            return memory
        *rest, adviser_memory = memory
        return (*rest, self.adviser.restart(adviser_memory, mask))

    def annotations(self, memory: Memory) -> Annotations:
        """Return the adviser's annotations."""
        return {} if self.adviser is None else self.adviser.annotations(memory[-1])

    def save(self, path: Path) -> None:
        """Write the policy as one file, and its card beside it as readable JSON.

        Each file replaces an old one atomically.

        Raises:
            OSError: A file could not be written; an old one of that name is unchanged.
        """
        correction = "motion" if self._advising is None else self._advising.correction
        old = correction == "motion" and not self.encoding.believes
        description = {
            "format": FORMATS[0] if old else FORMATS[-1],
            "limit": self.network.limit,
            "activation": self.network.activation,
            "output": self.network.output,
            "encoding": self.encoding.to_dict(),
            "card": self.card,
            "adviser": None if self.adviser is None else self.adviser.name,
        }
        if not old:
            description["correction"] = correction
        path.parent.mkdir(parents=True, exist_ok=True)
        write_policy_file(path, self.network.tensors(), description)
        card = json.dumps(self.card, indent=2, sort_keys=True) + "\n"
        write_atomically(path.with_suffix(".json"), card.encode())

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
    def _from_parts(
        cls, tensors: Mapping[str, FloatArray], description: Mapping[str, Any]
    ) -> LearnedPolicy:
        if description["format"] not in FORMATS:
            raise PolicyError(
                f"its format is {description['format']!r:.80}, this version reads "
                f"{' and '.join(map(str, FORMATS))}: install the version that wrote it"
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
            network, encoding, description["card"], _adviser(description.get("adviser")),
            str(description.get("correction", "motion")),
        )  # fmt: skip


def _adviser(name: str | None) -> Adviser | None:
    """Return a scripted policy of this package as adviser; a file never names other code."""
    if name is None:
        return None
    if name not in SCRIPTED:
        raise PolicyError(
            f"its adviser {name!r:.80} is none of {', '.join(SCRIPTED)}: install the version that "
            "wrote it"
        )
    return check_adviser(name, SCRIPTED[name]())
