"""The shipped learned targets: intact, small, worth it, and with the scores of their cards."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from scripts.ship import LARGEST, make_target_check

from posse import get_scenario
from posse_baselines import load_target
from posse_baselines.learned import LearnedPolicy
from posse_baselines.targets import SHIPPED_TARGETS, shipped_targets

FILES = sorted(SHIPPED_TARGETS.glob("*.safetensors"))
TOLERANCE = 0.03
"""About two standard errors of the mean of a check."""


def test_every_file_is_known_by_its_name() -> None:
    assert sorted(shipped_targets()) == [path.stem for path in FILES]
    for path in FILES:
        assert load_target(path.stem).name == path.stem


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_shipped_target_is_what_its_card_says(path: Path) -> None:
    policy = LearnedPolicy.from_file(path)
    card = policy.card
    assert path.stat().st_size <= LARGEST
    assert card["encoding_hash"] == policy.encoding.digest
    assert not re.search(r"(?<![\w.])/(tmp|home|root|work|Users)/", json.dumps(card))
    comparison = card["comparison"]
    assert comparison["split"] == "test"
    assert "test" not in policy.trained_splits
    assert comparison["cost"]["low"] >= 0.10, "than the scripted target, for the reference team"
    check = card["check"]
    again = make_target_check(check["team"], get_scenario(check["scenario"]), load_target(path.stem))
    assert again["version"] == check["version"]
    assert again["score"] == pytest.approx(check["score"], abs=TOLERANCE)
