"""The figures of ``posse compare``; each states worlds, split, seed and the scenario's version."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from posse import Scenario
from posse_training.compare.contenders import Contender, Plays
from posse_training.evaluation.results import block_of
from posse_training.evaluation.statistics import over_seeds, share
from posse_training.style import BAND, BOUND, PLANNER, RC, WIDTH, Looks, legend, looks_of, note, plain, save, subplots

CAPTIONS: Final = {
    "scenarios": "Mean safe score of every team on every scenario.",
    "profile": "Share of worlds with at least a safe score.",
    "learning": "Safe score on validation worlds during training.",
    "recovery": "Share of teams that have settled again, by time since their leader broke.",
}
"""What each figure shows, by the name of its file."""

Found = Mapping[tuple[str, str], Plays]
"""Results by scenario and policy."""


def draw(folder: Path, plays: Found, contenders: Sequence[Contender]) -> list[Path]:
    """Draw every figure that there is data for as PNG and SVG; return the files."""
    looks = looks_of([contender.label for contender in contenders])
    curves = curves_of(contenders)
    losses = [found for (name, _), found in plays.items() if name == "leader-loss"]
    drawn: dict[str, Figure] = {}
    with mpl.rc_context(RC):
        if plays:
            drawn = {"scenarios": scores(plays, looks), "profile": profile(plays, looks)}
        if curves:
            drawn["learning"] = learning(curves, looks)
        if any(np.isfinite(found["recovery_time"]).any() for found in losses):
            drawn["recovery"] = recovery(losses, looks)
        return [path for name, figure in drawn.items() for path in save(figure, folder, name)]


def scores(plays: Found, looks: Looks) -> Figure:
    """Draw the mean safe score of every policy on every scenario, with its interval."""
    names, policies = _order(plays, looks)
    figure, axis = subplots(1, 1, (WIDTH, 1.3 + len(names) * (0.2 + 0.11 * len(policies))))
    for row, name in enumerate(names):
        if row % 2:
            axis.axhspan(row - 0.5, row + 0.5, color=BAND, zorder=0, linewidth=0)
        for k, policy in enumerate(policies):
            if (name, policy) not in plays:
                continue
            found, style = plays[name, policy], looks[policy]
            score = over_seeds(found["safe_score"], block=block_of(found.scenario))
            y = row + (k - (len(policies) - 1) / 2) * 0.8 / len(policies)
            axis.plot([score.low, score.high], [y, y], color=style.colour, linewidth=1.4)
            axis.plot(score.value, y, **style.point)
        bound, look = _bound(plays, name)["bound"].mean(), looks[BOUND]
        axis.plot([bound, bound], [row - 0.42, row + 0.42], color=look.colour, linestyle=look.line)
    axis.set_yticks(range(len(names)), [_versioned(plays, name) for name in names])
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False, axis="y")
    axis.set(ylim=(len(names) - 0.5, -0.5), xlim=(0, 1), xlabel="mean safe score, 95 % interval")
    note(figure, facts_of(list(plays.values())))
    legend(figure, [*policies, BOUND], looks)
    return figure


def profile(plays: Found, looks: Looks) -> Figure:
    """Draw the share of worlds that reach a safe score (a performance profile) on each scenario."""
    names, policies = _order(plays, looks)
    columns = 4 if len(names) > 6 else min(3, len(names))
    rows = -(-len(names) // columns)
    size = (WIDTH, 1.1 + 1.6 * rows)
    figure, grid = subplots(rows, columns, size, squeeze=False, sharex=True, sharey=True)
    axes = list(grid.flat)
    at = np.linspace(0, 1, 201)
    for axis, name in zip(axes, names, strict=False):
        axis.set_title(_versioned(plays, name), fontweight="bold")
        curves = [(p, plays[name, p]["safe_score"]) for p in policies if (name, p) in plays]
        for policy, values in [*curves, (BOUND, _bound(plays, name)["bound"])]:
            reached = (values.reshape(-1, 1) >= at).mean(axis=0)
            _steps(axis, at, reached, looks, policy)
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
    for axis in axes[len(names) :]:
        axis.set_visible(False)
    figure.supylabel("share of worlds with τ or more", fontsize=9)
    note(figure, f"x: safe score τ; {facts_of(list(plays.values()))}")
    legend(figure, [*policies, BOUND], looks)
    return figure


def curves_of(contenders: Sequence[Contender]) -> list[tuple[str, Any]]:
    """Return label and (points, steps and score with its interval) of each card with a learning curve."""
    found = []
    for contender in contenders:
        for policy in contender.policies:
            card = getattr(policy, "card", None)
            points = card.get("curve") if isinstance(card, Mapping) else None
            try:
                rows = [[float(point[n]) for n in ("steps", "safe_score", "low", "high")] for point in points or ()]
            except (KeyError, TypeError, ValueError):
                continue  # a card may come from anyone
            if len(rows) > 1 and all(math.isfinite(value) for row in rows for value in row):
                found.append((contender.label, np.array(rows).T))
    return found


def learning(curves: Sequence[tuple[str, Any]], looks: Looks) -> Figure:
    """Draw the safe score on validation worlds over training steps, with its interval."""
    figure, axis = subplots(1, 1, (WIDTH, 3.6))
    for label, (steps, value, low, high) in curves:
        axis.fill_between(steps / 1e6, low, high, color=looks[label].colour, alpha=0.15, linewidth=0)
        axis.plot(steps / 1e6, value, **looks[label].point)
    axis.set(xlabel="training steps, millions", ylabel="safe score on validation worlds")
    axis.set_xlim(left=0)
    legend(figure, list(dict.fromkeys(label for label, _ in curves)), looks)
    return figure


def recovery(losses: Sequence[Plays], looks: Looks) -> Figure:
    """Draw the share of teams that have settled again by a time after their leader broke."""
    figure, axis = subplots(1, 1, (WIDTH, 3.6))
    scenario = losses[0].scenario
    assert isinstance(scenario, Scenario)
    # After this time, an episode may end before a recovery counts.
    latest = scenario.duration * (1 - scenario.break_window[1]) - scenario.settle_time
    times = np.arange(0, latest + 1e-9, scenario.control_step)
    for plays in losses:
        # nan, which means never, compares false
        shares = [share(plays["recovery_time"] <= time + 1e-9) for time in times]
        low, high = [s.low for s in shares], [s.high for s in shares]
        axis.fill_between(times, low, high, step="post", color=looks[plays.label].colour, alpha=0.15, linewidth=0)
        _steps(axis, times, np.array([s.value for s in shares]), looks, plays.label)
    axis.set(xlim=(0, latest), ylim=(-0.02, 1.02), xlabel="time since the loss, s", ylabel="share settled again")
    note(figure, f"{scenario.name} v{scenario.version}: {facts_of(losses)}")
    legend(figure, [plays.label for plays in losses], looks)
    return figure


def facts_of(plays: Sequence[Plays]) -> str:
    """Return the number of worlds, with the policies that played another one, split and seed."""
    counts = {found.label: found.results[0].episodes for found in plays}
    ((usual, _),) = Counter(counts.values()).most_common(1)
    other = ", ".join(f"{plain(label)} {n:,}" for label, n in counts.items() if n != usual)
    first = plays[0].results[0]
    return f"{usual:,} worlds{f' ({other})' if other else ''}, {first.split} split, seed {first.seed}"


def _order(plays: Found, looks: Looks) -> tuple[list[str], list[str]]:
    """Return the scenarios in the order of play, and the policies in the order of a legend."""
    played = {policy for _, policy in plays}
    return list(dict.fromkeys(name for name, _ in plays)), [policy for policy in looks if policy in played]


def _versioned(plays: Found, name: str) -> str:
    scenario = next(found.scenario for (played, _), found in plays.items() if played == name)
    return f"{plain(name)} v{scenario.version}"


def _bound(plays: Found, name: str) -> Plays:
    """Return the results that the bound of a scenario is taken from: it depends on the target's path."""
    found = {policy: played for (scenario, policy), played in plays.items() if scenario == name}
    return found.get(PLANNER) or next(iter(found.values()))


def _steps(axis: Any, x: Any, y: Any, looks: Looks, policy: str) -> None:
    """Draw a step function with some markers."""
    look, k = looks[policy].point, list(looks).index(policy)
    every = max(1, len(x) // 6)
    axis.step(x, y, where="post", **look, markevery=(k * every // len(looks), every))
