"""``posse tune``: from a policy to its tuned settings, in the order it runs."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from posse_baselines import Tunable
from posse_baselines.files import write_atomically
from posse_baselines.tuned import TUNED
from posse_baselines.tuned.files import SHIPPED_TUNED
from posse_training.cluster.settings import of_option
from posse_training.errors import RunFolderError, SettingsError
from posse_training.files import InUseError, locked
from posse_training.provenance import commit
from posse_training.reports.statistics import mean
from posse_training.tuning.card import make_card
from posse_training.tuning.display import Display
from posse_training.tuning.scoring import Scorer, tunable_policy
from posse_training.tuning.search import Generation, Search
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.space import Point, Space, select
from posse_training.tuning.state import State, read_state

TUNED_FILE: Final = "tuned.json"
"""Name of the result in a run folder."""


def tune(settings: TuneSettings, *, console: Console | None = None) -> Path:
    """Tune a policy for a scenario, or resume that; return the file of the settings found.

    Raises:
        PolicyError: An unknown policy, or one without tunable settings.
        ScenarioError: An unknown scenario.
        SettingsError: A value out of its range, an unknown setting in ``only``, a policy that
            cannot ship, or nothing that has an effect.
        RunFolderError: The folder is in use, or holds something else.
        CheckpointError: Its state is damaged or cannot be written.
        MissingExtraError: Ray is to be used and not installed.
        ClusterError: There is no such cluster, or workers died again and again.
    """
    settings.check()
    policy, tunables = tunable_policy(settings.policy)
    scorer = Scorer.of(policy, settings.scenario, settings.seed, settings.threads)
    _check_only(settings, tunables)
    shipped = _shipped_path(settings)
    identity = {**settings.identity(), "scenario_version": scorer.scenario.version}
    read_state(settings.folder, identity)  # before anything is made
    try:
        with (
            locked(settings.folder),
            Display(settings, console or Console()) as display,
            _place(settings, replace(scorer, played=display.played), display) as scorer,
        ):
            state = read_state(settings.folder, identity)
            if state is None:
                display.note("finding the settings that have an effect")
                names = settings.only or scorer.effective(tunables)
                if not names:
                    raise SettingsError(f"no setting of {settings.policy!r} has an effect on {settings.scenario!r}")
                state = State(identity, list(names))
            card = _run(settings, scorer, Space(*select(tunables, state.names)), state, display)
    except InUseError as error:
        raise RunFolderError(f"run folder {error}: wait for it, or choose another --out") from error
    path = settings.folder / TUNED_FILE
    content = (json.dumps(card, indent=2, sort_keys=True) + "\n").encode()
    write_atomically(path, content)
    if shipped is not None:
        shipped.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(shipped, content)
    return path


@contextlib.contextmanager
def _place(settings: TuneSettings, scorer: Scorer, display: Display) -> Iterator[Scorer]:
    """Yield a scorer that plays where the settings say."""
    cluster = of_option(settings.ray, settings.folder)
    if cluster is None:
        yield scorer
        return
    from posse_training.cluster.ray_backend import RayBackend
    from posse_training.tuning.on_cluster import ClusterScorer, Elsewhere

    with RayBackend(cluster) as backend:
        elsewhere = Elsewhere(backend, cluster.attempts, display.note)
        yield ClusterScorer(**vars(scorer), elsewhere=elsewhere)


def _run(settings: TuneSettings, scorer: Scorer, space: Space, state: State, display: Display) -> dict[str, Any]:
    """Search until the time is over; return the card."""
    search = Search(space.start, settings.population, settings.seed, state.generations)
    since = time.monotonic() - state.seconds
    display.begin(state, space.tunables)

    def keep() -> None:
        state.seconds = time.monotonic() - since
        state.write(settings.folder)

    if not state.curve:
        _validate(settings, scorer, space, state, space.start, display)
        keep()
    present = commit()
    while not _is_over(settings, state):
        if present not in state.commits:
            state.commits.append(present)
        _generation(settings, scorer, space, search, state, display.candidate)
        if len(state.generations) % settings.every == 0:
            _validate(settings, scorer, space, state, search.mean, display)
        keep()
        display.generation(state)
    if state.curve[-1]["generation"] != len(state.generations):
        _validate(settings, scorer, space, state, search.mean, display)
    display.note("scoring what was found on other validation worlds")
    # A point off the schedule counts only where the run ends: a run goes on as if uninterrupted.
    last = len(state.generations)
    points = [p for p in state.curve if p["generation"] in (0, last) or _due(settings, p)]
    state.curve = points
    return make_card(settings, scorer, state, max(points, key=lambda point: point["score"]))


def _generation(
    settings: TuneSettings, scorer: Scorer, space: Space, search: Search, state: State, report: Callable[[int], object]
) -> None:
    """Score a generation on worlds of its own, the same for all its candidates."""
    points = search.ask()
    first = len(state.generations) * settings.worlds
    candidates = [space.values(point) for point in points]
    found = scorer.scores_of(candidates, "train", first, settings.worlds, report)
    scores = [float(each.mean()) for each in found]
    state.generations.append(Generation(points=points.tolist(), scores=scores))
    search.tell(points, scores)


def _validate(
    settings: TuneSettings, scorer: Scorer, space: Space, state: State, point: Point, display: Display
) -> None:
    """Append the validation score of a point to the curve; the first one is the untuned policy."""
    values = space.values(point) if state.generations else {}
    scores = scorer.scores(values, "validation", 0, settings.validation_worlds)
    estimate = mean(scores)
    state.curve.append(
        {
            "generation": len(state.generations),
            "score": estimate.value,
            "low": estimate.low,
            "high": estimate.high,
            "settings": values,
        }
    )
    display.validated(state)


def _due(settings: TuneSettings, point: dict[str, Any]) -> bool:
    return bool(point["generation"] % settings.every == 0)


def _is_over(settings: TuneSettings, state: State) -> bool:
    if settings.generations is not None:
        return len(state.generations) >= settings.generations
    return bool(state.generations) and state.seconds >= 60.0 * settings.minutes


def _check_only(settings: TuneSettings, tunables: tuple[Tunable, ...]) -> None:
    known = [t.name for t in tunables]
    for name in settings.only:
        if name not in known:
            raise SettingsError(
                f"only={name!r:.80} is not a tunable setting of {settings.policy!r}; these are: {', '.join(known)}"
            )


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
