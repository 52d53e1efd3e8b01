"""A result file: what a policy scored in each world of a scenario, as JSON.

A file may come from anyone: it is data alone, every value is checked, and its size is limited.
Means, shares and intervals are not in it; whoever shows them works them out from the rows.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse_baselines.files import write_atomically
from posse_training.errors import ResultFileError
from posse_training.leaderboard import checks

FORMAT: Final = "posse-result"
VERSION: Final = 1
COLUMNS: Final = ("safe_score", "score", "contact_free")
"""Metrics of every world, each in [0, 1]."""
DIGITS: Final = 6
"""Decimals of a number in the rows."""
MOST_BYTES: Final = 1_000_000
MOST_WORLDS: Final = 10_000


@dataclass(frozen=True)
class ResultFile:
    """What a policy scored in worlds 0 to W - 1 of a seed and split of a named scenario.

    Attributes:
        label: Its name on the leaderboard.
        policy_kind: ``"shipped"`` (a name), ``"file"`` (a policy file beside this one) or
            ``"code"`` (``package.module:Class``).
        policy: Name, file name, or module and class.
        policy_sha256: Of a policy file, hexadecimal; else ``None``.
        reads_state: Whether the policy reads the state: a reference, which is not ranked.
        scenario: Name of the scenario, with no setting changed.
        scenario_version: Its version.
        split: Of the worlds.
        seed: Of the worlds.
        posse_version: Of the package that played.
        commit: Of its sources; ``None``: unknown.
        machine: Processor, system and libraries on which rows are equal to the last digit.
        replay: Address of a replay, ``None`` or an address that begins with https://.
        rows: Every metric of ``COLUMNS`` by name, (W,), rounded to six decimals.
    """

    label: str
    policy_kind: str
    policy: str
    policy_sha256: str | None
    reads_state: bool
    scenario: str
    scenario_version: int
    split: str
    seed: int
    posse_version: str
    commit: str | None
    machine: str
    replay: str | None
    rows: dict[str, tuple[float, ...]]

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return len(self.rows["safe_score"])

    def column(self, metric: str) -> npt.NDArray[np.float64]:
        """Return a metric of every world, (W,)."""
        return np.array(self.rows[metric])


_FIELDS: Final[dict[str, checks.Check]] = {
    "label": checks.text(100),
    "policy_kind": checks.one_of("shipped", "file", "code"),
    "policy": checks.text(200),
    "policy_sha256": checks.optional(checks.matching(r"[0-9a-f]{64}", "64 hexadecimal digits")),
    "reads_state": checks.flag,
    "scenario": checks.text(100),
    "scenario_version": checks.whole(1, 10**6),
    "split": checks.one_of("train", "validation", "test"),
    "seed": checks.whole(0, 2**63 - 1),
    "posse_version": checks.text(50),
    "commit": checks.optional(checks.matching(r"[0-9a-f]{7,40}\+?", "a commit's hash")),
    "machine": checks.text(300),
    "replay": checks.optional(checks.matching(r"https://[!#-;=?-~]{1,300}", "an address that begins with https://")),
}
_PATTERNS: Final = {
    "shipped": (r"[a-z][a-z0-9-]*", "the name of a policy of the package"),
    "file": (r"[\w][\w.-]*\.safetensors", "a file name without folders, ending in .safetensors"),
    "code": (r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*", "package.module:Class"),
}


def write_result(result: ResultFile, path: Path) -> Path:
    """Write a result file; what was there before is replaced as a whole.

    Raises:
        ResultFileError: A value that a reader would refuse; nothing is written.
        OSError: It could not be written.
    """
    content = {"format": FORMAT, "version": VERSION, **asdict(result)}
    text = json.dumps(content, indent=None, separators=(", ", ": "), allow_nan=False)
    _checked(json.loads(text), path)
    # One line for each key, so that a change of one shows as such.
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in content.items()]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())
    return path


def read_result(path: str | Path) -> ResultFile:
    """Read and check a result file. It runs no code and loads no policy.

    Raises:
        ResultFileError: The file is missing, too large, damaged, or holds an invalid value.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ResultFileError(f"{path}: cannot be read ({error})") from error
    if len(content) > MOST_BYTES:
        raise ResultFileError(f"{path}: more than {MOST_BYTES:,} bytes; no result file is so large")
    try:
        given = json.loads(content.decode("utf-8"), object_pairs_hook=_unique, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ResultFileError(f"{path}: not a JSON file as posse submit writes it: {error}") from error
    return _checked(given, path)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key stands twice")
    return found


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _checked(given: Any, path: Path) -> ResultFile:
    """Return the result in parsed JSON, or raise what is wrong with it."""
    try:
        checks.keys(given, ("format", "version", *_FIELDS, "rows"))
        if given["format"] != FORMAT or given["version"] != VERSION:
            raise ValueError(
                f"format={given['format']!r:.40}, version={given['version']!r:.40}: this posse "
                f"reads {FORMAT!r}, version {VERSION}"
            )
        for name, check in _FIELDS.items():
            check(name, given[name])
        kind = given["policy_kind"]
        checks.matching(*_PATTERNS[kind])("policy", given["policy"])
        if (given["policy_sha256"] is not None) != (kind == "file"):
            raise ValueError("policy_sha256 must be given for a policy file, and for no other")
        rows = _rows(given["rows"])
    except ValueError as error:
        raise ResultFileError(f"{path}: {error}") from error
    return ResultFile(**{name: given[name] for name in _FIELDS}, rows=rows)


def _rows(given: Any) -> dict[str, tuple[float, ...]]:
    checks.keys(given, COLUMNS)
    for name in COLUMNS:
        checks.shares(name, given[name], MOST_WORLDS, DIGITS)
    safe, score, free = (np.array(given[name], np.float64) for name in COLUMNS)
    if not len(safe) == len(score) == len(free):
        raise ValueError("the columns of rows differ in length")
    wrong = (
        ((free != 0) & (free != 1), "contact_free is neither 0 nor 1"),
        (safe > score, "safe_score is above score"),
        ((free == 1) & (safe != score), "safe_score differs from score without any contact"),
    )
    for worlds, what in wrong:
        if worlds.any():
            raise ValueError(f"{what} in world {int(worlds.argmax())}")
    return {name: tuple(map(float, given[name])) for name in COLUMNS}
