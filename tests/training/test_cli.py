"""The command line: fast start, clear errors."""

import json
import os
import shlex
from pathlib import Path

import pytest
from tests.support.process import printed
from tests.support.runs import steps_saved

import posse
from posse_training.cli import COMMANDS, main
from posse_training.options import settings_of, words_of
from posse_training.train.presets import default_settings
from posse_training.train.settings import read_settings

HEAVY = ("numpy", "numba", "torch", "tyro", "rich", "matplotlib", "posse")


@pytest.mark.parametrize(("words", "heavy"), [(["--help"], HEAVY), (["scenarios"], ("torch", "matplotlib"))])
def test_a_command_imports_only_what_it_needs(words: list[str], heavy: tuple[str, ...]) -> None:
    code = (
        f"import sys\nfrom posse_training.cli import main\nassert main({words!r}) == 0\n"
        f"found = sorted(set({heavy!r}) & set(sys.modules))\nassert not found, found"
    )
    text = printed("-c", code, seconds=120)
    assert words != ["scenarios"] or all(name in text for name in posse.scenario_names())


def status_of(words: list[str]) -> object:
    try:
        return main(words)
    except SystemExit as ended:  # of the parser
        return ended.code


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of([name, "--help"]) == 0
    assert f"usage: posse {name}" in capsys.readouterr().out


def test_a_reader_may_go_and_names_may_be_no_utf_8(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.close((pipe := os.pipe())[0])
    for file, words in ((pipe[1], "--help"), (tmp_path / "out", f"replay idle --out {tmp_path}/\udcff.html")):
        with open(file, "w", encoding="utf-8") as out:  # noqa: PTH123
            monkeypatch.setattr("sys.stdout", out)
            assert main(words.split()) == 0


INVALID = {
    "--import nosuch scenarios": "posse: --import nosuch: ModuleNotFoundError",
    "comprae": "unknown command 'comprae': did you mean 'compare'?",
    "watch pursuit --world -1": "world=-1",
    "watch": "No policies given",
    "watch pursuit --out film.avi": "must end in .gif or .mp4",
    "watch pursuit --out film.gif --from 90": "start=90.0 (--from) must be",
    "watch pursuit --size 9 9": "--size 9 9 must be 200 to 4096 px",
    "watch pursuit --speed 2": "--speed is not for a window: leave it out",
    "watch idle --page --out a.gif": "exclude each other",
    "watch idle": "no window can be opened (neither DISPLAY nor WAYLAND_DISPLAY is set): posse watch --page",
    "play --as tracker_9": "--as tracker_9 is no robot; there are: tracker_0",
    "play planner": "foresees a scripted target, not a person",
    "play --out play.txt": "'play.txt' must end in .html",
    "record": "no policies given",
    "record idle --set seed=3": "unknown setting 'seed'",
    "record idle random --episodes 1": "episodes=1 must be at least 2",
    "league --team": "teams=() must be one or more",
    "league --team a/best.json b/best.json": "must have different names",
    "league --team a,b": "without commas",
    "league --team idle --target target-1.safetensors": "'target-1' is how a member that is trained is called",
    "league --scenario nosuch --training seed=5": "training: seed is for the league to set",
    "submit pursuit --out new --name <script>": "name='<script>' must be at most 100 letters",
    "verify nowhere": "posse verify: [Errno 2] No such file or directory: 'nowhere/standing.csv'",
    "demo --seconds -1": "seconds=-1.0 is not a length of a film",
    "reproduce --starts 0": "starts=0 must be at least 1",
    "compare": "No policies given",
    "compare idle mine=": "'mine=' is not a group of policies",
    "compare two=idle,idle": "'two=idle,idle' names a policy twice",
    "compare idle idle=pursuit": "two policies have the label 'idle'",
    "compare \udcff=idle": "the label '\\udcff' is no UTF-8: give another one",
    "compare idle --scenario constant konstant": "unknown scenario 'konstant'",
    "compare idle --scenario --episodes 2": "no scenario is given",
    "compare idle --set name=mine": "unknown setting 'name'",
    "compare idle --ray auto smart": "one address at most",
    "compare idle --target smart --set target_motion=constant": "target_motion='constant' and a target exclude each",
    "replay idle --target smart --set target_motion=slow": "target_motion='slow' and a target exclude each other",
    "watch idle --target smart --set target_motion=smart": "target_motion='smart' and a target exclude each other",
    "submit idle --out new --episodes 0": "episodes=0 must be a whole number",
    "compare pursuit --target smrat": "unknown target 'smrat' (did you mean 'smart'",
    "replay": "1 to 4 players, got 0: give at least one policy",
    "replay none.html --seed 3": "all are replays: leave out the options other than --out",
    "watch idle --out film.gif --speed 1e-5": "too low for a GIF",
    "watch idle --out film.mp4 --speed 1e9": "too high for an MP4, which shows at most 1,000 frames/s",
    "train --scenario search --discount 0.1": "discount=0.1 is for ppo, mappo, sac and td3, not cmaes",
    "train --imitate-rounds 3": "imitate_rounds=3 is for --imitate",
    "train --family-scenarios 5": "family_scenarios=5 is for families of scenarios",
    "train --algorithm sac --steps 10_000": "learning_starts=20000 must be below steps=10000",
    "replay idle --set target_motion=agent": "the target of 'smart' is an agent",
    "replay none.html": "cannot read a replay from none.html",
    "replay idle --set arena=6 arena=4": "'arena' is set twice",
    "train --steps 0 --reward-weights slot=1 --reward_weights contact=1": "--reward-weights is given twice",
    "export pursuit --out x.onnx": "pursuit",
    "tune idle": "policy 'idle' has no tunable settings; pngl-l-phi, pngl",
    "tune pngl --minutes nan": "minutes=nan must lie in [0.001, 10000]",
    "train --safeguard --no-safeguard": "--safeguard is given twice",
    "train --algorithm cmaes --advise mine:Team": "advise='mine:Team' is no script of the package",
    "train --seed 1 1": "seed=1 1 names none, or one twice",
    "train --num-worlds 1 --team-sizes 2 3": "num_worlds=1",
    "train --scenario family-open --num-worlds 64 --target smart constant smart": "or lower family_scenarios",
    "train --set num_trackers=3 --team-sizes 2": "use the setting team_sizes",
    "train --algorithm dqn": "unknown algorithm 'dqn'; algorithms are: ppo",
    "train --algorithm sac --preset residual": "preset='residual' goes with cmaes, not sac",
    "train --algorithm sac --no-safeguard --imitate pursuit": "needs algorithm ppo or mappo, not sac: leave it out",
    "train --algorithm cmaes --encoding plain": "leaves cmaes nothing to read",
    "train --algorithm cmaes --start runs/a": "start='runs/a' does not go with cmaes",
    "train --algorithm cmaes --side target": "corrects no script: use ppo",
    "train --side target --team idle --num-worlds 1 --rollout 1": "a rollout of 1 row is too short to learn from",
    "train --advise ddcs-distributed": "needs algorithm cmaes, not ppo",
    "train --team idle": "team='idle' is of the side that learns, side='trackers'",
    "train --side target --team None": "set team",
    "train --side target --encoding features": "side='target' needs encoding='plain', not 'features'",
    "train --side target --reward-weights slot=1.0": "'slot' has no formula for a target",
    "train --imitate pursuit": "imitate='pursuit' proposes no velocities to the safeguard",
    "train --preset residual --advise planner": "'planner'",
    "train --wandb project": "pip install wandb",
}


@pytest.mark.parametrize("words", INVALID)
def test_what_is_invalid_is_named_before_anything_is_written(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    assert status_of(words.split()) == 2
    shown = " ".join(capsys.readouterr().err.split())
    assert INVALID[words] in shown
    assert "Traceback" not in shown
    assert list(tmp_path.iterdir()) == []


def test_the_command_trains_and_resumes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    arguments = (
        "train --scenario constant --steps 1_280 --num-worlds 4 --team-sizes 2 --hidden 8 8 "
        "--rollout 40 --minibatch 80 --evaluate-worlds 2 --evaluate-every 1280 --beside None --no-tensorboard "
        f"--set horizon=40 settle_time=1.0 --out {folder}"
    )
    assert main(arguments.split()) == 0
    shown = capsys.readouterr().out
    assert "1,280 steps" in shown, "all that were made, with the last rollout"
    _, _, after = shown.partition("\nnext:\n")
    watch, compare, replay = (shlex.split(line) for line in after.splitlines())
    assert (watch[1], compare[1], replay[1]) == ("watch", "compare", "replay")
    assert (folder / "best.safetensors") == Path(watch[2]) == Path(compare[3]) == Path(replay[3])
    assert compare[-4:] == ["--set", "horizon=40", "settle_time=1.0", "num_trackers=2"]
    assert main([*replay[1:], "--seconds", "1"]) == 0
    assert (folder / "replay.html").is_file()
    settings = json.loads((folder / "settings.json").read_text())
    assert settings["steps"] == 1280
    assert settings["overrides"] == {"horizon": 40, "settle_time": 1.0}
    kept = {path: path.read_bytes() for path in folder.iterdir()}
    assert main([*arguments.split(), "--discount", "0.9"]) == 2
    assert "holds a run with discount=0.99, not 0.9: choose another --out" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in folder.iterdir()} == kept
    assert main(arguments.replace("1_280", "1600").split()) == 0
    assert "resuming" in capsys.readouterr().out
    assert json.loads((folder / "settings.json").read_text())["steps"] == steps_saved(folder) == 1600
    steps = [line.split(",")[0] for line in (folder / "curve.csv").read_text().splitlines()]
    assert steps == ["steps", "1280.0", "1600.0"], "no point twice"
    assert main(arguments.split()) == 0
    assert "1,600 steps are made already: none is added" in capsys.readouterr().out


def test_settings_are_read_and_written_alike() -> None:
    words = ["arena=6,4", "target_speed=0.5", "horizon=40", "terminate_on_contact=True", "extra_fields=own,"]
    values = {"arena": (6, 4), "target_speed": 0.5, "horizon": 40, "terminate_on_contact": True}
    assert settings_of(words) == {**values, "extra_fields": ("own",)}
    assert words_of(settings_of(words)) == words
    assert settings_of(["num_neighbours=none", "arena=inf"]) == {"num_neighbours": None, "arena": float("inf")}


def test_several_scenarios_and_targets_of_a_training(tmp_path: Path) -> None:
    small = "--steps 1 --num-worlds 4 --rollout 8 --evaluate-worlds 1 --beside None --no-tensorboard --seed 3"
    named = "--scenario constant accelerating --target smart constant --set arena=30,20 --reward-weights slot=0.2"
    assert main(["train", *named.split(), *small.split(), "--out", str(tmp_path / "run")]) == 0
    found = read_settings(tmp_path / "run" / "settings.json")
    assert (found.scenario, found.opponents) == ("constant,accelerating", {"smart": 1, "constant": 1})
    assert found.reward_weights == {**default_settings().reward_weights, "slot": 0.2}
    assert [given.to_dict()["arena"] for given in found.given] == [(30, 20), (30, 20)]
