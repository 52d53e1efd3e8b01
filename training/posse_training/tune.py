"""``posse tune``: CMA-ES over the settings of a scripted team that are declared tunable, in the order it runs.

The run folder holds ``state.jsonl``, a line for each generation, from which the same command resumes.
"""

from __future__ import annotations

import json
import math
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
import tyro
from rich.console import Console

import posse
from posse import Scenario, get_scenario
from posse_baselines import Policy, PolicyError, Tunable, load, play
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import tunables
from posse_baselines.files import write_atomically
from posse_baselines.tuned import FORMAT, SHIPPED_TUNED, TUNED
from posse_training.errors import CheckpointError, RunFolderError, SettingsError, require
from posse_training.evaluation.evaluation import progress_bar
from posse_training.evaluation.statistics import mean
from posse_training.files import InUseError, locked, read_json
from posse_training.parallel import RayOption, address_of, connected, on_ray
from posse_training.provenance import commit

if TYPE_CHECKING:
    from cmaes import CMA

Point = npt.NDArray[np.float64]
STATE: Final = "state.jsonl"
RESULT: Final = "tuned.json"
SIGMA: Final = 0.1
"""Initial standard deviation, as a share of each setting's range."""
SCREENED_ON: Final = 8
"""Worlds in which a setting has to change a score to be searched."""
FRESH_SEED: Final = 1_000
"""Added to the run's seed for the validation worlds on which the result is scored once."""
CHECK: Final = (2, 32)
"""Seed and number of the validation worlds of a card's check."""
_LOG_FROM: Final = 10.0  # ratio of a range's ends from which it is searched by its logarithm
_GAP: Final = 0.02  # of the range; least distance of a setting above another
_RANGES: Final[dict[str, tuple[float, float]]] = {
    "minutes": (0.001, 10_000.0),
    "seed": (0, 2**31 - 1),
    "generations": (1, 1_000_000),
    "population": (4, 1_000),
    "worlds": (1, 100_000),
    "validation_worlds": (1, 100_000),
    "every": (1, 1_000_000),
    "threads": (1, 1_024),
}


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """Search the tunable settings of a policy for a scenario by CMA-ES. The same command again resumes a run."""

    policy: Annotated[str, tyro.conf.Positional]
    """Policy with tunable settings: a name, or package.module:Class."""
    scenario: str = "smart"
    """Scenario to tune for."""
    minutes: float = 3.0
    """When to stop: after the generation in which this time is over, resumed parts included."""
    seed: int = 1
    """Seed of the search and of the worlds."""
    out: Path | None = None
    """Run folder; default: runs/tune/POLICY-SCENARIO-SEED. A run that it holds is resumed."""
    generations: int | None = None
    """Stop after so many generations, whatever the time."""
    population: int = 12
    """Candidates in a generation."""
    worlds: int = 16
    """Training worlds of a generation; each generation has its own."""
    validation_worlds: int = 256
    """Validation worlds on which the mean of the search is scored; the best one is kept."""
    every: int = 10
    """Generations between two of these scores."""
    only: tuple[str, ...] = ()
    """Settings to search over; default: all that have an effect on this scenario."""
    threads: int | None = None
    """Threads that step the worlds; default: as many as cores. Never changes the result."""
    ray: RayOption = None
    """Play on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of this machine, or
    else all its cores. Extra: cluster."""
    ship: bool = False
    """Write the result to the package, where the policy's tuned version finds it."""

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


@runtime_checkable
class TunablePolicy(Policy, Protocol):
    """A policy whose settings a search can change."""

    settings: Any
    """A dataclass whose fields declare themselves by :func:`posse_baselines.fields.tuned`."""

    def with_settings(self, **values: Any) -> Policy:
        """Return a policy with some settings changed."""
        ...


@dataclass(frozen=True)
class Space:
    """Tunable settings as points of the unit cube.

    A range of positive numbers with a ratio of its ends of 10 or more is mapped by the logarithm.
    """

    tunables: tuple[Tunable, ...]
    fixed: tuple[Tunable, ...] = ()
    """Tunable settings that stay at their defaults; others may have to exceed them."""

    @property
    def start(self) -> Point:
        """The defaults, (n,)."""
        return np.array([_to_unit(t) for t in self.tunables])

    def values(self, point: Point) -> dict[str, float]:
        """Return the settings of a point (n,), those that must exceed another one made to."""
        found = {t.name: _from_unit(t, u) for t, u in zip(self.tunables, point, strict=True)}
        others = {t.name: t.default for t in self.fixed} | found
        for t in (*self.tunables, *self.fixed):
            if t.above and (t.name in found or t.above in found):
                least = others[t.above] + _GAP * (t.high - t.low)
                if others[t.name] < least:
                    found[t.name] = min(t.high, least)
        return found


def _to_unit(t: Tunable) -> float:
    if t.low > 0.0 and t.high / t.low >= _LOG_FROM:
        return math.log(t.default / t.low) / math.log(t.high / t.low)
    return (t.default - t.low) / (t.high - t.low)


def _from_unit(t: Tunable, unit: float) -> float:
    unit = min(1.0, max(0.0, float(unit)))
    is_log = t.low > 0.0 and t.high / t.low >= _LOG_FROM
    value = t.low * (t.high / t.low) ** unit if is_log else t.low + unit * (t.high - t.low)
    # Six digits, so that files stay readable; rounding must not leave the range.
    return min(t.high, max(t.low, float(f"{value:.6g}")))


def tune(settings: TuneSettings, *, console: Console | None = None) -> Path:
    """Tune a policy for a scenario, or resume that; return the file of the settings found.

    Raises:
        MissingExtraError: ``cmaes`` is not installed.
        PolicyError: An unknown policy, or one without tunable settings.
        ScenarioError: An unknown scenario.
        SettingsError: A value out of its range, an unknown setting in ``only``, a policy that cannot ship, or nothing
            that has an effect.
        RunFolderError: The folder is in use, or holds something else.
        CheckpointError: Its state is damaged.
        ClusterError: There is no such Ray cluster.
    """
    require("training", "cmaes")
    run = _Run(settings, console or Console())
    shipped = _shipped_path(settings)
    run.resume()  # before anything is made
    try:
        with connected(address_of(settings.ray)), locked(settings.folder):
            card = run.play()
            content = (json.dumps(card, indent=2, sort_keys=True) + "\n").encode()
            write_atomically(settings.folder / RESULT, content)
    except InUseError as error:
        raise RunFolderError(f"run folder {error}: wait for it, or choose another --out") from error
    if shipped is not None:
        shipped.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(shipped, content)
    return settings.folder / RESULT


class _Run:
    """One run: what it plays, and the lines of its state."""

    def __init__(self, settings: TuneSettings, console: Console) -> None:
        _check_ranges(settings)
        self.settings, self.console = settings, console
        self.policy, self.tunables = _tunable_policy(settings.policy)
        found = get_scenario(settings.scenario)
        self.scenario: Scenario = found.replace(message_size=max(found.message_size, self.policy.message_size))
        known = [t.name for t in self.tunables]
        for name in settings.only:
            if name not in known:
                raise SettingsError(
                    f"only={name!r:.80} is not a tunable setting of {settings.policy!r}; these are: {', '.join(known)}"
                )
        fields = ("policy", "scenario", "seed", "population", "worlds", "validation_worlds", "every")
        self.identity = {name: getattr(settings, name) for name in fields}
        self.identity |= {"only": list(settings.only), "scenario_version": found.version}
        self.lines: list[dict[str, Any]] = []

    def resume(self) -> None:
        """Read the lines of the folder's state; none if it is new.

        Raises:
            RunFolderError: The folder holds something else, or a run with other settings.
            CheckpointError: Its state is damaged.
        """
        folder = self.settings.folder
        path = folder / STATE
        if not path.is_file():
            others = [p.name for p in folder.iterdir() if p.name != "lock"] if folder.is_dir() else []
            if others or folder.is_file():
                raise RunFolderError(
                    f"{folder} is not the folder of a tuning run: it has no {STATE}, but "
                    f"{', '.join(sorted(others)[:3]) or 'is a file'}. Choose another --out"
                )
            return
        try:
            self.lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
            theirs = {name: self.lines[0]["identity"][name] for name in self.identity}
            differing = next((name for name in theirs if theirs[name] != self.identity[name]), None)
            if differing is None:
                _ = self._cma(), [point["score"] for point in self.curve], self.lines[-1]["seconds"]
        except (OSError, ValueError, TypeError, KeyError, IndexError, RecursionError) as error:
            raise CheckpointError(
                f"{path} is damaged: {error}. The run cannot be resumed: remove {folder}, or choose another --out"
            ) from error
        if differing is not None:
            raise RunFolderError(
                f"{folder} holds a tuning run with {differing}={theirs[differing]!r}, not "
                f"{self.identity[differing]!r}: choose another --out, or remove it"
            )

    @property
    def names(self) -> list[str]:
        """Settings that are searched."""
        names: list[str] = self.lines[0]["names"]
        return names

    @property
    def generations(self) -> list[dict[str, Any]]:
        """Generations that the search was told, with ``points`` (P, n) and ``scores`` (P,)."""
        return [line for line in self.lines if "points" in line]

    @property
    def curve(self) -> list[dict[str, Any]]:
        """Scores of the search's mean on the validation worlds; the first is the untuned policy's."""
        return [line["validation"] for line in self.lines if "validation" in line]

    @property
    def space(self) -> Space:
        """What is searched."""
        chosen = tuple(t for t in self.tunables if t.name in self.names)
        return Space(chosen, tuple(t for t in self.tunables if t.name not in self.names))

    def play(self) -> dict[str, Any]:
        """Search until the time is over; return the card."""
        s = self.settings
        self.resume()
        if not self.lines:
            names = s.only or self._effective()
            if not names:
                raise SettingsError(f"no setting of {s.policy!r} has an effect on {s.scenario!r}")
            self._keep({"identity": self.identity, "names": list(names), "seconds": 0.0})
        spent: float = self.lines[-1]["seconds"]
        self.console.print(f"searching {len(self.names)} settings: {', '.join(self.names)}", markup=False)
        if self.generations:
            self.console.print(f"resuming after generation {len(self.generations)}")
        cma, space, since = self._cma(), self.space, time.monotonic() - spent
        if not self.curve:
            self._keep({"validation": self._validated(0, {}), "seconds": time.monotonic() - since})
        with progress_bar(console=self.console, disable=not self.console.is_terminal) as bar:
            task = bar.add_task("generations", total=s.generations, completed=len(self.generations))
            while not self._is_over():
                line = self._generation(cma, space)
                done = len(self.generations) + 1
                if done % s.every == 0:
                    line["validation"] = self._validated(done, space.values(_mean(cma)))
                self._keep({**line, "commit": commit(), "seconds": time.monotonic() - since})
                bar.advance(task)
        points, last = self.curve, len(self.generations)
        # A point off the schedule counts only where the run ends: a run goes on as if uninterrupted.
        if points[-1]["generation"] != last:
            points = [*points, self._validated(last, space.values(_mean(cma)))]
        return self._card(points)

    def _cma(self) -> CMA:
        """Return the search as it is after all past generations: its state follows from them and the seed."""
        from cmaes import CMA

        start, s = self.space.start, self.settings
        bounds = np.tile([0.0, 1.0], (len(start), 1))
        cma = CMA(mean=start, sigma=SIGMA, bounds=bounds, seed=s.seed, population_size=s.population)
        for past in self.generations:
            _ = [cma.ask() for _ in range(s.population)]  # draws what was drawn then
            points, scores = np.array(past["points"], np.float64), np.array(past["scores"], np.float64)
            if points.shape != (s.population, len(start)) or scores.shape != (s.population,):
                raise ValueError(f"a generation has points of shape {points.shape} and scores of {scores.shape}")
            if not (((points >= 0) & (points <= 1)).all() and np.isfinite(scores).all()):
                raise ValueError("a generation has points outside the cube, or scores that are not finite")
            cma.tell([(p, -float(v)) for p, v in zip(points, scores, strict=True)])
        return cma

    def _generation(self, cma: CMA, space: Space) -> dict[str, Any]:
        """Score a generation on worlds of its own, the same for all its candidates."""
        s = self.settings
        points = [cma.ask() for _ in range(s.population)]
        first = len(self.generations) * s.worlds
        played = self._play_each([space.values(p) for p in points], "train", first, s.worlds)
        scores = [float(metrics["safe_score"].mean()) for metrics in played]
        cma.tell([(p, -v) for p, v in zip(points, scores, strict=True)])
        return {"points": np.array(points).tolist(), "scores": scores}

    def _validated(self, generation: int, values: dict[str, float]) -> dict[str, Any]:
        found = mean(self._scores(values, "validation", 0, self.settings.validation_worlds))
        self.console.print(
            f"generation {generation:>4}  safe score {found.value:.3f} [{found.low:.3f}, {found.high:.3f}]",
            markup=False,
            highlight=False,
        )
        score = {"score": found.value, "low": found.low, "high": found.high}
        return {"generation": generation, **score, "settings": values}

    def _keep(self, line: dict[str, Any]) -> None:
        """Add a line to the state, and write it."""
        self.lines.append(line)
        text = "".join(json.dumps(each) + "\n" for each in self.lines)
        write_atomically(self.settings.folder / STATE, text.encode())

    def _is_over(self) -> bool:
        s, done = self.settings, len(self.generations)
        if s.generations is not None:
            return done >= s.generations
        return done > 0 and bool(self.lines[-1]["seconds"] >= 60.0 * s.minutes)

    def _play_each(
        self, candidates: Sequence[dict[str, float]], split: str, first: int, count: int, seed: int | None = None
    ) -> list[dict[str, Point]]:
        """Return the metrics of each candidate, (count,) each, on worlds ``first`` and following."""
        s = self.settings
        here = s.seed if seed is None else seed
        worlds = (self.scenario, here, split, first, count, s.threads if s.ray is None else 1)
        calls = [(self.policy.with_settings(**values), *worlds) for values in candidates]
        if s.ray is None:
            return [_played(*call) for call in calls]
        found = dict(on_ray(_played, calls))
        for result in found.values():
            if isinstance(result, Exception):
                raise result
        return [found[k] for k in range(len(calls))]

    def _metrics(
        self, values: dict[str, float], split: str, first: int, count: int, seed: int | None = None
    ) -> dict[str, Point]:
        return self._play_each([values], split, first, count, seed)[0]

    def _scores(self, values: dict[str, float], split: str, first: int, count: int, seed: int | None = None) -> Point:
        return self._metrics(values, split, first, count, seed)["safe_score"]

    def _effective(self) -> list[str]:
        """Return the settings whose ends of the range change any score in a few training worlds."""
        usual = self._scores({}, "train", 0, SCREENED_ON)
        defaults = {t.name: t.default for t in self.tunables}
        found: set[str] = set()
        for ends in ({t.name: t.low for t in self.tunables}, {t.name: t.high for t in self.tunables}):
            tried = []
            for name in (name for name in ends if name not in found):
                values = defaults | {name: ends[name]}
                if all(values[o.name] > values[o.above] for o in self.tunables if o.above):
                    tried.append(name)
            played = self._play_each([{name: ends[name]} for name in tried], "train", 0, SCREENED_ON)
            changed = [np.any(metrics["safe_score"] != usual) for metrics in played]
            found |= {name for name, is_other in zip(tried, changed, strict=True) if is_other}
        return [t.name for t in self.tunables if t.name in found]

    def _card(self, curve: list[dict[str, Any]]) -> dict[str, Any]:
        """Return what was found, from what, and how well it scores."""
        import cmaes

        s, best = self.settings, max(curve, key=lambda point: point["score"])
        values: dict[str, float] = best["settings"]
        fresh, (check_seed, check_worlds) = s.seed + FRESH_SEED, CHECK
        check = self._scores(values, "validation", 0, check_worlds, check_seed)
        scores = {}
        for name, given in (("tuned", values), ("untuned", {})):
            metrics = self._metrics(given, "validation", 0, s.validation_worlds, fresh)
            others = {metric: float(metrics[metric].mean()) for metric in ("score", "contact_free")}
            scores[name] = {"safe_score": mean(metrics["safe_score"]).to_dict(), **others}
        versions = {"cmaes": cmaes.__version__, "numpy": np.__version__, "posse": posse.__version__}
        return {
            "format": FORMAT,
            "policy": s.policy,
            "scenario": self.scenario.name,
            "scenario_version": self.scenario.version,
            "settings": values,
            "command": s.command(len(self.generations), self.names),
            "seed": s.seed,
            "commit": self.generations[-1]["commit"],
            "searched": self.names,
            "generation": best["generation"],
            "curve": [{k: v for k, v in point.items() if k != "settings"} for point in curve],
            "trained_splits": ["train"],
            "chosen_on": "validation",
            "scores": {"split": "validation", "seed": fresh, **scores},
            "check": {
                "split": "validation",
                "seed": check_seed,
                "worlds": check_worlds,
                "safe_score": float(check.mean()),
            },
            "software": {**versions, "python": platform.python_version()},
        }


def _played(
    policy: Policy, scenario: Scenario, seed: int, split: str, first: int, count: int, threads: int | None
) -> dict[str, Point]:
    """Return the metrics of a policy, (count,) each, on worlds ``first`` and following."""
    batch = posse.Batch(scenario, count, seed=seed, split=split, first_world=first, num_threads=threads)
    return play(batch, policy)


def _mean(cma: CMA) -> Point:
    """Return the mean of the search's distribution, (n,), within the cube."""
    mean_of: Point = np.clip(cma.mean, 0.0, 1.0)
    return mean_of


def _tunable_policy(name: str) -> tuple[TunablePolicy, tuple[Tunable, ...]]:
    policy = load(name)
    if isinstance(policy, TunablePolicy) and getattr(policy, "trained_splits", ()) == ():
        found = tunables(policy.settings)
        if found:
            return policy, found
    raise PolicyError(f"policy {name!r:.100} has no tunable settings; those that have: {', '.join(FAMILY)}")


def _check_ranges(settings: TuneSettings) -> None:
    for name, (low, high) in _RANGES.items():
        value = getattr(settings, name)
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise SettingsError(f"{name}={value!r} is out of range: choose it from {low:g} to {high:,g}")


def _shipped_path(settings: TuneSettings) -> Path | None:
    """Return where the package keeps the result; ``None``: it is not to be shipped."""
    if not settings.ship:
        return None
    for name, policy in TUNED.items():
        if policy == settings.policy:
            return SHIPPED_TUNED / name / f"{settings.scenario}.json"
    raise SettingsError(
        f"--ship needs a policy whose tuned version ships: {', '.join(TUNED.values())}; not {settings.policy!r}"
    )


def main(arguments: Sequence[str]) -> None:
    """Tune a policy, and print what was found."""
    path = tune(tyro.cli(TuneSettings, prog="posse tune", args=arguments))
    scores = read_json(path)["scores"]
    for which in ("untuned", "tuned"):
        safe, contact = scores[which]["safe_score"], 1 - scores[which]["contact_free"]
        interval = f"{safe['value']:.3f} [{safe['low']:.3f}, {safe['high']:.3f}]"
        print(f"{which:>8}: safe score {interval}, contact in {contact:.1%} of {safe['count']} validation worlds")
    print(path)
