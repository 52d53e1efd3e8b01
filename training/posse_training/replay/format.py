"""Encoding of a replay: a JSON header, and one deflated stream of whole numbers.

A column of shape (T + 1, ...) is divided by its resolution and rounded, which gives K series of
T + 1 whole numbers. Each series is replaced ``order`` times by its differences (the first number by
its difference from 0). The differences are mapped to non-negative numbers (0, -1, 1, -2, ... become
0, 1, 2, 3, ...) and stored as ``width`` planes of bytes, lowest first, each plane series by series.
The columns are concatenated and deflated (zlib). The header states for each column its ``name``,
``shape`` of a row, ``scale``, ``unit``, ``order``, ``width``, and the number ``missing`` that
encodes nan, if any.
"""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import astuple
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse_training.errors import SettingsError
from posse_training.replay.episode import Column, Event, Player, Replay

FORMAT: Final = 1
_GREATEST: Final = 2**30
_Integers = npt.NDArray[np.int64]


def encode(replay: Replay) -> tuple[str, bytes]:
    """Return the JSON header and the deflated columns.

    Raises:
        SettingsError: A column with numbers too large for its resolution.
    """
    parts: list[bytes] = []
    players = []
    for player in replay.players:
        columns = []
        for name, column in player.columns.items():
            described, packed = _pack(name, column)
            columns.append(described)
            parts.append(packed)
        events = [astuple(event) for event in player.events]
        own = {key: getattr(player, key) for key in ("name", "frames", "metrics", "about", "argument")}
        players.append({**own, "events": events, "columns": columns})
    header = {"format": FORMAT, "world": replay.world, "players": players}
    text = json.dumps(_to_json(header), separators=(",", ":"), allow_nan=False)
    return text, zlib.compress(b"".join(parts), 9)


def decode(header: str, data: bytes) -> Replay:
    """Return the argument of :func:`encode`, each number to half its column's resolution.

    Raises:
        SettingsError: Data of another format.
        ValueError, TypeError, KeyError, zlib.error: Damaged data.
    """
    described = _from_json(json.loads(header))
    if described["format"] != FORMAT:
        raise SettingsError(f"a replay of format {described['format']!r:.80} cannot be read: known is {FORMAT}")
    raw, start = zlib.decompress(data), 0
    players = []
    for player in described["players"]:
        columns = {}
        for column in player["columns"]:
            end = start + player["frames"] * math.prod(column["shape"]) * column["width"]
            columns[column["name"]] = _unpack(column, player["frames"], raw[start:end])
            start = end
        events = tuple(Event(step, kind, text, tuple(robots)) for step, kind, text, robots in player["events"])
        own = [player[key] for key in ("metrics", "about", "argument")]
        players.append(Player(player["name"], columns, events, *own))
    return Replay(described["world"], tuple(players))


def _pack(name: str, column: Column) -> tuple[dict[str, Any], bytes]:
    values = np.asarray(column.values, np.float64) / column.resolution
    finite = np.isfinite(values)
    if (np.abs(values[finite]) > _GREATEST).any():
        raise SettingsError(
            f"column {name!r} holds {np.abs(values[finite]).max() * column.resolution:g}, too "
            f"great for a resolution of {column.resolution:g}: raise it"
        )
    whole = np.rint(np.where(finite, values, 0)).astype(np.int64)
    described: dict[str, Any] = {
        "name": name,
        "shape": list(values.shape[1:]),
        "scale": column.resolution,
        "unit": column.unit,
    }
    if not finite.all():
        described["missing"] = int(whole.min() - 1)
        whole[~finite] = described["missing"]
    series = whole.reshape(len(whole), -1).T
    candidates = [(order, *_planes(series, order)) for order in (0, 1, 2)]
    order, width, packed = min(candidates, key=lambda one: len(zlib.compress(one[2], 6)))
    return described | {"order": order, "width": width}, packed


def _planes(series: _Integers, order: int) -> tuple[int, bytes]:
    for _ in range(order):
        series = np.diff(series, axis=1, prepend=0)
    folded = (series << 1) ^ (series >> 63)
    width = max(1, (int(folded.max(initial=0)).bit_length() + 7) // 8)
    planes = [((folded >> 8 * k) & 255).astype(np.uint8).tobytes() for k in range(width)]
    return width, b"".join(planes)


def _unpack(column: dict[str, Any], frames: int, raw: bytes) -> Column:
    planes = np.frombuffer(raw, np.uint8).reshape(column["width"], -1, frames).astype(np.int64)
    folded = sum((plane << 8 * k for k, plane in enumerate(planes)), np.int64(0))
    series = (np.asarray(folded) >> 1) ^ -(np.asarray(folded) & 1)
    for _ in range(column["order"]):
        series = np.cumsum(series, axis=1)
    whole = series.T.reshape(frames, *column["shape"])
    if column["scale"] == 1 and "missing" not in column:
        return Column(whole, 1.0, column["unit"])
    values = whole * column["scale"]
    if "missing" in column:
        values = np.where(whole == column["missing"], np.nan, values)
    return Column(values, column["scale"], column["unit"])


# JSON has no infinity or nan: they are written as {"number": "inf"}.


def _to_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _to_json(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_to_json(part) for part in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return str(value)


def _from_json(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) == {"number"} and value["number"] in ("inf", "-inf", "nan"):
            return float(value["number"])
        return {key: _from_json(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_from_json(part) for part in value]
    return value
