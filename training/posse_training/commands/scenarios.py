"""``posse scenarios``: list the scenarios, or the settings of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from posse import get_scenario, scenario_names


@dataclass(frozen=True)
class _Scenarios:
    """List the scenarios, or all settings of one."""

    name: Annotated[str | None, tyro.conf.Positional] = None
    """Scenario whose settings to list."""


def main(arguments: Sequence[str]) -> None:
    """List the scenarios with their differences from ``constant``, or all settings of one."""
    which = tyro.cli(_Scenarios, prog="posse scenarios", args=arguments)
    table = Table(box=None, pad_edge=False)
    if which.name is not None:
        table.add_column("setting", style="bold", no_wrap=True)
        table.add_column("value", overflow="fold")
        table.add_column("unit")
        table.add_column("range", overflow="fold")
        table.add_column("meaning", overflow="fold")
        scenario = get_scenario(which.name)
        for name, value in scenario.to_dict().items():
            setting = scenario.settings()[name]
            table.add_row(name, Text(str(value)), setting.unit, Text(setting.range), setting.meaning)
    else:
        plain = get_scenario("constant").to_dict()
        table.add_column("scenario", style="bold", no_wrap=True)
        table.add_column("meaning", overflow="fold")
        table.add_column("settings that differ from those of constant", overflow="fold")
        for name in scenario_names():
            differs = [
                f"{key}={value}"
                for key, value in get_scenario(name).to_dict().items()
                if value != plain[key] and key not in ("name", "meaning")
            ]
            table.add_row(name, get_scenario(name).meaning, Text(", ".join(differs) or "-"))
    Console().print(table)
