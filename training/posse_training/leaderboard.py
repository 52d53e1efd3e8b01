"""The leaderboard: ``posse submit`` plays and claims a score, ``posse verify`` plays fresh worlds and measures it.

A standing is a row of ``benchmarks/standings.csv``. A submission is a folder with a table of one row, the claim,
and the policy file, if the policy is one.
"""

import csv
import io
import json
import re
import secrets
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from posse import get_scenario, scenario_names
from posse_baselines import Policy, load, policy_names
from posse_baselines.files import write_atomically
from posse_baselines.registry import FILES, is_code
from posse_training.errors import SettingsError
from posse_training.evaluation.evaluation import evaluate, played_errors, prepare
from posse_training.files import check_new, locked
from posse_training.provenance import commit

__all__ = ["Standing", "read_standings", "submit", "verify"]

SEED: Final = 2026
WORLDS: Final = 1000
"""Seed of a claim's worlds, and the least number of worlds that is ranked; of the split ``test``."""
CLAIM: Final = "standing.csv"
_TEXT: Final = re.compile(r"[A-Za-z0-9._:+ -]{0,100}")
"""What a text of a table may hold: it is shown on a page, and names a file beside the table."""
_KINDS: Final[dict[Any, Callable[[str], Any]]] = {str: str, int: int, float: float, bool: json.loads}


@dataclass(frozen=True)
class Standing:
    """What a policy scores on a scenario: mean safe score with its 95 % interval, score, share without contact.

    SettingsError for a text that a page could not show as it is, or numbers that no play has.
    """

    label: str
    policy: str
    reads_state: bool
    scenario: str
    version: int
    seed: int
    worlds: int
    safe_score: float
    low: float
    high: float
    score: float
    contact_free: float
    commit: str

    def __post_init__(self) -> None:
        check_texts(**{name: value for name, value in asdict(self).items() if isinstance(value, str)})
        check_label(self.label, self.policy)
        ordered = 0 <= self.low <= self.safe_score <= self.high <= 1
        narrow = (self.high - self.low) ** 2 * self.worlds <= 6  # of numbers in [0, 1] about 4 at most
        if not (ordered and narrow and 0 <= self.score <= 1 and 0 <= self.contact_free <= 1 and self.worlds >= 1):
            others = f"score {self.score}, contact_free {self.contact_free}"
            raise SettingsError(f"no play has such numbers: {self}, {others}")

    def agrees(self, other: "Standing") -> bool:
        """Return whether the intervals of both safe scores overlap, and both read the state or neither does."""
        return self.reads_state == other.reads_state and self.low <= other.high and other.low <= self.high

    def __str__(self) -> str:
        interval = f"{self.safe_score:.4f} [{self.low:.4f}, {self.high:.4f}]"
        return f"{self.label} on {self.scenario}: safe score {interval}, {self.worlds:,} worlds, seed {self.seed}"


def check_texts(**texts: str) -> None:
    """Raise a ``SettingsError`` for a text that a table cannot hold."""
    for name, text in texts.items():
        if not _TEXT.fullmatch(text):
            raise SettingsError(f"{name}={text!r:.80} must be at most 100 letters, digits and '._:+ -'")


def check_label(label: str, policy: str) -> None:
    """Raise a ``SettingsError`` for an empty label, or one by which the package knows another policy."""
    if not label.strip() or (label != policy and label in policy_names()):
        raise SettingsError(f"name={label!r} is empty or that of a policy of the package: choose another one")


def measure(label: str, text: str, policy: Policy, scenario: str, worlds: int, seed: int) -> Standing:
    """Play a policy and return its row; ``text`` is what it was loaded from."""
    results = evaluate(policy, scenario, worlds, seed)
    safe = results.estimate("safe_score")
    scores = {"safe_score": safe.value, "low": safe.low, "high": safe.high}
    scores |= {name: float(results[name].mean()) for name in ("score", "contact_free")}
    return Standing(
        label=label,
        policy=text,
        reads_state=bool(policy.reads_state),
        scenario=scenario,
        version=results.scenario.version,
        seed=seed,
        worlds=worlds,
        **{name: round(value, 6) for name, value in scores.items()},
        commit=commit() or "",
    )


def standings_text(rows: Iterable[Standing]) -> str:
    """Return a table as CSV, with numbers as JSON has them."""
    writer = csv.writer(out := io.StringIO(), lineterminator="\n")
    writer.writerow(field.name for field in fields(Standing))
    for row in rows:
        writer.writerow(value if isinstance(value, str) else json.dumps(value) for value in asdict(row).values())
    return out.getvalue()


def read_standings(path: str | Path) -> list[Standing]:
    """Read and check a table, without loading a policy; SettingsError names the line of what is missing or invalid."""
    rows: list[Standing] = []
    content = Path(path).read_bytes()
    try:
        for row in csv.DictReader(content.decode().splitlines(), restval="", strict=True):
            values = {field.name: _KINDS[field.type](row[field.name]) for field in fields(Standing)}
            rows.append(Standing(**values))
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise SettingsError(f"{path}, line {len(rows) + 2}: {error}") from error
    if len({(row.label, row.scenario, row.version) for row in rows}) < len(rows):
        raise SettingsError(f"{path}: two rows have one label and scenario: rename one")
    return rows


def submit(
    policy: Annotated[str, tyro.conf.Positional],
    out: Path,
    scenario: str = "smart",
    name: str | None = None,
    episodes: int = WORLDS,
) -> Standing:
    """Play a scenario for the leaderboard, on worlds of its split ``test`` and the seed 2026, and write the claim.

    Args:
        policy: A name, a policy file, which is copied, or ``package.module:Class``.
        out: New or empty folder to write to.
        scenario: Name of the scenario.
        name: Name on the leaderboard; default: the policy's.
        episodes: Number of worlds; 1,000 or more are ranked.

    Raises:
        SettingsError: An invalid name; nothing is played.
        RunFolderError: A folder that is not empty; nothing is played.
        ScenarioError: An unknown scenario; nothing is played.
        PlayError: An error of the policy's own code.
    """
    loaded, is_file = load(policy), not is_code(policy) and policy not in policy_names()
    content = Path(policy).read_bytes() if is_file else b""  # before it plays: a training may replace the file
    text = Path(policy).name if is_file else policy
    label = name if name is not None else loaded.name if is_file else policy
    check_texts(name=label, policy=text)
    check_label(label, text)
    prepare(loaded, get_scenario(scenario), episodes, SEED)  # a family has no standings
    check_new(out)
    with locked(out):
        with played_errors():
            claim = measure(label, text, loaded, scenario, episodes, SEED)
        if is_file:
            write_atomically(out / text, content)
        write_atomically(out / CLAIM, standings_text([claim]).encode())
    return claim


def verify(
    folder: Annotated[Path, tyro.conf.Positional],
    run_code: bool = False,
    episodes: int = WORLDS,
    seed: int | None = None,
) -> tuple[Standing, Standing]:
    """Play a submission's policy on worlds of a fresh seed; return what it claims and what it scores there.

    The score there ranks, whatever was claimed: worlds that are known can be trained or planned on. The claim holds if
    it agrees with it.

    Args:
        folder: Folder that ``posse submit`` wrote.
        run_code: Import a policy that is code. It runs with all your rights: read it first.
        episodes: Number of fresh worlds.
        seed: Seed of the fresh worlds; default: drawn now, so that no submission can know them.

    Raises:
        SettingsError: An invalid claim, or one of another seed than 2026, or ``seed`` is that; code without
            ``run_code``, or another version of the scenario.
        PlayError: An error of the policy's own code.
    """
    rows = read_standings(path := folder / CLAIM)
    if len(rows) != 1:
        raise SettingsError(f"{path} must have one row, it has {len(rows)}")
    claim, text = rows[0], rows[0].policy
    if claim.seed != SEED:
        raise SettingsError(f"{path}: seed={claim.seed}, and claims are of seed {SEED}")
    if claim.scenario not in scenario_names() or get_scenario(claim.scenario).version != claim.version:
        raise SettingsError(f"{path}: this posse has no scenario {claim.scenario!r} of version {claim.version}")
    if seed == SEED:
        raise SettingsError(f"seed={SEED} gives the claim's own worlds: choose another seed, or none")
    if is_code(text) and not run_code:
        raise SettingsError(f"{path}: the policy is code, {text}: read it, then pass --run-code")
    policy = load(str(folder / text) if Path(text).suffix in FILES else text)
    drawn = secrets.randbelow(2**31) if seed is None else seed
    with played_errors():
        return claim, measure(claim.label, text, policy, claim.scenario, episodes, drawn)


def submit_command(arguments: Sequence[str]) -> None:
    """``posse submit``: play, write and print the claim."""
    print(tyro.cli(submit, prog="posse submit", args=arguments))


def verify_command(arguments: Sequence[str]) -> int:
    """``posse verify``: play, print the verdict and the row for the leaderboard; 1 if the claim does not hold."""
    claim, measured = tyro.cli(verify, prog="posse verify", args=arguments)
    print(f"claim: {claim}\nmeasured: {measured}")
    print(f"the claim {'holds' if (holds := claim.agrees(measured)) else 'DOES NOT HOLD'}")
    print("the measured row:", standings_text([measured]).splitlines()[1])
    return 0 if holds else 1
