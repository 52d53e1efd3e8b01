"""One comparison while it is played and written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, Protocol

from posse import get_scenario
from posse_baselines import PolicyError
from posse_training.cluster.settings import WORLDS
from posse_training.cluster.shards import cut
from posse_training.errors import SettingsError
from posse_training.replay import Replay, join
from posse_training.reports.comparing.comparison import Comparison, summary
from posse_training.reports.comparing.contenders import Contender
from posse_training.reports.comparing.extremes import Extreme, extremes
from posse_training.reports.comparing.folder import FileNames
from posse_training.reports.comparing.players import Play, Players
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.progress import Progress
from posse_training.reports.comparing.sweeps import LEADER_LOSS, Sweep, play_sweeps, write_points
from posse_training.reports.failures import PlayError

PLANNER: Final = "planner"
"""The reference that is shown with every team."""
SUMMARY: Final = "summary.json"
REPORT: Final = "report.html"
POINTS: Final = "sweeps.csv"
MARL_EVAL: Final = "marl-eval.json"


class _Settings(Protocol):
    """What a run reads of the settings of ``posse compare``."""

    @property
    def policies(self) -> tuple[str, ...]: ...
    @property
    def episodes(self) -> int: ...
    @property
    def planner_episodes(self) -> int: ...
    @property
    def sweep_episodes(self) -> int: ...
    @property
    def seed(self) -> int: ...
    @property
    def split(self) -> str: ...
    @property
    def out(self) -> Path: ...
    @property
    def replays(self) -> int: ...


class ComparisonRun:
    """One comparison while it is played and written.

    Args:
        settings: Of the comparison.
        players: Plays the contenders.
        contenders: The first is the baseline.
        scenarios: Names of the scenarios.
        sweeps: Settings to vary.
        folder: Where to write.

    Attributes:
        found: The results so far.
    """

    def __init__(
        self,
        settings: _Settings,
        players: Players,
        contenders: Sequence[Contender],
        scenarios: Sequence[str],
        sweeps: Sequence[Sweep],
        folder: Path,
    ) -> None:
        self.settings = settings
        self.contenders = contenders
        self.scenarios = scenarios
        self.sweeps = sweeps
        self.folder = folder
        self.found = Comparison(contenders[0].label)
        self._players = players
        self._names = FileNames(SUMMARY, REPORT, POINTS, MARL_EVAL)

    def planned(self) -> tuple[Counter[str], Counter[str]]:
        """Return the evaluations to come, and their worlds, for each contender."""
        evaluations: Counter[str] = Counter()
        worlds: Counter[str] = Counter()
        points = sum(len(sweep.values) for sweep in self.sweeps)
        for contender in self.contenders:
            label, seeds = contender.label, len(contender.policies)
            for times, episodes in (
                (len(self.scenarios), self.settings.episodes),
                (points, self.settings.sweep_episodes),
            ):
                evaluations[label] += times
                worlds[label] += times * seeds * self._worlds(contender, episodes)
        return evaluations, worlds

    def play(self, progress: Progress) -> None:
        """Play the scenarios and the sweeps; write the rows and the points."""
        for scenario in self.scenarios:
            self._play_scenario(scenario, progress)
        if self.sweeps:
            ordered = sorted(self.contenders, key=lambda contender: contender.label == PLANNER)
            self.found.points = play_sweeps(
                ordered,
                lambda contender, sweep, value: self._attempt(
                    contender,
                    sweep.scenario,
                    self.settings.sweep_episodes,
                    f"{sweep.name} {value:g}",
                    progress,
                    **{sweep.setting: value},
                ),
                self.sweeps,
            )
            write_points(self.folder / POINTS, self.found.points)

    def plays(self) -> Iterator[Play]:
        """Yield all that will be played."""
        s = self.settings
        wanted = [(get_scenario(name), s.episodes) for name in self.scenarios]
        wanted += [(w.at(value), s.sweep_episodes) for w in self.sweeps for value in w.values]
        for scenario, episodes in wanted:
            for contender in self.contenders:
                yield contender, scenario, self._worlds(contender, episodes)

    def _worlds(self, contender: Contender, episodes: int) -> int:
        """Return the number of worlds that a contender plays."""
        if contender.label == PLANNER and PLANNER not in self.settings.policies:
            return min(episodes, self.settings.planner_episodes)
        return episodes

    def _attempt(
        self, contender: Contender, name: str, episodes: int, what: str, progress: Progress, **overrides: Any
    ) -> Plays | None:
        """Play; return ``None`` and note why if the contender cannot or fails."""
        s, worlds, seeds = self.settings, self._worlds(contender, episodes), len(contender.policies)
        scenario = get_scenario(name, **overrides)
        steps = len(cut(worlds, WORLDS)) * scenario.horizon
        progress.begin(contender.label, what, worlds * seeds, steps * seeds)
        try:
            return self._players.play(contender, scenario, worlds, s.seed, s.split, progress.advance)
        except PolicyError as error:
            self.found.left_out.append({"policy": contender.label, "what": what, "why": str(error)})
        except PlayError as error:
            self.found.failed.append({"policy": contender.label, "what": what, "why": str(error)})
        finally:
            progress.end()
        return None

    def _play_scenario(self, scenario: str, progress: Progress) -> None:
        """Play one scenario with every contender, and write the rows."""
        reference: Plays | None = None
        for contender in self.contenders:
            plays = self._attempt(contender, scenario, self.settings.episodes, scenario, progress)
            if plays is None:
                continue
            self.found.plays[scenario, contender.label] = plays
            self.found.rows.append(
                {
                    "scenario": scenario,
                    "policy": contender.label,
                    **summary(plays, reference),
                    "files": self._write(scenario, plays),
                }
            )
            if contender is self.contenders[0]:
                reference = plays
        best = self.found.plays.get((scenario, PLANNER))
        for row in self.found.rows:
            if row["scenario"] == scenario and best is not None:
                row["of_planner"] = self.found.plays[scenario, row["policy"]].ratio(best)

    def _write(self, scenario: str, plays: Plays) -> list[str]:
        """Write the rows of a contender, one file for each training seed; return their names."""
        written = []
        for k, results in enumerate(plays.results):
            member = f"-{k + 1}" if len(plays.results) > 1 else ""
            stem = self._names.stem(f"{scenario}-{plays.label}{member}", ".csv", ".json")
            results.write(self.folder / f"{stem}.csv")
            written.append(f"{stem}.csv")
        return written

    def report(self, progress: Progress) -> None:
        """Draw the figures, record the replays, and write the report of all of it."""
        from posse_training.reports.pictures import figures, learning  # matplotlib is slow
        from posse_training.reports.report import Shown, report

        progress.note("drawing the figures")
        found = self.found
        losses = [plays for (name, _), plays in found.plays.items() if name == LEADER_LOSS]
        curves = learning.curves_of(self.contenders)
        drawn = figures.draw(self.folder, found.plays, found.points, losses, curves, sweep_facts=self._sweep_facts())
        found.figures = [self.settings.out / path.name for path in drawn]
        if self.settings.replays:
            progress.note("recording the replays of the report")
        best, worst = (
            [Shown(one, *self._record(one)) for one in some] for some in extremes(found, self.settings.replays)
        )
        shown = [path for path in drawn if path.suffix == ".svg"]
        text = report(found, self._facts(), shown, best, worst)
        (self.folder / REPORT).write_text(text, encoding="utf-8")

    def _record(self, one: Extreme) -> tuple[Replay | None, str]:
        """Return the replay of a world, the policy beside the baseline; or why there is none."""
        s, by_label = self.settings, {each.label: each for each in self.contenders}
        scenario = get_scenario(one.scenario)
        try:
            replays = [
                self._players.record(by_label[label], seed, scenario, s.seed, one.world, s.split)
                for label, seed in ((self.found.reference, 0), (one.policy, one.seed))
            ]
            return join(replays), ""
        except (PlayError, SettingsError) as error:
            return None, f"No replay: {error}"

    def _facts(self) -> dict[str, str]:
        """Return what was played, for the report."""
        s, scenarios = self.settings, {name: get_scenario(name).version for name in self.scenarios}
        beside = self._worlds(self.contenders[-1], s.episodes)
        return {
            "worlds": f"{s.episodes:,} each" + (f", planner {beside:,}" if beside < s.episodes else ""),
            "split": s.split,
            "seed": str(s.seed),
            "baseline": self.found.reference,
            "versions": ", ".join(f"{name} v{version}" for name, version in scenarios.items()),
        }

    def _sweep_facts(self) -> str:
        s = self.settings
        beside = self._worlds(self.contenders[-1], s.sweep_episodes)
        other = f" (planner {beside:,})" if beside != s.sweep_episodes else ""
        return f"{s.sweep_episodes:,} worlds at each point{other}, {s.split} split, seed {s.seed}"
