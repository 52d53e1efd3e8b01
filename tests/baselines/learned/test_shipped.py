"""The shipped learned policies: intact, small, and with the scores of their cards."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scripts.ship import CHECK_WORLDS, LARGEST, check_scenarios, make_check, replay

import posse
from posse_baselines import PolicyError, load, policy_names
from posse_baselines.learned import Encoder, Encoding, LearnedPolicy
from posse_baselines.registry import SHIPPED, shipped
from posse_training import evaluate

FILES = sorted(SHIPPED.glob("*.safetensors"))

TOLERANCE = 0.03
"""Two standard errors of a mean over the worlds of a check (32 scores, 0.08 apart).

Another processor rounds otherwise, so that worlds decide otherwise once in a while; `test_digests` notices less.
"""


def test_every_file_is_known_by_its_name() -> None:
    assert sorted(shipped()) == [path.stem for path in FILES]
    assert set(shipped()) <= set(policy_names())


def test_a_name_that_is_not_shipped_is_refused_with_those_that_are() -> None:
    with pytest.raises(PolicyError, match="no policy 'learned-nothing' is shipped") as caught:
        load("learned-nothing")
    assert all(name in str(caught.value) for name in shipped() or ["none yet"])


def problems_of(path: Path) -> list[str]:
    """Reasons against shipping a file; none if it is valid."""
    found = []
    if path.stat().st_size > LARGEST:
        found.append(f"{path.stat().st_size:,} bytes")
    policy = LearnedPolicy.from_file(path)
    card = policy.card
    needed = {
        "check",
        "choice",
        "command",
        "commit",
        "curve",
        "encoding_hash",
        "name",
        "seed",
        "settings",
        "trained_splits",
        "training_seeds",
        "validation_score",
    }
    if missing := sorted(needed - set(card)):
        return [*found, f"its card lacks {', '.join(missing)}"]
    if policy.name != path.stem:
        found.append(f"it calls itself {policy.name!r}")
    if not card["training_seeds"]:
        found.append(f"{len(card['training_seeds'])} training seeds")
    if card["encoding_hash"] != policy.encoding.digest:
        found.append("its inputs are not those that it was trained with")
    if "train" not in policy.trained_splits or "test" in (*policy.trained_splits, card["chosen_on"]):
        found.append(f"trained on {policy.trained_splits}, chosen on {card['chosen_on']!r}")
    if re.search(r"(?<![\w.])/(tmp|home|root|work|Users)/", json.dumps(card)):
        found.append("its card names a folder of the machine it was trained on")
    scenarios = check_scenarios(card["check"])
    for play, scenario in zip(card["check"]["plays"], scenarios, strict=True):
        if scenario.version != play["version"]:
            found.append(
                f"it was trained on version {play['version']} of {scenario.name!r}, which is now at {scenario.version}"
            )
        needs = scenario.replace(message_size=max(scenario.message_size, policy.message_size))
        Encoder(policy.encoding, posse.ObservationLayout(needs))
    return found


# Without shipped files there is nothing to check; with one, no check is skipped.
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_shipped_file_has_all_that_it_needs(path: Path) -> None:
    assert problems_of(path) == []


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=() if path.stem == "learned-smart" else pytest.mark.long) for path in FILES],
    ids=lambda path: path.stem,
)
def test_a_shipped_policy_scores_what_its_card_says(path: Path) -> None:
    policy = LearnedPolicy.from_file(path)
    check = policy.card["check"]
    now, then = replay(policy, check), [play["score"] for play in check["plays"]]
    assert np.mean(now) == pytest.approx(np.mean(then), abs=TOLERANCE)
    np.testing.assert_allclose(now, then, rtol=0, atol=TOLERANCE * (CHECK_WORLDS / check["worlds"]) ** 0.5)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_worlds_that_it_was_trained_on_are_refused(path: Path) -> None:
    policy = load(path.stem)
    with pytest.raises(ValueError, match="was trained on the split 'train'"):
        evaluate(policy, "constant", 1, split="train", progress=False)


# --- with a policy made up here ------------------------------------------------------------------


@pytest.fixture
def made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file as ``scripts/ship.py`` writes it, in the folder where the package looks."""
    monkeypatch.setattr("posse_baselines.registry.SHIPPED", tmp_path)
    path = tmp_path / "learned-made-up.safetensors"
    policy = seeker()
    check = make_check(policy, [posse.get_scenario("constant", horizon=200)])
    policy.with_card({**card_of(policy), "check": check}).save(path)
    return path


def card_of(policy: LearnedPolicy) -> dict[str, Any]:
    return {
        "name": "learned-made-up",
        "choice": {},
        "chosen_on": "validation",
        "command": "posse train",
        "commit": None,
        "curve": [],
        "encoding_hash": policy.encoding.digest,
        "seed": 1,
        "settings": {},
        "trained_splits": ["train"],
        "training_seeds": [{"seed": seed} for seed in (1, 2, 3)],
        "validation_score": 0.1,
    }


def seeker(gain: float = 1.0) -> LearnedPolicy:
    """A hand-written network of one layer that turns towards its slot and drives."""
    from posse_baselines.learned import Network

    encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario("constant")), "slots")
    weight = np.zeros((2, encoding.size), np.float32)
    weight[0, 16] = weight[1, 17] = gain  # ahead and left of the slot among the features
    network = Network(
        np.zeros(encoding.size, np.float32),
        np.full(encoding.size, 3, np.float32),
        10.0,
        (weight,),
        (np.array([0.2, 0.0], np.float32),),
        "tanh",
        "clip",
    )
    return LearnedPolicy(network, encoding, {"name": "learned-made-up"})


def test_a_file_in_the_folder_is_found_by_name(made_up: Path) -> None:
    assert policy_names()[-1] == "learned-made-up"
    assert load("learned-made-up").name == "learned-made-up"
    assert problems_of(made_up) == []


def test_what_is_missing_is_noticed(made_up: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy = LearnedPolicy.from_file(made_up)

    def problems(**changes: Any) -> str:
        policy.with_card({**policy.card, **changes}).save(made_up)
        return "; ".join(problems_of(made_up))

    assert "0 training seeds" in problems(training_seeds=[])
    assert "inputs" in problems(encoding_hash="0" * 16)
    assert "calls itself 'other'" in problems(name="other")
    assert "chosen on 'test'" in problems(chosen_on="test")
    assert "names a folder" in problems(command="posse train --folder /home/me/run")
    stale = json.loads(json.dumps(policy.card["check"]))
    stale["plays"][0]["version"] = 0
    assert "version 0 of 'constant'" in problems(check=stale)
    policy.with_card({"name": "bare"}).save(made_up)
    assert "its card lacks check" in "; ".join(problems_of(made_up))


def test_what_is_wrong_shows(made_up: Path) -> None:
    policy = LearnedPolicy.from_file(made_up)
    check = policy.card["check"]
    recorded = check["plays"][0]["score"]
    assert recorded > 0.1
    assert abs(replay(policy, check)[0] - recorded) < 1e-6
    assert abs(replay(seeker(gain=-1.0), check)[0] - recorded) > 2 * TOLERANCE
