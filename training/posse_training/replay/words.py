"""What a page says in words: the verdict, and the command that makes it again."""

from __future__ import annotations

import shlex
from collections import defaultdict
from typing import Final

import numpy as np
import numpy.typing as npt

from posse_training.replay.episode import Player, Replay

_CAUSES: Final = ("dart", "contact", "break")
_NUMBERS: Final = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_MOST: Final = 0.6  # of a difference: what arose there is named
_ALL: Final = 0.85  # and called all of it


def verdict(replay: Replay) -> str:
    """Return a sentence: the share of its slots that each team held, and for two teams where the difference arose.

    A step in which slots are free is put down to the team's last dart, contact or break before it, or, before the team
    first held as many as in the mean, to the way to the slots. The difference is said to arise where most of it lies.
    """
    step = replay.world["settings"]["control_step"]
    ranked = sorted(replay.players, key=lambda player: -_scores(player).mean())
    parts = []
    for place, player in enumerate(ranked):
        share = f"{100 * _scores(player).mean():.0f} %"
        contact = next((event.step for event in player.events if event.kind == "contact"), None)
        after = "" if contact is None else f" (none counts from its contact at {contact * step:.1f} s on)"
        parts.append(f"{player.name} {'' if place else 'held '}{share}{'' if place else ' of its slots'}{after}")
    reason = _reason(ranked[0], ranked[1]) if len(ranked) == 2 else ""
    return f"{', '.join(parts)}{reason}."


def command(replay: Replay) -> str:
    """Return the command line that makes the page again; empty if a player or a setting cannot be given in one."""
    arguments, options = [player.argument for player in replay.players], replay.world.get("options")
    return "" if options is None or not all(arguments) else shlex.join(["posse", "replay", *arguments, *options])


def _scores(player: Player) -> npt.NDArray[np.float64]:
    """Return the score of each step, (T,)."""
    return np.asarray(player.columns["score"].values[1:], np.float64)


def _losses(player: Player) -> tuple[dict[str, float], dict[str, int]]:
    """Return by cause how many steps' worth of slots were free, and in how many events of it any were."""
    scores = _scores(player)
    lost, times = defaultdict[str, float](float), defaultdict[str, int](int)
    begins = {0: "way", int((scores >= scores.mean()).argmax()): ""}
    there = max(begins)
    begins |= {e.step - 1: e.kind for e in player.events if e.kind in _CAUSES and e.step - 1 > there}
    steps = sorted(begins)
    for first, end in zip(steps, [*steps[1:], len(scores)], strict=True):
        free = float((1 - scores[first:end]).sum())
        lost[begins[first]] += free
        times[begins[first]] += free > 0
    return lost, times


def _reason(first: Player, second: Player) -> str:
    """Return where the second team fell behind the first, one cause or two; empty if nowhere in particular."""
    (kept, _), (lost, times) = _losses(first), _losses(second)
    behind = {cause: lost.get(cause, 0.0) - kept.get(cause, 0.0) for cause in dict.fromkeys((*lost, *kept))}
    total, greatest = sum(behind.values()), sorted(behind, key=lambda cause: -behind[cause])
    for causes in (greatest[:1], greatest[:2]):
        share = sum(behind[cause] for cause in causes) / max(total, 1e-9)
        if total >= 1 and share >= _MOST and "" not in causes:
            places = " and ".join(_place(cause, times[cause]) for cause in causes)
            return f"; {'the' if share >= _ALL else 'most of the'} difference arose {places}"
    return ""


def _place(cause: str, count: int) -> str:
    if cause == "way":
        return "on the way to the slots"
    word = _NUMBERS[count] if count < len(_NUMBERS) else count
    return f"{'after' if cause == 'break' else 'in'} {word} {cause}{'s' * (count != 1)}"
