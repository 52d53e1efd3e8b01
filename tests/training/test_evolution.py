"""Evolution: a correction begins as the script; it resumes exactly, and treats a mirrored world as the world."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file
from tests.support.runs import killed_at, quiet, resume, small

import posse
from posse_baselines import begin, load
from posse_training import evolution
from posse_training.errors import RunFolderError
from posse_training.evaluation import evaluate
from posse_training.evolution import Candidates
from posse_training.train.train import train

EVOLVED: dict[str, Any] = {
    "advise": "ddcs-tuned",
    "scenario": "constant",
    # So near to the target that slots are held from the start on.
    "overrides": {"horizon": 40, "settle_time": 1.0, "start_distance": (1.0, 2.0)},
    "population": 4,
    "deviation": 0.5,
    "steps": 6000,
    "evaluate_every": 2560,
}
NOTHING: dict[str, Any] = {**EVOLVED, "advise": None, "safeguard": True}


def test_it_begins_as_the_script_and_keeps_the_best(tmp_path: Path) -> None:
    settings = small(tmp_path, "cmaes", **EVOLVED)
    best = train(settings, console=quiet())
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    curve = {int(float(row["steps"])): float(row["safe_score"]) for row in csv.DictReader(lines)}
    assert list(curve) == [0, 2560, 5120, 6400], "four candidates, four worlds, two trackers, 40 steps: 1,280"
    assert len(set(curve.values())) > 1
    for policy, score in (("ddcs-tuned", curve[0]), (load(best), max(curve.values()))):
        played = evaluate(policy, settings.given[0], 3, 0, split="validation", progress=False)
        assert played["safe_score"].mean() == pytest.approx(score, abs=1e-12)


def test_an_interrupted_evolution_ends_as_an_uninterrupted_one(tmp_path: Path) -> None:
    train(small(tmp_path / "whole", "cmaes", **EVOLVED), console=quiet())
    with killed_at(evolution, "write_json", 3):
        train(small(tmp_path / "cut", "cmaes", **EVOLVED), console=quiet())
    shutil.copytree(tmp_path / "cut", tmp_path / "ended")
    resume(tmp_path / "ended", steps=1)
    assert (tmp_path / "ended/curve.csv").read_text().splitlines()[-1].startswith("1280.0,")
    resume(tmp_path / "cut")
    resume(tmp_path / "cut", steps=1)
    mine, other = (load_file(tmp_path / name / "last.safetensors") for name in ("whole", "cut"))
    np.testing.assert_equal(mine, other)
    assert np.any(mine["layers.0.weight"] != 0.0)
    versions = json.loads((tmp_path / "cut" / "software.json").read_text())
    (tmp_path / "cut" / "software.json").write_text(json.dumps({**versions, "numpy": "1.0"}))
    with pytest.raises(RunFolderError, match=r"numpy"):
        resume(tmp_path / "cut")


@pytest.mark.parametrize(("how", "start"), [(EVOLVED, "ddcs-tuned"), (NOTHING, "idle")])
def test_a_mirrored_world_is_played_as_the_world(tmp_path: Path, how: dict[str, Any], start: str) -> None:
    """Three trackers and a target, and the same with every y and every heading turned round."""
    train(small(tmp_path, "cmaes", **{**how, "steps": 1280}), console=quiet())
    policy: Any = load(tmp_path / "last.safetensors")
    assert policy.safeguard == (how is NOTHING)
    begun, actions = load(start), {}
    for side in (1.0, -1.0):
        batch = posse.batch("constant", 1, num_trackers=3, message_size=policy.message_size)
        poses = np.array([[[1.0, 2.0, 0.3], [-3.0, 1.0, -0.4], [2.0, -3.0, 1.0]]]) * (1.0, side, side)
        observations = batch.reset(options={"tracker_pose": poses, "target_pose": [[4.0, side, 0.5 * side]]})
        for team in (policy, begun):
            actions[team.name, side] = team.act(observations, begin(team, batch))[0][0, :, :2]
    there, mirrored = actions[policy.name, 1.0], actions[policy.name, -1.0]
    assert np.abs(there - actions[begun.name, 1.0]).max() > 0.01, "it has learned"
    np.testing.assert_allclose(mirrored, there * (1.0, -1.0), rtol=1e-3, atol=1e-3)


def test_candidates_play_the_same_worlds_as_alone(tmp_path: Path) -> None:
    """Each of three at once has the score that it has alone, in two worlds of each of two opponents."""
    changes = {**EVOLVED, "overrides": {**EVOLVED["overrides"], "horizon": 60}, "num_worlds": 4}
    settings = small(tmp_path, "cmaes", **changes, target="smart,evader")
    weights = np.zeros((3, 2, 17), np.float32)
    weights[1:] = np.random.default_rng(0).normal(0.0, 0.1, (2, 2, 17))
    together = Candidates(settings, weights).scores(5, None)
    alone = [Candidates(settings, weights[k : k + 1]).scores(5, None)[0] for k in range(3)]
    assert together == pytest.approx(alone, abs=0.002)  # longer episodes would amplify rounding
    assert np.ptp(alone) > 0.05
    bare, scores = {**changes, "advise": None, "safeguard": False, "target": "smart,evader"}, []
    for ends in (False, True):  # by contact, which scores ignore
        bare["overrides"] = {**changes["overrides"], "terminate_on_contact": ends}
        scores.append(Candidates(small(tmp_path, "cmaes", **bare), 20 * weights[..., :15]).scores(5, None))
    assert scores[0] == scores[1]
