"""``posse scenarios`` and ``posse policies``: what there is, by name, in tables that fit 80 columns."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from posse import Family, Scenario, family, family_names, get_scenario, scenario_names
from posse.scenarios.family import scenario_or_family
from posse_training.options import words_of


@dataclass(frozen=True)
class _Scenarios:
    """List the scenarios and families, or all settings of one."""

    name: Annotated[str | None, tyro.conf.Positional] = None
    """Scenario or family whose settings to list."""


@dataclass(frozen=True)
class _Policies:
    """List the policies."""


def scenarios(arguments: Sequence[str]) -> None:
    """List the scenarios with their differences from ``constant``, and families, or all settings of one."""
    which = tyro.cli(_Scenarios, prog="posse scenarios", args=arguments)
    if which.name is not None:
        found, rows = scenario_or_family(which.name), []
        values = vars(found.base) | dict(found.ranges) if isinstance(found, Family) else vars(found)
        for name, declared in Scenario.settings().items():
            value = " ".join((str(values[name]), declared.unit.replace("1", "")))
            rows.append((name, value.strip(), "; ".join(filter(None, (declared.meaning, declared.range)))))
        _show(("setting", "value", "meaning; range"), rows)
        return
    plain, rows = get_scenario("constant").to_dict(), []
    for name in scenario_names():
        scenario = get_scenario(name)
        own = {k: v for k, v in scenario.to_dict().items() if v != plain[k] and k not in ("name", "meaning")}
        rows.append((name, scenario.meaning, " ".join(words_of(own)) or "-"))
    for name in family_names():
        drawn = family(name)
        rows.append((name, drawn.meaning, " ".join(f"{k}={low:g}..{high:g}" for k, (low, high) in drawn.ranges)))
    _show(("scenario", "meaning", "what is set otherwise than in constant"), rows)


def policies(arguments: Sequence[str]) -> None:
    """List the policies, each with a sentence."""
    tyro.cli(_Policies, prog="posse policies", args=arguments)
    from posse_baselines.policies.scripted import MEANINGS
    from posse_baselines.registry import shipped

    rows = [*MEANINGS.items()]
    for name in shipped():
        kind, _, scenario = name.partition("-")
        where = "two families and radio" if scenario == "generalist" else scenario
        learned = "a correction of ddcs-tuned, learned" if kind == "corrected" else "learned"
        rows.append((name, f"{learned} on {where}"))
    _show(("policy", "what it does"), rows)


def _show(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    table = Table(box=None, pad_edge=False)
    for k, header in enumerate(headers):
        table.add_column(header, style=None if k else "bold", no_wrap=not k, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)
