"""Encoding of a replay: a JSON header, and one deflated stream of whole numbers.

A column of shape (T + 1, ...) is divided by its resolution and rounded, which gives K series of T + 1 whole numbers.
Each series is replaced by its differences (the first number by its difference from 0), ``order`` = 1 times. The
differences are mapped to non-negative numbers (0, -1, 1, -2, ... become 0, 1, 2, 3, ...) and stored as ``width`` planes
of bytes, lowest first, each plane series by series. The columns are concatenated and deflated (zlib). The header states
for each column its ``name``, ``shape`` of a row, ``scale``, ``order``, ``width``, and the number ``missing`` that
encodes nan, if any.
"""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import astuple
from typing import Any, Final

import numpy as np

from posse_training.errors import SettingsError
from posse_training.replay.episode import Column, Event, Player, Replay

FORMAT: Final = 1
_GREATEST: Final = 2**30


def encode(replay: Replay) -> tuple[str, bytes]:
    """Return the JSON header and the deflated columns."""
    players, parts = [], []
    for player in replay.players:
        packed = [_pack(name, column) for name, column in player.columns.items()]
        parts += [content for _, content in packed]
        own = {"frames": player.frames, "events": [astuple(event) for event in player.events]}
        players.append({**vars(player), **own, "columns": [described for described, _ in packed]})
    header = _to_json({"format": FORMAT, "world": replay.world, "players": players})
    return json.dumps(header, separators=(",", ":"), allow_nan=False), zlib.compress(b"".join(parts), 9)


def decode(header: str, data: bytes) -> Replay:
    """Return the argument of :func:`encode`, each number to half its column's resolution.

    Raises:
        SettingsError: Data of another format.
        ValueError, TypeError, KeyError, zlib.error: Damaged data.
    """
    described = json.loads(header, object_hook=_from_json)
    if described["format"] != FORMAT:
        raise SettingsError(f"a replay of format {described['format']!r:.80} cannot be read: known is {FORMAT}")
    raw, start = zlib.decompress(data), 0
    players = []
    for player in described["players"]:
        frames, columns = player.pop("frames"), {}
        for column in player["columns"]:
            end = start + frames * math.prod(column["shape"]) * column["width"]
            columns[column["name"]] = _unpack(column, frames, raw[start:end])
            start = end
        events = tuple(Event(step, kind, text, tuple(robots)) for step, kind, text, robots in player["events"])
        players.append(Player(**{**player, "columns": columns, "events": events}))
    return Replay(described["world"], tuple(players))


def _pack(name: str, column: Column) -> tuple[dict[str, Any], bytes]:
    values = np.asarray(column.values, np.float64) / column.resolution
    finite = np.isfinite(values)
    whole = np.rint(np.where(finite, values, 0)).astype(np.int64)
    if np.abs(whole).max(initial=0) > _GREATEST:
        raise SettingsError(f"column {name!r} is too great for a resolution of {column.resolution:g}: raise it")
    missing = {} if finite.all() else {"missing": int(whole.min() - 1)}
    whole[~finite] = missing.get("missing", 0)
    series = np.diff(whole.reshape(len(whole), -1).T, axis=1, prepend=0)
    folded = (series << 1) ^ (series >> 63)
    width = max(1, (int(folded.max(initial=0)).bit_length() + 7) // 8)
    planes = [((folded >> 8 * k) & 255).astype(np.uint8).tobytes() for k in range(width)]
    shape = {"shape": list(values.shape[1:]), "scale": column.resolution, "order": 1, "width": width}
    return {"name": name, **shape, **missing}, b"".join(planes)


def _unpack(column: dict[str, Any], frames: int, raw: bytes) -> Column:
    planes = np.frombuffer(raw, np.uint8).reshape(column["width"], -1, frames)
    folded = sum((plane.astype(np.int64) << 8 * k for k, plane in enumerate(planes)), np.zeros((), np.int64))
    whole = np.cumsum((folded >> 1) ^ -(folded & 1), axis=1).T.reshape(frames, *column["shape"])
    if "missing" in column:
        whole = np.where(whole == column["missing"], np.nan, whole)
    return Column(whole if column["scale"] == 1 else whole * column["scale"], column["scale"])


# JSON has no infinity or nan: they are written as {"number": "inf"}.


def _to_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _to_json(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_to_json(part) for part in value]
    return {"number": str(value)} if isinstance(value, float) and not math.isfinite(value) else value


def _from_json(found: dict[str, Any]) -> Any:
    return float(found["number"]) if list(found) == ["number"] else found
