"""The forward pass of a network, compiled.

One tracker at a time, so that a tracker's action never depends on what else is in the batch: the
rounding of a matrix library does depend on it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Records, compiled, kernel
from posse_baselines.learned.encoder import encode_row
from posse_baselines.learned.features import SCRATCH

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


@compiled
def _layer(x: FloatArray, size: int, weights: FloatArray, biases: FloatArray, count: int, y: FloatArray) -> None:
    """Write biases + weights x to y; weights lie input by input."""
    for j in range(count):
        y[j] = biases[j]
    for i in range(size):
        xi = x[i]
        row = weights[i * count : (i + 1) * count]
        for j in range(count):
            y[j] += xi * row[j]


@kernel
def act(
    observations: FloatArray,
    columns: npt.NDArray[np.int64],
    unknown: FloatArray,
    fields: Records,
    slots: FloatArray,
    with_features: int,
    further: FloatArray,
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
    first: int,
    end: int,
) -> None:
    """Write the actions (E, N, 2 + m) of a share of the worlds.

    ``further`` (E, N, k) are inputs behind those of the encoding.
    """
    inputs = len(mean)
    widest = (scratch.shape[1] - SCRATCH) // 2
    work = scratch[thread, :SCRATCH]
    for e in range(first, end):
        for i in range(observations.shape[1]):
            x = scratch[thread, SCRATCH : SCRATCH + widest]
            y = scratch[thread, SCRATCH + widest :]
            encode_row(observations[e, i], columns, unknown, fields, slots, with_features, work, x)
            for j in range(further.shape[2]):
                x[inputs - further.shape[2] + j] = further[e, i, j]
            for k in range(inputs):
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
