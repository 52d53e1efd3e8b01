"""``posse league``: trackers and targets that are trained in turns against the other side's past.

Everything is kept in the folder, so that the same command resumes a league that was interrupted at any moment.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from posse import get_scenario
from posse_baselines import load, load_target
from posse_baselines.fields import number
from posse_baselines.files import read_json, write_json
from posse_baselines.policies.open_loop import OPEN_LOOP
from posse_baselines.registry import is_code
from posse_training.errors import SettingsError, check_settings, require
from posse_training.evaluation.episodes import refuse_trained_split
from posse_training.evaluation.evaluation import evaluate
from posse_training.evaluation.results import Results
from posse_training.evaluation.statistics import Estimate
from posse_training.files import check_held, intact, locked, write_csv
from posse_training.options import Changes, Pairs
from posse_training.provenance import digests
from posse_training.train.presets import default_settings
from posse_training.train.settings import BEST, LAST, TrainSettings

TEAM: Final = "trackers"
TARGET: Final = "target"
SCORES: Final = ("score", "safe_score", "contact_free")
Cell = dict[str, Estimate]
"""What a team scores against a target, by these names; the last one is the share of episodes without contact."""
TEST_SEED: Final = 7
_SHARES: Final = 8  # parts of the worlds that go to the opponents by their difficulty, about
_FREE: Final = ("generations", "responses", "episodes")
"""Settings that the command that resumes a league may change."""
_ITS_OWN: Final = ("scenario", "overrides", "side", "team", "target", "steps", "seed", "start", "folder")
_COLUMNS: Final = 4  # of targets, which fit into 80 characters


@dataclass(frozen=True, kw_only=True)
class LeagueSettings:
    """Train trackers and targets in turns against the other side's past. The same command again resumes a league."""

    scenario: str = "duel"
    """Scenario of all plays."""
    generations: int = number(8, "", 1, 10_000)
    """Generations in all: in each a target is trained, then a team."""
    teams: Annotated[tuple[str, ...], tyro.conf.arg(name="team")] = ("ddcs-tuned",)
    """Teams at the beginning: names or files."""
    targets: Annotated[tuple[str, ...], tyro.conf.arg(name="target")] = ("smart", "constant", *OPEN_LOOP)
    """Targets at the beginning: names or files. Default: smart, constant, and those that read nothing."""
    target_steps: int = number(2_000_000, "", 1, 10**12)
    """Steps of each target's training."""
    team_steps: int = number(6_000_000, "", 1, 10**12)
    """Steps of each team's training, of one tracker each."""
    responses: Literal["last", "all", "none"] = "last"
    """For which generations a best response is trained, which says how much it can be exploited."""
    longer: int = number(1, "", 1, 1000)
    """How many times as long as a member a best response is trained."""
    episodes: int = number(200, "", 2, 10**8)
    """Test worlds of each pair of a team and a target."""
    seed: int = number(1, "", 0, 2**32 - 1)
    """Seed of the trainings."""
    overrides: Changes = field(default_factory=dict)
    """Settings of the scenario to change, such as target_speed=0.5 or arena=6,4."""
    training: Pairs = field(default_factory=dict)
    """Settings of the trainings to change, such as num_worlds=64."""
    folder: Annotated[Path | None, tyro.conf.arg(name="out")] = None
    """Folder; default: runs/league/SCENARIO."""

    def __post_init__(self) -> None:
        check_settings(self)
        for name in ("teams", "targets"):
            labels = [label_of(each) for each in getattr(self, name)]
            if not labels or len(set(labels)) < len(labels):
                raise SettingsError(
                    f"{name}={getattr(self, name)!r:.80} must be one or more, which must have different names: rename "
                    "the files, or leave one out"
                )
            for label in labels:
                if re.fullmatch(r"(trackers|target)-\d+|response to .*", label):
                    raise SettingsError(f"{label!r:.80} is how a member that is trained is called: rename the file")
        for name in self.training.keys() & _ITS_OWN:
            raise SettingsError(f"training: {name} is for the league to set: use its own options, such as --team-steps")
        for each in (*self.teams, *self.targets, str(self.path)):
            if "," in each:
                raise SettingsError(f"{each!r:.80} must be without commas, which stand between opponents: rename it")

    @property
    def path(self) -> Path:
        """The folder that the league is kept in."""
        return (self.folder or Path("runs/league") / self.scenario).resolve()  # members are opponents by their paths

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values, without the folder."""
        return {**asdict(self), "folder": None}


@dataclass(frozen=True)
class Member:
    """A team or a target.

    Attributes:
        label: Its name in tables.
        policy: What loads it: a name or a file.
        run: The folder of its training; ``None``: it was there at the beginning.
    """

    label: str
    policy: str
    run: Path | None = None

    @property
    def trained(self) -> bool:
        """Whether its training has ended, or it needed none."""
        return self.run is None or (self.run / LAST).is_file()


@dataclass(frozen=True)
class Exploited:
    """What a best response gains against a member: by how much it moves the team's score in its own favour.

    Attributes:
        label: The member's label.
        opponent: Label of the strongest opponent of the league.
        gain: Of the best response.
        before: The member's play against that opponent.
        after: Its play against the best response.
    """

    label: str
    opponent: str
    gain: float
    before: Cell
    after: Cell


class League:
    """A league: its members, and all results once it has been played."""

    def __init__(self, settings: LeagueSettings, console: Console) -> None:
        self.settings, self.console = settings, console
        self.scenario = get_scenario(settings.scenario, **settings.overrides)
        self.teams, self.targets = (self._members(side, settings.generations) for side in (TEAM, TARGET))
        self.cells: dict[tuple[str, str], Cell] = {}  # by the labels of team and target
        self.exploited: list[Exploited] = []

    def play(self) -> None:
        """Generations, cross-play, best responses."""
        for generation in range(1, self.settings.generations + 1):
            for side in (TARGET, TEAM):
                self._generation(side, generation)
        self.cells = {(a.label, b.label): self._cell(a, b) for a in self.teams for b in self.targets}
        self._exploit(TARGET, self.teams, self.targets)
        self._exploit(TEAM, self.targets, self.teams)

    def _generation(self, side: str, generation: int) -> None:
        """Train the member of a side, against the other's past and present."""
        *own, trained = self._members(side, generation)
        if trained.trained:
            return
        others = self._members(TEAM if side == TARGET else TARGET, generation - (side == TARGET))
        # Prioritised fictitious self-play: harder ones get more of the worlds.
        parts = shares({other.policy: self._difficulty(side, own[-1], other) for other in others})
        opponents = ",".join(name for name, part in parts.items() for _ in range(part))
        self._train(side, trained, opponents, 1, own)

    def _exploit(self, side: str, of: list[Member], others: list[Member]) -> None:
        """Train best responses of a side to the last member of the other one, or to all, and note what they gain."""
        s = self.settings
        first = {"none": s.generations, "last": s.generations - 1, "all": 0}[s.responses]
        sign = -1 if side == TARGET else 1  # the strongest target has the lowest score
        for generation, to in [*enumerate((m for m in of if m.run is not None), 1)][first:]:
            run = s.path / "responses" / f"{side}-to-{to.label}"
            best = Member(f"response to {to.label}", str(run / BEST), run)
            if not best.trained:
                self._train(side, best, to.policy, s.longer, self._members(side, generation))
            found = {m.label: self._cell(*((to, m) if side == TARGET else (m, to))) for m in (*others, best)}
            after = found.pop(best.label)
            opponent = max(found, key=lambda label: sign * found[label]["score"].value)
            gain = sign * (after["score"].value - found[opponent]["score"].value)
            self.exploited.append(Exploited(to.label, opponent, gain, found[opponent], after))

    def _members(self, side: str, generations: int) -> list[Member]:
        """Return those of a side that were there at the beginning, and those of its first generations."""
        s = self.settings
        found = [Member(label_of(name), name) for name in (s.teams if side == TEAM else s.targets)]
        for generation in range(1, generations + 1):
            run = s.path / f"generation-{generation:02d}" / side
            found.append(Member(f"{side}-{generation}", str(run / BEST), run))
        return found

    def _train(self, side: str, trained: Member, opponents: str, longer: int, own: Sequence[Member]) -> None:
        """Train a member so many times as long as usual, or resume that; it begins where its side's latest ended."""
        from posse_training.train.train import train  # torch

        assert trained.run is not None
        self.console.print(f"{trained.label}: {trained.run}", markup=False)
        start = next((m.run for m in reversed(own) if m.run is not None), None)
        train(self.training(side, trained.run, opponents, longer, start), console=self.console)

    def training(
        self, side: str, run: Path, opponents: str, longer: int = 1, start: Path | None = None
    ) -> TrainSettings:
        """Return the settings of a side's training in a folder, against opponents separated by commas."""
        s = self.settings
        steps = longer * (s.target_steps if side == TARGET else s.team_steps)
        algorithm = s.training.get("algorithm", "ppo")  # the default of some scenarios, cmaes, goes on from no member
        values = {
            **default_settings(s.scenario, algorithm, side=side).to_dict(),
            "steps": steps,
            "seed": s.seed,
            "overrides": s.overrides,
            "team" if side == TARGET else "target": opponents,
            "start": None if start is None else str(start),
            "folder": run,
            "evaluate_every": max(1, steps // 4),
            "evaluate_worlds": 64,
            "checkpoint_every": max(1, steps // 8),
            "tensorboard": False,
            "beside": None,
        }
        return TrainSettings.from_dict({**values, **s.training})

    def _difficulty(self, side: str, own: Member, other: Member) -> float:
        """Return how hard an opponent is for a member, in [0, 1].

        For a team 1 less its safe score; for a target the team's score.
        """
        seed, worlds = 1, 32  # of the validation worlds
        if side == TARGET:
            return float(self._play(other, own, worlds, seed, "validation")["score"].mean())
        return 1 - float(self._play(own, other, worlds, seed, "validation")["safe_score"].mean())

    def _cell(self, team: Member, target: Member) -> Cell:
        """Return what a team scores against a target; a pair that was played before is read."""
        path = self.settings.path / "cross-play" / team.label / f"{target.label}-{self.settings.episodes}.json"
        if not path.is_file():
            results = self._play(team, target, self.settings.episodes, TEST_SEED, "test")
            path.parent.mkdir(parents=True, exist_ok=True)
            write_json(path, {name: asdict(results.estimate(name)) for name in SCORES})
        with intact(path):
            return {name: Estimate(**score) for name, score in read_json(path).items()}

    def _play(self, team: Member, target: Member, episodes: int, seed: int, split: str) -> Results:
        self.console.print(f"playing {team.label} against {target.label}", markup=False)
        return evaluate(team.policy, self.scenario, episodes, seed, target=target.policy, split=split, progress=False)


def play_league(settings: LeagueSettings, *, console: Console | None = None) -> League:
    """Train the generations that are missing, play all against all, train best responses."""
    from posse_training.train.train import check_before  # torch

    found = League(settings, console or Console())
    for side, others, read in ((TARGET, settings.teams, load), (TEAM, settings.targets, load_target)):
        for other in others:
            refuse_trained_split(read(other), "test")
        check_before(first := found.training(side, settings.path, ",".join(others)))
        met = len(others) + settings.generations  # by the last member of the side
        if first.num_worlds < (most := met + _SHARES + met // 2):  # parts, as shares() rounds them
            raise SettingsError(f"num_worlds={first.num_worlds} is too few for {met} opponents in the end: use {most}")
    with locked(settings.path):
        held = {**settings.to_dict(), "scenario_version": found.scenario.version}
        held |= digests((*settings.teams, *settings.targets))
        check_held(file := settings.path / "league.json", held, _FREE)
        if any(found._members(side, settings.generations + 1)[-1].trained for side in (TARGET, TEAM)):
            less = f"generations={settings.generations} is less than {settings.path} has"
            raise SettingsError(f"{less}: raise it, or choose another --out")
        write_json(file, held)
        found.play()
        write_results(found)
    return found


def label_of(name: str) -> str:
    """Return how tables name one that was there at the beginning: its name, or that of its file."""
    return name if is_code(name) else Path(name).stem


def shares(difficulties: Mapping[str, float]) -> dict[str, int]:
    """Return how many parts of the worlds each opponent gets: one, and about eight by their difficulties in [0, 1].

    None is left out: a member that no longer meets an easy opponent forgets how to play it without contact.
    """
    total = sum(difficulties.values()) or 1.0
    return {name: 1 + round(_SHARES * d / total) for name, d in difficulties.items()}


def write_results(found: League) -> None:
    """Write matrix and summary to the league's folder."""
    folder = found.settings.path
    rows = []
    for (team, target), cell in found.cells.items():
        score, other = cell["score"], {name: cell[name].value for name in ("safe_score", "contact_free")}
        values = {"score": score.value, "low": score.low, "high": score.high, **other}
        texts = {name: f"{value:.4f}" for name, value in values.items()}
        rows.append({"team": team, "target": target, **texts, "episodes": score.count})
    write_csv(folder / "matrix.csv", rows)
    summary = {
        "settings": found.settings.to_dict(),
        "cells": [
            {"team": team, "target": target, **{name: asdict(e) for name, e in cell.items()}}
            for (team, target), cell in found.cells.items()
        ],
        "exploited": [asdict(one) for one in found.exploited],
    }
    write_json(folder / "summary.json", summary)


def draw_matrix(found: League) -> list[Path]:
    """Write the matrix of scores as PNG and SVG to the league's folder; return the files."""
    import matplotlib as mpl

    from posse_training.style import RC, WIDTH, note, plain, save, subplots

    s, teams, targets = found.settings, [t.label for t in found.teams], [t.label for t in found.targets]
    scores = [[found.cells[a, b]["score"] for b in targets] for a in teams]
    with mpl.rc_context({**RC, "axes.grid": False}):
        figure, axis = subplots(1, 1, (WIDTH, 1.4 + 0.42 * len(teams)))
        image = axis.imshow([[v.value for v in row] for row in scores], vmin=0, vmax=1, cmap="cividis", aspect="auto")
        axis.set_xticks(range(len(targets)), [plain(t) for t in targets], rotation=35, ha="right")
        axis.set_yticks(range(len(teams)), [plain(t) for t in teams])
        axis.set(xlabel="target", ylabel="team")
        for i, row in enumerate(scores):
            for j, score in enumerate(row):
                text = f"{score.value:.2f}\n±{(score.high - score.low) / 2:.2f}"
                colour = "white" if score.value < 0.55 else "black"
                axis.text(j, i, text, ha="center", va="center", color=colour, fontsize=7)
        figure.colorbar(image, label="score of the team", shrink=0.8)
        changed = "".join(f", {name}={value}" for name, value in s.overrides.items())
        played = f"{s.scenario} v{found.scenario.version}{changed}: {s.episodes:,} worlds a pair"
        note(figure, plain(f"{played}, test split, seed {TEST_SEED}; training seed {s.seed}"))
        return save(figure, s.path, "matrix")


def tables(found: League) -> list[Table]:
    """Return the matrix and what the best responses gain, as tables."""
    matrices = []
    for first in range(0, len(found.targets), _COLUMNS):
        part = found.targets[first : first + _COLUMNS]
        matrix = Table("team", title="score of the team (row) against the target (column), 95 % intervals")
        for target in part:
            matrix.add_column(Text(target.label))
        for team in found.teams:
            scores = [found.cells[team.label, target.label]["score"] for target in part]
            matrix.add_row(Text(team.label), *(f"{s.value:.2f}\n[{s.low:.2f}, {s.high:.2f}]" for s in scores))
        matrices.append(matrix)
    exploited = Table(
        "member", "strongest opponent so far", "score", "with the response", "gain", title="best responses"
    )
    for e in found.exploited:
        numbers = str(e.before["score"]), str(e.after["score"]), f"{e.gain:+.3f}"
        exploited.add_row(Text(e.label), Text(e.opponent), *numbers)
    return [*matrices, exploited] if found.exploited else matrices


def main(arguments: Sequence[str]) -> None:
    """Play a league, and print its matrix."""
    settings = tyro.cli(LeagueSettings, prog="posse league", args=arguments)
    require("training", "torch", "stable_baselines3")
    found = play_league(settings)
    console = Console()
    for table in tables(found):
        console.print(table)
    for path in draw_matrix(found):
        print(path)
