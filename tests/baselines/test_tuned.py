"""Tuned policies play the settings of the scenario that they are given; their files are checked."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import DDCS, PolicyError, load, play, tunables
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.tuned import FORMAT, TUNED, read_tuned, tuned_files
from posse_training import evaluate

FILES = [(name, path) for name in TUNED for path in tuned_files(name).values()]
IDS = [f"{name}-{path.stem}" for name, path in FILES]


def batch_of(name: str, **overrides: Any) -> posse.Batch:
    return posse.batch(name, num_worlds=6, seed=5, message_size=5, horizon=150, **overrides)


@pytest.mark.parametrize(("name", "path"), FILES, ids=IDS)
def test_a_file_says_where_it_is_from(name: str, path: Path) -> None:
    card = read_tuned(path).card
    assert card["policy"] == TUNED[name]
    assert card["scenario"] == path.stem
    assert card["scenario_version"] == posse.get_scenario(path.stem).version
    assert card["command"].startswith(f"posse tune {card['policy']} --scenario {path.stem} --gener")
    assert card["command"].endswith(" ".join(["--only", *card["searched"]]))
    assert card["commit"]
    assert card["trained_splits"] == ["train"]
    assert card["chosen_on"] == "validation"
    # "near" may raise "far", which has to exceed it.
    assert set(card["settings"]) - {"far", "range_far"} <= set(card["searched"])
    assert set(card.get("dropped", ())).isdisjoint(tunable.name for tunable in tunables(FAMILY[TUNED[name]]))
    points = {point["generation"]: point["score"] for point in card["curve"]}
    assert points[card["generation"]] == max(points.values()) > points[0]
    assert not re.search(r"(?<![\w.])/(tmp|home|root|work|Users)/", json.dumps(card))


@pytest.mark.long
@pytest.mark.parametrize(("name", "path"), FILES, ids=IDS)
def test_a_tuned_policy_scores_what_its_card_says(name: str, path: Path) -> None:
    check = read_tuned(path).card["check"]
    results = evaluate(name, path.stem, check["worlds"], check["seed"], split=check["split"], progress=False)
    scores = results["safe_score"]
    sampled = max(0.01, 2.0 * float(scores.std()) / len(scores) ** 0.5)  # two standard errors
    assert scores.mean() == pytest.approx(check["safe_score"], abs=sampled)


@pytest.mark.parametrize(("name", "path"), FILES[:: len(FILES) - 1])  # one of each policy
def test_a_tuned_policy_plays_the_settings_of_its_scenario(name: str, path: Path) -> None:
    values = json.loads(path.read_text())["settings"]
    policy: Any = load(name)
    tuned = play(batch_of(path.stem), policy)["score"]
    by_hand = play(batch_of(path.stem), DDCS(FAMILY[TUNED[name]]).with_settings(**values))["score"]
    untuned = play(batch_of(path.stem), load(TUNED[name]))["score"]
    from_file = play(batch_of(path.stem), load(path))["score"]
    np.testing.assert_array_equal(tuned, by_hand)
    np.testing.assert_array_equal(tuned, from_file)
    np.testing.assert_array_equal(tuned, play(batch_of(path.stem), policy.with_settings(radio=True))["score"])
    assert np.any(tuned != untuned)


@pytest.mark.parametrize("name", TUNED)
def test_without_a_file_the_untuned_policy_is_played_and_the_split_of_tuning_is_refused(name: str) -> None:
    scenario = "paper-distributed"
    assert scenario not in tuned_files(name)
    played, untuned = (play(batch_of(scenario), load(each))["score"] for each in (name, TUNED[name]))
    np.testing.assert_array_equal(played, untuned)
    with pytest.raises(ValueError, match=f"'{name}' was trained on the split 'train'"):
        evaluate(name, "constant", 1, split="train", progress=False)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "holds no tuned settings: ValueError: it must have format='posse-tuned-1'"),
        ({"policy": "idle"}, "unknown policy with settings 'idle'.*known: pngl-l"),
        ({"settings": [1]}, "holds no tuned settings: ValueError: unknown tunable setting of pngl 1"),
        ({"settings": {"gian": 1.0}}, r"unknown tunable setting of pngl 'gian' \(did you mean 'gain'"),
        ({"settings": {"gain": "high"}}, "could not convert"),
        ({"settings": {"gain": 7.0}}, r"gain=7.0 must lie in \[0.2, 6\] 1/s"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    card = {"format": FORMAT, "policy": "pngl", "scenario": "smart", "settings": {"near": 0.5}}
    path = tmp_path / "x.json"
    path.write_text(json.dumps({**card, **changes}))
    with pytest.raises(PolicyError, match=message):
        load(path)
