"""Data sets recorded for Minari reload, recover their environment, and replay what they hold."""

import json
from pathlib import Path
from typing import Any

import gymnasium
import minari
import numpy as np
import pytest
from tests.support.runs import killed_at

import posse
from posse_training import datasets
from posse_training.cli import main
from posse_training.datasets import record_dataset
from posse_training.errors import RunFolderError, SettingsError

SHORT: dict[str, Any] = {"horizon": 12, "settle_time": 0.5}


def test_a_data_set_replays_in_the_environment_that_it_recovers(tmp_path: Path) -> None:
    record_dataset(["pursuit", "random"], "radio", 5, out=tmp_path, seed=3, **SHORT)
    data = minari.MinariDataset(tmp_path / "posse/radio/pursuit-and-random-v0/data")
    assert (data.total_episodes, data.total_steps) == (5, 60)
    found = data.recover_environment()
    about = json.loads(data.storage.metadata["posse"])
    assert json.loads(json.dumps(found.unwrapped.scenario.to_dict())) == about["scenario"]
    assert (about["seed"], about["split"], about["version"]) == (3, "train", posse.__version__)
    who = []
    for episode, told in zip(data, data.storage.get_episode_metadata(range(5)), strict=True):
        who.append(told["policy"])
        spec = found.spec
        assert spec is not None
        env = gymnasium.make(spec, first_world=int(told["world"]))
        observation, _ = env.reset(seed=3)
        np.testing.assert_array_equal(observation, episode.observations[0])
        for t, action in enumerate(episode.actions):
            observation, reward, terminated, truncated, info = env.step(action)
            np.testing.assert_array_equal(observation, episode.observations[t + 1])
            assert reward == pytest.approx(episode.rewards[t])
            assert (terminated, truncated) == (episode.terminations[t], episode.truncations[t])
            assert info["score"] == pytest.approx(episode.infos["score"][t + 1])
            for term in posse.REWARD_TERMS:
                np.testing.assert_array_equal(info[f"reward/{term.name}"], episode.infos["reward"][term.name][t + 1])
        assert truncated
        assert told["score"] == pytest.approx(info["metrics/score"])
    assert who == ["pursuit", "random"] * 2 + ["pursuit"]


def test_episodes_have_the_numbers_of_their_worlds(tmp_path: Path) -> None:
    data = record_dataset("random", "constant", 5, out=tmp_path, name="a.1", terminate_on_contact=True, **SHORT)
    assert data.spec.dataset_id == "posse/constant/a-1-v0", "as Minari lets it be called"
    assert [episode.id for episode in data] == list(range(5))


def test_a_recording_that_is_killed_leaves_no_data_set_and_a_whole_one_is_not_overwritten(tmp_path: Path) -> None:
    with killed_at(datasets, "_episode", 3):
        record_dataset("idle", "constant", 30, out=tmp_path, **SHORT)
    assert list(tmp_path.rglob("*.hdf5")) == []
    assert record_dataset("idle", "constant", 2, out=tmp_path, **SHORT).total_episodes == 2
    with pytest.raises(SettingsError, match="exists: remove it"):
        record_dataset("idle", "constant", 1, out=tmp_path, **SHORT)


def test_two_recordings_of_one_name_do_not_lose_the_second_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def again(*_: Any) -> None:
        record_dataset("random", "constant", 1, out=tmp_path, name="one", **SHORT)

    monkeypatch.setattr(datasets, "_episode", again)
    with pytest.raises(RunFolderError, match=r"uses .*: wait, stop it, or choose another"):
        record_dataset("idle", "constant", 1, out=tmp_path, name="one", **SHORT)


def test_the_command_says_how_to_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["record", "idle", "--scenario", "constant", "--episodes", "1", "--out", "data sets"]) == 0
    told = capsys.readouterr().out
    assert "MINARI_DATASETS_PATH='data sets' and minari.load_dataset('posse/constant/idle-v0')" in told
    monkeypatch.setenv("MINARI_DATASETS_PATH", "data sets")
    assert minari.load_dataset("posse/constant/idle-v0")[0].observations.shape[0] == 601
