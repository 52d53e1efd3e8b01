"""The shipped learned teams and targets: intact, small, and with the scores of their cards."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scripts.ship import CHECK_WORLDS, LARGEST, check_scenarios, make_target_check, replay

import posse
from posse_baselines import batch_for, load_target
from posse_baselines.learned import Encoder, LearnedPolicy
from posse_baselines.registry import SHIPPED, SHIPPED_TARGETS

TEAMS = sorted(SHIPPED.glob("*.safetensors"))
TARGETS = sorted(SHIPPED_TARGETS.glob("*.safetensors"))
NEEDED = {"check", "choice", "command", "commit", "curve", "name", "seed", "settings"}
NEEDED |= {"trained_splits", "training_seeds", "validation_score"}

TOLERANCE = 0.03
"""Two standard errors of a mean over the worlds of a check (32 scores, 0.08 apart).

Another processor rounds otherwise, so that worlds decide otherwise once in a while; `test_digests` notices less.
"""


@pytest.mark.parametrize("path", [*TEAMS, *TARGETS], ids=lambda path: path.stem)
def test_a_shipped_file_is_whole_and_of_this_version(path: Path) -> None:
    policy = LearnedPolicy.from_file(path)
    card = policy.card
    assert path.stat().st_size <= LARGEST
    assert policy.name == path.stem
    assert "test" not in policy.trained_splits
    assert not re.search(r"(?<![\w.])/(tmp|home|root|work|Users)/", json.dumps(card)), "folders of a machine"


@pytest.mark.parametrize("path", TEAMS, ids=lambda path: path.stem)
def test_a_shipped_team_says_how_it_was_made(path: Path) -> None:
    policy = LearnedPolicy.from_file(path)
    card = policy.card
    assert set(card) >= NEEDED
    assert card["training_seeds"]
    assert ("train" in policy.trained_splits, card["chosen_on"]) == (True, "validation")
    scenarios = check_scenarios(card["check"])
    assert [play["version"] for play in card["check"]["plays"]] == [scenario.version for scenario in scenarios]
    for scenario in scenarios:
        Encoder(policy.encoding, batch_for(policy, scenario).layout, 1)


@pytest.mark.long
@pytest.mark.parametrize("path", TEAMS, ids=lambda path: path.stem)
def test_a_shipped_team_scores_what_its_card_says(path: Path) -> None:
    policy = LearnedPolicy.from_file(path)
    check = policy.card["check"]
    now, then = replay(policy, check), [play["score"] for play in check["plays"]]
    assert np.mean(now) == pytest.approx(np.mean(then), rel=0, abs=TOLERANCE)
    np.testing.assert_allclose(now, then, rtol=0, atol=TOLERANCE * (CHECK_WORLDS / check["worlds"]) ** 0.5)


@pytest.mark.parametrize("path", TARGETS, ids=lambda path: path.stem)
def test_a_shipped_target_costs_what_its_card_says(path: Path) -> None:
    comparison, check = (LearnedPolicy.from_file(path).card[part] for part in ("comparison", "check"))
    assert comparison["split"] == "test"
    assert comparison["cost"]["low"] >= 0.10, "than the scripted target, for the reference team"
    again = make_target_check(check["team"], posse.get_scenario(check["scenario"]), load_target(path.stem))
    assert again["version"] == check["version"]
    assert again["score"] == pytest.approx(check["score"], rel=0, abs=TOLERANCE)
