"""The numbers of the selected robot, line by line: its condition, task and observation."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Field, ObservationLayout, Scenario
from posse.rendering.style import TASKS
from posse_training.replay.world import block_of
from posse_training.viewer.tape import Moment

_UNITLESS = "1"


@dataclass(frozen=True)
class Line:
    """A line of the panel.

    Attributes:
        name: What it is; of a heading, its text.
        value: As it is shown; empty: a heading.
        unit: Of the value; empty: none.
        known: Whether the robot knows it; what it does not is grey.
    """

    name: str
    value: str = ""
    unit: str = ""
    known: bool = True

    @property
    def is_heading(self) -> bool:
        """Whether the line begins a block."""
        return not self.value


def lines_of(moment: Moment, layout: ObservationLayout, robot: int) -> list[Line]:
    """Return what there is to say of a robot; the last number is the target's."""
    n = len(moment.scene.position)
    if robot >= n:
        return _target(moment, layout.scenario)
    return [*_condition(moment, robot), *_action(moment, layout.scenario, robot), *_observation(moment, layout, robot)]


def title_of(robot: int, trackers: int) -> str:
    """Return what a robot is called."""
    return "target" if robot >= trackers else f"tracker {robot}"


def _target(moment: Moment, scenario: Scenario) -> list[Line]:
    scene = moment.scene
    angle = math.atan2(scene.target_heading[1], scene.target_heading[0])
    frame = math.atan2(scene.frame[1], scene.frame[0])
    return [
        Line("motion", scenario.target_motion),
        Line("x, y", _numbers(scene.target), "m"),
        Line("heading", _number(angle), "rad"),
        Line("slot frame", _number(frame), "rad"),
        Line("slots occupied", f"{int(scene.occupied.sum())} of {len(scene.occupied)}"),
        Line("seen by", _named(np.flatnonzero(scene.sees))),
    ]


def _condition(moment: Moment, i: int) -> list[Line]:
    scene, beliefs = moment.scene, moment.beliefs
    condition = "broken" if scene.broken[i] else "works" if scene.senses[i] else "no sensor"
    lines = [Line("condition", condition)]
    if scene.task is not None and 0 <= scene.task[i] < len(TASKS):
        lines.append(Line("task", TASKS[scene.task[i]]))
    if "leader" in beliefs:
        lines.append(_index("leader", int(beliefs["leader"][i]), "tracker "))
    if scene.knowledge.slot is not None:
        lines.append(_index("slot it goes to", int(scene.knowledge.slot[i])))
    lines.append(Line("sees the target", "yes" if scene.sees[i] else "no"))
    age = scene.knowledge.fix_age[i]
    known = math.isfinite(age)
    lines.append(Line("last fix", f"{age:.1f} s ago" if known else "none yet", "", known))
    place = scene.knowledge.fix[i]
    if np.isfinite(place).all():
        lines.append(Line("off by", _number(math.dist(place, scene.target)), "m"))
    return lines


def _action(moment: Moment, scenario: Scenario, i: int) -> list[Line]:
    lines = [Line("action and reward")]
    if moment.actions is not None:
        speed, turn = (float(a) for a in moment.actions[i, :2])
        most = scenario.tracker_speeds[i], scenario.tracker_turn_rates[i]
        lines.append(Line("speed asked for", _number((speed + 1) / 2 * most[0]), "m/s"))
        lines.append(Line("turn rate asked for", _number(turn * most[1]), "rad/s"))
    lines.append(Line("reward of the last step", _number(float(moment.reward[i]), 3)))
    return lines


def _observation(moment: Moment, layout: ObservationLayout, i: int) -> list[Line]:
    """Return the observation by block; last the task, most of which never changes."""
    views = layout.views(moment.observations[i])
    blocks: dict[str, list[Line]] = {}
    for field in layout.fields:
        if field.of_neighbour:
            continue
        block = blocks.setdefault(block_of(field), [])
        value = np.atleast_1d(views[field.name])
        known = _is_known(field, value, bool(views["target_known"]))
        block.append(_field_line(field, field.name, value, known))
    task = blocks.pop("task", [])
    lines: list[Line] = []
    for name, block in blocks.items():
        lines += [Line(f"observed: {name}"), *block]
    mates = [field for field in layout.fields if field.of_neighbour]
    for place in range(layout.neighbours if mates else 0):
        number = int(views["neighbour_number"][place])
        whom = f"tracker {number}" if number >= 0 else "nobody"
        lines.append(Line(f"observed: team-mate {place + 1} ({whom})"))
        if number < 0:
            continue
        for field in mates:
            name = field.name.removeprefix("neighbour_")
            value = np.atleast_1d(views[field.name][place])
            lines.append(_field_line(field, name, value, _is_known(field, value, True)))
    return [*lines, Line("observed: task"), *task] if task else lines


def _is_known(field: Field, value: npt.NDArray[Any], block_known: bool) -> bool:
    """Return whether a value is more than what stands for "not known".

    Zeros stand for it in directions, where the whole block is not known.
    """
    if field.unknown is None or (value != field.unknown).any():
        return True
    return field.unknown == 0 and block_known


def _field_line(field: Field, name: str, value: npt.NDArray[Any], known: bool) -> Line:
    unit = "" if field.unit == _UNITLESS else field.unit
    words = name.replace("_", " ")
    return Line(words, _numbers(value) if known else "not known", unit if known else "", known)


def _index(name: str, number: int, prefix: str = "") -> Line:
    return Line(name, f"{prefix}{number}" if number >= 0 else "none", "", number >= 0)


def _named(numbers: Iterable[int]) -> str:
    return ", ".join(str(int(k)) for k in numbers) or "nobody"


def _number(value: float, digits: int = 2) -> str:
    text = f"{value:.{digits}f}"
    return text.replace("-", "\N{MINUS SIGN}") if float(text) else text.lstrip("-")


def _numbers(values: npt.NDArray[Any]) -> str:
    digits = 0 if all(float(v).is_integer() for v in values) else 1 if len(values) > 4 else 2
    return "  ".join(_number(float(v), digits) for v in values)
