"""A recurrent layer as plain arrays: long short-term memory (Hochreiter and Schmidhuber, 1997).

Of its state, (..., 2, cells), the first row is the hidden state h, which is also its output, and
the second the cell state c. Both are 0 when an episode starts. One step::

    i, f, g, o = parts of input_weights x + memory_weights h + biases
    c <- sigmoid(f) c + sigmoid(i) tanh(g)
    h <- sigmoid(o) tanh(c)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posse.numeric import FloatArray, OwnArrays
from posse_baselines.policy import PolicyError

GATES: Final = 4
STATES: Final = 2
_HALF: Final = np.float32(0.5)


@dataclass(frozen=True)
class LSTM(OwnArrays):
    """A layer of ``cells`` cells, all float32; the gates i, f, g, o one below the other.

    Attributes:
        input_weights: (4 cells, inputs).
        memory_weights: (4 cells, cells).
        biases: (4 cells,).
    """

    input_weights: FloatArray
    memory_weights: FloatArray
    biases: FloatArray

    @property
    def cells(self) -> int:
        """Numbers that it outputs."""
        return len(self.biases) // GATES

    def check_shapes(self, inputs: int) -> None:
        """Raise unless the arrays make a layer that reads so many numbers.

        Raises:
            PolicyError: The message names the shapes.
        """
        wanted = ((GATES * self.cells, inputs), (GATES * self.cells, self.cells))
        if (
            self.cells < 1
            or self.biases.shape != (GATES * self.cells,)
            or (self.input_weights.shape, self.memory_weights.shape) != wanted
        ):
            raise PolicyError(
                f"an LSTM of shapes {self.input_weights.shape}, {self.memory_weights.shape} and "
                f"{self.biases.shape} for {inputs} numbers: they must be (4 cells, {inputs}), "
                "(4 cells, cells) and (4 cells,)"
            )

    def step(self, inputs: FloatArray, states: FloatArray) -> FloatArray:
        """Return the next states (..., 2, cells) for inputs (..., in), in plain numpy."""
        h, c = states[..., 0, :], states[..., 1, :]
        gates = inputs @ self.input_weights.T + h @ self.memory_weights.T + self.biases
        i, f, g, o = np.split(gates, GATES, axis=-1)
        c = _sigmoid(f) * c + _sigmoid(i) * np.tanh(g)
        return np.stack([_sigmoid(o) * np.tanh(c), c], axis=-2)

    def flat(self) -> tuple[FloatArray, FloatArray]:
        """Return weights and biases as the compiled network reads them, input by input."""
        weights = (self.input_weights.T, self.memory_weights.T)
        return np.concatenate([np.ascontiguousarray(w).reshape(-1) for w in weights]), self.biases


def _sigmoid(x: FloatArray) -> FloatArray:
    """Return 1 / (1 + exp(-x)), computed such that no intermediate result overflows."""
    return np.asarray(_HALF + _HALF * np.tanh(_HALF * x))
