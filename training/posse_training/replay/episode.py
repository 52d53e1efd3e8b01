"""Contents of a replay: one world, and the episode of each player as named columns over time.

A *frame* is the world at a control step: frame 0 is the start, frame T the end. Row t of a column is frame t. Actions
and beliefs in row t are those of frame t; a reward term in row t is that of the step before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy.typing as npt

from posse_training.errors import SettingsError

MOST_PLAYERS: Final = 4


@dataclass(frozen=True)
class Event:
    """An event marked on the timeline.

    Attributes:
        step: The first frame after the event.
        kind: ``"detection"``, ``"dart"``, ``"contact"``, ``"break"``, ``"leader"`` or ``"settled"``.
        text: Description.
        robots: Numbers of the trackers involved.
    """

    step: int
    kind: str
    text: str
    robots: tuple[int, ...] = ()


@dataclass(frozen=True)
class Player:
    """One team's episode.

    Attributes:
        name: Name on the page.
        columns: (T + 1, ...) each, by name; :mod:`posse_training.replay.columns` lists them. nan: no value in a frame.
        events: Events in order of time.
        metrics: Every metric of the recorded part of the episode; nan: never happened.
        about: Description of the policy, such as the card of a learned one; plain JSON.
        argument: What ``posse replay`` is given to play it; empty: it is no name or file.
    """

    name: str
    columns: dict[str, npt.NDArray[Any]] = field(repr=False)
    events: tuple[Event, ...] = ()
    metrics: dict[str, float] = field(default_factory=dict)
    about: dict[str, Any] = field(default_factory=dict)
    argument: str = ""

    @property
    def frames(self) -> int:
        """T + 1, number of frames."""
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True)
class Replay:
    """One world, played by one to four players.

    Attributes:
        world: Common data of the players: scenario, seed, obstacles, ...; plain JSON, with infinite numbers.
        players: Left to right.
    """

    world: dict[str, Any]
    players: tuple[Player, ...]


def _identity(world: dict[str, Any]) -> dict[str, Any]:
    """Return the data that are equal if two episodes are of the same world."""
    own = {key: world[key] for key in ("seed", "split", "world", "episode", "obstacles")}
    # A target that a person moved is moved so once.
    moved_by = world.get("moved_by", object()) if world["settings"]["target_motion"] == "agent" else None
    return {**world["settings"], **own, "message_size": None, "target": moved_by}


def join(replays: Sequence[Replay]) -> Replay:
    """Combine the players, one to four, of replays of one world, or raise SettingsError."""
    players = tuple(player for replay in replays for player in replay.players)
    if not 1 <= len(players) <= MOST_PLAYERS:
        raise SettingsError(
            f"a replay shows 1 to {MOST_PLAYERS} players, got {len(players)}: "
            + ("give at least one policy" if not players else "leave some out")
        )
    first = _identity(replays[0].world)
    for replay in replays[1:]:
        other = _identity(replay.world)
        differing = sorted(key for key in first | other if first.get(key) != other.get(key))
        if differing:
            raise SettingsError(
                f"{replays[0].players[0].name!r} and {replay.players[0].name!r} did not play the "
                f"same world: {', '.join(differing)} differ; record them in the same one"
            )
    fields: dict[str, Any] = {}
    for replay in replays:
        for entry in replay.world["fields"]:
            fields.setdefault(entry["name"], entry)
    options = [replay.world.get("options") for replay in replays]
    same = options[0] if options.count(options[0]) == len(options) else None
    return Replay({**replays[0].world, "options": same, "fields": list(fields.values())}, players)
