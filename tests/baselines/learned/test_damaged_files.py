"""Policy files of any bytes are refused or play as before; reading them runs no code and writes nothing."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.support.learned import any_policy

import posse
from posse_baselines import Policy, PolicyError, load

PROPERTY = settings(derandomize=True, database=None, deadline=None, max_examples=150)
FORBIDDEN = (
    "exec",
    "compile",
    "import",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "subprocess.Popen",
    "pickle.find_class",
)
_seen: list[str] | None = None


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    writes = event == "open" and any(letter in str(arguments[1] or "r") for letter in "wax+")
    if _seen is not None and (event in FORBIDDEN or writes):
        _seen.append(f"{event} {arguments!r:.200}")


sys.addaudithook(_watch)  # there is no way to remove one


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("policy") / "mine.safetensors"
    any_policy().save(path)
    assert actions_of(load(path)).any()  # all modules are imported and all kernels compiled before anything is watched
    return path.read_bytes()


def actions_of(policy: Policy) -> Any:
    batch = posse.batch("smart", 2, message_size=policy.message_size)
    return policy.act(batch.reset(seed=1), policy.begin(batch.layout, 2))[0].copy()


def read(content: bytes) -> Policy | None:
    """Return the policy in a file of these bytes, or None where it is refused."""
    global _seen
    message = ""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.safetensors"
        path.write_bytes(content)
        _seen = []
        try:
            policy = load(path)
        except PolicyError as error:
            policy, message = None, str(error)
        finally:
            found, _seen = _seen, None
        assert found == []
        assert [each.name for each in Path(folder).iterdir()] == [path.name]
    assert policy is not None or (str(path) in message and len(message) < 2000)
    return policy


@PROPERTY
@given(st.binary(max_size=300))
def test_random_bytes_are_refused(content: bytes) -> None:
    assert read(content) is None
    assert read(len(content).to_bytes(8, "little") + content) is None  # as the header of safetensors begins


@PROPERTY
@given(data=st.data())
def test_changed_bytes_are_refused_or_play_the_same(whole: bytes, data: st.DataObject) -> None:
    first = data.draw(st.integers(0, len(whole)) | st.integers(0, 3000))
    length = data.draw(st.sampled_from((0, 1, 1, 64)))
    changed = whole[:first] + data.draw(st.binary(max_size=length)) + whole[first + length :]
    assume(changed != whole)
    policy = read(changed)
    if policy is not None:
        np.testing.assert_array_equal(actions_of(policy), actions_of(read(whole) or policy))


@PROPERTY
@given(where=st.floats(0, 0.999999), bit=st.integers(0, 7))
def test_a_flipped_bit_is_refused_or_plays_the_same(whole: bytes, where: float, bit: int) -> None:
    flipped = bytearray(whole)
    flipped[int(where * len(whole))] ^= 1 << bit
    policy = read(bytes(flipped))
    if policy is not None:
        np.testing.assert_array_equal(actions_of(policy), actions_of(read(whole) or policy))


def test_what_is_watched_is_seen(tmp_path: Path) -> None:
    global _seen
    _seen = []
    (tmp_path / "other").write_bytes(b"")
    found, _seen = _seen, None
    assert len(found) == 1
