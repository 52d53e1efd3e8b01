"""``posse submit``: play a scenario for the leaderboard and write the result file."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

import posse
from posse_baselines import Policy, load, policy_names
from posse_baselines.files import write_atomically
from posse_baselines.registry import is_code
from posse_training.errors import ResultFileError
from posse_training.leaderboard.result_file import COLUMNS, DIGITS, ResultFile, write_result
from posse_training.provenance import commit
from posse_training.reports.evaluation import Results, evaluate
from posse_training.reports.statistics import mean

SEED: Final = 2026
WORLDS: Final = 1000
"""Seed and number of worlds of the leaderboard, on the split ``test``."""


def play_for_result(
    policy: str,
    scenario: str,
    *,
    worlds: int = WORLDS,
    seed: int = SEED,
    split: str = "test",
    label: str | None = None,
    replay: str | None = None,
    progress: bool = True,
) -> ResultFile:
    """Play worlds 0 to ``worlds`` - 1 of a named scenario and return the result.

    Args:
        policy: A name, a policy file, or ``package.module:Class``, which runs that code.
        scenario: Name of a scenario; its settings are those of the benchmark.
        worlds: Number of worlds, 1 to 10,000; the leaderboard ranks results of 1,000.
        seed: Seed of the worlds; the leaderboard's is 2026.
        split: Split of the worlds; the leaderboard's is ``"test"``.
        label: Name on the leaderboard; default: the policy's.
        replay: Address of a replay that the leaderboard links to, beginning with https://.
        progress: Whether to show a bar.

    Raises:
        PolicyError: An unknown or damaged policy, or one that does not fit the scenario.
        ScenarioError: An unknown scenario or split, an invalid seed.
        TrainedSplitError: A split that the policy was trained on.
        SettingsError: ``worlds`` below 1.
    """
    loaded = load(policy)
    results = evaluate(loaded, scenario, worlds, seed, split=split, progress=progress)
    return result_of(policy, loaded, results, label=label, replay=replay)


def result_of(
    text: str, policy: Policy, results: Results, *, label: str | None = None, replay: str | None = None
) -> ResultFile:
    """Return the result file of an evaluation; ``text`` is what the policy was loaded from."""
    kind, name, digest = "shipped", text, None
    if is_code(text):
        kind = "code"
    elif text not in policy_names():
        kind, name = "file", Path(text).name
        digest = hashlib.sha256(Path(text).read_bytes()).hexdigest()
    return ResultFile(
        label=label or (policy.name if kind == "file" else text),
        policy_kind=kind,
        policy=name,
        policy_sha256=digest,
        reads_state=bool(policy.reads_state),
        scenario=results.scenario.name,
        scenario_version=results.scenario.version,
        split=results.split,
        seed=results.seed,
        posse_version=posse.__version__,
        commit=commit(),
        machine=machine_type(),
        replay=replay,
        rows={name: rounded(results, name) for name in COLUMNS},
    )


def rounded(results: Results, metric: str) -> tuple[float, ...]:
    """Return a metric as result files hold it."""
    return tuple(round(float(value), DIGITS) for value in results[metric])


def machine_type() -> str:
    """Return what rows depend on beside the sources: processor, C library, compiler.

    The last digit of a sine differs between C libraries, and a world amplifies it.
    """
    import llvmlite
    import numba
    from llvmlite import binding

    library = "-".join(platform.libc_ver()) if platform.system() == "Linux" else platform.release()
    return ", ".join(
        (
            f"{platform.system()} {platform.machine()}",
            binding.get_host_cpu_name(),
            library,
            f"numba {numba.__version__}",
            f"llvmlite {llvmlite.__version__}",
        )
    )


@dataclass(frozen=True)
class _Submit:
    """Play a scenario for the leaderboard and write the result file."""

    policy: Annotated[str, tyro.conf.Positional]
    """Policy: a name, a file, or package.module:Class."""
    out: Path
    """File to write (.json); a policy file is copied beside it."""
    scenario: str = "smart"
    """Scenario to play."""
    label: str | None = None
    """Name on the leaderboard; default: the policy's."""
    worlds: int = WORLDS
    """Number of worlds; the leaderboard ranks results of 1,000 or more."""
    seed: int = SEED
    """Seed of the worlds; the leaderboard's is 2026."""
    split: str = "test"
    """Split of the worlds; the leaderboard's is test."""
    replay: str | None = None
    """Address of a replay to link to, beginning with https://."""


def main(arguments: Sequence[str]) -> None:
    """Play, and write the file."""
    which = tyro.cli(_Submit, prog="posse submit", args=arguments)
    if which.out.suffix != ".json":
        raise ResultFileError(f"--out {which.out} must end in .json")
    result = play_for_result(
        which.policy,
        which.scenario,
        worlds=which.worlds,
        seed=which.seed,
        split=which.split,
        label=which.label,
        replay=which.replay,
    )
    write_result(result, which.out)
    copy = which.out.parent / result.policy
    if result.policy_kind == "file" and not (copy.exists() and copy.samefile(which.policy)):
        write_atomically(copy, Path(which.policy).read_bytes())
    print(
        f"{which.out}: {result.label} on {result.scenario}, safe score "
        f"{mean(result.column('safe_score'))} over {result.worlds:,} worlds\n"
        f"check it: posse verify {which.out}"
    )
