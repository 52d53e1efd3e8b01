"""What a run is judged and normalised by: validation scores and first input statistics."""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from posse_baselines import PolicyError, Target, load, load_target
from posse_training.errors import PlayError, SettingsError
from posse_training.evaluation.evaluation import evaluate, played_errors
from posse_training.evaluation.results import block_of
from posse_training.evaluation.statistics import mean
from posse_training.train.display import Display
from posse_training.train.networks import RunningStatistics
from posse_training.train.settings import TrainSettings
from posse_training.train.worlds import make_env, pairings

VALIDATION_SEED: Final = 0
LOAD: Final[dict[str, Any]] = {"trackers": load, "target": load_target}
"""How a policy of each side is found by name."""
_WARM_WORLDS: Final = 32
_HELD: Final = 20  # steps for which a random action is held, so that trackers move somewhere


def first_statistics(settings: TrainSettings, statistics: RunningStatistics) -> None:
    """Gather input statistics from one episode of random actions in a few worlds.

    Without them the first updates learn from inputs of very different sizes, and the run lags behind for millions of
    steps.
    """
    few = max(_WARM_WORLDS, sum(pair.share for pair in pairings(settings)))
    try:
        warm = make_env(replace(settings, num_worlds=few))
    except SettingsError:  # drawn scenarios need more
        warm = make_env(settings)
    generator = np.random.default_rng(settings.seed)
    statistics.add(warm.reset())
    for step in range(max(batch.scenario.horizon for batch in warm.batches)):
        if step % _HELD == 0:
            actions = generator.uniform(-1.0, 1.0, (warm.num_envs, warm.action_length)).astype(np.float32)
        statistics.add(np.asarray(warm.step(actions)[0]))


def score_beside(settings: TrainSettings, display: Display) -> float | None:
    """Return the safe score of ``settings.beside`` on the validation worlds; ``None``: none."""
    if settings.beside is None:
        return None
    display.note(f"evaluating {settings.beside} on the validation worlds")
    try:
        with played_errors():
            return validate(settings, LOAD[settings.side](settings.beside))["safe_score"]
    except (PolicyError, PlayError) as error:
        display.note(f"no score of {settings.beside}: {error}")
        return None


def validate(settings: TrainSettings, policy: Any) -> dict[str, float]:
    """Return the results of the learning side's policy on the validation worlds of every pairing.

    ``safe_score`` with its 95 % interval ``low``, ``high``; ``score``; and ``contact_free``, the
    share of episodes. For a target, both scores are what it denies the team: 1 less the team's score.
    """
    played: dict[str, list[Any]] = {"safe_score": [], "score": [], "contact_free": []}
    for pair in pairings(settings):
        team: Any = policy
        target: Any = pair.opponent
        if settings.side == "target":
            team, target = pair.opponent, policy if isinstance(policy, Target) else Target(policy.name, "agent", policy)
        results = evaluate(
            team,
            pair.scenario,
            settings.evaluate_worlds,
            VALIDATION_SEED,
            target=target,
            split="validation",
            progress=False,
        )
        denied = 1 - results["score"]
        for name, parts in played.items():
            parts.append(denied if settings.side == "target" and name != "contact_free" else results[name])
    # Of the mean over pairings in each world: families of many pairings draw the same shares of their ranges.
    safe = mean(np.mean(played["safe_score"], axis=0), max(map(block_of, settings.given)))
    return {
        "safe_score": safe.value,
        "low": safe.low,
        "high": safe.high,
        **{name: float(np.mean(played[name])) for name in ("score", "contact_free")},
    }
