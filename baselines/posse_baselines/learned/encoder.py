"""Encodings, compiled: from observations to network inputs."""

from __future__ import annotations

import numpy as np

from posse import ObservationLayout
from posse.numeric import MOST_THREADS, FloatArray, OwnArrays, Records, compiled, kernel, over_worlds
from posse_baselines.learned.encoding import Columns, Encoding
from posse_baselines.learned.features import NUM_FEATURES, SCRATCH, feature_tables, write_features


@compiled
def encode_row(
    row: FloatArray,
    columns: Columns,
    unknown: FloatArray,
    fields: Records,
    slots: FloatArray,
    with_features: int,
    scratch: FloatArray,
    out: FloatArray,
) -> None:
    """Write the network inputs (size,) of one tracker's observation (F,) to ``out``."""
    start = 0
    if with_features:
        start = NUM_FEATURES
        write_features(row, fields[0], slots, scratch, out[:start])
    for k in range(len(columns)):
        c = columns[k]
        out[start + k] = row[c] if c >= 0 else unknown[k]


@kernel
def _encode_rows(
    rows: FloatArray,
    columns: Columns,
    unknown: FloatArray,
    fields: Records,
    slots: FloatArray,
    with_features: int,
    scratch: FloatArray,
    out: FloatArray,
    thread: int,
    first: int,
    end: int,
) -> None:
    s = scratch[thread]
    for r in range(first, end):
        encode_row(rows[r], columns, unknown, fields, slots, with_features, s, out[r])


class Encoder(OwnArrays):
    """An encoding applied to the observations of one layout.

    Raises:
        PolicyError: The layout does not fit.
    """

    def __init__(self, encoding: Encoding, layout: ObservationLayout) -> None:
        self.encoding = encoding
        columns, unknown = encoding.columns(layout)
        fields, slots = feature_tables(layout)
        self._scratch = np.empty((MOST_THREADS, SCRATCH), np.float32)
        self.tables = (columns, unknown, fields, slots, int(encoding.with_features))
        """The arguments of :func:`encode_row` between the observation and the scratch memory."""

    def encode(self, observations: FloatArray, out: FloatArray | None = None) -> FloatArray:
        """Return (..., F) observations as (rows, size), written to ``out`` if given."""
        rows = np.ascontiguousarray(observations).reshape(-1, observations.shape[-1])
        if out is None:
            out = np.empty((len(rows), self.encoding.size), np.float32)
        # The threads share out rows as if each were a world of one tracker.
        over_worlds(_encode_rows, (rows, *self.tables, self._scratch, out), len(rows), 1)
        return out
