"""Everything that writes files, as a table: how it is called, and what it has to leave.

The campaigns that kill, fill the disk and run two at once take all rows. To add a command, add one.
"""

from __future__ import annotations

import csv
import functools
import json
import shlex
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from tests.fuzz.elsewhere import CALLS, run, timed
from tests.fuzz.kernel_cache import KERNELS
from tests.support.runs import numbers, small

from posse_baselines import load
from posse_baselines.learned import LearnedPolicy
from posse_training.replay import read_replay
from posse_training.runs.saved.checkpoint import read_checkpoint
from posse_training.runs.saved.command import command_of
from posse_training.runs.settings import read_settings

Arguments = Callable[[Path], list[str]]


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder, by path; none where there is no folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@dataclass(frozen=True)
class Command:
    """A command that writes.

    Attributes:
        first: Its arguments, given the folder in which it writes.
        again: Its arguments after it was ended before its time.
        left: Returns what a finished one leaves, to be compared bit for bit; without times.
        sound: Raises if a file is damaged, whenever the command was ended.
        old: Arguments of one whose result is there before; ``None``: it refuses to replace one.
        never_fails: Whether a full disk is no error, but only costs time.
    """

    first: Arguments
    again: Arguments
    left: Callable[[Path], Any] = contents
    sound: Callable[[Path], None] = field(default=lambda folder: None)
    old: Arguments | None = None
    never_fails: bool = False

    @property
    def is_call(self) -> bool:
        """Whether it is not a command of ``posse``."""
        return self.first(Path())[0] in CALLS


@dataclass(frozen=True)
class Reference:
    """What an undisturbed command leaves, what was there before, and how long it takes."""

    left: Any
    old: Any
    seconds: float
    size: int


@functools.cache
def reference(name: str) -> Reference:
    """Run a command undisturbed, once a process."""
    command = COMMANDS[name]
    with tempfile.TemporaryDirectory() as temporary:
        folder, old = Path(temporary) / "folder", None
        folder.mkdir()
        if command.old is not None:
            ended = run(command.old(folder))
            assert ended.status == 0, ended.printed
            old = command.left(folder)
        ended, seconds = timed(command.first(folder))
        assert ended.status == 0, ended.printed
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        return Reference(command.left(folder), old, seconds, size)


def prepare(name: str, folder: Path) -> None:
    """Make a folder as it is before a command, with the result of an older one if there can be."""
    command = COMMANDS[name]
    folder.mkdir()
    if command.old is not None:
        kept = _old(name)
        shutil.copytree(kept, folder, dirs_exist_ok=True)


@functools.cache
def _kept() -> Any:
    return tempfile.TemporaryDirectory()


@functools.cache
def _old(name: str) -> Path:
    command, folder = COMMANDS[name], Path(_kept().name) / name
    assert command.old is not None
    folder.mkdir()
    ended = run(command.old(folder))
    assert ended.status == 0, ended.printed
    return folder


def judge_unfinished(name: str, folder: Path) -> None:
    """Raise if a command that was ended before its time has left anything damaged or half done."""
    command, whole = COMMANDS[name], reference(name)
    command.sound(folder)
    if command.old is not None:
        found = command.left(folder)
        assert found in (whole.old, whole.left), f"neither the old nor the new one: {[*found]}"


# train


def _training(algorithm: str, **changes: Any) -> Arguments:
    def arguments(folder: Path) -> list[str]:
        settings = small(folder / "run", algorithm, **changes)
        return [*shlex.split(command_of(settings))[1:], "--folder", str(folder / "run")]

    return arguments


def _resumed(algorithm: str, **changes: Any) -> Arguments:
    def arguments(folder: Path) -> list[str]:
        if (folder / "run" / "settings.json").exists():
            return ["train", "--resume", str(folder / "run")]
        return _training(algorithm, **changes)(folder)

    return arguments


def _left_by_training(folder: Path) -> Any:
    run_folder = folder / "run"
    found = numbers(run_folder)
    with (run_folder / "curve.csv").open(newline="") as file:
        curve = [{**row, "seconds": ""} for row in csv.DictReader(file)]
    best = LearnedPolicy.from_file(run_folder / "best.safetensors").network.tensors()
    named = {f"{part}/{k}": a for part in ("arrays", "last") for k, a in found[part].items()}
    named |= {f"best/{k}": a for k, a in best.items()}
    arrays = {name: (str(a.dtype), a.shape, a.tobytes()) for name, a in named.items()}
    return {"arrays": arrays, "state": found["state"], "curve": curve}


def _sound_run(folder: Path) -> None:
    run_folder = folder / "run"
    if (run_folder / "settings.json").exists():
        read_settings(run_folder / "settings.json")
    if (run_folder / "checkpoint.safetensors").exists():
        read_checkpoint(run_folder)
    for path in run_folder.glob("[a-z]*.safetensors"):
        if path.name != "checkpoint.safetensors":
            LearnedPolicy.from_file(path)
    for path in run_folder.glob("[a-z]*.json"):
        json.loads(path.read_text())


# tune


def _tuning(folder: Path) -> list[str]:
    return [
        "tune",
        "pngl-l-phi",
        "--scenario",
        "constant",
        "--generations",
        "3",
        "--population",
        "4",
        "--worlds",
        "2",
        "--validation-worlds",
        "4",
        "--every",
        "1",
        "--only",
        "navigation_constant",
        "gain",
        "--out",
        str(folder / "run"),
    ]


def _left_by_tuning(folder: Path) -> bytes:
    return (folder / "run" / "tuned.json").read_bytes()


def _sound_tuning(folder: Path) -> None:
    tuned = folder / "run" / "tuned.json"
    if tuned.exists():
        load(str(tuned))
    if (folder / "run" / "state.json").exists():
        json.loads((folder / "run" / "state.json").read_text())


# league


def _league(folder: Path) -> list[str]:
    return [
        "league",
        "--scenario",
        "smart",
        "--generations",
        "1",
        "--teams",
        "idle",
        "--target-steps",
        "160",
        "--team-steps",
        "320",
        "--response-steps",
        "160",
        "--episodes",
        "2",
        "--responses",
        "none",
        "--overrides",
        "horizon",
        "40",
        "settle_time",
        "1.0",
        "num_trackers",
        "2",
        "--training",
        "num_worlds",
        "4",
        "rollout",
        "20",
        "minibatch",
        "32",
        "epochs",
        "1",
        "evaluate_worlds",
        "2",
        "--folder",
        str(folder / "league"),
    ]


def _left_by_league(folder: Path) -> dict[str, Any]:
    """Return the policies' numbers, and what the pairs scored."""
    league = folder / "league"
    found: dict[str, Any] = {}
    for path in sorted(league.rglob("[a-z]*.safetensors")):
        if path.name != "checkpoint.safetensors":
            tensors = LearnedPolicy.from_file(path).network.tensors()
            name = str(path.relative_to(league))
            found[name] = {k: (a.shape, a.tobytes()) for k, a in tensors.items()}
    for path in sorted(league.rglob("*.json")):
        if path.parent.name == "cross-play":
            found[path.name] = json.loads(path.read_text())
    return found


def _sound_league(folder: Path) -> None:
    for path in sorted((folder / "league").rglob("[a-z]*.json")):
        json.loads(path.read_text())
    for path in sorted((folder / "league").rglob("[a-z]*.safetensors")):
        if path.name == "checkpoint.safetensors":
            read_checkpoint(path.parent)
        else:
            LearnedPolicy.from_file(path)


# compare


def _comparison(policies: str) -> Arguments:
    return lambda folder: [
        "compare",
        *policies.split(),
        "--scenarios",
        "constant",
        "smart",
        "--episodes",
        "3",
        "--out",
        str(folder / "out"),
        "--no-figures",
        "--planner-episodes",
        "0",
    ]


def _left_by_comparison(folder: Path) -> Any:
    # Killed between the two renames at its end, the old one is beside its place.
    out, previous = folder / "out", folder / ".out.previous"
    return contents(out if out.exists() else previous)


# replay, policy files, kernels


def _replay(policy: str) -> Arguments:
    return lambda folder: [
        "replay",
        policy,
        "--scenario",
        "constant",
        "--seconds",
        "5",
        "--out",
        str(folder / "page.html"),
    ]


def _left_by_replay(folder: Path) -> Any:
    return {name: data for name, data in contents(folder).items() if name == "page.html"}


def _sound_page(folder: Path) -> None:
    read_replay(folder / "page.html")


def _saved(scenario: str) -> Arguments:
    return lambda folder: ["save-policy", str(folder / "mine.safetensors"), scenario]


def _left_by_saving(folder: Path) -> Any:
    return {n: data for n, data in contents(folder).items() if n == "mine.safetensors"}


def _sound_policy(folder: Path) -> None:
    LearnedPolicy.from_file(folder / "mine.safetensors")
    json.loads((folder / "mine.json").read_text())


def _kernels(folder: Path) -> list[str]:
    return ["compile-kernels", str(folder / "cache"), str(_code())]


@functools.cache
def _code() -> Path:
    """Write the kernels elsewhere than their cache, whose disk may be full."""
    folder = Path(_kept().name) / "code"
    (folder / "fuzzed").mkdir(parents=True)
    (folder / "fuzzed" / "__init__.py").touch()
    (folder / "fuzzed" / "kernels.py").write_text(KERNELS)
    return folder


COMMANDS: Final[dict[str, Command]] = {
    "train ppo": Command(
        _training("ppo", tensorboard=True), _resumed("ppo", tensorboard=True), _left_by_training, _sound_run
    ),
    "train sac": Command(_training("sac"), _resumed("sac"), _left_by_training, _sound_run),
    "league": Command(_league, _league, _left_by_league, _sound_league),
    "tune": Command(_tuning, _tuning, _left_by_tuning, _sound_tuning),
    "compare": Command(
        _comparison("pursuit idle"), _comparison("pursuit idle"), _left_by_comparison, old=_comparison("idle")
    ),
    "replay": Command(_replay("pursuit"), _replay("pursuit"), _left_by_replay, _sound_page, old=_replay("idle")),
    "policy file": Command(_saved("field"), _saved("field"), _left_by_saving, _sound_policy, old=_saved("smart")),
    "kernel cache": Command(_kernels, _kernels, lambda folder: None, never_fails=True),
}
