"""History shown in a frame: trails and recent contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posse.rendering.content.scene import Floats, Scene

_TRAIL_TIME: Final = 6.0  # s
_MARK_TIME: Final = 0.2  # s, between two marks of a trail
_FLASH_TIME: Final = 0.8  # s


@dataclass(frozen=True)
class Mark:
    """Past positions of the robots."""

    position: Floats
    """(N + 1, 2) m, the target last."""
    freshness: float
    """1: now; 0: end of the trail."""


@dataclass(frozen=True)
class Flash:
    """A contact that has just begun."""

    position: Floats
    """(2,) of the tracker that touched something, m."""
    age: float
    """0: now; 1: no longer drawn."""


class History:
    """The recorded last seconds of an episode. Cleared at the start of an episode."""

    def __init__(self) -> None:
        self._episode: tuple[int, ...] = ()
        self._marks: list[tuple[int, Floats]] = []
        self._contacts: dict[tuple[int, int], Floats] = {}  # (step, tracker): where
        self._step_time = 0.0

    def note(self, scene: Scene) -> float | None:
        """Record a state; return the time since the last one, s, or None in a new episode.

        A state recorded twice counts once; an earlier one (a restored batch) clears the history.
        """
        self._step_time = scene.scenario.control_step
        marks, last = self._marks, self._marks[-1][0] if self._marks else -1
        begun = scene.episode != self._episode or scene.step < last
        if begun:
            self._episode = scene.episode
            marks.clear()
            self._contacts.clear()
        elif scene.step == last or self._is_close(marks):
            marks.pop()
        marks.append((scene.step, np.vstack([scene.position, scene.target])))
        for i in np.flatnonzero(scene.struck).tolist():
            self._contacts[scene.step, i] = scene.position[i]
        self._marks = [m for m in marks if self._age(m[0]) <= _TRAIL_TIME]
        self._contacts = {key: place for key, place in self._contacts.items() if self._age(key[0]) < _FLASH_TIME}
        return None if begun else (scene.step - last) * self._step_time

    def trail(self) -> list[Mark]:
        """Return past positions, oldest first."""
        return [Mark(place, 1 - self._age(step) / _TRAIL_TIME) for step, place in self._marks]

    def flashes(self) -> list[Flash]:
        """Return the contacts that have just begun."""
        return [Flash(place, self._age(step) / _FLASH_TIME) for (step, _), place in self._contacts.items()]

    def _is_close(self, marks: list[tuple[int, Floats]]) -> bool:
        """Return whether the last mark is too close to the one before to be kept."""
        if len(marks) < 2:
            return False
        return (marks[-1][0] - marks[-2][0]) * self._step_time < _MARK_TIME - 1e-9

    def _age(self, step: int) -> float:
        return (self._marks[-1][0] - step) * self._step_time
