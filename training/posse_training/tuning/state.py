"""The state of a tuning run: one JSON file, replaced atomically after each generation."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from posse_baselines.files import write_atomically
from posse_training.errors import CheckpointError, RunFolderError
from posse_training.files import read_json
from posse_training.tuning.search import Generation

STATE: Final = "state.json"
_FORMAT: Final = "posse-tune-1"


@dataclass
class State:
    """All that a resumed run continues from.

    Attributes:
        identity: What the course of the search depends on.
        names: Settings that are searched.
        generations: Those that the search was told.
        curve: Scores of the search's mean on the validation worlds, by generation.
        seconds: Time that the run has taken; decides when it stops, and nothing else.
        commits: Commits of the sources that played the generations.
    """

    identity: dict[str, Any]
    names: list[str]
    generations: list[Generation] = field(default_factory=list)
    curve: list[dict[str, Any]] = field(default_factory=list)
    seconds: float = 0.0
    commits: list[str | None] = field(default_factory=list)

    def write(self, folder: Path) -> None:
        """Write the state to a folder.

        Raises:
            CheckpointError: It could not be written; the last one is unchanged.
        """
        text = json.dumps(vars(self))
        digest = hashlib.sha256(text.encode()).hexdigest()
        content = json.dumps({"format": _FORMAT, "digest": digest, "state": text})
        try:
            write_atomically(folder / STATE, content.encode())
        except OSError as error:
            raise CheckpointError(
                f"cannot write {folder / STATE}: {error.strerror or error}. Make room, then run "
                "the same command again: it resumes"
            ) from error


def read_state(folder: Path, identity: dict[str, Any]) -> State | None:
    """Return the state of a run folder; ``None``: it is new.

    Raises:
        RunFolderError: The folder holds something else, or a run with other settings.
        CheckpointError: Its state is damaged.
    """
    path = folder / STATE
    if not path.is_file():
        others = [p.name for p in folder.iterdir() if p.name != "lock"] if folder.is_dir() else []
        if others or folder.is_file():
            raise RunFolderError(
                f"{folder} is not the folder of a tuning run: it has no {STATE}, but "
                f"{', '.join(sorted(others)[:3]) or 'is a file'}. Choose another --out"
            )
        return None
    try:
        content = read_json(path)
        if content["format"] != _FORMAT:
            raise CheckpointError(f"the format of {path} is {content['format']!r:.80}, this version reads {_FORMAT!r}")
        text = content["state"]
        whole = content["digest"] == hashlib.sha256(text.encode()).hexdigest()
        state = State(**json.loads(text)) if whole else None
    except (OSError, KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise _damaged(path, f"{error}") from error
    if state is None:
        raise _damaged(path, "its digest does not match its contents")
    for name, value in identity.items():
        if state.identity.get(name) != value:
            raise RunFolderError(
                f"{folder} holds a tuning run with {name}={state.identity.get(name)!r}, not "
                f"{value!r}: choose another --out, or remove it"
            )
    return state


def _damaged(path: Path, why: str) -> CheckpointError:
    return CheckpointError(
        f"{path} is damaged: {why}. The run cannot be resumed: remove {path.parent}, or choose another --out"
    )
