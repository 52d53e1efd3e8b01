"""Result files: what is written is read back, and no damaged or forged file gets through."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from posse_training import cli
from posse_training.errors import ResultFileError
from posse_training.leaderboard import ResultFile, read_result, verify, write_result

Content = dict[str, Any]
RESULT = ResultFile(
    label="a team",
    policy_kind="shipped",
    policy="pursuit",
    policy_sha256=None,
    reads_state=False,
    scenario="paper-distributed",
    scenario_version=1,
    split="test",
    seed=2026,
    posse_version="0.1.0",
    commit="932670c6b288+",
    machine="some machine",
    replay="https://example.org/r.html",
    rows={"safe_score": (0.25, 0.5), "score": (0.5, 0.5), "contact_free": (0.0, 1.0)},
)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = write_result(RESULT, tmp_path / "folder" / "r.json")
    assert read_result(path) == RESULT


def forged(tmp_path: Path, change: Callable[[Content], None]) -> Path:
    path = write_result(RESULT, tmp_path / "r.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def setting(name: str, value: Any) -> Callable[[Content], None]:
    return lambda content: content.update({name: value})


def row(name: str, value: Any) -> Callable[[Content], None]:
    return lambda content: content["rows"].update({name: value})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (setting("format", "other"), "this posse reads"),
        (setting("version", 2), "this posse reads"),
        (setting("extra", 1), "has the unknown 'extra'"),
        (lambda content: content.pop("seed"), "lacks 'seed'"),
        (setting("label", ""), "printable text of 1 to 100"),
        (setting("label", "x" * 101), "printable text of 1 to 100"),
        (setting("label", "a\nb"), "printable text"),
        (setting("label", ["a"]), "printable text"),
        (setting("policy_kind", "pickle"), "one of shipped, file, code"),
        (setting("policy", "os:system"), "name of a policy of the package"),
        (setting("policy", "../../etc/passwd"), "name of a policy of the package"),
        (setting("policy_sha256", "0" * 64), "for no other"),
        (setting("reads_state", 1), "true or false"),
        (setting("scenario_version", 1.0), "whole number"),
        (setting("scenario_version", True), "whole number"),
        (setting("split", "secret"), "one of train, validation, test"),
        (setting("seed", -1), "whole number"),
        (setting("seed", 2**63), "whole number"),
        (setting("commit", "<script>"), "a commit's hash"),
        (setting("replay", "javascript:alert(1)"), "begins with https://"),
        (setting("replay", 'https://x/"><script>'), "begins with https://"),
        (setting("rows", []), "not an object"),
        (row("more", [1]), "has the unknown 'more'"),
        (row("score", 0.5), "list of 1 to 10,000"),
        (row("score", []), "list of 1 to 10,000"),
        (row("score", [0.5] * 10_001), "list of 1 to 10,000"),
        (row("score", [0.5]), "differ in length"),
        (row("score", [0.5, 1.5]), "number in [0, 1]"),
        (row("score", [0.5, "1"]), "number in [0, 1]"),
        (row("score", [0.5, True]), "number in [0, 1]"),
        (row("score", [0.5, 0.5000001]), "at most 6 decimals"),
        (row("contact_free", [0.5, 1]), "neither 0 nor 1 in world 0"),
        (row("safe_score", [0.75, 0.5]), "above score in world 0"),
        (row("safe_score", [0.25, 0.25]), "without any contact in world 1"),
    ],
)
def test_an_invalid_value_is_named(tmp_path: Path, change: Callable[[Content], None], message: str) -> None:
    with pytest.raises(ResultFileError) as error:
        read_result(forged(tmp_path, change))
    assert message in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    "content",
    [b"", b"\xff\xfe", b"{", b"[" * 100_000, b'{"a": NaN}', b'{"a": 1, "a": 2}', b"7" * 5000, b" " * 1_000_001],
)
def test_what_is_no_result_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "r.json"
    path.write_bytes(content)
    with pytest.raises(ResultFileError):
        read_result(path)


def test_a_missing_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["verify", str(tmp_path / "none.json")]) == 2
    assert "none.json: cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (setting("scenario", "nowhere"), "scenario='nowhere' is not one of"),
        (setting("scenario_version", 7), "made on version 7"),
        (setting("policy", "no-such-policy"), "is not shipped"),
        (setting("reads_state", True), "is not true of pursuit"),
    ],
)
def test_what_cannot_be_played_is_refused(tmp_path: Path, change: Callable[[Content], None], message: str) -> None:
    with pytest.raises(ResultFileError) as error:
        verify(forged(tmp_path, change), progress=False)
    assert message in str(error.value)


def test_code_is_not_run_unless_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "forged_module.py").write_text("raise SystemExit('it ran')\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    def change(content: Content) -> None:
        content.update(policy_kind="code", policy="forged_module:Policy")

    path = forged(tmp_path, change)
    with pytest.raises(ResultFileError, match="--run-code"):
        verify(path, progress=False)
    with pytest.raises(SystemExit, match="it ran"):
        verify(path, run_code=True, progress=False)


def test_a_policy_file_must_be_the_one_that_was_played(tmp_path: Path) -> None:
    def change(content: Content) -> None:
        content.update(policy_kind="file", policy="p.safetensors", policy_sha256="0" * 64)

    path = forged(tmp_path, change)
    with pytest.raises(ResultFileError, match="must lie beside it"):
        verify(path, progress=False)
    (tmp_path / "p.safetensors").write_bytes(b"something else")
    with pytest.raises(ResultFileError, match="not the policy file that was played"):
        verify(path, progress=False)


@pytest.mark.parametrize("name", ["../p.safetensors", "/tmp/p.safetensors", "p.pkl", "a/b.safetensors"])
def test_a_policy_file_lies_in_the_same_folder(tmp_path: Path, name: str) -> None:
    def change(content: Content) -> None:
        content.update(policy_kind="file", policy=name, policy_sha256="0" * 64)

    with pytest.raises(ResultFileError, match="file name without folders"):
        read_result(forged(tmp_path, change))
