"""Encoding of a replay: one deflated stream (zlib) of a JSON header, a newline, and the columns as whole numbers.

A column of shape (T + 1, ...) is divided by its resolution and rounded, which gives K series of T + 1 whole numbers;
-2^30 stands for nan. All series of a player are stored as differences (the first number as its difference from 0),
mapped to non-negative numbers (0, -1, 1, -2, ... become 0, 1, 2, 3, ...), in four planes of bytes, lowest first, each
plane series by series: small numbers leave long runs of zeros, which deflate well. The header states the ``frames`` of
each player, T + 1, and of each column its ``name``, the ``shape`` of a row and its resolution, ``scale``.
"""

import json
import math
import zlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse_training.errors import SettingsError
from posse_training.replay.episode import Event, Player, Replay

FORMAT: Final = 2
_RESOLUTIONS: Final = {
    "action": 0.004,
    "score": 0.0001,
    "tracker_fix_x": 0.01,
    "tracker_fix_y": 0.01,
    "observation/sonar": 0.05,
    "observation/neighbour_message": 1 / 512,
}
_MISSING: Final = -(2**30)  # also the bound of the others: a difference of two has 32 bits


def resolution_of(name: str, values: npt.NDArray[Any]) -> float:
    """Return to how much a page stores a column, rounded; 1 if it holds whole numbers alone, which stay exact."""
    finite = values[np.isfinite(values)]
    if np.array_equal(finite, np.rint(finite)):
        return 1.0
    return _RESOLUTIONS.get(name, 0.01 if name.startswith("belief/") else 0.001)


def encode(replay: Replay) -> bytes:
    """Return a replay as bytes."""
    players, packed = [], []
    for player in replay.players:
        columns, series = [], []
        for name, values in player.columns.items():
            scale = resolution_of(name, values)
            columns.append({"name": name, "shape": values.shape[1:], "scale": scale})
            series.append(_series(name, values, scale))
        events = [vars(event) for event in player.events]
        players.append({**vars(player), "frames": player.frames, "events": events, "columns": columns})
        packed.append(_pack(np.concatenate(series)))
    header = to_json({"format": FORMAT, "world": replay.world, "players": players})
    text = json.dumps(header, separators=(",", ":"), allow_nan=False)
    return zlib.compress(b"".join([text.encode(), b"\n", *packed]), 9)


def decode(data: bytes) -> Replay:
    """Return the argument of :func:`encode`, each number to half its :func:`resolution_of`.

    SettingsError for another format; for damaged data ValueError, TypeError, KeyError or zlib.error.
    """
    text, _, raw = zlib.decompress(data).partition(b"\n")
    header = json.loads(text, object_hook=_from_json)
    if header["format"] != FORMAT:
        raise SettingsError(f"a replay of format {header['format']!r:.80} cannot be read: known is {FORMAT}")
    players = []
    for player in header["players"]:
        frames, columns = player.pop("frames"), {}
        sizes = [math.prod(column["shape"]) for column in player["columns"]]
        end = 4 * frames * sum(sizes)
        series, raw = np.split(_unpack(raw[:end], frames), np.cumsum(sizes)[:-1]), raw[end:]
        for column, whole in zip(player["columns"], series, strict=True):
            values = np.where(whole == _MISSING, np.nan, whole * column["scale"])
            columns[column["name"]] = values.T.reshape(frames, *column["shape"])
        events = tuple(Event(**{**event, "robots": tuple(event["robots"])}) for event in player["events"])
        players.append(Player(**{**player, "columns": columns, "events": events}))
    return Replay(header["world"], tuple(players))


def _series(name: str, values: npt.NDArray[Any], scale: float) -> npt.NDArray[np.int64]:
    """Return a column as whole numbers, a row for each of its series."""
    finite = np.isfinite(values)
    whole = np.rint(np.where(finite, values, 0).astype(np.float64) / scale)
    if np.abs(whole).max(initial=0) >= -_MISSING:
        raise SettingsError(f"column {name!r} is too great for a replay: it holds numbers below {-_MISSING * scale:g}")
    return np.where(finite, whole, _MISSING).astype(np.int64).reshape(len(whole), -1).T


def _pack(series: npt.NDArray[np.int64]) -> bytes:
    """Return series, (K, T + 1), as bytes."""
    steps = np.diff(series, axis=1, prepend=np.int64(0))
    folded = (steps << 1) ^ (steps >> 63)
    return folded.ravel().astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()


def _unpack(raw: bytes, frames: int) -> npt.NDArray[np.int64]:
    """Return the argument of :func:`_pack`."""
    planes = np.frombuffer(raw, np.uint8).reshape(4, -1)
    folded = np.ascontiguousarray(planes.T).view("<u4").astype(np.int64).reshape(-1, frames)
    return np.cumsum((folded >> 1) ^ -(folded & 1), axis=1)


def to_json(value: Any) -> Any:
    """Return a value for JSON, with ``{"number": "inf"}`` for an infinite number."""
    if isinstance(value, dict):
        return {name: to_json(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(part) for part in value]
    return {"number": str(value)} if isinstance(value, float) and not math.isfinite(value) else value


def _from_json(found: dict[str, Any]) -> Any:
    return float(found["number"]) if list(found) == ["number"] else found
