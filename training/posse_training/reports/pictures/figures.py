"""The figures of ``posse compare``, as PNG and SVG.

Each states what was played: number of worlds, split, seed and the scenario's version.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from posse import get_scenario
from posse_baselines.files import replacing
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.sweeps import BOUND, SWEEPS, Point, Sweep
from posse_training.reports.pictures.learning import Curve, learning
from posse_training.reports.pictures.palette import BAND, NOTE, OWN
from posse_training.reports.pictures.parts import facts_of, legend, names_of, note, panels, steps, versions_of
from posse_training.reports.pictures.style import RC, Looks, in_order, looks_of, marker_of, reference_of
from posse_training.reports.statistics import Estimate, share

CAPTIONS: Final = {
    "scenarios": "Mean safe score of every team on every scenario.",
    "profile": "Share of worlds with at least a safe score.",
    "learning": "Validation score over the training of the learned teams.",
    "team-size": "Safe score against the size of the team.",
    "radio-loss": "Safe score against the share of messages lost.",
    "target-speed": "Safe score against the speed of the target.",
    "recovery": "Share of teams that have settled again, by time since their leader broke.",
}
"""What each figure shows, by the name of its file."""


def draw(
    folder: Path,
    plays: Mapping[tuple[str, str], Plays],
    points: Sequence[Point] = (),
    losses: Sequence[Plays] = (),
    curves: Sequence[Curve] = (),
    *,
    sweep_facts: str = "",
) -> list[Path]:
    """Draw every figure that there is data for; return the files.

    Args:
        folder: Folder to write to.
        plays: Results by scenario and policy.
        points: Points of the sweeps.
        losses: Results in the scenario in which the leader breaks.
        curves: Learning curves.
        sweep_facts: Number of worlds at each point, split and seed.
    """
    looks = looks_of(
        {policy for _, policy in plays}
        | {point.policy for point in points if point.policy != BOUND}
        | {found.label for found in losses}
        | {curve.policy for curve in curves}
    )
    with mpl.rc_context(RC):
        drawn: dict[str, Figure] = {}
        if plays:
            drawn["scenarios"] = scores(plays, looks)
            drawn["profile"] = profile(plays, looks)
        if curves:
            drawn["learning"] = learning(curves, looks)
        for sweep in SWEEPS:
            mine = [point for point in points if point.sweep == sweep.name]
            if mine:
                drawn[sweep.name] = sweep_figure(sweep, mine, looks, sweep_facts)
        if losses:
            drawn["recovery"] = recovery(losses, looks)
        files = []
        for name, figure in drawn.items():
            for suffix in (".png", ".svg"):
                path = folder / f"{name}{suffix}"
                dated = {"Date": None} if suffix == ".svg" else None
                with replacing(path) as part:
                    figure.savefig(part, dpi=160, metadata=dated)
                files.append(path)
        return files


def profile(plays: Mapping[tuple[str, str], Plays], looks: Looks) -> Figure:
    """Draw the share of worlds that reach a safe score (a performance profile) on each scenario."""
    names, policies = names_of(plays)
    versions = versions_of(plays)
    columns = 4 if len(names) > 6 else min(3, len(names))
    rows = -(-len(names) // columns)
    figure, axes = panels(rows, columns, 1.1 + 1.6 * rows)
    scores = np.linspace(0, 1, 201)
    for axis, name in zip(axes, names, strict=False):
        axis.set_title(versions[name], fontweight="bold")
        for k, policy in enumerate(policies):
            if (name, policy) not in plays:
                continue
            mine = plays[name, policy]["safe_score"]
            phase = (k + 0.5) / len(policies)
            steps(axis, scores, _at_least(mine, scores), policy, looks, phase)
            if policy == reference_of(policies):
                steps(axis, scores, _at_least(plays[name, policy]["bound"], scores), BOUND, looks)
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
        axis.set_xticks((0, 0.5, 1), ("0", "0.5", "1"))
        axis.set_yticks((0, 0.5, 1), ("0", "0.5", "1"))
    for k, axis in enumerate(axes):
        axis.set_visible(k < len(names))
        axis.label_outer()
        if k < len(names) and k + columns >= len(names):
            axis.tick_params(labelbottom=True)
            axis.set_xlabel("safe score τ")
    figure.supylabel("share of worlds with τ or more", fontsize=9)
    note(figure, facts_of(list(plays.values())))
    legend(figure, [*policies, BOUND], looks)
    return figure


def _at_least(values: Any, scores: Any) -> Any:
    """Return the share of values (S, W) that are at least each score."""
    ordered = np.sort(values.reshape(-1))
    return 1 - np.searchsorted(ordered, scores, side="left") / len(ordered)


def scores(plays: Mapping[tuple[str, str], Plays], looks: Looks) -> Figure:
    """Draw the mean safe score of every policy on every scenario, with its interval."""
    names, policies = names_of(plays)
    versions = versions_of(plays)
    figure, (axis,) = panels(1, 1, 1.3 + len(names) * (0.2 + 0.11 * len(policies)))
    apart = 0.8 / max(len(policies), 1)
    for row, name in enumerate(names):
        if row % 2:
            axis.axhspan(row - 0.5, row + 0.5, color=BAND, zorder=0, linewidth=0)
        for k, policy in enumerate(policies):
            if (name, policy) not in plays:
                continue
            found, style = plays[name, policy], looks[policy]
            score = found.mean("safe_score")
            y = row + (k - (len(policies) - 1) / 2) * apart
            axis.plot([score.low, score.high], [y, y], color=style.colour, linewidth=1.4)
            axis.plot(score.value, y, **marker_of(policy, style))
            if policy == reference_of(policies):
                bound = found.mean("bound").value
                axis.plot(
                    [bound, bound],
                    [row - 0.42, row + 0.42],
                    color=looks[BOUND].colour,
                    linestyle=looks[BOUND].line,
                    linewidth=1.6,
                )
    axis.set_yticks(range(len(names)), [versions[name] for name in names])
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False, axis="y")
    axis.set(ylim=(len(names) - 0.5, -0.5), xlim=(0, 1), xlabel="mean safe score, 95 % interval")
    note(figure, facts_of(list(plays.values())))
    legend(figure, [*policies, BOUND], looks, lines=False)
    return figure


def sweep_figure(sweep: Sweep, points: Sequence[Point], looks: Looks, facts: str = "") -> Figure:
    """Draw the mean safe score of every policy against a setting, with its interval."""
    figure, (axis,) = panels(1, 1, 3.8)
    policies = in_order({point.policy for point in points})
    scenario = get_scenario(sweep.scenario)
    axis.axvline(sweep.own, color=OWN, linewidth=5, zorder=0)
    for policy in policies:
        mine = sorted((p for p in points if p.policy == policy), key=lambda p: p.value)
        style = looks[policy]
        x = [p.value for p in mine]
        axis.plot(
            x, [p.score.value for p in mine], color=style.colour, linestyle=style.line, zorder=2 + (policy != BOUND)
        )
        if policy == BOUND:
            continue
        axis.vlines(x, [p.score.low for p in mine], [p.score.high for p in mine], color=style.colour, linewidth=1.4)
        look = marker_of(policy, style) | {"linestyle": ""}
        axis.plot(x, [p.score.value for p in mine], **look)
    axis.set(
        ylim=(0, 1),
        xticks=sweep.values,
        xlabel=sweep.label,
        ylabel=f"mean safe score on {scenario.name} v{scenario.version}",
    )
    axis.annotate(
        f"as in {sweep.scenario}",
        (sweep.own, 1),
        (0, 3),
        textcoords="offset points",
        color=NOTE,
        fontsize=8,
        ha="center",
    )
    note(figure, facts)
    legend(figure, policies, looks)
    return figure


def recovery(losses: Sequence[Plays], looks: Looks) -> Figure:
    """Draw the share of teams that have settled again by a time after their leader broke."""
    figure, (axis,) = panels(1, 1, 3.6)
    scenario = losses[0].scenario
    # After this time, an episode may end before a recovery counts.
    latest = scenario.duration * (1 - scenario.break_window[1]) - scenario.settle_time
    times = np.arange(0, latest + 1e-9, scenario.control_step)
    policies = in_order({plays.label for plays in losses})
    for plays in sorted(losses, key=lambda plays: policies.index(plays.label)):
        bands = [_recovered(plays, time) for time in times]
        style = looks[plays.label]
        axis.fill_between(
            times,
            [b.low for b in bands],
            [b.high for b in bands],
            step="post",
            color=style.colour,
            alpha=0.15,
            linewidth=0,
        )
        phase = (policies.index(plays.label) + 0.5) / len(policies)
        steps(axis, times, [b.value for b in bands], plays.label, looks, phase)
    axis.set(
        xlim=(0, latest), ylim=(-0.02, 1.02), xlabel="time since the loss, s", ylabel="share of teams settled again"
    )
    note(figure, f"{scenario.name} v{scenario.version}: {facts_of(losses)}")
    legend(figure, policies, looks)
    return figure


def _recovered(plays: Plays, time: float) -> Estimate:
    """Return the share of teams that have settled again by a time after the loss, s.

    The interval is Wilson's; for several training seeds, it spans the lowest to the highest.
    """
    by_then = plays["recovery_time"] <= time + 1e-9  # nan, which means never, compares false
    if len(by_then) == 1:
        return share(by_then)
    shares = by_then.mean(axis=1)
    return Estimate(shares.mean(), shares.min(), shares.max(), by_then.size)
