"""Records episodes of policies as a Minari data set, with what it takes to make it again."""

from __future__ import annotations

import contextlib
import json
import os
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium
import minari

import posse
from posse import Scenario, get_scenario
from posse_baselines import Policy, PolicyError, load
from posse_training.cluster.settings import Cluster, as_cluster
from posse_training.cluster.shards import cut
from posse_training.datasets.episodes import Part, play_part
from posse_training.errors import SettingsError
from posse_training.provenance import commit

AT_ONCE: Final = 20
"""Episodes in memory at a time: some 20 MB for five trackers."""
_PATH: Final = "MINARI_DATASETS_PATH"


def record_dataset(
    policies: str | Policy | Sequence[str | Policy],
    scenario: str = "smart",
    episodes: int = 1000,
    *,
    out: str | Path,
    name: str | None = None,
    seed: int = 7,
    split: str = "train",
    progress: Callable[[int], object] = lambda episodes: None,
    ray: bool | str | Cluster = False,
    **overrides: Any,
) -> minari.MinariDataset:
    """Record episodes of ``posse/Team-v0`` as a Minari data set, ``posse/SCENARIO/NAME-v0``.

    Episode i is world i of the seed, played by policy i mod their number: one policy makes an
    expert's data set, several one of mixed quality. Each episode's metadata says who played which
    world, and every metric; the data set's ``posse`` entry (JSON) holds all settings, versions, the
    commit and the seed. Infos are the score and the reward terms of each step.

    Args:
        policies: Policies, or what :func:`posse_baselines.load` takes.
        scenario: Name of a scenario.
        episodes: How many, at least one for each policy.
        out: Folder of Minari data sets, made if missing.
        name: Name of the data set; default: the policies', joined by ``-and-``.
        seed: Seed of the worlds.
        split: Split of the worlds.
        progress: Called with the number of episodes that have been written since the last call.
        ray: Play on a Ray cluster, as in :func:`posse_training.evaluate`; the data set is the same.
        overrides: Settings of the scenario.

    Raises:
        SettingsError: Too few episodes, or a data set of this name in ``out``.
        PolicyError: No policy, an unknown one, or one that does not fit the scenario.
        ScenarioError: An unknown scenario or split, an invalid setting or seed.
        MissingExtraError: Ray is to be used and not installed.
        ClusterError: There is no such cluster, or the workers of some episodes died again and
            again.
    """
    given = [policies] if isinstance(policies, str) or not isinstance(policies, Sequence) else policies
    players = [load(each) if isinstance(each, str) else each for each in given]
    if not players:
        raise PolicyError("no policies given: pass at least one")
    if episodes < len(players):
        raise SettingsError(f"episodes={episodes} must be at least {len(players)}, one a policy")
    overrides["message_size"] = max(
        get_scenario(scenario, **overrides).message_size, *(each.message_size for each in players)
    )
    settings = get_scenario(scenario, **overrides)
    name = name or "-and-".join(each.name for each in players)
    called = f"posse/{scenario}/{re.sub(r'[^A-Za-z0-9_.-]', '-', name)}-v0"
    folder = Path(out)
    if (folder / called).exists():
        raise SettingsError(f"{folder / called} exists: remove it, or choose another name")
    env = gymnasium.make("posse/Team-v0", scenario=scenario, split=split, **overrides)
    with contextlib.ExitStack() as stack:
        cluster = as_cluster(ray)
        if cluster is None:
            parts = _buffers(players, settings, episodes, seed, split)
        else:
            from posse_training.datasets.on_cluster import recorded_on_cluster

            parts = stack.enter_context(recorded_on_cluster(players, settings, episodes, seed, split, cluster))
        stack.enter_context(_datasets_in(folder))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", UserWarning)  # that an e-mail address is missing
        dataset = _write(
            called,
            env,
            parts,
            progress,
            description=f"{episodes} episodes of posse's scenario {scenario!r}, played by {name}",
            algorithm_name=name,
            code_permalink=f"posse {posse.__version__} {commit() or ''}",
        )
    about = {
        "version": posse.__version__,
        "commit": commit(),
        "scenario": settings.to_dict(),
        "seed": seed,
        "split": split,
        "policies": [_about(each) for each in players],
    }
    dataset.storage.update_metadata({"posse": json.dumps(about)})
    return dataset


def load_dataset(out: str | Path, name: str) -> minari.MinariDataset:
    """Return a data set of a folder by its name, ``posse/SCENARIO/NAME-v0``.

    Raises:
        FileNotFoundError: There is none of this name.
    """
    with _datasets_in(Path(out)):
        return minari.load_dataset(name)


def _buffers(players: Sequence[Policy], settings: Scenario, episodes: int, seed: int, split: str) -> Iterator[Part]:
    """Yield buffers of episodes and their metadata, some at a time."""
    for shard in cut(episodes, AT_ONCE):
        yield play_part(players, settings, seed, split, shard)


def _write(
    called: str, env: gymnasium.Env[Any, Any], parts: Iterator[Part], progress: Callable[[int], object], **about: Any
) -> minari.MinariDataset:
    dataset: minari.MinariDataset | None = None
    done = 0
    for buffers, metadata in parts:
        if dataset is None:
            dataset = minari.create_dataset_from_buffers(
                called,
                buffers,
                env=env,
                data_format="hdf5",
                author="posse",
                requirements=[f"posse=={posse.__version__}"],
                **about,
            )
        else:
            dataset.storage.update_episodes(buffers)
        dataset.storage.update_episode_metadata(metadata, range(done, done + len(buffers)))
        done += len(buffers)
        progress(len(buffers))
    assert dataset is not None
    return minari.load_dataset(called)


def _about(policy: Policy) -> dict[str, Any]:
    card = getattr(policy, "card", None)
    return {"name": policy.name, "card": dict(card) if card else None}


@contextlib.contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Let Minari keep its data sets in a folder meanwhile."""
    folder.mkdir(parents=True, exist_ok=True)
    before = os.environ.get(_PATH)
    os.environ[_PATH] = str(folder.resolve())
    try:
        yield
    finally:
        if before is None:
            del os.environ[_PATH]
        else:
            os.environ[_PATH] = before
