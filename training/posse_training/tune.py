"""``posse tune``: CMA-ES over the settings of a scripted team that are declared tunable, in the order it runs.

The run folder holds ``state.json``, from which the same command resumes.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, cast

import numpy as np
import numpy.typing as npt
import tyro
from rich.console import Console

from posse.declarations import unknown
from posse.scenarios.family import scenario_or_family
from posse_baselines import PolicyError, Tunable, load
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import number, tunables
from posse_baselines.files import read_json, write_json
from posse_baselines.tuned import FORMAT
from posse_training.errors import SettingsError, check_settings, require
from posse_training.evaluation.episodes import Match, play_shard
from posse_training.evaluation.evaluation import guarded, progress_bar
from posse_training.evaluation.results import block_of
from posse_training.evaluation.statistics import Estimate, mean
from posse_training.files import check_held, intact, locked
from posse_training.options import Ray
from posse_training.parallel import all_on_ray, connected
from posse_training.provenance import commit, digests, software

Point = npt.NDArray[np.float64]
STATE: Final = "state.json"
RESULT: Final = "tuned.json"
_KEPT: Final = ("scores", "curve", "seconds")
"""What the state holds of a run: the search follows from its seed and these scores."""
_FREE: Final = ("minutes", "out", "generations", "ray")
"""Settings that the command that resumes a run may change."""
SIGMA: Final = 0.1
"""Initial standard deviation, as a share of each setting's range."""
SCREENED_ON: Final = 8
"""Worlds in which a setting has to change a score to be searched."""
FRESH_SEED: Final = 1_000
"""Added to the run's seed for the validation worlds on which the result is scored once."""
_LOG_FROM: Final = 10.0  # ratio of a range's ends from which it is searched by its logarithm
_GAP: Final = 0.02  # of the range; least distance of a setting above another


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """Search the tunable settings of a policy for a scenario by CMA-ES. The same command again resumes a run."""

    policy: Annotated[str, tyro.conf.Positional]
    """Policy with tunable settings: a name, or package.module:Class."""
    scenario: str = "smart"
    """Scenario or family to tune for."""
    minutes: float = number(3.0, "", 0.001, 10_000.0)
    """When to stop: after the generation in which this time is over, resumed parts included."""
    seed: int = number(1, "", 0, 2**31 - 1)
    """Seed of the search and of the worlds."""
    out: Path | None = None
    """Run folder; default: runs/tune/POLICY-SCENARIO-SEED. A run that it holds is resumed."""
    generations: int | None = number(None, "", 1, 1_000_000)
    """Stop after so many generations, whatever the time."""
    population: int = number(12, "", 4, 1_000)
    """Candidates in a generation."""
    worlds: int = number(16, "", 1, 100_000)
    """Training worlds of a generation; each generation has its own."""
    validation_worlds: int = number(256, "", 1, 100_000)
    """Validation worlds on which the mean of the search is scored; the best one is kept."""
    every: int = number(10, "", 1, 1_000_000)
    """Generations between two of these scores."""
    only: tuple[str, ...] = ()
    """Settings to search over; default: all that have an effect on this scenario."""
    ray: Ray = False
    """Play on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of this machine, or
    else all its cores. Extra: cluster."""

    @property
    def folder(self) -> Path:
        """The folder that the run is written to."""
        return self.out or Path("runs/tune") / f"{self.policy.replace(':', '.')}-{self.scenario}-{self.seed}"

    def command(self, generations: int, names: Sequence[str]) -> str:
        """Return the command that repeats the run up to a generation; it names the settings that were searched."""
        words = f"posse tune {self.policy} --scenario {self.scenario} --generations {generations} --seed {self.seed}"
        for name in ("population", "worlds", "validation_worlds", "every"):
            if (value := getattr(self, name)) != getattr(TuneSettings, name):
                words += f" --{name.replace('_', '-')} {value}"
        return f"{words} --only {' '.join(names)}"


@dataclass(frozen=True)
class Space:
    """Settings that are searched, as points (n,) of the unit cube; the other tunable ones stay at their defaults.

    A range of positive numbers with a ratio of its ends of 10 or more is mapped by the logarithm.
    """

    tunables: tuple[Tunable, ...]
    names: Sequence[str]
    """Of the settings that are searched."""

    @property
    def searched(self) -> list[Tunable]:
        """The settings that are searched, in the order of a point's numbers."""
        return [t for t in self.tunables if t.name in self.names]

    @property
    def start(self) -> Point:
        """The defaults, (n,)."""
        return np.array([_share(t) for t in self.searched])

    def values(self, point: Point) -> dict[str, float]:
        """Return the settings of a point, and others that have to change to exceed them."""
        values = {t.name: t.default for t in self.tunables}
        for t, u in zip(self.searched, np.clip(point, 0.0, 1.0).tolist(), strict=True):
            value = t.low * (t.high / t.low) ** u if _is_log(t) else t.low + u * (t.high - t.low)
            # Six digits, so that files stay readable; rounding must not leave the range.
            values[t.name] = min(t.high, max(t.low, float(f"{value:.6g}")))
        for t in self.tunables:
            if t.above and not {t.name, t.above}.isdisjoint(self.names):
                values[t.name] = max(values[t.name], min(t.high, values[t.above] + _GAP * (t.high - t.low)))
        return {t.name: values[t.name] for t in self.tunables if t.name in self.names or values[t.name] != t.default}


def advance(cma: Any, scores: list[list[float]], generation: int, score: Callable[[list[Point]], list[float]]) -> None:
    """Advance a search by a generation: one on record is drawn again and takes its scores, a new one is scored."""
    points = [cma.ask() for _ in range(cma.population_size)]
    if generation == len(scores):
        scores.append(score(points))
    cma.tell([(p, -v) for p, v in zip(points, scores[generation], strict=True)])


def _is_log(t: Tunable) -> bool:
    return t.low > 0.0 and t.high / t.low >= _LOG_FROM


def _share(t: Tunable) -> float:
    """Return where in its range the default is, in [0, 1]."""
    if _is_log(t):
        return math.log(t.default / t.low) / math.log(t.high / t.low)
    return (t.default - t.low) / (t.high - t.low)


def tune(settings: TuneSettings, *, console: Console | None = None) -> Path:
    """Tune a policy for a scenario, or resume that; return the file of the settings found."""
    require("training", "cmaes")
    run, folder = _Run(settings, console or Console()), settings.folder
    held = {name: value for name, value in asdict(settings).items() if name not in _FREE}
    held |= {"scenario_version": run.scenario.version, **software("cmaes", "numpy")}  # others draw other points
    held |= {"tunables": [list(each) for each in run.tunables], **digests([settings.policy])}
    with connected(settings.ray), locked(folder):
        check_held(file := folder / "settings.json", held, results=(RESULT,))
        write_json(file, held)
        write_json(folder / RESULT, run.play())
    return folder / RESULT


class _Run:
    """One run: what it plays, and its state."""

    def __init__(self, settings: TuneSettings, console: Console) -> None:
        check_settings(settings)
        self.settings, self.console = settings, console
        self.policy = policy = cast("Any", load(settings.policy))
        is_tunable = hasattr(policy, "with_settings") and not getattr(policy, "trained_splits", ())
        own = getattr(policy, "settings", None)
        self.tunables = tunables(own) if is_tunable and is_dataclass(own) else ()
        if not self.tunables:
            raise PolicyError(f"policy {settings.policy!r:.100} has no tunable settings; {', '.join(FAMILY)} have")
        known = [t.name for t in self.tunables]
        for name in settings.only:
            if name not in known:
                raise SettingsError(f"only: {unknown(f'tunable setting of {settings.policy!r}', name, known)}")
        # As in evaluations: scores are of whole episodes.
        self.scenario = scenario_or_family(settings.scenario, terminate_on_contact=False)
        self.scores: list[list[float]] = []  # of the candidates of each generation
        self.curve: list[dict[str, Any]] = []  # scores of the search's mean on validation worlds, the defaults' first
        self.seconds = 0.0

    def play(self) -> dict[str, Any]:
        """Search until the time is over; return the card."""
        from cmaes import CMA

        s, state = self.settings, self.settings.folder / STATE
        if state.is_file():
            with intact(state):
                kept = read_json(state)
                self.scores, self.curve, self.seconds = (kept[name] for name in _KEPT)
        since = time.monotonic() - self.seconds
        if not s.only:
            self.console.print(f"looking which of {len(self.tunables)} settings have an effect")
        space = Space(self.tunables, list(dict.fromkeys(s.only)) or self._effective())
        if not space.names:
            raise SettingsError(f"no setting of {s.policy!r} has an effect on {s.scenario!r}")
        self.console.print(f"searching {len(space.names)} settings: {', '.join(space.names)}", markup=False)
        if self.scores:
            self.console.print(f"resuming after generation {len(self.scores)}")
        bounds = np.tile([0.0, 1.0], (len(space.names), 1))
        cma = CMA(mean=space.start, sigma=SIGMA, bounds=bounds, seed=s.seed, population_size=s.population)
        for generation in range(len(self.scores)):  # the search draws again what it drew then
            self._generation(cma, space, generation)
        if not self.curve:
            self.curve.append(self._validated({}))
        with progress_bar(console=self.console, disable=not self.console.is_terminal) as bar:
            task = bar.add_task("generations", total=s.generations, completed=len(self.scores))
            while not self._is_over():
                self._generation(cma, space, len(self.scores))
                if len(self.scores) % s.every == 0:
                    self.curve.append(self._validated(space.values(cma.mean)))
                self.seconds = time.monotonic() - since
                write_json(state, {name: getattr(self, name) for name in _KEPT}, indent=None)
                bar.advance(task)
        # A point off the schedule is not kept: a run goes on as if uninterrupted.
        if self.curve[-1]["generation"] < len(self.scores):
            self.curve.append(self._validated(space.values(cma.mean)))
        return self._card(space.names)

    def _is_over(self) -> bool:
        s, done = self.settings, len(self.scores)
        return done >= s.generations if s.generations is not None else done > 0 and self.seconds >= 60.0 * s.minutes

    def _generation(self, cma: Any, space: Space, generation: int) -> None:
        """Score a generation on worlds of its own, the same for all its candidates; scores on record are taken."""
        s, first = self.settings, generation * self.settings.worlds

        def score(points: list[Point]) -> list[float]:
            played = self._play(map(space.values, points), s.seed, "train", range(first, first + s.worlds))
            return [float(metrics["safe_score"].mean()) for metrics in played]

        advance(cma, self.scores, generation, score)

    def _validated(self, values: dict[str, float]) -> dict[str, Any]:
        """Return a point of the curve: settings, and their score on the validation worlds."""
        s, generation = self.settings, len(self.scores)
        (metrics,) = self._play([values], s.seed, "validation", range(s.validation_worlds))
        found = mean(metrics["safe_score"], block_of(self.scenario))
        self.console.print(f"generation {generation:>4}  safe score {found}", markup=False, highlight=False)
        score = {"score": found.value, "low": found.low, "high": found.high}
        return {"generation": generation, **score, "settings": values}

    def _play(
        self, candidates: Iterable[dict[str, float]], seed: int, split: str, worlds: range
    ) -> list[dict[str, Point]]:
        """Return the metrics of each candidate, (worlds,) each."""
        teams = [self.policy.with_settings(**values) for values in candidates]
        calls = [(Match(team, None, self.scenario, seed, split), worlds) for team in teams]
        if self.settings.ray is False:
            return [guarded(None, play_shard, *call) for call in calls]
        return all_on_ray(partial(play_shard, num_threads=1), calls)

    def _effective(self) -> list[str]:
        """Return the settings of which an end of the range changes a score in a few training worlds."""
        spaces = [Space(self.tunables, [t.name]) for t in self.tunables]
        ends = [space.values(np.array([end])) for space in spaces for end in (0.0, 1.0)]
        usual, *played = self._play([{}, *ends], self.settings.seed, "train", range(SCREENED_ON))
        changed = [np.any(metrics["safe_score"] != usual["safe_score"]) for metrics in played]
        return [t.name for t, low, high in zip(self.tunables, changed[::2], changed[1::2], strict=True) if low or high]

    def _card(self, names: Sequence[str]) -> dict[str, Any]:
        """Return what was found, from what, and how well it scores."""
        s, best = self.settings, max(self.curve, key=lambda point: point["score"])
        values: dict[str, float] = best["settings"]
        scores: dict[str, Any] = {"split": "validation", "seed": s.seed + FRESH_SEED}
        played = self._play([values, {}], s.seed + FRESH_SEED, "validation", range(s.validation_worlds))
        for name, metrics in zip(("tuned", "untuned"), played, strict=True):
            others = {metric: float(metrics[metric].mean()) for metric in ("score", "contact_free")}
            scores[name] = {"safe_score": asdict(mean(metrics["safe_score"], block_of(self.scenario))), **others}
        (checked,) = self._play([values], 2, "validation", range(32))
        check = {"split": "validation", "seed": 2, "worlds": 32, "safe_score": float(checked["safe_score"].mean())}
        return {
            "format": FORMAT,
            "policy": s.policy,
            "scenario": self.scenario.name,
            "scenario_version": self.scenario.version,
            "settings": values,
            "command": s.command(len(self.scores), names),
            "seed": s.seed,
            "commit": commit(),
            "searched": names,
            "generation": best["generation"],
            "curve": [{k: v for k, v in point.items() if k != "settings"} for point in self.curve],
            "trained_splits": ["train"],
            "chosen_on": "validation",
            "scores": scores,
            "check": check,
            "software": software("cmaes", "numpy"),
        }


def main(arguments: Sequence[str]) -> None:
    """Tune a policy, and print what was found."""
    path = tune(tyro.cli(TuneSettings, prog="posse tune", args=arguments))
    scores = read_json(path)["scores"]
    for which in ("untuned", "tuned"):
        safe, contact = Estimate(**scores[which]["safe_score"]), 1 - scores[which]["contact_free"]
        print(f"{which:>8}: safe score {safe}, contact in {contact:.1%} of {safe.count} validation worlds")
    print(path)
