"""The message of a tracker: five small whole numbers."""

from __future__ import annotations

from typing import Final

from posse.numeric import FloatArray, Record, compiled

MESSAGE_SIZE: Final = 5
"""Task, leader, term, pulse, slot."""
COUNT: Final = 256
"""Terms and pulses count modulo this."""

_STEP: Final = 1.0 / 512.0


@compiled
def encode(value: int) -> float:
    """Return a whole number, -1 (nothing) to 510, as a number in [0, 1); 0 is nothing."""
    return (value + 1) * _STEP


@compiled
def decode(number: float) -> int:
    """Inverse of :func:`encode`, defined for any number."""
    return round(number / _STEP) - 1


@compiled
def is_newer(value: int, old: int) -> bool:
    """Return whether a count modulo ``COUNT`` is ahead of another, by the shorter way."""
    ahead = (value - old) % COUNT
    return 0 < ahead < COUNT // 2


@compiled
def write_message(me: Record, action: FloatArray) -> None:
    """Write the message of a tracker into an action (2 + m,)."""
    action[2] = encode(me.task)
    action[3] = encode(me.leader)
    action[4] = encode(me.term)
    action[5] = encode(me.pulse)
    action[6] = encode(me.slot)
