"""Learning curves: scores on validation worlds over training steps, from policies' cards."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from posse_training.reports.comparing.contenders import Contender
from posse_training.reports.pictures.parts import legend, note, panels, plain
from posse_training.reports.pictures.style import Looks, in_order, marker_of
from posse_training.reports.statistics import Estimate


@dataclass(frozen=True)
class Curve:
    """The validation scores of one training.

    Attributes:
        policy: Label of the contender.
        what: Measure (early versions recorded the score only), scenarios with their versions,
            and the training seed.
        worlds: Validation worlds of each scenario; 0: not known.
        steps: Training steps at each point.
        scores: Score at each point.
    """

    policy: str
    what: str
    worlds: int
    steps: tuple[float, ...]
    scores: tuple[Estimate, ...]


def curves_of(contenders: Sequence[Contender]) -> list[Curve]:
    """Return the learning curves of all contenders whose cards hold one.

    Cards come from files that anyone may have written: one whose curve is damaged has none.
    """
    found = []
    for contender in contenders:
        for policy in contender.policies:
            card = getattr(policy, "card", None)
            if isinstance(card, Mapping):
                try:
                    curve = _read(contender.label, card)
                except (KeyError, TypeError, ValueError):
                    continue
                found += [curve] if len(curve.steps) > 1 else []
    return found


def _read(label: str, card: Mapping[str, Any]) -> Curve:
    steps, scores = [], []
    measure = "safe_score" if all("safe_score" in point for point in card["curve"]) else "score"
    for point in card["curve"]:
        value, low, high = (float(point[name]) for name in (measure, "low", "high"))
        steps.append(float(point["steps"]))
        scores.append(Estimate(value, low, high, 0))
        if not all(math.isfinite(number) for number in (steps[-1], value, low, high)):
            raise ValueError("a curve of numbers that are not finite")
    names = [f"{scenario['name']} v{scenario['version']}" for scenario in card["scenarios"]]
    where = ", ".join(names) if len(names) <= 2 else f"{len(names)} scenarios"
    worlds = int(card["settings"]["evaluate_worlds"])
    what = f"{measure.replace('_', ' ')}, {where[:60]}, training seed {int(card['seed'])}"
    return Curve(label, what, worlds, tuple(steps), tuple(scores))


def learning(curves: Sequence[Curve], looks: Looks) -> Figure:
    """Draw the score on validation worlds over training steps, with its interval."""
    policies = in_order({curve.policy for curve in curves})
    figure, (axis,) = panels(1, 1, 3.2 + 0.16 * len(curves))
    for curve in sorted(curves, key=lambda curve: policies.index(curve.policy)):
        style = looks[curve.policy]
        millions = [steps / 1e6 for steps in curve.steps]
        axis.fill_between(
            millions,
            [s.low for s in curve.scores],
            [s.high for s in curve.scores],
            color=style.colour,
            alpha=0.15,
            linewidth=0,
        )
        axis.plot(millions, [s.value for s in curve.scores], **marker_of(curve.policy, style))
    axis.set(xlabel="training steps, millions", ylabel="validation score")
    axis.set_xlim(left=0)
    note(figure, "\n".join(f"{plain(c.policy)}: {plain(c.what)}, {_worlds(c)}" for c in curves))
    legend(figure, policies, looks)
    return figure


def _worlds(curve: Curve) -> str:
    return f"{curve.worlds:,} worlds of the validation split"
