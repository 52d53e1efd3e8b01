"""Helpers of the adapters' tests."""

import pickle
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode


def part(info: Any, prefix: str) -> dict[str, Any]:
    """Return the entries of an info whose names begin with a prefix, under the rest of their names."""
    return {name.removeprefix(prefix): value for name, value in info.items() if name.startswith(prefix)}


def f32(values: Any) -> npt.NDArray[np.float32]:
    """Return an array of actions as policies return it."""
    return np.array(values, np.float32)


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


def play_both(ours: Any, theirs: Any, mode: AutoresetMode, steps: int) -> tuple[int, int]:
    """Play a vector environment and Gymnasium's own over single ones, which must agree.

    Return how many episodes were terminated and truncated.
    """
    for name in ("single_observation_space", "single_action_space", "observation_space", "action_space"):
        assert getattr(ours, name) == getattr(theirs, name), name
    assert same(ours.reset(seed=6), theirs.reset(seed=[6] * ours.num_envs))
    ours.action_space.seed(0)
    terminations = truncations = 0
    for _ in range(steps):
        actions = ours.action_space.sample()
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert a.dtype == b.dtype
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=0)
        assert same(mine[4], other[4])
        terminations, truncations, ended = terminations + mine[2].sum(), truncations + mine[3].sum(), mine[2] | mine[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            again = [env.reset(options={"reset_mask": ended.copy()}) for env in (ours, theirs)]
            assert same(*again)
    return terminations, truncations
