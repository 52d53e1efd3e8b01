"""Policies and targets by name, file and code; errors for those that are not there; matches with a target."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.learned import policy_for, target_for

import posse
from posse_baselines import PolicyError, batch_for, deploy, load, load_target, play, policy_names, target_names
from posse_baselines.policies.open_loop import OPEN_LOOP

SHORT = posse.get_scenario("smart", num_trackers=3, horizon=30, settle_time=1.0)


@pytest.mark.parametrize(
    ("read", "name", "message"),
    [
        (load, "ddcs-distribute", "did you mean 'ddcs-distributed'"),
        (load, "nothing-like-it", f"known: {', '.join(policy_names())}"),
        (load, "no_such_module:Team", "'no_such_module:Team' cannot be imported.*ModuleNotFoundError"),
        (load, "posse_baselines.ddcs:DDSC", "unknown name 'DDSC' .did you mean 'DDCS'"),
        (load, "posse_baselines.ddcs:Settings", "is not a policy: it must have name"),
        *((load, text, "cannot be imported") for text in (":x", "x:", "a..b:C", "a b:C", "a\0b:c")),
        (load, "x" * 5000, "unknown policy"),
        (load, "none.safetensors", "there is no policy file none"),
        (load, __file__, "is not a policy file: known suffixes are"),
        (load_target, "agent", "unknown target 'agent'"),
        (load_target, __file__, "not a policy file"),
        (load_target, "posse_baselines:load", "lacks begin, act or restart"),
        (load_target, "a\0b", "unknown target"),
    ],
)
def test_what_is_not_there_is_named_with_what_is(read: Callable[[str], object], name: str, message: str) -> None:
    with pytest.raises(PolicyError, match=message) as caught:
        read(name)
    assert len(str(caught.value)) < 1000


MODULE = """
from posse_baselines import BasePolicy
class Whole(BasePolicy):
    name = "whole"
    def act(self, observations, memory): ...
class Failing(Whole):
    def __init__(self): raise LookupError("no weights")
class Asking(Whole):
    def __init__(self, weights): ...
"""


def test_code_that_makes_no_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made_up_policies.py").write_text(MODULE)
    (tmp_path / "failing_policies.py").write_text("1 / 0")
    (tmp_path / "exiting_policies.py").write_text("exit(3)")
    (tmp_path / "a:b").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    assert load("made_up_policies:Whole").name == "whole"
    for name, message in (
        ("made_up_policies:Failing", "or created without arguments: LookupError: no weights"),
        ("made_up_policies:Asking", "or created without arguments: TypeError"),
        ("failing_policies:Any", "'failing_policies:Any' cannot be imported, or created.*: ZeroDivisionError"),
        ("exiting_policies:Any", "'exiting_policies:Any' cannot be imported, or created.*: SystemExit: 3"),
        (str(tmp_path / "a:b"), "is not a policy file"),
    ):
        with pytest.raises(PolicyError, match=message):
            load(name)


def test_a_scripted_target_is_the_scenarios_motion() -> None:
    assert set(target_names()) >= {"constant", "accelerating", "smart"}
    assert "agent" not in target_names()
    target = load_target("accelerating")
    assert target.motion == "accelerating"
    assert target.policy is None
    assert load_target(target) is target
    resting = load_target("posse_baselines.policies.simple:Idle")
    assert (resting.name, resting.motion) == ("idle", "agent")


def test_the_sides_are_not_mixed_up(tmp_path: Path) -> None:
    file, team = tmp_path / "evader.safetensors", tmp_path / "team.safetensors"
    target_for(SHORT).save(file)
    with pytest.raises(PolicyError, match=r"moves a target: give it as target="):
        load(file)
    policy_for(posse.ObservationLayout(SHORT)).save(team)
    with pytest.raises(PolicyError, match="policy of a team, 'mine'"):
        load_target(team)
    evader = load_target(file)
    policy: Any = evader.policy
    with pytest.raises(PolicyError, match="'evading' moves a target"):
        deploy(policy, posse.Robot("duel", 0))
    with pytest.raises(TypeError, match="is no target: give a name"):
        load_target(policy)
    with pytest.raises(PolicyError, match="plays the target's motion ahead"):
        batch_for(load("planner"), SHORT, 1, evader)
    with pytest.raises(PolicyError, match="give a target too"):
        play(posse.Batch(SHORT.replace(target_motion="agent"), 1), load("pursuit"))


@pytest.mark.long
def test_no_open_loop_target_costs_the_tuned_script_more_than_a_tenth() -> None:
    team, scores = load("ddcs-tuned"), {}
    for name in ("smart", "constant", *OPEN_LOOP):
        found = play(batch_for(team, "duel", 40, load_target(name), seed=3, split="test"), team)
        scores[name] = found["safe_score"].mean()
        assert name == "smart" or found["contact_free"].mean() > 0.97, name
    assert min(scores.values()) > scores["smart"] - 0.1, scores


def test_an_open_loop_target_restarts_with_its_world() -> None:
    policy = OPEN_LOOP["stop-and-go"]
    clock = policy.begin(posse.batch("duel", 2).layout, 2)
    row = np.zeros((2, 1, 1), np.float32)
    for _ in range(16):
        actions, clock = policy.act(row, clock)
    assert actions[:, 0, 0].tolist() == [1.0, 1.0]
    clock = policy.restart(clock, np.array([True, False]))
    actions, clock = policy.act(row, clock)
    assert actions[:, 0, 0].tolist() == [-1.0, 1.0]
