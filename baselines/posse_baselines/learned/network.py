"""A network as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, OwnArrays
from posse_baselines.policy import PolicyError

ACTIVATIONS: Final = ("tanh", "relu")
OUTPUTS: Final = ("clip", "tanh")
"""Functions that bring the output into [-1, 1]."""
LARGEST: Final = 1e30
"""Largest absolute value of an input statistic or of ``limit``: differences stay finite."""

_FLOAT_MAX: Final = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Network(OwnArrays):
    """A network with its input normalisation, all float32.

    x = clip((input - mean) * scale, ±limit), then layers of weight (out, in) and bias (out,) with
    the activation between them; ``output`` brings the result into [-1, 1].
    """

    mean: FloatArray
    scale: FloatArray
    limit: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    activation: str
    output: str

    @property
    def inputs(self) -> int:
        """Numbers that it reads."""
        return len(self.mean)

    @property
    def outputs(self) -> int:
        """Numbers of an action."""
        return len(self.weights[-1])

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers that the first layer reads, and that each layer computes."""
        return (self.inputs, *(weight.shape[0] for weight in self.weights))

    @property
    def widest(self) -> int:
        """Most numbers that any layer reads or computes."""
        return max(self.sizes)

    def check(self) -> None:
        """Raise unless the network returns finite actions for every observation.

        Raises:
            PolicyError: Shapes that do not chain, numbers that are not finite or whose sums can
                overflow float32, unknown functions.
        """
        if self.activation not in ACTIVATIONS or self.output not in OUTPUTS:
            raise PolicyError(
                f"unknown activation {self.activation!r:.80} or output {self.output!r:.80}: "
                f"known are {', '.join(ACTIVATIONS)} and {', '.join(OUTPUTS)}"
            )
        if not self.weights or len(self.weights) != len(self.biases):
            raise PolicyError("a network needs as many biases as weights, at least one of each")
        self._check_shapes()
        for array in self.tensors().values():
            if array.dtype != np.float32 or not np.isfinite(array).all():
                raise PolicyError("a network's numbers must be finite float32")
        if not 0 < self.limit <= LARGEST:
            raise PolicyError(f"limit={self.limit} of the normalised inputs must be above 0, at most {LARGEST:g}")
        if (np.abs(self.mean) > LARGEST).any():
            raise PolicyError(f"the input means must lie within ±{LARGEST:g}")
        self._check_reach()

    def _check_shapes(self) -> None:
        if self.mean.ndim != 1 or self.scale.shape != self.mean.shape:
            raise PolicyError(
                f"input statistics of shapes {self.mean.shape} and {self.scale.shape}: both must be (inputs,)"
            )
        size = self.inputs
        for weight, bias in zip(self.weights, self.biases, strict=True):
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise PolicyError(
                    f"a layer of shape {weight.shape} with bias {bias.shape} does not follow one "
                    f"that gives {size} numbers"
                )
            size = weight.shape[0]

    def _check_reach(self) -> None:
        """Raise if a sum of the largest possible terms exceeds float32 in some layer."""
        reach: npt.NDArray[Any] = np.full(self.inputs, float(self.limit))
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            terms = np.abs(weight.astype(np.float64)) @ reach
            reach = terms + np.abs(bias.astype(np.float64))
            if (reach > _FLOAT_MAX).any():
                raise PolicyError(
                    f"the weights of layer {k} are so large (up to {np.abs(weight).max():g}) that "
                    "its sums can overflow float32: train with smaller weights"
                )
            if self.activation == "tanh":
                reach = np.ones(len(reach))

    def tensors(self) -> dict[str, FloatArray]:
        """Return the arrays by their names in a policy file."""
        named = {"normaliser.mean": self.mean, "normaliser.scale": self.scale}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            named[f"layers.{k}.weight"] = weight
            named[f"layers.{k}.bias"] = bias
        return {name: np.ascontiguousarray(array) for name, array in named.items()}

    def flat(self) -> tuple[Any, ...]:
        """Return the network as :func:`posse_baselines.learned.forward.act` reads it.

        Weights lie input by input, so that the kernel's inner loop vectorises.
        """
        weights = [np.ascontiguousarray(weight.T).reshape(-1) for weight in self.weights]
        return (
            np.ascontiguousarray(self.mean),
            np.ascontiguousarray(self.scale),
            np.float32(self.limit),
            np.array(self.sizes, np.int64),
            np.concatenate(weights),
            np.concatenate(self.biases),
            int(self.activation == "tanh"),
            int(self.output == "tanh"),
        )
