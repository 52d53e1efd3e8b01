"""A network as plain arrays, and its forward pass."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from posse.numeric import MOST_THREADS, ONE, WIDTH, ZERO, FloatArray, OwnArrays, kernel, load, over_worlds, store
from posse_baselines.policy import PolicyError

LIMIT: Final = np.float32(10.0)
"""Largest absolute value of a normalised input."""
ACTIVATIONS: Final = ("tanh", "relu")
OUTPUTS: Final = ("clip", "tanh")
"""Functions that bring the output into [-1, 1]."""


@dataclass(frozen=True)
class Network(OwnArrays):
    """A network with its input normalisation, all float32.

    x = clip((input - mean) * scale, ±LIMIT), then layers of weight (out, in) and bias (out,) with
    the activation between them; ``output`` brings the result into [-1, 1].

    Raises:
        PolicyError: An unknown function, layers that do not follow one another, or a number that is not finite.
    """

    mean: FloatArray
    scale: FloatArray
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    activation: str
    output: str

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS or self.output not in OUTPUTS:
            raise PolicyError(
                f"unknown activation {self.activation!r:.80} or output {self.output!r:.80}: "
                f"known are {', '.join(ACTIVATIONS)} and {', '.join(OUTPUTS)}"
            )
        sizes = [self.mean.size, *(bias.size for bias in self.biases)]
        wanted: dict[str, tuple[int, ...]] = dict.fromkeys(("normaliser.mean", "normaliser.scale"), (self.mean.size,))
        for k, (before, after) in enumerate(pairwise(sizes)):
            wanted |= {f"layers.{k}.weight": (after, before), f"layers.{k}.bias": (after,)}
        for name, array in self.tensors().items():
            if array.shape != wanted[name]:
                raise PolicyError(f"{name} has shape {array.shape}, not {wanted[name]}: layers must follow one another")
            if array.dtype != np.float32 or not np.isfinite(array).all():
                raise PolicyError("a network's numbers must be finite float32")

    @property
    def inputs(self) -> int:
        """Numbers that it reads."""
        return len(self.mean)

    @property
    def outputs(self) -> int:
        """Numbers of an action."""
        return len(self.weights[-1])

    def tensors(self) -> dict[str, FloatArray]:
        """Return the arrays by their names in a policy file."""
        named = {"normaliser.mean": self.mean, "normaliser.scale": self.scale}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            named[f"layers.{k}.weight"] = weight
            named[f"layers.{k}.bias"] = bias
        return {name: np.ascontiguousarray(array) for name, array in named.items()}

    def layers(self) -> "Layers":
        """Return the network as :func:`forward` reads it."""
        weights, biases = [], []
        for weight, bias in zip(self.weights, self.biases, strict=True):
            rows = -len(bias) % WIDTH  # of zeros, to whole blocks
            blocks = np.pad(weight, ((0, rows), (0, 0))).reshape(-1, WIDTH, weight.shape[1])
            weights.append(np.array(blocks.swapaxes(1, 2), order="C"))
            biases.append(np.pad(bias, (0, rows)))
        return Layers(
            np.array(self.mean),
            np.array(self.scale),
            tuple(weights),
            tuple(biases),
            self.outputs,
            self.activation == "tanh",
            self.output == "tanh",
        )


class Layers(NamedTuple):
    """A network as the kernel reads it, in blocks of eight neurons."""

    mean: FloatArray
    scale: FloatArray
    weights: tuple[FloatArray, ...]
    """(blocks, inputs, 8) of each layer."""
    biases: tuple[FloatArray, ...]
    """(8 blocks,) of each layer."""
    outputs: int
    hyperbolic: bool
    squashed: bool


def forward(network: Layers, inputs: FloatArray) -> FloatArray:
    """Return the outputs (rows, outputs) for inputs (rows, inputs).

    Each row is computed alone, so that it never depends on the others: the rounding of a matrix library does.
    """
    outputs = np.empty((len(inputs), network.outputs), np.float32)
    scratch = np.empty((MOST_THREADS, 2, max(map(len, (network.mean, *network.biases)))), np.float32)
    # The threads share out rows as if each were a world of one tracker.
    over_worlds(_forward_rows, (network, inputs, scratch, outputs), len(inputs), 1)
    return outputs


@kernel
def _forward_rows(
    network: Layers, inputs: FloatArray, scratch: FloatArray, outputs: FloatArray, thread: int, first: int, end: int
) -> None:
    last = len(network.weights) - 1
    for r in range(first, end):
        x, y = scratch[thread, 0], scratch[thread, 1]
        for k in range(len(network.mean)):
            normalised = (inputs[r, k] - network.mean[k]) * network.scale[k]
            x[k] = min(max(normalised, -LIMIT), LIMIT)
        for layer in range(last + 1):
            weights, biases = network.weights[layer], network.biases[layer]
            for block in range(len(weights)):
                total = load(biases, WIDTH * block)
                for i in range(weights.shape[1]):
                    total = total + x[i] * load(weights[block, i], 0)
                store(y, WIDTH * block, total)
            if layer < last:
                for j in range(len(biases)):
                    y[j] = np.float32(math.tanh(y[j])) if network.hyperbolic else max(y[j], ZERO)
            x, y = y, x
        for j in range(outputs.shape[1]):
            out = np.float32(math.tanh(x[j])) if network.squashed else x[j]
            outputs[r, j] = min(max(out, -ONE), ONE)
