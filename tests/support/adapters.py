"""Helpers of the adapters' tests."""

import pickle
from typing import Any

import numpy as np


def out_of_band(thing: Any) -> Any:
    """Return an object after pickling with out-of-band arrays, as in Ray.

    They come back read-only, and here at addresses that suit no number.
    """
    buffers: list[pickle.PickleBuffer] = []
    data = pickle.dumps(thing, protocol=5, buffer_callback=buffers.append)
    assert buffers
    beside = [memoryview(b"-" + buffer.raw().tobytes())[1:] for buffer in buffers]
    return pickle.loads(data, buffers=beside)  # noqa: S301


def same(a: Any, b: Any) -> bool:
    """Return whether nested structures are equal: types, keys, dtypes, values; nan equals nan."""
    if type(a) is not type(b):
        return False
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray):
        if a.dtype == object:
            return a.shape == b.shape and all(same(x, y) for x, y in zip(a, b, strict=True))
        exact = np.issubdtype(a.dtype, np.floating)
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=exact)
    return bool(a == b or (a != a and b != b))
