"""Policies by name, and what is said when there is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from posse_baselines import Policy, PolicyError, load, policy_names
from posse_baselines.ddcs import DDCS


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
