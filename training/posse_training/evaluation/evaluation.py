"""Play episodes with a policy and keep a row for each.

Every policy plays the same worlds: world i depends on the seed, the split and i only.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from posse import Family, Scenario, ScenarioError
from posse.declarations import is_number
from posse.scenarios.family import blocks, scenario_or_family
from posse_baselines import Policy, PolicyError, Target, batch_for, load, load_target, policy_names
from posse_baselines.registry import is_code
from posse_training.errors import PlayError, SettingsError, describe
from posse_training.evaluation.episodes import Match, play_shard, refuse_trained_split, refuse_two_targets
from posse_training.evaluation.results import Results
from posse_training.parallel import Arrays, Job, apart, cut, gathered, joined

WORLDS: Final = 500
"""Worlds that are played at once; on a cluster a shard. What shipped policies do is the same with any."""
FAILURES: Final = (PlayError, SettingsError, ScenarioError)  # of one that plays; with a PolicyError it does not fit


def evaluate(
    policy: str | Policy,
    scenario: str | Scenario | Family,
    episodes: int = 1000,
    seed: int = 7,
    *,
    target: str | Target | None = None,
    split: str = "test",
    progress: bool = True,
    num_threads: int | None = None,
    ray: bool | str = False,
    **overrides: Any,
) -> Results:
    """Play episodes of a scenario with a policy, here or on a Ray cluster, with the same result.

    Episodes go on after a contact, whatever ``terminate_on_contact`` says.

    Args:
        policy: A policy, or an argument of :func:`posse_baselines.load`.
        scenario: A scenario, a family (:func:`posse.family`), or the name of one; ten worlds in a row of a family
            play the same drawn scenario.
        episodes: Number of episodes; episode i is world i of the seed.
        seed: Seed of the worlds.
        target: A target, or an argument of :func:`posse_baselines.load_target`; default: the scenario's own motion.
        split: Split of the worlds; no training and no tuning uses ``"test"``.
        progress: Whether to show a bar.
        num_threads: Threads that step the worlds; never changes a result; on a cluster one a shard.
        ray: Play on a Ray cluster (extra ``cluster``): its address; ``True`` for the cluster of
            this machine, or else all its cores.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: ``episodes`` no whole number of at least 1, a split that policy or target was trained on, or
            both a target and a ``target_motion``.
        PolicyError: An unknown policy or target, or one that does not fit; TypeError for what is none.
        ScenarioError: An unknown scenario or split, an invalid setting or seed.
        MissingExtraError: Ray is to be used and not installed.
        ClusterError: There is no such cluster, or one of its nodes has other versions.
        PlayError: The policy failed on the cluster, or its workers died again and again.
    """
    refuse_two_targets(target, overrides)
    given = scenario_or_family(scenario, **overrides)
    one = prepare(policy, given, episodes, seed, target=target, split=split)
    with progress_bar(disable=not progress) as bar:
        task = bar.add_task(escape(f"{one.policy.name} on {one.match.scenario.name}"), total=one.steps)
        if ray is False:
            match, advance = one.match._replace(policy=one.policy), partial(bar.advance, task)
            parts = [play_shard(match, shard, num_threads=num_threads, advance=advance) for shard in one.shards]
            return one.results(joined(parts))
        with gathered_results([one], ray, lambda: bar.advance(task, one.steps // len(one.shards))) as (found,):
            if isinstance(found, Exception):
                raise found
            return found


@dataclass(frozen=True)
class Evaluation:
    """What :func:`evaluate` plays, checked."""

    policy: Policy
    match: Match
    """What a worker of a cluster gets, with a name that it can load itself if there is one for the policy."""
    shards: Sequence[range]
    time_limit: float | None
    """Of a shard that code plays on a cluster, s."""

    @property
    def steps(self) -> int:
        """Control steps of all batches."""
        _, _, scenario, seed, split = self.match
        parts = (blocks(scenario, shard, seed, split) for shard in self.shards)
        return scenario.horizon * sum(1 for part in parts for _ in part)

    def results(self, columns: Arrays) -> Results:
        """Return the results, given the metrics of all worlds."""
        _, target, scenario, seed, split = self.match
        return Results(self.policy.name, scenario, seed, split, columns, None if target is None else target.name)


def prepare(
    policy: str | Policy,
    scenario: Scenario | Family,
    episodes: int,
    seed: int,
    *,
    target: str | Target | None = None,
    split: str = "test",
    time_limit: float | None = None,
) -> Evaluation:
    """Return an evaluation; arguments and errors are those of :func:`evaluate`, and a time limit of code, s."""
    if not is_number(episodes) or episodes < 1 or episodes != int(episodes):
        raise SettingsError(f"episodes={episodes!r} must be a whole number of at least 1")
    loaded = load(policy)
    opponent = None if target is None else load_target(target)
    for player in (loaded, opponent):
        refuse_trained_split(player, split)
    scenario = scenario if opponent is None else scenario.replace(target_motion=opponent.motion)
    size = max(scenario.message_size, loaded.message_size)
    scenario = scenario.replace(message_size=size, terminate_on_contact=False)  # scores are of whole episodes
    first, _ = next(blocks(scenario, range(1), 0, "train"))
    batch_for(loaded, first, 1, opponent, seed=seed, split=split)  # raises here what is invalid
    is_name = isinstance(policy, str) and (policy in policy_names() or is_code(policy))
    match = Match(policy if is_name else loaded, opponent, scenario, seed, split)
    return Evaluation(loaded, match, cut(int(episodes), WORLDS), time_limit if has_code(policy, target) else None)


def has_code(*players: object) -> bool:
    """Return whether one of some policies or targets is ``package.module:Class``."""
    return any(isinstance(each, str) and is_code(each) for each in players)


@contextmanager
def gathered_results(
    evaluations: Sequence[Evaluation], ray: bool | str, done: Callable[[], object]
) -> Iterator[list[Results | Exception]]:
    """Play all evaluations at once on a Ray cluster; give the results of each, or why there are none.

    What is finished is kept until the context ends without an exception; see
    :func:`posse_training.parallel.gathered`. ``done`` is called after each shard.
    """
    jobs = [
        Job(partial(guarded, one.time_limit, partial(play_shard, one.match, num_threads=1)), one.shards)
        for one in evaluations
    ]
    with gathered(jobs, ray, done) as found:
        both = zip(evaluations, found, strict=True)
        yield [columns if isinstance(columns, Exception) else one.results(columns) for one, columns in both]


def guarded(limit: float | None, play: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a call gives, with :func:`played_errors`; with a time limit, s, in a process of its own."""
    if limit is not None:
        return apart(limit, guarded, None, play, *arguments)
    with played_errors():
        return play(*arguments)


@contextmanager
def played_errors() -> Iterator[None]:
    """Turn errors of a policy's own code into a ``PlayError`` that says where; all can be pickled."""
    try:
        yield
    except PolicyError as error:
        raise PolicyError(str(error)) from None  # a subclass may not survive pickling
    except FAILURES:
        raise
    except Exception as error:
        raise PlayError(describe(error)) from None


def progress_bar(*, disable: bool = False, console: Console | None = None) -> Progress:
    """Return a progress bar, as all commands show it."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        transient=True,
        disable=disable,
        console=console or Console(force_jupyter=False),  # in notebooks it needs ipywidgets
    )
