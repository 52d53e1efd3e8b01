"""The card of a policy: its name, what it was trained on, and how well it did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from posse.rules import SPLITS
from posse_baselines.policy import PolicyError

LONGEST_NAME: Final = 100
"""Characters of a policy's name, at most."""
SIDES: Final = ("trackers", "target")
"""What a policy moves."""


def side_of(card: Mapping[str, Any]) -> str:
    """Return what the policy of a card moves, one of :data:`SIDES`; default: the trackers.

    Raises:
        PolicyError: Neither.
    """
    side = card.get("side", SIDES[0])
    if side not in SIDES:
        raise PolicyError(f"side={side!r:.80} on its card must be {' or '.join(SIDES)}")
    return str(side)


def check_card(card: Any) -> tuple[str, tuple[str, ...]]:
    """Return the name and the trained splits of a card; default: ``"learned"``, ``("train",)``.

    Raises:
        PolicyError: Not a mapping, a name that cannot be printed, an unknown split.
    """
    if not isinstance(card, Mapping):
        raise PolicyError(f"its card must be a mapping of names to values, not {card!r:.80}")
    name = card.get("name", "learned")
    if not isinstance(name, str) or not 1 <= len(name) <= LONGEST_NAME or not name.isprintable():
        raise PolicyError(
            f"the name on its card, {name!r:.80}, must be a text of 1 to {LONGEST_NAME} printable characters"
        )
    splits = card.get("trained_splits", ("train",))
    if not isinstance(splits, (list, tuple)) or any(split not in SPLITS for split in splits):
        raise PolicyError(f"trained_splits={splits!r:.80} on its card must be a list of {', '.join(SPLITS)}")
    return name, tuple(splits)
