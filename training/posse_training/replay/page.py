"""The page: one HTML file with style, code and data that loads nothing else.

The code consists of the modules in ``web/``, concatenated to one module, since a page opened from a file cannot import
other files. Data are deflated. External text (names, cards, settings) is written as data, never as markup or code.
"""

import base64
import itertools
import re
import shlex
import zlib
from collections import defaultdict
from graphlib import TopologicalSorter
from importlib import resources
from pathlib import Path
from typing import Any, Final

import jinja2
import numpy as np
import numpy.typing as npt

from posse.rendering import style
from posse_baselines.files import write_atomically
from posse_training.errors import SettingsError
from posse_training.replay.episode import Player, Replay
from posse_training.replay.format import decode, encode

PAGES: Final = (".html", ".htm")
PROJECT: Final = "https://github.com/posse-benchmark/posse"  # as in pyproject.toml
TASK_COLOURS: Final[tuple[style.Colour, ...]] = ((86, 180, 233), (0, 114, 178), (0, 158, 115), (240, 228, 66))
"""Of the tasks of a tracker, in the order of ``posse_baselines.ddcs.TASKS``. The last is not Okabe and Ito's pink,
which deuteranopia maps to the grey of a tracker."""
PLAYERS: Final[tuple[style.Colour, ...]] = ((0, 114, 178), style.INK, (40, 165, 130), (140, 60, 160))
"""Of the teams compared in one replay or film, left to right: none is near the vermilion of target and slots."""
DARK: Final[dict[str, style.Colour]] = {
    "PAPER": (24, 27, 32),
    "GROUND": (18, 20, 24),
    "GRID": (58, 64, 72),
    "WALL": (140, 147, 157),
    "OBSTACLE": (62, 68, 76),
    "OBSTACLE_RIM": (96, 103, 112),
    "INK": (228, 231, 235),
    "FAINT_INK": (154, 161, 171),
    "TARGET": (240, 124, 48),
    "SLOT": (150, 92, 52),
    "SLOT_FILLED": (92, 58, 36),
    "TRACKER_RIM": (205, 210, 217),
    "BROKEN": (70, 75, 82),
    "LINK": (86, 180, 233),
    "SENSING": (30, 42, 54),
    "SENSING_RIM": (52, 78, 102),
    "CONTACT": (244, 84, 110),
}
"""Colours of the page where the browser prefers a dark scheme; the others are the same."""
DARK_PLAYERS: Final[tuple[style.Colour, ...]] = ((86, 180, 233), DARK["INK"], (60, 190, 150), (190, 120, 210))
_IMPORT: Final = re.compile(r'^import [^;]*? from "./(\w+)\.js";\n', re.MULTILINE)
_EXPORT: Final = re.compile(r"^export ", re.MULTILINE)
_DATA: Final = re.compile('<script type="text/plain" id="data">(.*?)</script>')

_CAUSES: Final = ("dart", "contact", "break")
_MOST: Final = 0.6  # of a difference: the cause of so much is named


def check_page(path: Path) -> None:
    """Raise SettingsError for a path that no page is written to."""
    if path.suffix.lower() not in PAGES or path.is_dir():
        raise SettingsError(f"{str(path)!r} must end in .html, since a replay is a web page, and be no folder")


def write_replay(replay: Replay, path: str | Path) -> Path:
    """Write a page that shows a replay; folders are made, a file there is replaced as a whole.

    Args:
        replay: Result of :func:`posse_training.replay.record` or :func:`posse_training.replay.replay_of`.
        path: File to write, ending in ``.html``.

    Raises:
        SettingsError: A path that does not end in ``.html``.
        OSError: It could not be written; an old file is unchanged.
    """
    check_page(path := Path(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, page(replay).encode(errors="replace"))  # names of files may be no UTF-8
    return path


def read_replay(path: str | Path) -> Replay:
    """Return the replay of a page, each number to half its column's resolution; SettingsError if there is none."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        found = _DATA.search(text)
        if found is None:
            raise SettingsError("it is no replay: posse replay writes one")
        return decode(base64.b64decode(found[1], validate=True))
    except (OSError, ValueError, TypeError, KeyError, zlib.error) as error:
        raise SettingsError(f"cannot read a replay from {path}: {error}") from error


def page(replay: Replay) -> str:
    """Return the page's HTML."""
    names = " and ".join(player.name for player in replay.players)
    values = {
        "title": f"{names} on {replay.world['settings']['name']}",
        "verdict": verdict(replay),
        "command": command(replay),
        "project": PROJECT,
        "style": _file("style.css"),
        "colours": colours(),
        "data": base64.b64encode(encode(replay)).decode(),
        "code": _code(),
    }
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(_file("index.html")).render(values)


def _code() -> str:
    """Return the modules concatenated, each after those that it imports from, without imports and "export"."""
    files = sorted((resources.files(__package__) / "web").iterdir(), key=lambda file: file.name)
    modules = {file.name.removesuffix(".js"): file.read_text("utf-8") for file in files if file.name.endswith(".js")}
    order = TopologicalSorter({name: _IMPORT.findall(text) for name, text in modules.items()}).static_order()
    return "".join(f"// --- {name}.js ---\n{_EXPORT.sub('', _IMPORT.sub('', modules[name]))}\n" for name in order)


def colours() -> dict[str, Any]:
    """Return the colours of figures and films for the page."""
    css = "#{:02x}{:02x}{:02x}".format
    return {
        **{name: css(*colour) for name, colour in vars(style).items() if isinstance(colour, tuple)},
        "TASKS": [css(*colour) for colour in TASK_COLOURS],
        "PLAYERS": [css(*colour) for colour in PLAYERS],
        "DARK": {name: css(*colour) for name, colour in DARK.items()}
        | {"PLAYERS": [css(*colour) for colour in DARK_PLAYERS]},
    }


def _file(name: str) -> str:
    return (resources.files(__package__) / "web" / name).read_text(encoding="utf-8")


def verdict(replay: Replay) -> str:
    """Return a sentence: the share of its slots that each team held, and for two teams where the difference arose.

    A step in which slots are free is put down to the team's last dart, contact or break before it, or, before the team
    first held as many as in the mean, to the way to the slots.
    """
    step = replay.world["settings"]["control_step"]
    ranked = sorted(replay.players, key=lambda player: -_scores(player).mean())
    parts: list[str] = []
    for player in ranked:
        contact = next((event.step for event in player.events if event.kind == "contact"), None)
        after = "" if contact is None else f" (none counts from its contact at {contact * step:.1f} s on)"
        held = "{} {:.0f} %{}" if parts else "{} held {:.0f} % of its slots{}"
        parts.append(held.format(player.name, 100 * _scores(player).mean(), after))
    reason = _reason(ranked[0], ranked[1]) if len(ranked) == 2 else ""
    return f"{', '.join(parts)}{reason}."


def command(replay: Replay) -> str:
    """Return the command line that makes the page again; empty if a player or a setting cannot be given in one."""
    arguments, options = [player.argument for player in replay.players], replay.world.get("options")
    return "" if options is None or not all(arguments) else shlex.join(["posse", "replay", *arguments, *options])


def _scores(player: Player) -> npt.NDArray[np.float64]:
    """Return the score of each step, (T,)."""
    return np.asarray(player.columns["score"][1:], np.float64)


def _losses(player: Player) -> dict[str, list[float]]:
    """Return by cause how many steps' worth of slots were free in each event of it."""
    scores, free = _scores(player), defaultdict[str, list[float]](list)
    begins = {0: "way", int((scores >= scores.mean()).argmax()): ""}
    there = max(begins)
    begins |= {e.step - 1: e.kind for e in player.events if e.kind in _CAUSES and e.step - 1 > there}
    for first, end in itertools.pairwise([*sorted(begins), len(scores)]):
        free[begins[first]].append(float((1 - scores[first:end]).sum()))
    return free


def _reason(first: Player, second: Player) -> str:
    """Return where most of what the second team fell behind the first arose; empty if nowhere in particular."""
    kept, lost = _losses(first), _losses(second)
    behind = {cause: sum(lost[cause]) - sum(kept[cause]) for cause in (*lost, *kept)}
    total, cause = sum(behind.values()), max(behind, key=lambda cause: behind[cause])
    if not cause or total < 1 or behind[cause] < _MOST * total:
        return ""
    times = sum(slots > 0 for slots in lost[cause])
    count = f"{times} {cause}{'s' * (times != 1)}"
    place = {"way": "on the way to the slots", "break": f"after {count}"}.get(cause, f"in {count}")
    return f"; most of the difference arose {place}"
