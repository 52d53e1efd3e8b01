"""The course of a session of rounds: no window, no drawing, no world.

A session is a :class:`Session` value. :func:`react` returns it after a key, :func:`advance` after
some real time, :func:`finish` after the end of a round.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

READY, COUNTDOWN, RUNNING, PAUSED, OVER = "ready", "countdown", "running", "paused", "over"
COUNTED: Final = 3.0
"""Seconds counted down before a round."""


@dataclass(frozen=True)
class Session:
    """Where a session stands.

    Attributes:
        phase: ``"ready"``, ``"countdown"``, ``"running"``, ``"paused"`` or ``"over"``.
        world: Index of the world of this round.
        left: Seconds left of the countdown.
        rounds: Points of the rounds played to the end, in order.
        begun: Rounds begun so far, by which a new one is told.
        closed: Whether the player has ended the session.
    """

    phase: str = READY
    world: int = 0
    left: float = COUNTED
    rounds: tuple[float, ...] = ()
    begun: int = 0
    closed: bool = False

    @property
    def best(self) -> float | None:
        """Most points of a round of this session; ``None``: none has been played to the end."""
        return max(self.rounds, default=None)


def points_of(score: float, as_target: bool) -> float:
    """Return the player's points in a round, 0 to 100.

    The team's score for a tracker; what the team missed, for the target.

    Args:
        score: Of the team, its mean over the steps, in [0, 1].
        as_target: Whether the player drives the target.
    """
    return 100.0 * (1.0 - score if as_target else score)


def react(session: Session, key: str) -> Session:
    """Return the session after a key: ``"go"``, ``"pause"``, ``"next"`` (world) or ``"quit"``.

    Raises:
        ValueError: Another key.
    """
    if key == "quit":
        return replace(session, closed=True)
    if key == "go":
        if session.phase == PAUSED:
            return replace(session, phase=RUNNING)
        if session.phase in (READY, OVER):
            return replace(session, phase=COUNTDOWN, left=COUNTED, begun=session.begun + 1)
        return session
    if key == "pause":
        swapped = {RUNNING: PAUSED, PAUSED: RUNNING}
        return replace(session, phase=swapped.get(session.phase, session.phase))
    if key == "next":
        if session.phase not in (READY, OVER):
            return session
        return replace(session, phase=READY, world=session.world + 1)
    raise ValueError(f"unknown key {key!r}; keys are: go, pause, next, quit")


def advance(session: Session, seconds: float) -> Session:
    """Return the session after some real time: the countdown runs, then the round begins."""
    if session.phase != COUNTDOWN:
        return session
    left = session.left - seconds
    if left > 0:
        return replace(session, left=left)
    return replace(session, phase=RUNNING, left=0.0)


def finish(session: Session, points: float) -> Session:
    """Return the session after the end of a round."""
    return replace(session, phase=OVER, rounds=(*session.rounds, points))
