"""``posse compare``: policies on the same worlds, with intervals and paired differences.

Policies of the package and policy files play in this process. Code, ``package.module:Class``, of a policy or the target
plays in a process of its own, which is ended at the time limit. That is no sandbox.
"""

import contextlib
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro
from rich.console import Console
from rich.progress import Progress, TaskID

import posse
from posse import Batch, Family, Scenario, scenario_names
from posse.scenarios.family import blocks, scenario_or_family
from posse_baselines import Policy, PolicyError, load_target
from posse_baselines.fields import number
from posse_baselines.files import write_json
from posse_baselines.registry import is_code
from posse_training.compare.contenders import PLANNER, Contender, Plays, check_code, read_contenders
from posse_training.compare.table import Row, row_of, table, write_marl_eval
from posse_training.errors import PlayError, SettingsError, TimeLimitError, check_settings, require
from posse_training.evaluation.episodes import refuse_trained_split, refuse_two_targets
from posse_training.evaluation.evaluation import (
    FAILURES,
    Evaluation,
    evaluate,
    gathered_results,
    guarded,
    has_code,
    played_errors,
    prepare,
    progress_bar,
)
from posse_training.evaluation.results import Results
from posse_training.evaluation.statistics import Estimate
from posse_training.files import check_new, locked
from posse_training.options import Changes, Ray, words_of
from posse_training.provenance import commit
from posse_training.replay import join, record, write_replay

SUMMARY: Final = "summary.json"
REPORT: Final = "report.html"
Key = tuple[str, str, int]
"""Scenario, label of a contender, and which of its policies."""


@dataclass(frozen=True)
class CompareSettings:
    """Score policies on the same worlds; write tables, figures and a report page."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names, files, package.module:Class, or LABEL=FILE,FILE,... for several training seeds of one
    policy; the first is the baseline of differences."""
    scenario: tuple[str, ...] = ("all",)
    """Names of one or several scenarios or families, or "all"."""
    episodes: int = number(1000, "", 1, 10**8)
    """Worlds for each policy and scenario."""
    seed: int = 7
    """Seed of the worlds."""
    split: str = "test"
    """Split of the worlds: train, validation or test."""
    out: Path | None = None
    """New or empty folder for the report (HTML), the rows (CSV), the summary (JSON) and the figures
    (PNG and SVG); default: the first of runs/compare, runs/compare-2, ... that is free."""
    figures: bool = True
    """Draw figures, and write the report."""
    replays: int = number(3, "", 0, 10**8)
    """Largest wins, and as many largest losses, of all policies against the first one that are
    recorded as replays beside the report; 0: none."""
    planner_episodes: int = number(100, "", 0, 10**8)
    """Largest number of the worlds that the planner plays as a reference; 0: none. It takes about
    0.4 s of processor time per world. If named among the policies, it plays all worlds."""
    export: tuple[Literal["marl-eval"], ...] = ()
    """Further files to write beside the summary: "marl-eval" for marl-eval.json, which marl-eval and rliable read."""
    time_limit: float = number(1800.0, "s", 0.001, 10.0**9)
    """Time limit of a policy that is code, on one scenario, for each training seed, s (with --ray: of a shard of
    500 worlds); one that exceeds it is stopped and skipped on the remaining scenarios."""
    ray: Ray = False
    """Play all at once on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of
    this machine, or else all its cores. The same command resumes an interrupted comparison. Extra: cluster."""
    target: str | None = None
    """Target that all teams play against: a motion, a learned target, a file or
    package.module:Class; default: the scenario's own."""
    overrides: Changes = field(default_factory=dict)
    """Settings to change in each scenario, such as num_trackers=3 or arena=6,4, which is a range of a family."""


def compare(settings: CompareSettings, *, console: Console | None = None) -> "Comparison":
    """Evaluate all policies; write rows, summary, figures and report.

    A policy that is incompatible with a scenario is omitted there; one that fails is listed under ``failed``. The
    other policies are not affected. Progress is shown on the console, or else the standard error output.
    """
    scenarios = _checked(settings)
    contenders = read_contenders(settings.policies)
    if settings.planner_episodes > 0 and PLANNER not in settings.policies:
        contenders += read_contenders((PLANNER,))
    for policy in (policy for contender in contenders for policy in contender.policies):
        refuse_trained_split(policy, settings.split)
    if settings.target is not None:
        if is_code(settings.target):
            try:
                check_code(settings.target, load_target)
            except PlayError as error:
                raise SettingsError(f"target={settings.target!r:.120} cannot be loaded: {error}") from error
        refuse_trained_split(load_target(settings.target), settings.split)
    if settings.out is not None:
        check_new(settings.out)
    if settings.ray is not False:
        require("cluster", "ray")
    found = Comparison(settings, scenarios, contenders)
    with progress_bar(console=console or Console(stderr=True)) as bar, contextlib.ExitStack() as stack:
        task = bar.add_task("comparison", total=len(scenarios) * len(contenders))
        if settings.ray is not False:
            stack.enter_context(found.played_on_ray(bar, task))
            bar.reset(task, total=len(scenarios) * len(contenders))
        found.folder = settings.out or _new_folder()
        stack.enter_context(locked(found.folder))
        check_new(found.folder)  # it may have been filled since
        for scenario in scenarios:
            found.play(scenario, lambda what: bar.update(task, description=what, advance=1))
        found.write()
    return found


def _checked(settings: CompareSettings) -> list[Scenario | Family]:
    check_settings(settings)
    refuse_two_targets(settings.target, settings.overrides)
    if not settings.scenario:
        raise SettingsError("no scenario is given: name one or several, or all")
    names = [each for name in settings.scenario for each in (scenario_names() if name == "all" else (name,))]
    found = [scenario_or_family(name, **settings.overrides) for name in dict.fromkeys(names)]
    for scenario in found:
        first, _ = next(blocks(scenario, range(1), 0, "train"))
        Batch(first, 1, seed=settings.seed, split=settings.split)
    return found


def _new_folder() -> Path:
    """Return a folder that is made here, so that two comparisons at once have two."""
    k, folder = 1, Path("runs", "compare")
    while True:
        try:
            folder.mkdir(parents=True)
            return folder
        except FileExistsError:
            k += 1
            folder = Path("runs", f"compare-{k}")


@dataclass
class Comparison:
    """A comparison: what is played, and what has been found so far."""

    settings: CompareSettings
    scenarios: Sequence[Scenario | Family]
    contenders: Sequence[Contender]
    folder: Path = field(init=False)
    """Where the results are written."""
    plays: dict[tuple[str, str], Plays] = field(default_factory=dict)
    """By scenario and policy."""
    rows: list[Row] = field(default_factory=list)
    """The estimates of each, and the files of its rows."""
    left_out: list[dict[str, str]] = field(default_factory=list)
    """Policies that do not fit: ``policy``, ``what`` they cannot play, and ``why``."""
    failed: list[dict[str, str]] = field(default_factory=list)
    """Policies that raised, returned invalid actions, died or exceeded the time limit."""
    stopped: dict[str, str] = field(default_factory=dict)
    """Why policies that exceeded the time limit are not played again, by label."""
    stems: set[str] = field(default_factory=set)
    played: dict[Key, Results | Exception] = field(default_factory=dict)
    """What a cluster has played already."""

    @property
    def reference(self) -> str:
        """The baseline of the differences."""
        return self.contenders[0].label

    @property
    def place(self) -> dict[str, Any]:
        """Seed and split of the worlds, and the target."""
        return {name: getattr(self.settings, name) for name in ("seed", "split", "target")}

    def episodes(self, contender: Contender) -> int:
        """Number of worlds that a contender plays."""
        s = self.settings
        is_reference = contender.label == PLANNER and PLANNER not in s.policies
        return min(s.episodes, s.planner_episodes) if is_reference else s.episodes

    @contextlib.contextmanager
    def played_on_ray(self, bar: Progress, task: TaskID) -> Iterator[None]:
        """Play all at once on a Ray cluster; finished shards are kept until the context ends without an exception."""
        ready: dict[Key, Evaluation] = {}
        for scenario, contender in itertools.product(self.scenarios, self.contenders):
            for k, policy in enumerate(contender.policies):
                key, limit = (scenario.name, contender.label, k), self.settings.time_limit
                try:
                    if isinstance(policy, str):
                        check_code(policy)
                    with played_errors():
                        ready[key] = prepare(policy, scenario, self.episodes(contender), time_limit=limit, **self.place)
                except (PolicyError, *FAILURES) as error:
                    self.played[key] = error
        bar.reset(task, total=sum(len(one.shards) for one in ready.values()))
        with gathered_results(list(ready.values()), self.settings.ray, lambda: bar.advance(task)) as results:
            self.played |= zip(ready, results, strict=True)
            yield

    def play(self, scenario: Scenario | Family, report: Callable[[str], object]) -> None:
        """Play one scenario with every contender, and write the rows."""
        name = scenario.name
        for contender in self.contenders:
            plays = self._attempt(contender, scenario)
            report(f"{contender.label} on {name}".replace("[", r"\["))
            if plays is None:
                continue
            self.plays[name, contender.label] = plays
            reference = None if contender is self.contenders[0] else self.plays.get((name, self.reference))
            files = []
            for k, results in enumerate(plays.results):
                member = f"-{k + 1}" if len(plays.results) > 1 else ""
                files.append(f"{self._stem(f'{name}-{plays.label}{member}')}.csv")
                results.write(self.folder / files[-1])
            self.rows.append({**row_of(plays, reference), "files": files})
        best = self.plays.get((name, PLANNER))
        for row in self.rows:
            if row["scenario"] == name and best is not None:
                mine, theirs = self.plays[name, row["policy"]].paired(best)
                row["of_planner"] = float(mine.mean() / theirs.mean()) if theirs.any() else None

    def write(self) -> None:
        """Write summary, export, figures and report."""
        s = self.settings
        if "marl-eval" in s.export:
            write_marl_eval(self.plays, self.folder / "marl-eval.json")
        rows = [{k: asdict(v) if isinstance(v, Estimate) else v for k, v in row.items()} for row in self.rows]
        about: dict[str, Any] = {**self.place, "episodes": s.episodes, "changed": s.overrides}
        about |= {"comparison": rows, "left_out": self.left_out, "failed": self.failed}
        write_json(self.folder / SUMMARY, about)
        if s.figures:
            self._report()

    def _attempt(self, contender: Contender, scenario: Scenario | Family) -> Plays | None:
        """Play; return ``None`` and note why if the contender cannot or fails."""
        label = contender.label
        why = {"policy": label, "what": scenario.name}
        if label in self.stopped and not self.played:
            self.failed.append({**why, "why": self.stopped[label]})
            return None
        try:
            return Plays(contender.label, tuple(self._results(contender, scenario)))
        except PolicyError as error:
            self.left_out.append({**why, "why": str(error)})
        except TimeLimitError as error:  # the next scenario would most likely take as long
            self.stopped[label] = f"not played: on {scenario.name} {error}"
            self.failed.append({**why, "why": str(error)})
        except FAILURES as error:
            self.failed.append({**why, "why": str(error)})
        return None

    def _results(self, contender: Contender, scenario: Scenario | Family) -> Iterator[Results]:
        """Play with every policy of a contender, but for what has been played already, and raise its errors."""
        for k, policy in enumerate(contender.policies):
            found = self.played.get((scenario.name, contender.label, k))
            if isinstance(found, Exception):
                raise found
            episodes = self.episodes(contender)
            play = partial(evaluate, policy, scenario, episodes, progress=False, **self.place)
            yield found or guarded(self._limit(policy), play)

    def _limit(self, policy: Policy | str) -> float | None:
        """Return the time limit of code, which plays in a process of its own, as do those whom it plays against."""
        return self.settings.time_limit if has_code(policy, self.settings.target) else None

    def _stem(self, wanted: str) -> str:
        """Return a name of letters, digits and ``._-`` that no other file has, also where case is ignored."""
        clean = re.sub(r"[^A-Za-z0-9._-]", "_", wanted)[:100].lstrip(".") or "_"
        names = itertools.chain([clean], (f"{clean}-{k}" for k in itertools.count(2)))
        stem = next(name for name in names if name.lower() not in self.stems)
        self.stems.add(stem.lower())
        return stem

    def _report(self) -> None:
        """Draw the figures, record the replays, and write the report of all of it."""
        from posse_training.compare import figures, report  # matplotlib is slow

        s = self.settings
        shown = [(one, *self._record(one)) for one in report.extremes(self.plays, self.reference, s.replays)]
        versions = ", ".join(f"{scenario.name} v{scenario.version}" for scenario in self.scenarios)
        text = report.page(
            self.rows,
            figures.draw(self.folder, self.plays, self.contenders),
            title=f"Policies: {len(self.contenders)}, scenarios: {len(self.scenarios)}",
            facts=f"{_facts(s)}; {versions}; posse {posse.__version__}, commit {commit() or 'unknown'}",
            baseline=self.reference,
            replays=shown,
            problems={"Left out": self.left_out, "Failed": self.failed},
        )
        (self.folder / REPORT).write_text(text, encoding="utf-8", errors="replace")

    def _record(self, one: Any) -> tuple[str, str]:
        """Write the replay of a world, the policy beside the baseline; return its address, or why there is none."""
        by_label = {each.label: each for each in self.contenders}
        given, s = next(each for each in self.scenarios if each.name == one.scenario), self.settings
        scenario, _ = next(blocks(given, range(one.world, one.world + 1), s.seed, s.split))
        try:
            replays = []
            for label, seed in ((self.reference, 0), (one.policy, one.seed)):
                policy = by_label[label].policies[seed]
                play = partial(record, [(label, policy)], scenario, world=one.world, observations=False, **self.place)
                replays.append(guarded(self._limit(policy), play))
            name = f"{self._stem(f'replay-{one.scenario}-{one.policy}-{one.world}')}.html"
            write_replay(join(replays), self.folder / name)
        except (PolicyError, *FAILURES) as error:
            return "", f"no replay: {error}"
        return name, ""


def _facts(settings: CompareSettings) -> str:
    target = "" if settings.target is None else f"target {settings.target}, "
    target += "".join(f"{word}, " for word in words_of(settings.overrides))
    few = PLANNER not in settings.policies and 0 < settings.planner_episodes < settings.episodes
    fewer = f" (the planner {settings.planner_episodes:,})" if few else ""
    return f"{settings.episodes:,} worlds each{fewer}, {target}split {settings.split}, seed {settings.seed}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare policies, print the table, and return 1 if a policy failed or none played, else 0."""
    settings = tyro.cli(CompareSettings, prog="posse compare", args=arguments)
    found = compare(settings)
    console = Console()
    title = f"{_facts(settings)}; 95 % intervals; differences of the safe score to {found.reference}, paired by world"
    console.print(table(found.rows, title))
    for word, problems in (("left out", found.left_out), ("failed", found.failed)):
        for row in problems:
            console.print(f"{word}: {row['policy']} on {row['what']}: {row['why']}", markup=False)
    console.print(f"rows and summary: {found.folder}", markup=False, soft_wrap=True)
    if settings.figures:
        page = found.folder / REPORT
        console.print(f"all of it, to open in a browser: {page}", markup=False, soft_wrap=True)
    return 1 if found.failed or not found.rows else 0
