"""``posse tune``: CMA-ES over the settings of a scripted team that are declared tunable, in the order it runs.

The run folder holds ``state.json``, from which the same command resumes.
"""

from __future__ import annotations

import json
import math
import platform
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import numpy.typing as npt
import tyro
from rich.console import Console

import posse
from posse import Family, Scenario
from posse.scenarios.family import scenario_or_family
from posse_baselines import PolicyError, Tunable, load
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import number, tunables
from posse_baselines.files import read_json, write_atomically
from posse_baselines.tuned import FORMAT
from posse_training.errors import CheckpointError, SettingsError, check_settings, require
from posse_training.evaluation.episodes import Match, play_shard
from posse_training.evaluation.evaluation import progress_bar
from posse_training.evaluation.statistics import mean
from posse_training.files import hold_settings, locked
from posse_training.options import Ray
from posse_training.parallel import connected, on_ray
from posse_training.provenance import commit

if TYPE_CHECKING:
    from cmaes import CMA

Point = npt.NDArray[np.float64]
SETTINGS: Final = "settings.json"
STATE: Final = "state.json"
RESULT: Final = "tuned.json"
_KEPT: Final = ("names", "told", "curve", "seconds")
"""What the state holds of a run."""
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
    threads: int | None = number(None, "", 1, 1_024)
    """Threads that step the worlds; default: as many as cores. Never changes the result."""
    ray: Ray = False
    """Play on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of this machine, or
    else all its cores. Extra: cluster."""

    @property
    def folder(self) -> Path:
        """The folder that the run is written to."""
        return self.out or Path("runs/tune") / f"{self.policy.replace(':', '.')}-{self.scenario}-{self.seed}"

    def command(self, generations: int, names: Sequence[str]) -> str:
        """Return the command that repeats the run up to a generation; it names the settings that were searched."""
        words = ["posse", "tune", self.policy, "--scenario", self.scenario]
        words += ["--generations", str(generations), "--seed", str(self.seed)]
        for name in ("population", "worlds", "validation_worlds", "every"):
            value = getattr(self, name)
            if value != getattr(type(self), name):
                words += [f"--{name.replace('_', '-')}", str(value)]
        return " ".join([*words, "--only", *names])


@dataclass(frozen=True)
class Space:
    """Settings that are searched, as points (n,) of the unit cube; the other tunable ones stay at their defaults.

    A range of positive numbers with a ratio of its ends of 10 or more is mapped by the logarithm.
    """

    tunables: tuple[Tunable, ...]
    names: Sequence[str]
    """Of the settings that are searched."""

    @property
    def start(self) -> Point:
        """The defaults, (n,)."""
        return np.array([_scaled(t, t.default) for t in self.tunables if t.name in self.names])

    def values(self, point: Point) -> dict[str, float]:
        """Return the settings of a point, and others that have to change to exceed them."""
        values = {t.name: t.default for t in self.tunables}
        searched = [t for t in self.tunables if t.name in self.names]
        for t, u in zip(searched, np.clip(point, 0.0, 1.0).tolist(), strict=True):
            value = t.low * (t.high / t.low) ** u if _is_log(t) else t.low + u * (t.high - t.low)
            # Six digits, so that files stay readable; rounding must not leave the range.
            values[t.name] = min(t.high, max(t.low, float(f"{value:.6g}")))
        for t in self.tunables:
            if t.above and not {t.name, t.above}.isdisjoint(self.names):
                values[t.name] = max(values[t.name], min(t.high, values[t.above] + _GAP * (t.high - t.low)))
        return {t.name: values[t.name] for t in self.tunables if t.name in self.names or values[t.name] != t.default}


def _is_log(t: Tunable) -> bool:
    return t.low > 0.0 and t.high / t.low >= _LOG_FROM


def _scaled(t: Tunable, value: float) -> float:
    return math.log(value / t.low) / math.log(t.high / t.low) if _is_log(t) else (value - t.low) / (t.high - t.low)


def tune(settings: TuneSettings, *, console: Console | None = None) -> Path:
    """Tune a policy for a scenario, or resume that; return the file of the settings found."""
    require("training", "cmaes")
    run, folder = _Run(settings, console or Console()), settings.folder
    with connected(settings.ray), locked(folder):
        hold_settings(folder / SETTINGS, run.identity)
        write_atomically(folder / RESULT, (json.dumps(run.play(), indent=2, sort_keys=True) + "\n").encode())
    return folder / RESULT


class _Run:
    """One run: what it plays, and its state."""

    def __init__(self, settings: TuneSettings, console: Console) -> None:
        check_settings(settings)
        self.settings, self.console = settings, console
        policy: Any = load(settings.policy)
        is_tunable = hasattr(policy, "with_settings") and not getattr(policy, "trained_splits", ())
        self.policy, self.tunables = policy, tunables(policy.settings) if is_tunable else ()
        if not self.tunables:
            raise PolicyError(
                f"policy {settings.policy!r:.100} has no tunable settings; those that have: {', '.join(FAMILY)}"
            )
        known = [t.name for t in self.tunables]
        for name in settings.only:
            if name not in known:
                raise SettingsError(
                    f"only={name!r:.80} is not a tunable setting of {settings.policy!r}; these are: {', '.join(known)}"
                )
        found = scenario_or_family(settings.scenario)
        self.scenario: Scenario | Family = found.replace(message_size=max(found.message_size, policy.message_size))
        fields = ("policy", "scenario", "seed", "population", "worlds", "validation_worlds", "every", "only")
        self.identity = {name: getattr(settings, name) for name in fields} | {"scenario_version": found.version}
        self.names: list[str] = []  # of the settings that are searched
        self.told: list[tuple[list[list[float]], list[float]]] = []  # points (P, n) and scores (P,) of each generation
        self.curve: list[dict[str, Any]] = []  # scores of the search's mean on validation worlds, the defaults' first
        self.seconds = 0.0

    def play(self) -> dict[str, Any]:
        """Search until the time is over; return the card."""
        s = self.settings
        self._resume()
        self.names = self.names or list(s.only) or self._effective()
        if not self.names:
            raise SettingsError(f"no setting of {s.policy!r} has an effect on {s.scenario!r}")
        self.console.print(f"searching {len(self.names)} settings: {', '.join(self.names)}", markup=False)
        if self.told:
            self.console.print(f"resuming after generation {len(self.told)}")
        space = Space(self.tunables, self.names)
        cma, since = self._cma(space), time.monotonic() - self.seconds
        if not self.curve:
            self.curve.append(self._validated({}))
        with progress_bar(console=self.console, disable=not self.console.is_terminal) as bar:
            task = bar.add_task("generations", total=s.generations, completed=len(self.told))
            while not self._is_over():
                self._generation(cma, space)
                if len(self.told) % s.every == 0:
                    self.curve.append(self._validated(space.values(cma.mean)))
                self.seconds = time.monotonic() - since
                state = {name: getattr(self, name) for name in _KEPT}
                write_atomically(s.folder / STATE, json.dumps(state).encode())
                bar.advance(task)
        # A point off the schedule counts only where the run ends: a run goes on as if uninterrupted.
        is_scored = self.curve[-1]["generation"] == len(self.told)
        return self._card(self.curve if is_scored else [*self.curve, self._validated(space.values(cma.mean))])

    def _resume(self) -> None:
        path = self.settings.folder / STATE
        if not path.is_file():
            return
        try:
            state = read_json(path)
            for name in _KEPT:
                setattr(self, name, state[name])
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise CheckpointError(
                f"{path} is damaged: {error}. The run cannot be resumed: remove {path.parent}, or choose another --out"
            ) from error

    def _is_over(self) -> bool:
        s, done = self.settings, len(self.told)
        return done >= s.generations if s.generations is not None else done > 0 and self.seconds >= 60.0 * s.minutes

    def _cma(self, space: Space) -> CMA:
        """Return the search as it is after all past generations: its state follows from them and the seed."""
        from cmaes import CMA

        s, start = self.settings, space.start
        bounds = np.tile([0.0, 1.0], (len(start), 1))
        cma = CMA(mean=start, sigma=SIGMA, bounds=bounds, seed=s.seed, population_size=s.population)
        for points, scores in self.told:
            for _ in points:
                cma.ask()  # draws what was drawn then
            cma.tell([(np.array(p), -v) for p, v in zip(points, scores, strict=True)])
        return cma

    def _generation(self, cma: CMA, space: Space) -> None:
        """Score a generation on worlds of its own, the same for all its candidates."""
        s, first = self.settings, len(self.told) * self.settings.worlds
        points = [cma.ask() for _ in range(s.population)]
        played = self._play(map(space.values, points), s.seed, "train", range(first, first + s.worlds))
        scores = [float(metrics["safe_score"].mean()) for metrics in played]
        cma.tell([(p, -v) for p, v in zip(points, scores, strict=True)])
        self.told.append((np.array(points).tolist(), scores))

    def _validated(self, values: dict[str, float]) -> dict[str, Any]:
        """Return a point of the curve: settings, and their score on the validation worlds."""
        s, generation = self.settings, len(self.told)
        (metrics,) = self._play([values], s.seed, "validation", range(s.validation_worlds))
        found = mean(metrics["safe_score"])
        self.console.print(f"generation {generation:>4}  safe score {found}", markup=False, highlight=False)
        score = {"score": found.value, "low": found.low, "high": found.high}
        return {"generation": generation, **score, "settings": values}

    def _play(
        self, candidates: Iterable[dict[str, float]], seed: int, split: str, worlds: range
    ) -> list[dict[str, Point]]:
        """Return the metrics of each candidate, (worlds,) each."""
        s = self.settings
        teams = [self.policy.with_settings(**values) for values in candidates]
        calls = [(Match(team, None, self.scenario, seed, split), worlds) for team in teams]
        if s.ray is False:
            return [play_shard(*call, num_threads=s.threads) for call in calls]
        found = dict(on_ray(partial(play_shard, num_threads=1), calls))
        for result in found.values():
            if isinstance(result, Exception):
                raise result
        return [found[k] for k in range(len(calls))]

    def _effective(self) -> list[str]:
        """Return the settings whose ends of the range change any score in a few training worlds."""
        worlds = (self.settings.seed, "train", range(SCREENED_ON))
        (usual,) = self._play([{}], *worlds)
        found: set[str] = set()
        for end in (0.0, 1.0):
            tried = [t.name for t in self.tunables if t.name not in found]
            played = self._play([Space(self.tunables, [name]).values(np.array([end])) for name in tried], *worlds)
            changed = [np.any(metrics["safe_score"] != usual["safe_score"]) for metrics in played]
            found |= {name for name, is_other in zip(tried, changed, strict=True) if is_other}
        return [t.name for t in self.tunables if t.name in found]

    def _card(self, curve: list[dict[str, Any]]) -> dict[str, Any]:
        """Return what was found, from what, and how well it scores."""
        import cmaes

        s, best = self.settings, max(curve, key=lambda point: point["score"])
        values: dict[str, float] = best["settings"]
        fresh, check = s.seed + FRESH_SEED, {"split": "validation", "seed": 2, "worlds": 32}
        scores: dict[str, Any] = {"split": "validation", "seed": fresh}
        played = self._play([values, {}], fresh, "validation", range(s.validation_worlds))
        for name, metrics in zip(("tuned", "untuned"), played, strict=True):
            others = {metric: float(metrics[metric].mean()) for metric in ("score", "contact_free")}
            scores[name] = {"safe_score": asdict(mean(metrics["safe_score"])), **others}
        (checked,) = self._play([values], 2, "validation", range(32))
        versions = {"cmaes": cmaes.__version__, "numpy": np.__version__, "posse": posse.__version__}
        return {
            "format": FORMAT,
            "policy": s.policy,
            "scenario": self.scenario.name,
            "scenario_version": self.scenario.version,
            "settings": values,
            "command": s.command(len(self.told), self.names),
            "seed": s.seed,
            "commit": commit(),
            "searched": self.names,
            "generation": best["generation"],
            "curve": [{k: v for k, v in point.items() if k != "settings"} for point in curve],
            "trained_splits": ["train"],
            "chosen_on": "validation",
            "scores": scores,
            "check": {**check, "safe_score": float(checked["safe_score"].mean())},
            "software": {**versions, "python": platform.python_version()},
        }


def main(arguments: Sequence[str]) -> None:
    """Tune a policy, and print what was found."""
    path = tune(tyro.cli(TuneSettings, prog="posse tune", args=arguments))
    scores = read_json(path)["scores"]
    for which in ("untuned", "tuned"):
        safe, contact = scores[which]["safe_score"], 1 - scores[which]["contact_free"]
        interval = f"{safe['value']:.3f} [{safe['low']:.3f}, {safe['high']:.3f}]"
        print(f"{which:>8}: safe score {interval}, contact in {contact:.1%} of {safe['count']} validation worlds")
    print(path)
