"""The page: one HTML file with style, code and data that loads nothing else.

The code consists of the modules in ``web/``, concatenated to one module, since a page opened from a
file cannot import other files. Code and data are deflated, for a small file; ``web/loader.js``
unpacks and runs the code. External text (names, cards, settings) is written as data, never as
markup or code, and the page's Content-Security-Policy forbids all other code.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import zlib
from importlib import resources
from pathlib import Path
from typing import Any, Final

from posse.rendering import style
from posse_baselines.files import write_atomically
from posse_training.errors import SettingsError
from posse_training.replay.colours import DARK, DARK_PLAYERS, DARK_TASK_COLOURS, PLAYERS, TASK_COLOURS
from posse_training.replay.episode import Replay
from posse_training.replay.format import decode, encode

MODULES: Final = (
    "data.js",
    "colours.js",
    "state.js",
    "geometry.js",
    "camera.js",
    "world.js",
    "sensing.js",
    "robots.js",
    "view.js",
    "events.js",
    "timeline.js",
    "values.js",
    "panel.js",
    "header.js",
    "export.js",
    "legend.js",
    "controls.js",
    "main.js",
)
"""Modules of the page's code, each after those that it imports from."""
_COLOURS: Final = (
    "PAPER",
    "GROUND",
    "GRID",
    "WALL",
    "OBSTACLE",
    "OBSTACLE_RIM",
    "INK",
    "FAINT_INK",
    "TARGET",
    "SLOT",
    "SLOT_FILLED",
    "TRACKER",
    "TRACKER_RIM",
    "TRAIL",
    "BROKEN",
    "LINK",
    "SENSING",
    "SENSING_RIM",
    "CONTACT",
)
_IMPORT: Final = re.compile(r"^import .*?;\n", re.MULTILINE | re.DOTALL)
_EXPORT: Final = re.compile(r"^export ", re.MULTILINE)
_DATA: Final = re.compile(
    r'<script type="application/json" id="header">(.*?)</script>\s*'
    r'<script type="text/plain" id="data">(.*?)</script>',
    re.DOTALL,
)


def write_replay(replay: Replay, path: str | Path) -> Path:
    """Write a page that shows a replay; folders are made, a file there is replaced as a whole.

    Args:
        replay: Result of :func:`posse_training.replay.record` or a
            :class:`~posse_training.replay.Recorder`.
        path: File to write, ending in ``.html``.

    Raises:
        SettingsError: A path that does not end in ``.html``.
        OSError: It could not be written; an old file is unchanged.
    """
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise SettingsError(f"path={str(path)!r} must end in .html: a replay is a web page")
    text = page(replay)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text.encode())
    return path


def read_replay(path: str | Path) -> Replay:
    """Return the replay that a page shows, each number to half its column's resolution.

    Raises:
        SettingsError: No such file, or not a replay.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"cannot read a replay from {path}: {error}") from error
    found = _DATA.search(text)
    if found is None:
        raise SettingsError(f"{path} is no replay: posse replay writes one")
    try:
        replay = decode(found[1], base64.b64decode(found[2], validate=True))
    except ValueError as error:  # SettingsError is one
        raise SettingsError(f"cannot read a replay from {path}: {error}") from error
    _check_world(path, replay)
    return replay


def _check_world(path: Path, replay: Replay) -> None:
    """Raise if a page lacks what every recorded replay has."""
    world = replay.world
    wanted = ("scenario", "settings", "obstacles", "seed", "split", "world", "episode", "fields")
    missing = [name for name in wanted if name not in world]
    fields = world.get("fields")
    whole = (
        not missing
        and isinstance(world["scenario"], str)
        and isinstance(world["settings"], dict)
        and isinstance(fields, list)
        and all(isinstance(f, dict) and isinstance(f.get("name"), str) for f in fields)
        and all(player.columns for player in replay.players)
    )
    if not whole or not replay.players:
        raise SettingsError(
            f"cannot read a replay from {path}: its description of the world or its players is "
            f"damaged{f': it lacks {missing}' if missing else ''}"
        )


def page(replay: Replay) -> str:
    """Return the page's HTML."""
    before, *after = shell()
    filled = (text + part for text, part in zip(contents(replay), after, strict=True))
    return before + "".join(filled)


def contents(replay: Replay) -> tuple[str, str, str]:
    """Return what a replay puts into the :func:`shell`: title, header and data, as HTML."""
    header, data = encode(replay)
    return html.escape(_title(replay)), as_data(header), in_letters(data)


def shell() -> list[str]:
    """Return the HTML that is the same for all replays: before, between and after the contents."""
    code, loader, sheet = code_of_page(), _file("loader.js"), _file("style.css")
    policy = {"default-src": "'none'", **content_policy(), "base-uri": "'none'", "form-action": "'none'"}
    values = {
        "policy": "; ".join(f"{name} {value}" for name, value in policy.items()),
        "style": sheet,
        "colours": as_data(json.dumps(colours(), separators=(",", ":"))),
        "code": in_letters(zlib.compress(code.encode(), 9)),
        "loader": loader,
    }
    parts = re.split(r"\{\{(?:title|header|data)\}\}", _file("index.html"))
    # In one pass, so that inserted text is not searched again.
    return [re.sub(r"\{\{(\w+)\}\}", lambda found: values[found[1]], part) for part in parts]


def content_policy() -> dict[str, str]:
    """Return what a replay's Content-Security-Policy allows, by directive."""
    return {
        "script-src": f"'{digest(_file('loader.js'))}' '{digest(code_of_page())}'",
        "style-src": f"'{digest(_file('style.css'))}'",
        "img-src": "blob: data:",
        "media-src": "blob:",
    }


def _title(replay: Replay) -> str:
    names = " and ".join(player.name for player in replay.players)
    return f"{names} on {replay.world['scenario']}"


def code_of_page() -> str:
    """Return the modules concatenated, without imports and the keyword "export"."""
    modules = (_EXPORT.sub("", _IMPORT.sub("", _file(name))) for name in MODULES)
    return "".join(f"// --- {name} ---\n{text}\n" for name, text in zip(MODULES, modules, strict=True))


def in_letters(data: bytes) -> str:
    """Return bytes as base64."""
    return base64.b64encode(data).decode()


def colours() -> dict[str, Any]:
    """Return the colours of figures and films for the page, light and dark."""

    def css(colour: style.Colour) -> str:
        return "#" + "".join(f"{part:02x}" for part in colour)

    light = {name: css(getattr(style, name)) for name in _COLOURS}
    dark = light | {name: css(colour) for name, colour in DARK.items()}
    return {
        "light": {
            **light,
            "TASKS": [css(colour) for colour in TASK_COLOURS],
            "PLAYERS": [css(colour) for colour in PLAYERS],
        },
        "dark": {
            **dark,
            "TASKS": [css(colour) for colour in DARK_TASK_COLOURS],
            "PLAYERS": [css(colour) for colour in DARK_PLAYERS],
        },
    }


def as_data(text: str) -> str:
    """Return equivalent JSON that cannot be parsed as markup in a page."""
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def digest(text: str) -> str:
    """Return what a Content-Security-Policy names an inline script or style by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _file(name: str) -> str:
    return (resources.files(__package__) / "web" / name).read_text(encoding="utf-8")
