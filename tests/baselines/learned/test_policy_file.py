"""Policy files give back the policy, damaged ones are refused, reading runs no code; files are written as a whole."""

import errno
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from safetensors.numpy import save
from tests.support.learned import observations_of, policy_for

import posse
from posse_baselines import Policy, PolicyError, load
from posse_baselines.files import remove_unfinished, replacing, write_atomically
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.policy import write_policy_file

POLICY = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
TENSORS = POLICY.network.tensors()
RUNS_CODE = ("exec", "compile", "import", "os.system", "os.exec", "os.posix_spawn", "subprocess.Popen")
_seen: list[str] | None = None


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    writes = event == "open" and any(letter in str(arguments[1] or "r") for letter in "wax+")
    if _seen is not None and (event in (*RUNS_CODE, "pickle.find_class") or writes):
        _seen.append(f"{event} {arguments!r:.200}")


sys.addaudithook(_watch)  # there is no way to remove one


def actions_of(policy: Policy) -> Any:
    batch, observations = observations_of("smart", 2, message_size=policy.message_size)
    return policy.act(observations, policy.begin(batch.layout, 2))[0].copy()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("policy") / "deep" / "mine.safetensors"
    POLICY.save(path)
    assert actions_of(load(path)).any()  # all modules are imported and all kernels compiled before anything is watched
    return path.read_bytes()


@pytest.fixture(scope="module")
def described(whole: bytes) -> dict[str, Any]:
    length = int.from_bytes(whole[:8], "little")  # the header of safetensors is JSON after its length
    found: dict[str, Any] = json.loads(json.loads(whole[8 : 8 + length])["__metadata__"]["posse-policy"])
    return found


def test_a_file_gives_back_the_policy(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(whole)
    again = LearnedPolicy.from_file(path)
    assert (again.name, again.trained_splits, again.card) == ("mine", ("train",), POLICY.card)
    assert again.encoding == POLICY.encoding
    np.testing.assert_array_equal(actions_of(again), actions_of(POLICY))


def read(content: bytes) -> Policy | None:
    """Return the policy in a file of these bytes, or None where it is refused; nothing runs and nothing is written."""
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
    assert policy is not None or (str(path) in message and len(message) < 2000)
    return policy


@given(st.binary(max_size=300))
@example(b"cos\nsystem\n(S'true'\ntR.")  # a pickle that runs a command
@example(save({"a": np.zeros(3)}))
def test_other_bytes_are_refused_and_not_run(content: bytes) -> None:
    assert read(content) is None
    assert read(len(content).to_bytes(8, "little") + content) is None  # as the header of safetensors begins


@given(where=st.floats(0, 0.999999) | st.floats(0, 0.01), bit=st.integers(0, 7), kept=st.floats(0, 1))
def test_a_damaged_file_is_refused_or_plays_the_same(whole: bytes, where: float, bit: int, kept: float) -> None:
    flipped = bytearray(whole)
    flipped[int(where * len(whole))] ^= 1 << bit
    policy = read(bytes(flipped))
    assert policy is None or np.array_equal(actions_of(policy), actions_of(POLICY))
    assert kept == 1 or read(whole[: int(kept * len(whole))]) is None


LAST = TENSORS["layers.2.weight"]
LONG = {"kind": "plain", "neighbours": 0, "fields": [["speed", 10**9, "m/s", 0, False]]}


@pytest.mark.parametrize(
    ("changes", "arrays", "message"),
    [
        ({"format": 2}, {}, "its format is 2, this version reads 1"),
        ({"adviser": "os:system"}, {}, "unknown adviser 'os:system'"),
        ({"adviser": "planner"}, {}, "cannot be an adviser"),
        ({"adviser": "ddcs-distributed"}, {}, "the network takes"),
        ({"encoding": {**LONG, "kind": "fancy"}}, {}, "encodings are: plain"),
        ({"encoding": LONG}, {}, "takes"),
        ({"card": "name"}, {}, "is damaged"),
        ({"card": {"side": "both"}}, {}, "side='both'"),
        ({"card": {"trained_splits": ["trian"]}}, {}, "trained_splits="),
        ({"card": {"message_size": -1}}, {}, "message_size=-1 on its card"),
        ({}, {"normaliser.mean": np.zeros((3, 3), np.float32)}, "normaliser.mean has shape"),
        ({}, {"layers.0.weight": TENSORS["layers.0.weight"].astype(np.float64)}, "finite float32"),
        ({}, {"layers.2.bias": np.full_like(TENSORS["layers.2.bias"], np.nan)}, "finite float32"),
        ({}, {"layers.2.weight": LAST[:1]}, r"layers.2.weight has shape \(1, 16\), not \(2, 16\)"),
        ({}, {"layers.2.weight": LAST[:1], "layers.2.bias": TENSORS["layers.2.bias"][:1]}, "gives 1"),
        ({}, {"layers.7.weight": LAST}, "is damaged"),
    ],
)
def test_descriptions_and_arrays_that_make_no_policy(
    tmp_path: Path, described: dict[str, Any], changes: dict[str, Any], arrays: dict[str, Any], message: str
) -> None:
    path = tmp_path / "forged.safetensors"
    write_policy_file(path, {**TENSORS, **arrays}, {**described, **changes})
    with pytest.raises(PolicyError, match=message) as caught:
        LearnedPolicy.from_file(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_descriptions_that_lack_something_or_are_of_another_kind(tmp_path: Path, described: dict[str, Any]) -> None:
    path = tmp_path / "forged.safetensors"
    lacking: list[Any] = [{k: v for k, v in described.items() if k != missing} for missing in described]
    for description in (*lacking, None, 3, "text", [[]]):
        write_policy_file(path, TENSORS, description)
        with pytest.raises(PolicyError, match="damaged"):
            LearnedPolicy.from_file(path)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "the disk is full")])
def test_an_error_while_writing_leaves_the_old_file_alone(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "file.txt"
    write_atomically(path, b"old")

    def write_half() -> None:
        with replacing(path) as partial:
            partial.write_bytes(b"half")
            raise error

    with pytest.raises(type(error)) as caught:
        write_half()
    assert str(caught.value) in ("", f"[Errno {errno.ENOSPC}] the disk is full: {str(path)!r}")
    assert path.read_bytes() == b"old"
    with pytest.raises(IsADirectoryError, match=f"directory: {str(tmp_path)!r}$"):
        write_atomically(tmp_path, b"new")
    with pytest.raises(NotADirectoryError, match=f"directory: {str(path / 'below')!r}$"):
        write_atomically(path / "below", b"new")
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_removed(tmp_path: Path) -> None:
    kept = tmp_path / ".posse-notes"
    kept.touch()
    (tmp_path / f".posse-{'0123456789abcdef'}.safetensors").write_bytes(b"half")
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == [kept]
