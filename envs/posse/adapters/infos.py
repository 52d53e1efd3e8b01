"""Infos without nested dictionaries, for libraries that take every entry as one array."""

from __future__ import annotations

from typing import Any


def flattened(info: dict[str, Any]) -> dict[str, Any]:
    """Return an info whose nested entries are named ``"outer/inner"``; see ``flat_infos``."""
    flat: dict[str, Any] = {}
    for name, value in info.items():
        if isinstance(value, dict):
            flat.update({f"{name}/{inner}": each for inner, each in value.items()})
        else:
            flat[name] = value
    return flat
