"""A common interface to every kind of environment: invalid inputs, the whole state, and whether two are the same."""

import copy
import functools
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import VectorEnv
from tests.support.reference.state import snapshot

import posse
import posse_baselines  # noqa: F401  registers posse/Tracker-v0

SHORT: dict[str, Any] = {"num_trackers": 2, "horizon": 4, "settle_time": 0.1}
LONG_NAME = "x" * 5000


def _single(name: str, **settings: Any) -> Any:
    return gymnasium.make(name, disable_env_checker=True, **{**SHORT, **settings}).unwrapped


def _vector(name: str, **settings: Any) -> VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(name, **{"num_envs": 2, **SHORT, **settings})


def _torchrl() -> Any:
    from posse_training.torchrl import PosseEnv

    return PosseEnv("constant", 2, **SHORT)


MAKERS: dict[str, Callable[..., Any]] = {
    "batch": lambda **settings: posse.batch(**{"num_worlds": 2, **SHORT, **settings}),
    "parallel": lambda **settings: posse.parallel_env(**{**SHORT, **settings}),
    "team": functools.partial(_single, "posse/Team-v0"),
    "solo": functools.partial(_single, "posse/Solo-v0", num_trackers=1),
    "tracker": functools.partial(_single, "posse/Tracker-v0"),
    "team vector": functools.partial(_vector, "posse/Team-v0"),
    "solo vector": functools.partial(_vector, "posse/Solo-v0", num_trackers=1),
    "torchrl": _torchrl,
}


class Subject:
    """An environment of one kind, and the batch that it stands on."""

    def __init__(self, kind: str, **settings: Any) -> None:
        self.kind = kind
        self.env = inner = MAKERS[kind](**settings)
        self.batch: posse.Batch = inner if kind == "batch" else inner.batch

    def good_action(self, rng: np.random.Generator) -> Any:
        """Return a valid action."""
        return self.action(rng.uniform(-1, 1, self.batch.action_shape).astype(np.float32))

    def action(self, actions: npt.NDArray[np.float32]) -> Any:
        """Return a batch's actions (E, N, 2) as this kind of environment takes them."""
        if self.kind == "parallel":
            return {f"tracker_{i}": row for i, row in enumerate(actions[0])}
        if self.kind == "torchrl":
            import torch

            carried = self.env.fake_tensordict().exclude("next")
            return carried.set(("agents", "action"), torch.from_numpy(actions))
        shape: dict[str, Any] = {"team": actions[0], "solo": actions[0, 0], "tracker": actions[0, 0]}
        return shape.get(self.kind, actions[:, 0] if self.kind == "solo vector" else actions)

    def bad_actions(self) -> Iterator[Any]:
        """Yield arguments that are always invalid."""
        if self.kind == "torchrl":
            import torch

            for number in (np.nan, np.inf, 2.0, 1j):
                bad = torch.tensor([0.0] * 7 + [number]).reshape(2, 2, 2)
                yield self.good_action(np.random.default_rng(0)).set(("agents", "action"), bad)
            return
        yield from ("x", LONG_NAME, object(), 5, 10**5000, 1j, [[1], [2, 3]], [10**400, 0], b"ab", slice(3))
        yield from ({"a": 1}, {5: 2}, {10**5000: 1}, np.array(None), [np.nan, 0.0], [1e300, 0.0], np.zeros(2, "M8[s]"))
        if self.kind == "parallel":
            good = self.good_action(np.random.default_rng(0))
            for value in (LONG_NAME, 10**5000, [10**400, 0], [[1], [2, 3]], object(), [0.0, 2.0]):
                yield {**good, "tracker_1": value}
                yield {**good, LONG_NAME: value}

    def refused(self, call: Any) -> str:
        """Return the message of a refused call, after checking that it changed nothing."""
        before = self.held()
        with pytest.raises((ValueError, ResetNeeded)) as caught:
            call()
        assert same(before, self.held())
        assert 0 < len(str(caught.value)) <= 1000
        return str(caught.value)

    def held(self) -> list[Any]:
        """Return copies of the environment's whole state, for comparison by :func:`same`."""
        batch, env = self.batch, self.env
        kept: list[Any] = [snapshot(batch), batch.seed, batch._started, batch._over]
        kept += [copy.copy(getattr(env, name, None)) for name in ("_seeded", "_seed", "agents")]
        if isinstance(env, (gymnasium.Env, VectorEnv)):
            kept.append(repr(env.np_random.bit_generator.state))
        return kept


BAD_SEEDS: tuple[Any, ...] = (-1, 2**63, -(10**5000), 1.0, True, "1", LONG_NAME, [1], 1j, np.array([1, 2]), object())
_POSES: tuple[Any, ...] = ("x", LONG_NAME, 5, 1j, {"a": 1}, [], [[1, 2], [3]], [object()] * 3, ["1", "2", "3"], b"abc")
_POSES += ([None] * 3, [10**5000, 0, 0], [True] * 3, [np.nan, 0, 0], [1e300, 0, 0])
_POSES += (np.zeros((0, 3)), np.zeros(3, "M8[s]"))
BAD_OPTIONS: tuple[Any, ...] = (5, "abc", [1], True, object(), {LONG_NAME: 1}, {5: 1}, {10**5000: 1})
BAD_OPTIONS += tuple({name: pose} for name in ("tracker_pose", "target_pose") for pose in _POSES)


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
