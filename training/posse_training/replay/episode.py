"""What a replay holds: one world, and what each player did in it, as named columns over time.

A *frame* is the world at a control step: frame 0 is the start, frame T the end. Row t of a column
is frame t. An action and a belief in row t are what was chosen in frame t; a reward term in row t
is of the step that led to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy.typing as npt

from posse_training.runs.settings import SettingsError

MOST_PLAYERS: Final = 4
EVENT_KINDS: Final = ("detection", "dart", "contact", "break", "leader", "settled")


@dataclass(frozen=True)
class Column:
    """One quantity over an episode.

    Attributes:
        values: (T + 1, ...), one row a frame; not a number: there is none in this frame.
        resolution: A page keeps the values to half of this. 1: they are whole numbers.
        unit: Of the values.
    """

    values: npt.NDArray[Any]
    resolution: float = 1.0
    unit: str = "1"


@dataclass(frozen=True)
class Event:
    """Something worth a tick on the timeline.

    Attributes:
        step: The frame in which it is first there.
        kind: One of :data:`EVENT_KINDS`.
        text: What happened, for people.
        robots: Numbers of the trackers that it is about.
    """

    step: int
    kind: str
    text: str
    robots: tuple[int, ...] = ()


@dataclass(frozen=True)
class Player:
    """One team's episode.

    Attributes:
        name: What the page calls it.
        columns: By name; :mod:`posse_training.replay.columns` lists them.
        events: In order of time.
        metrics: Every metric of the episode, as far as it was played; nan: never happened.
        about: What is known of the policy, such as the card of a learned one; plain JSON.
    """

    name: str
    columns: dict[str, Column]
    events: tuple[Event, ...] = ()
    metrics: dict[str, float] = field(default_factory=dict)
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def frames(self) -> int:
        """T + 1, how many frames there are."""
        return len(next(iter(self.columns.values())).values)


@dataclass(frozen=True)
class Replay:
    """One world, played by one to four players.

    Attributes:
        world: What the players have in common: scenario, seed, obstacles, ...; plain JSON, with
            infinite numbers.
        players: Left to right.
    """

    world: dict[str, Any]
    players: tuple[Player, ...]


def _identity(world: dict[str, Any]) -> dict[str, Any]:
    """Return what has to be equal for two episodes to be of the same world."""
    settings = {k: v for k, v in world["settings"].items() if k != "message_size"}
    return {"settings": settings, "obstacles": world["obstacles"]} | {
        key: world[key] for key in ("seed", "split", "world", "episode")
    }


def join(replays: Sequence[Replay]) -> Replay:
    """Put the players of several replays of the same world into one.

    Raises:
        SettingsError: None, more than four players, or worlds that differ.
    """
    players = tuple(player for replay in replays for player in replay.players)
    if not 1 <= len(players) <= MOST_PLAYERS:
        raise SettingsError(
            f"a replay shows 1 to {MOST_PLAYERS} players, got {len(players)}: "
            + ("give at least one policy" if not players else "leave some out")
        )
    first = _identity(replays[0].world)
    for replay in replays[1:]:
        other = _identity(replay.world)
        differing = sorted(
            {k for k in first if first[k] != other[k]} - {"settings"}
            | {
                k
                for k in first["settings"] | other["settings"]
                if first["settings"].get(k) != other["settings"].get(k)
            }
        )
        if differing:
            raise SettingsError(
                f"{replays[0].players[0].name!r} and {replay.players[0].name!r} did not play the "
                f"same world: {', '.join(differing)} differ; record them in the same one"
            )
    fields: dict[str, Any] = {}
    for replay in replays:
        for entry in replay.world["fields"]:
            fields.setdefault(entry["name"], entry)
    return Replay({**replays[0].world, "fields": list(fields.values())}, players)
