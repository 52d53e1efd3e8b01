"""The worlds of a training run: what learns in them, and what it plays against."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

import posse
from posse import Family, ObservationLayout, Scenario
from posse_baselines import Policy, PolicyError, Target, load, load_target
from posse_baselines.learned import Encoding
from posse_training.errors import SettingsError
from posse_training.evaluation.episodes import refuse_trained_split
from posse_training.train.algorithms import ALGORITHMS, EVOLUTION
from posse_training.train.settings import TrainSettings
from posse_training.train.vec_env import TeamVecEnv


class Pairing(NamedTuple):
    """A scenario and an opponent."""

    scenario: Scenario | Family
    """With the opponent's target, or messages."""
    opponent: Policy | Target | None
    """A team's policy where the target learns, else a target; ``None``: the scenario's own target."""
    inside: dict[str, Any]
    """The argument of :func:`posse.batches` that puts the opponent into the worlds, if it is a policy."""
    share: int
    """How many parts of the worlds it gets."""


def pairings(settings: TrainSettings) -> tuple[Pairing, ...]:
    """Return every scenario with every opponent; PolicyError if its memory cannot be saved, as resuming requires."""
    found: list[Pairing] = []
    for scenario in settings.given:
        if not settings.opponents:
            found.append(Pairing(scenario, None, {}, 1))
        for name, share in settings.opponents.items():
            opponent: Any
            policy: Any
            if settings.side == "target":
                opponent = policy = load(name)
                size = max(scenario.message_size, policy.message_size)
                faced, argument = scenario.replace(target_motion="agent", message_size=size), "team_policy"
            else:
                opponent = load_target(name)
                faced, policy = scenario.replace(target_motion=opponent.motion), opponent.policy
                argument = "target_policy"
            if policy is not None and (getattr(policy, "reads_state", False) or not hasattr(policy, "arrays")):
                raise PolicyError(
                    f"{name!r} cannot be trained against: it reads the state of the worlds, or its memory cannot be "
                    "saved (it has no method arrays)"
                )
            refuse_trained_split(opponent, "validation")
            found.append(Pairing(faced, opponent, {} if policy is None else {argument: policy}, share))
    return tuple(found)


def make_env(settings: TrainSettings, num_threads: int | None = None) -> TeamVecEnv:
    """Return the training worlds, of the split ``"train"``, stepped by so many threads."""
    batches: list[posse.Batch] = []
    for pair, worlds in divided(settings):
        scenario = pair.scenario
        if settings.end_on_contact:
            scenario = scenario.replace(terminate_on_contact=True)
        batches += posse.batches(
            scenario,
            len(worlds),
            scenarios=settings.family_scenarios,
            seed=settings.seed,
            first_world=worlds.start,
            autoreset="disabled",
            num_threads=num_threads,
            **pair.inside,
        )
    layout = max((batch.layout for batch in batches), key=lambda layout: layout.neighbours)
    layout = ObservationLayout(layout.scenario.replace(message_size=settings.message_size))  # the learner's alone
    encoding = Encoding.of(layout, settings.encoding, settings.num_neighbours)
    return TeamVecEnv(
        batches, encoding, safeguard=settings.safeguard, see_state=ALGORITHMS[settings.algorithm].reads_state
    )


def divided(settings: TrainSettings) -> list[tuple[Pairing, range]]:
    """Return every pairing with its part of the worlds, by their shares.

    SettingsError if there are too few for one in each share, or in each scenario that is drawn of a family.
    """
    pairs = pairings(settings)
    ends = np.cumsum([0, *(pair.share for pair in pairs)])
    edges = (settings.num_worlds * ends // ends[-1]).tolist()
    parts = [(pair, range(*edge)) for pair, edge in zip(pairs, pairwise(edges), strict=True)]
    for pair, worlds in parts:
        drawn = isinstance(pair.scenario, Family) and settings.algorithm != EVOLUTION
        if len(worlds) < (least := settings.family_scenarios if drawn else 1):
            raise SettingsError(
                f"num_worlds={settings.num_worlds} leaves {len(worlds)} for a share of {pair.scenario.name}: it "
                f"needs {least}; raise it" + ", or lower family_scenarios" * drawn
            )
    return parts
