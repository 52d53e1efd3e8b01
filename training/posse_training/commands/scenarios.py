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
        for name, value in get_scenario(which.name).to_dict().items():
            table.add_row(name, Text(str(value)))
    else:
        plain = get_scenario("constant").to_dict()
        table.add_column("scenario", style="bold", no_wrap=True)
        table.add_column("settings that differ from those of constant", overflow="fold")
        for name in scenario_names():
            differs = [
                f"{key}={value}"
                for key, value in get_scenario(name).to_dict().items()
                if value != plain[key] and key != "name"
            ]
            table.add_row(name, Text(", ".join(differs) or "-"))
    Console().print(table)
