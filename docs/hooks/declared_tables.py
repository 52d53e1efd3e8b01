"""Tables of what the code declares: settings, observation fields, metrics, reward terms, defaults of a training."""

import dataclasses
import math
from collections.abc import Iterable, Sequence

import posse


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines) + "\n"


def _cell(value: object) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")


def code(text: object) -> str:
    """Return a text as code, or nothing for an empty one."""
    return f"`{text}`" if str(text) else ""


def all_settings() -> str:
    """Return every setting of a scenario with default, unit, range and meaning."""
    defaults = {field.name: field.default for field in dataclasses.fields(posse.Scenario)}
    rows = []
    for name, setting in posse.Scenario.settings().items():
        default = defaults[name]
        shown = "" if default is dataclasses.MISSING else code(value(default))
        rows.append((code(name), shown, setting.unit, setting.range, setting.meaning))
    return table(("setting", "default", "unit", "range", "meaning"), rows)


def changed_settings(scenario: str) -> str:
    """Return the settings of a named scenario that differ from the defaults, as a user writes them."""
    own, plain = posse.get_scenario(scenario), posse.Scenario(name="plain")
    found = []
    for field in dataclasses.fields(own):
        given, default = getattr(own, field.name), getattr(plain, field.name)
        if field.name not in ("name", "version", "meaning") and given != default:
            found.append(code(f"{field.name}={value(given)}"))
    return ", ".join(found)


def value(given: object) -> str:
    """Return a value as a user writes it."""
    if isinstance(given, float) and math.isclose(given, 2 * math.pi):
        return "2π"
    if isinstance(given, tuple) and given and isinstance(given[0], tuple):
        return str(dict(given))
    return f"{given:g}" if isinstance(given, float) else repr(given)


def observation(scenario: str) -> str:
    """Return the fields of a scenario's observation in their order, with their indices."""
    layout = posse.ObservationLayout(posse.get_scenario(scenario))
    rows = []
    for field in layout.fields:
        first = layout.offsets[field.name]
        indices = f"{first}" if field.size == 1 else f"{first}:{first + field.size}"
        if field.of_neighbour:
            indices += f"&nbsp;+&nbsp;{layout.stride}k"
        bounds = f"{field.low:.4g} to {field.high:.4g}".replace("-", "\N{MINUS SIGN}").replace(" ", "&nbsp;")
        unknown = "" if field.unknown is None else f"{field.unknown:g}"
        rows.append((indices, code(field.name), field.unit, bounds, unknown, field.meaning))
    note = (
        f"The vector has {layout.size} numbers. Indices are Python's, a:b without b; k is the place of a team-mate, "
        f"0 to {layout.neighbours - 1}, nearest first.\n\n"
    )
    return note + table(("index", "field", "unit", "range", "unknown", "meaning"), rows)


def metrics() -> str:
    """Return the metrics of an episode."""
    rows = [(code(metric.name), metric.unit, metric.meaning) for metric in posse.METRICS]
    return table(("metric", "unit", "meaning"), rows)


def reward_terms() -> str:
    """Return the terms of the reward with their weights by default."""
    weights = dict(posse.Scenario(name="plain").reward_weights)
    rows = [(code(term.name), term.unit, f"{weights.get(term.name, 0):g}", term.meaning) for term in posse.REWARD_TERMS]
    return table(("term", "unit", "weight", "meaning"), rows)
