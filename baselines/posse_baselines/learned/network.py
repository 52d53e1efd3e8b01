"""Learned policies: numbers in a file, played without the library that learned them.

A policy file is one safetensors file. It holds the weights of a feed-forward network, the
statistics that its inputs are normalised with, and the policy's card: what it was trained on, how,
and how well it did. Reading one interprets numbers and JSON, and never runs anything.

The network is played by a compiled kernel, one tracker at a time, so that what a tracker does never
depends on what else is in the batch (a matrix library's rounding does).
"""

from __future__ import annotations

import copy
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from posse import ObservationLayout
from posse.numeric import BoolArray, FloatArray, Numbers, OwnArrays, compiled, kernel, worlds_of
from posse_baselines.learned.advice import MOTION, Adviser, advised, check_adviser
from posse_baselines.learned.encoding import Encoder, Encoding, encode_row
from posse_baselines.learned.features import SCRATCH
from posse_baselines.parallel import MOST_THREADS, over_worlds
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import (
    Annotations,
    BasePolicy,
    Memory,
    PolicyError,
    check_observations,
    message_size_of,
)

FORMAT: Final = 1
ACTIVATIONS: Final = ("tanh", "relu")
OUTPUTS: Final = ("clip", "tanh")
"""How the network's output becomes an action in [-1, 1]."""
_KEY: Final = "posse-policy"

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


@dataclass(frozen=True)
class Network(OwnArrays):
    """A feed-forward network with its input normalisation.

    x = clip((input - mean) * scale, ±limit); then layers of weight (out, in) and bias (out,), with
    the activation between them, and the output brought into [-1, 1].
    """

    mean: FloatArray
    scale: FloatArray
    limit: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    activation: str
    output: str

    @property
    def sizes(self) -> tuple[int, ...]:
        """Length of the input and of each layer's output."""
        return (self.weights[0].shape[1], *(weight.shape[0] for weight in self.weights))

    def check(self) -> None:
        """Raise if the parts do not fit each other.

        Raises:
            PolicyError: Shapes that do not chain, numbers that are not finite, unknown functions.
        """
        if self.activation not in ACTIVATIONS or self.output not in OUTPUTS:
            raise PolicyError(
                f"unknown activation {self.activation!r} or output {self.output!r}: known are "
                f"{', '.join(ACTIVATIONS)} and {', '.join(OUTPUTS)}"
            )
        if not self.weights or len(self.weights) != len(self.biases):
            raise PolicyError("a network needs as many biases as weights, at least one of each")
        size = len(self.mean)
        for weight, bias in zip(self.weights, self.biases, strict=True):
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise PolicyError(
                    f"a layer of shape {weight.shape} with bias {bias.shape} does not follow one "
                    f"that gives {size} numbers"
                )
            size = weight.shape[0]
        if self.scale.shape != self.mean.shape:
            raise PolicyError("the input statistics do not fit each other")
        if not (math.isfinite(self.limit) and self.limit > 0):
            raise PolicyError(f"limit={self.limit} of the normalised inputs must be above 0")
        for array in (self.mean, self.scale, *self.weights, *self.biases):
            if array.dtype != np.float32 or not np.isfinite(array).all():
                raise PolicyError("a network's numbers must be finite float32")

    def forward(self, inputs: FloatArray) -> FloatArray:
        """Return the actions (..., out) for inputs (..., in), in plain numpy."""
        x = np.clip((inputs - self.mean) * self.scale, -self.limit, self.limit)
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight.T + bias
            if k < len(self.weights) - 1:
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, _ZERO)
        y = np.tanh(x) if self.output == "tanh" else np.clip(x, -1, 1)
        return np.asarray(y, np.float32)

    def tensors(self) -> dict[str, FloatArray]:
        """Return the arrays by the names that they have in a file."""
        named = {"normaliser.mean": self.mean, "normaliser.scale": self.scale}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            named[f"layers.{k}.weight"] = weight
            named[f"layers.{k}.bias"] = bias
        return {name: np.ascontiguousarray(array) for name, array in named.items()}


@compiled
def _layer(
    x: FloatArray, size: int, weights: FloatArray, biases: FloatArray, count: int, y: FloatArray
) -> None:
    """Write biases + weights x to y; weights lie input by input: the inner loop vectorises."""
    for j in range(count):
        y[j] = biases[j]
    for i in range(size):
        xi = x[i]
        row = weights[i * count : (i + 1) * count]
        for j in range(count):
            y[j] += xi * row[j]


@kernel
def _act(
    observations: FloatArray,
    columns: npt.NDArray[np.int64],
    unknown: FloatArray,
    offsets: npt.NDArray[np.int64],
    slots: FloatArray,
    with_features: int,
    proposals: FloatArray,
    mean: FloatArray,
    scale: FloatArray,
    limit: np.float32,
    sizes: npt.NDArray[np.int64],
    weights: FloatArray,
    biases: FloatArray,
    hyperbolic: int,
    squashed: int,
    scratch: FloatArray,
    actions: FloatArray,
    thread: int,
    turns: Numbers,
) -> None:
    """Write the actions (E, N, 2 + m) of a thread's worlds."""
    widest = 0
    for k in range(len(sizes)):
        widest = max(widest, sizes[k])
    work = scratch[thread, :SCRATCH]
    for e in worlds_of(thread, turns):
        for i in range(observations.shape[1]):
            x = scratch[thread, SCRATCH : SCRATCH + widest]
            y = scratch[thread, SCRATCH + widest :]
            encode_row(observations[e, i], columns, unknown, offsets, slots, with_features, work, x)
            for j in range(proposals.shape[2]):
                x[sizes[0] - proposals.shape[2] + j] = proposals[e, i, j]
            for k in range(sizes[0]):
                x[k] = min(max((x[k] - mean[k]) * scale[k], -limit), limit)
            at_weight, at_bias = 0, 0
            for layer in range(len(sizes) - 1):
                size, count = sizes[layer], sizes[layer + 1]
                _layer(x, size, weights[at_weight:], biases[at_bias:], count, y)
                at_weight += size * count
                at_bias += count
                if layer < len(sizes) - 2:
                    for j in range(count):
                        y[j] = np.float32(math.tanh(y[j])) if hyperbolic else max(y[j], _ZERO)
                x, y = y, x
            out = actions[e, i]
            for j in range(len(out)):
                out[j] = _ZERO
                if j < sizes[-1]:
                    out[j] = np.float32(math.tanh(x[j])) if squashed else x[j]
                    out[j] = min(max(out[j], -_ONE), _ONE)


class LearnedPolicy(OwnArrays, BasePolicy):
    """A policy that was learned, as numbers.

    Args:
        network: What chooses the actions.
        encoding: What the network is given.
        card: What the policy is: ``name``, ``trained_splits`` and whatever else its maker recorded.
        adviser: The scripted policy that it listens to, if any
            (:mod:`posse_baselines.learned.advice`).

    Attributes:
        trained_splits: Splits whose worlds it has learned from; an evaluation refuses them.

    Raises:
        PolicyError: Network and encoding do not fit each other.
    """

    def __init__(
        self,
        network: Network,
        encoding: Encoding,
        card: Mapping[str, Any],
        adviser: Adviser | None = None,
    ) -> None:
        network.check()
        size = encoding.size + (0 if adviser is None else MOTION)
        if network.sizes[0] != size:
            raise PolicyError(
                f"the network takes {network.sizes[0]} numbers, its encoding gives {size}"
            )
        if network.sizes[-1] < 2:
            raise PolicyError(
                f"the network gives {network.sizes[-1]} numbers, an action has 2 or more"
            )
        self.network = network
        self.encoding = encoding
        self._describe(card)
        self.message_size = max(network.sizes[-1] - 2, encoding.message_size)
        self.adviser = adviser
        if adviser is not None:
            if network.sizes[-1] != MOTION:
                raise PolicyError("an advised network gives 2 numbers: messages are the adviser's")
            self.message_size = max(self.message_size, adviser.message_size)
        weights = [np.ascontiguousarray(weight.T).reshape(-1) for weight in network.weights]
        self._numbers = (
            np.ascontiguousarray(network.mean),
            np.ascontiguousarray(network.scale),
            np.float32(network.limit),
            np.array(network.sizes, np.int64),
            np.concatenate(weights),
            np.concatenate(network.biases),
            int(network.activation == "tanh"),
            int(network.output == "tanh"),
        )

    def _describe(self, card: Mapping[str, Any]) -> None:
        self.card = dict(card)
        self.name = str(self.card.get("name", "learned"))
        self.trained_splits = tuple(self.card.get("trained_splits", ("train",)))

    def with_card(self, card: Mapping[str, Any]) -> LearnedPolicy:
        """Return the same policy with another card."""
        other = copy.copy(self)
        other._describe(card)
        return other

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` worlds: where in the layout the inputs lie.

        Raises:
            PolicyError: The layout lacks what the network reads, or has it in another size.
        """
        super().begin(layout, num_worlds)
        encoder = Encoder(self.encoding, layout)
        thoughts = None if self.adviser is None else self.adviser.begin(layout, num_worlds)
        return layout, num_worlds, encoder, thoughts

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the most likely actions (E, N, 2 + m) for observations (E, N, F)."""
        layout, num_worlds, encoder, thoughts = memory
        observations = check_observations(self, observations, num_worlds, layout)
        trackers = observations.shape[1]
        actions = np.empty((num_worlds, trackers, 2 + message_size_of(layout)), np.float32)
        scratch = np.empty((MOST_THREADS, SCRATCH + 2 * max(self.network.sizes)), np.float32)
        proposals = actions[..., :0]
        if self.adviser is not None:
            proposals, thoughts = self.adviser.act(observations, thoughts)
        over_worlds(
            _act,
            (
                observations, *encoder.tables, np.ascontiguousarray(proposals[..., :MOTION]),
                *self._numbers, scratch, actions,
            ),
            num_worlds,
            trackers,
        )  # fmt: skip
        if self.adviser is not None:
            actions = advised(proposals, actions[..., :MOTION])
        return actions, (layout, num_worlds, encoder, thoughts)

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with the adviser's begun anew; the network remembers nothing."""
        if self.adviser is None:
            return memory
        *rest, thoughts = memory
        return (*rest, self.adviser.restart(thoughts, mask))

    def annotations(self, memory: Memory) -> Annotations:
        """Return what the adviser has in mind."""
        return {} if self.adviser is None else self.adviser.annotations(memory[-1])

    def save(self, path: Path) -> None:
        """Write the policy as one file, and its card beside it as JSON, for people to read.

        A file of that name is replaced in one stroke: at no time is there half a policy.
        """
        tensors = self.network.tensors()
        description = {
            "format": FORMAT,
            "limit": self.network.limit,
            "activation": self.network.activation,
            "output": self.network.output,
            "encoding": self.encoding.to_dict(),
            "card": self.card,
            "adviser": None if self.adviser is None else self.adviser.name,
        }
        text = json.dumps(description, sort_keys=True)
        metadata = {_KEY: text, "digest": _digest(tensors, text)}
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.name}.partial")
        try:
            save_file(tensors, partial, metadata)
            partial.replace(path)
            partial.write_text(json.dumps(self.card, indent=2, sort_keys=True) + "\n")
            partial.replace(path.with_suffix(".json"))
        finally:
            partial.unlink(missing_ok=True)

    @classmethod
    def from_file(cls, path: str | Path) -> LearnedPolicy:
        """Return the policy of a file.

        Raises:
            PolicyError: There is no such file, or it is damaged, cut short, or no policy.
        """
        path = Path(path)
        tensors, metadata = _read(path)
        text = metadata.get(_KEY)
        if text is None:
            raise PolicyError(f"{path} is a safetensors file, but holds no policy of posse")
        if metadata.get("digest") != _digest(tensors, text):
            raise PolicyError(f"{path} is damaged: its contents are not what was written")
        try:
            return cls._from_parts(tensors, json.loads(text))
        except PolicyError as error:
            raise PolicyError(f"{path}: {error}") from error
        except (KeyError, TypeError, ValueError) as error:
            raise PolicyError(f"{path} is damaged: {error!r}") from error

    @classmethod
    def _from_parts(
        cls, tensors: Mapping[str, FloatArray], description: Mapping[str, Any]
    ) -> LearnedPolicy:
        if description["format"] != FORMAT:
            raise PolicyError(
                f"it is of format {description['format']}, this version reads {FORMAT}: "
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
        return cls(network, encoding, description["card"], _adviser(description.get("adviser")))


def _adviser(name: str | None) -> Adviser | None:
    """Return the adviser of a name: a scripted policy of this package, and never other code."""
    if name is None:
        return None
    if name not in SCRIPTED:
        raise PolicyError(
            f"it listens to {name!r}, which is none of {', '.join(SCRIPTED)}: install the version "
            "that wrote it"
        )
    return check_adviser(name, SCRIPTED[name]())


def _read(path: Path) -> tuple[dict[str, FloatArray], dict[str, str]]:
    if not path.is_file():
        raise PolicyError(f"there is no policy file {path}")
    try:
        with safe_open(path, framework="numpy") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, file.metadata() or {}
    except (SafetensorError, OSError) as error:
        raise PolicyError(f"{path} is damaged, cut short, or no policy file: {error}") from error


def _digest(tensors: Mapping[str, FloatArray], text: str) -> str:
    """Return a hash over everything that a file says."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape}".encode())
        digest.update(np.ascontiguousarray(tensors[name]).tobytes())
    return digest.hexdigest()
