"""The report of a comparison: one page with all estimates and figures, and links to replays beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2

from posse_training.compare.contenders import Plays
from posse_training.compare.figures import CAPTIONS
from posse_training.compare.table import COLUMNS, Row, cell, ranked
from posse_training.style import PLANNER


@dataclass(frozen=True)
class Extreme:
    """One world that a policy, of a training seed from 0 on, and the baseline played, with their safe scores."""

    scenario: str
    policy: str
    seed: int
    world: int
    mine: float
    baseline: float

    @property
    def gain(self) -> float:
        """How much higher the policy's safe score is than the baseline's."""
        return self.mine - self.baseline


def extremes(plays: Mapping[tuple[str, str], Plays], reference: str, count: int) -> list[Extreme]:
    """Return the largest wins, then the largest losses against the reference, at most ``count`` each.

    Of each policy on each scenario only the largest win and the largest loss are candidates, so that several of them
    are shown. The planner, which reads the state, is one where nobody else is.
    """
    others = {policy for _, policy in plays} - {reference}
    shown = others - {PLANNER} or others
    wins: list[Extreme] = []
    losses: list[Extreme] = []
    for (scenario, policy), found in plays.items():
        base = plays.get((scenario, reference))
        if policy not in shown or base is None:
            continue
        mine, theirs = found.paired(base)
        gains = mine - theirs[:1]
        for kept, place in ((wins, gains.argmax()), (losses, gains.argmin())):
            seed, world = divmod(int(place), gains.shape[1])
            kept.append(Extreme(scenario, policy, seed, world, float(mine[seed, world]), float(theirs[0, world])))
    wins = sorted((one for one in wins if one.gain > 0), key=lambda one: -one.gain)
    losses = sorted((one for one in losses if one.gain < 0), key=lambda one: one.gain)
    return wins[:count] + losses[:count]


def page(rows: Sequence[Row], figures: Sequence[Path], **values: Any) -> str:
    """Return the page; names and messages of policies are text in it, whatever they hold.

    Beside the rows and the figures' files, ``report.html`` names the values that it shows.
    """
    text = (resources.files(__package__) / "report.html").read_text(encoding="utf-8")
    values |= {"columns": COLUMNS, "rows": ranked(rows), "cell": cell}
    values["figures"] = [(path.name, CAPTIONS[path.stem]) for path in figures if path.suffix == ".svg"]
    return jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(text).render(values)
