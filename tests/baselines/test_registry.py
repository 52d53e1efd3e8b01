"""Policies by name, and errors for unknown names."""

from __future__ import annotations

from pathlib import Path

import pytest

from posse_baselines import Policy, PolicyError, load, policy_names
from posse_baselines.ddcs import DDCS
from posse_baselines.registry import is_code, ships_or_is_file


@pytest.mark.parametrize("name", policy_names())
def test_a_name_loads_the_policy_that_bears_it(name: str) -> None:
    policy = load(name)
    assert isinstance(policy, Policy)
    assert policy.name == name


def test_a_class_is_loaded_by_where_it_is() -> None:
    policy = load("posse_baselines.ddcs:DDCS")
    assert isinstance(policy, DDCS)


def test_only_the_planner_reads_the_state() -> None:
    assert [name for name in policy_names() if load(name).reads_state] == ["planner"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("ddcs-distribute", "did you mean 'ddcs-distributed'"),
        ("plannner", "did you mean 'planner'"),
        ("nothing-like-it", "policies are: random, idle, pursuit"),
        ("no_such_module:Team", "cannot import 'no_such_module'"),
        ("posse_baselines.ddcs:DDSC", "has no 'DDSC' .did you mean 'DDCS'"),
        ("posse_baselines.ddcs:Settings", "is not a policy: it must have name"),
    ],
)
def test_a_policy_that_is_not_there_is_named_with_what_is(name: str, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        load(name)


def test_a_file_of_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.pkl"
    path.write_bytes(b"")
    with pytest.raises(PolicyError, match="is not a policy file: known suffixes are"):
        load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "names no class: write") for text in (":x", "x:", "a..b:C", "a:b:c", "a b:C", "a:1")),
        ("", "a name or path has 1 to 4096 characters"),
        ("x" * 5000, r"\.\.\. \(5,000 characters\) cannot be a policy"),
        ("x" * 4000, r"unknown policy 'x{60}'\.\.\. \(4,000 characters\)"),
        ("x" * 4000 + ":y", "cannot import"),
        ("learned-" + "x" * 4000, r"\(4,008 characters\) is shipped"),
        ("x" * 4000 + ".safetensors", r"there is no policy file .*\(4,012 characters\)"),
        ("a\0b.safetensors", "no NUL"),
        ("a\0b:c", "no NUL"),
    ],
)
def test_text_that_names_nothing(text: str, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        load(text)


MODULE = """
from posse_baselines import BasePolicy
class Whole(BasePolicy):
    name = "whole"
    def act(self, observations, memory): ...
class Failing(Whole):
    def __init__(self): raise LookupError("no weights")
class Asking(Whole):
    def __init__(self, weights): ...
class Nameless(Whole):
    name = 3
class Wordy(Whole):
    message_size = -1
class Grudging(Whole):
    @property
    def name(self): raise OSError("not today")
"""


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Failing", "cannot be created without arguments: LookupError: no weights"),
        ("Asking", "cannot be created without arguments: TypeError"),
        ("Nameless", "name=3 must be a str"),
        ("Wordy", "message_size=-1 an int of at least 0"),
        ("Grudging", "OSError: not today"),
    ],
)
def test_a_class_that_makes_no_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str) -> None:
    (tmp_path / "made_up_policies.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert load("made_up_policies:Whole").name == "whole"
    with pytest.raises(PolicyError, match=message):
        load(f"made_up_policies:{name}")


@pytest.mark.parametrize("code", ["1 / 0", "x = (", "import nothing_at_all"])
def test_a_module_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    (tmp_path / "failing_policies.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(PolicyError, match="cannot import 'failing_policies'"):
        load("failing_policies:Any")


def test_what_counts_as_code(tmp_path: Path) -> None:
    (tmp_path / "a:b").touch()
    for text in (*policy_names(), "x.safetensors", "a:b.safetensors"):
        assert ships_or_is_file(text)
        assert not is_code(text)
    for text in ("a:b", "a.b:C", ":x"):
        assert is_code(text)
        assert not ships_or_is_file(text)
    assert not is_code(str(tmp_path / "a:b"))
    for other in ("nobody", 3, None, ["pursuit"], "a\0.safetensors"):
        assert not ships_or_is_file(other)
