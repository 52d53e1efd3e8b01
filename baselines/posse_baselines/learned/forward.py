"""The forward pass of a network, compiled.

One tracker at a time, so that a tracker's action never depends on what else is in the batch: the
rounding of a matrix library does depend on it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Blocks, FloatArray, compiled, kernel, worlds_of
from posse_baselines.learned.encoder import encode_row
from posse_baselines.learned.features import SCRATCH

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)


@compiled
def _layer(x: FloatArray, size: int, weights: FloatArray, biases: FloatArray, count: int, y: FloatArray) -> None:
    """Write biases + weights x to y; weights lie input by input."""
    for j in range(count):
        y[j] = biases[j]
    _add_products(x, size, weights, count, y)


@compiled
def _add_products(x: FloatArray, size: int, weights: FloatArray, count: int, y: FloatArray) -> None:
    """Add weights x to y."""
    for i in range(size):
        xi = x[i]
        row = weights[i * count : (i + 1) * count]
        for j in range(count):
            y[j] += xi * row[j]


@compiled
def _sigmoid(x: np.float32) -> np.float32:
    """Return 1 / (1 + exp(-x)), computed such that nothing overflows."""
    return _HALF + _HALF * np.float32(math.tanh(_HALF * x))


@compiled
def _remember(
    x: FloatArray, size: int, weights: FloatArray, biases: FloatArray, gates: FloatArray, state: FloatArray
) -> None:
    """Advance the state (2, cells) of an LSTM (:mod:`posse_baselines.learned.lstm`) by inputs x."""
    h, c = state[0], state[1]
    cells = len(h)
    _layer(x, size, weights, biases, 4 * cells, gates)
    _add_products(h, cells, weights[size * 4 * cells :], 4 * cells, gates)
    for j in range(cells):
        new = np.float32(math.tanh(gates[2 * cells + j]))
        c[j] = _sigmoid(gates[cells + j]) * c[j] + _sigmoid(gates[j]) * new
        h[j] = _sigmoid(gates[3 * cells + j]) * np.float32(math.tanh(c[j]))


@kernel
def act(
    observations: FloatArray,
    columns: npt.NDArray[np.int64],
    unknown: FloatArray,
    offsets: npt.NDArray[np.int64],
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
    states: FloatArray,
    actions: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Write the actions (E, N, 2 + m) of a thread's worlds.

    ``further`` (E, N, k) are inputs behind those of the encoding. The states (E, N, 2, cells) of
    the recurrent layer are advanced; without one, there are 0 cells.
    """
    inputs, cells = len(mean), states.shape[3]
    widest = (scratch.shape[1] - SCRATCH) // 2
    work = scratch[thread, :SCRATCH]
    for e in worlds_of(thread, blocks):
        for i in range(observations.shape[1]):
            x = scratch[thread, SCRATCH : SCRATCH + widest]
            y = scratch[thread, SCRATCH + widest :]
            encode_row(observations[e, i], columns, unknown, offsets, slots, with_features, work, x)
            for j in range(further.shape[2]):
                x[inputs - further.shape[2] + j] = further[e, i, j]
            for k in range(inputs):
                x[k] = min(max((x[k] - mean[k]) * scale[k], -limit), limit)
            at_weight, at_bias = 0, 0
            if cells > 0:
                _remember(x, inputs, weights, biases, y, states[e, i])
                for j in range(cells):
                    x[j] = states[e, i, 0, j]
                at_weight, at_bias = (inputs + cells) * 4 * cells, 4 * cells
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
