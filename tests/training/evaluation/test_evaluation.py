import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posse
from posse.numeric import FloatArray
from posse_baselines import BasePolicy, Memory, load
from posse_training import evaluate
from posse_training.evaluation.episodes import ExchangeCounter

FAST: dict[str, Any] = {"progress": False, "horizon": 60}


def test_an_episode_scores_the_same_however_many_are_played() -> None:
    few = evaluate("pursuit", "smart", 3, seed=5, **FAST)
    many = evaluate("pursuit", "smart", 20, seed=5, **FAST)
    for name, column in few.columns.items():
        np.testing.assert_array_equal(column, many[name][:3])


class Spinning(BasePolicy):
    name = "spinning"

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        actions = np.zeros((*observations.shape[:2], 2 + self.message_size), np.float32)
        actions[..., 0] = -1
        actions[..., 1] = 1
        return actions, memory


def test_the_score_is_the_mean_of_the_steps_scores() -> None:
    scenario = posse.get_scenario("constant", horizon=80)
    results = evaluate("pursuit", scenario, 4, seed=3, progress=False)
    batch = posse.Batch(scenario, 4, seed=3, split="test")
    policy = load("pursuit")
    memory, observations = policy.begin(batch.layout, 4), batch.reset()
    scores = []
    for _ in range(80):
        actions, memory = policy.act(observations, memory)
        observations, _, _, _, infos = batch.step(actions)
        scores.append(infos["score"])
    np.testing.assert_allclose(results["score"], np.mean(scores, axis=0), rtol=1e-5, atol=1e-6)


def test_a_split_that_a_policy_was_trained_on_is_refused() -> None:
    class Trained(BasePolicy):
        name = "trained"
        trained_splits = ("train", "validation")

    with pytest.raises(ValueError, match="'trained' was trained on the split 'validation'"):
        evaluate(Trained(), "constant", 1, split="validation", **FAST)  # type: ignore[arg-type]


def test_wrong_numbers_of_episodes_and_unknown_metrics_are_named() -> None:
    with pytest.raises(ValueError, match="episodes=0"):
        evaluate("idle", "constant", 0, **FAST)
    with pytest.raises(KeyError, match="unknown metric 'scor'"):
        evaluate("idle", "constant", 1, **FAST)["scor"]


def test_rows_and_settings_are_written_as_files(tmp_path: Path) -> None:
    results = evaluate("idle", "radio", 3, seed=9, **FAST)
    results.write(tmp_path / "deep" / "idle.csv")
    with (tmp_path / "deep" / "idle.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["world"]) for row in rows] == [0, 1, 2]
    assert [float(row["score"]) for row in rows] == list(results["score"])
    settings = json.loads((tmp_path / "deep" / "idle.json").read_text())
    assert settings["scenario"]["radio_loss"] == posse.get_scenario("radio").radio_loss
    assert (settings["seed"], settings["split"]) == (9, "test")


def test_leader_exchanges_are_counted_where_most_agree() -> None:
    counter = ExchangeCounter(2)
    running = np.array([True, True])
    for leaders in ([[0, 0, 0], [1, 1, 2]], [[0, 1, 2], [1, 1, 1]], [[2, 2, 0], [1, 1, 1]]):
        counter.count(np.array(leaders), running)
    assert list(counter.total) == [1, 0]


@pytest.mark.parametrize("reads", [False, True])
def test_only_a_policy_that_says_so_is_given_the_state(reads: bool) -> None:
    class Spy(Spinning):
        given = False
        reads_state = reads

        def watch(self, batch: posse.Batch) -> None:
            self.given = True

    spy = Spy()
    evaluate(spy, "constant", 1, **FAST)
    assert spy.given is reads
