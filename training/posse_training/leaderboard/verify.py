"""``posse verify``: play what a result file says again and compare."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro

from posse import get_scenario, scenario_names
from posse_baselines import Policy, load, policy_names
from posse_training.errors import ResultFileError
from posse_training.leaderboard.result_file import COLUMNS, ResultFile, read_result
from posse_training.leaderboard.submit import machine_type, rounded
from posse_training.provenance import commit
from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Column

TOLERANCE: Final = {"safe_score": 0.01, "score": 0.01, "contact_free": 0.02}
"""How far a mean may be off on another type of machine, where worlds play out differently."""
LEAST_WORLDS: Final = 100
"""Worlds whose means say something on another type of machine."""
MOST_POLICY_BYTES: Final = 64_000_000


@dataclass(frozen=True)
class Verdict:
    """What playing a result file again showed.

    Attributes:
        holds: Whether the file says what the policy does.
        same_machine: Whether this machine is of the type on which the file was made.
        worlds: Number of worlds played.
        differing: Number of worlds whose rows differ.
        off: By how much the mean of each metric in the file is above the one found here.
        explanation: The verdict in a sentence.
    """

    holds: bool
    same_machine: bool
    worlds: int
    differing: int
    off: dict[str, float]
    explanation: str


def verify(path: str | Path, *, run_code: bool = False, progress: bool = True) -> Verdict:
    """Play a result file's policy in its worlds again and compare the rows.

    On a machine of the same type all rows must be equal. On another one worlds play out
    differently, from the last digit on: there the means must agree within ``TOLERANCE``, over at
    least 100 worlds.

    Args:
        path: The result file. A policy file is looked for beside it.
        run_code: Import and run the code of a policy ``package.module:Class``. It runs with all
            rights of the process: only for code that you have read.
        progress: Whether to show a bar.

    Raises:
        ResultFileError: A damaged or invalid file, a policy that is missing or not the one played,
            code without ``run_code``, or a scenario of another version.
        PolicyError: A policy that cannot be loaded.
        TrainedSplitError: A split that the policy was trained on.
    """
    path = Path(path)
    result = read_result(path)
    _check_scenario(result, path)
    policy = _policy(result, path, run_code=run_code)
    if bool(policy.reads_state) != result.reads_state:
        raise ResultFileError(f"{path}: reads_state={result.reads_state} is not true of {result.policy}")
    again = evaluate(policy, result.scenario, result.worlds, result.seed, split=result.split, progress=progress)
    return _compare(result, {name: np.array(rounded(again, name)) for name in COLUMNS})


def _check_scenario(result: ResultFile, path: Path) -> None:
    if result.scenario not in scenario_names():
        raise ResultFileError(f"{path}: scenario={result.scenario!r} is not one of: {', '.join(scenario_names())}")
    version = get_scenario(result.scenario).version
    if version != result.scenario_version:
        raise ResultFileError(
            f"{path}: made on version {result.scenario_version} of {result.scenario!r}, and this "
            f"posse has version {version}: make it again with posse submit"
        )


def _policy(result: ResultFile, path: Path, *, run_code: bool) -> Policy:
    """Load the policy; only ``run_code`` imports code."""
    if result.policy_kind == "shipped":
        if result.policy not in policy_names():
            raise ResultFileError(
                f"{path}: policy={result.policy!r} is not shipped; shipped policies are: {', '.join(policy_names())}"
            )
        return load(result.policy)
    if result.policy_kind == "code":
        if not run_code:
            raise ResultFileError(
                f"{path}: its policy is code, {result.policy}, which would run with all your "
                "rights. Read it first; then pass --run-code"
            )
        return load(result.policy)
    beside = path.parent / result.policy
    try:
        size = beside.stat().st_size
        if size > MOST_POLICY_BYTES:
            raise ResultFileError(f"{beside}: {size:,} bytes; at most {MOST_POLICY_BYTES:,} are read")
        digest = hashlib.sha256(beside.read_bytes()).hexdigest()
    except OSError as error:
        raise ResultFileError(f"{path}: its policy file {result.policy} must lie beside it ({error})") from error
    if digest != result.policy_sha256:
        raise ResultFileError(
            f"{beside}: not the policy file that was played: its SHA-256 is {digest[:12]}..., "
            f"the result file says {str(result.policy_sha256)[:12]}..."
        )
    return load(beside)


def _compare(result: ResultFile, found: dict[str, Column]) -> Verdict:
    stated = {name: result.column(name) for name in COLUMNS}
    differs = np.any([stated[name] != found[name] for name in COLUMNS], axis=0)
    off = {name: float(stated[name].mean() - found[name].mean()) for name in COLUMNS}
    same = machine_type() == result.machine
    count = int(differs.sum())
    figures = ", ".join(f"{name} {value:+.4f}" for name, value in off.items())
    if count == 0:
        holds, why = True, f"all {result.worlds:,} worlds are equal"
    elif same:
        world = int(differs.argmax())
        holds, why = (
            False,
            (
                f"{count:,} of {result.worlds:,} worlds differ on a machine of the same type, "
                f"first world {world}: safe_score {stated['safe_score'][world]:g}, here "
                f"{found['safe_score'][world]:g}. Made at commit {result.commit}, checked at "
                f"{commit()}"
            ),
        )
    elif result.worlds < LEAST_WORLDS:
        holds, why = (
            False,
            (
                f"{result.worlds} worlds are too few to judge on another type of machine: at least "
                f"{LEAST_WORLDS}, or check it on {result.machine}"
            ),
        )
    else:
        holds = all(abs(off[name]) <= TOLERANCE[name] for name in COLUMNS)
        why = (
            f"another type of machine: {count:,} worlds differ, and means are "
            f"{'within' if holds else 'beyond'} the tolerance ({figures})"
        )
    return Verdict(holds, same, result.worlds, count, off, why)


@dataclass(frozen=True)
class _Verify:
    """Play what a result file says again and compare. The exit status is 1 if it does not hold."""

    file: Annotated[Path, tyro.conf.Positional]
    """Result file, as posse submit writes it."""
    run_code: bool = False
    """Run the code of a policy package.module:Class. Read it first."""


def main(arguments: Sequence[str]) -> int:
    """Verify a file and say what was found."""
    which = tyro.cli(_Verify, prog="posse verify", args=arguments)
    verdict = verify(which.file, run_code=which.run_code)
    print(f"{which.file}: {'holds' if verdict.holds else 'DOES NOT HOLD'}: {verdict.explanation}")
    return 0 if verdict.holds else 1
