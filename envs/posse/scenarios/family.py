"""Families: scenarios that differ in some settings, each drawn from its range."""

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from posse.declarations import Declarations, unknown
from posse.scenarios.named import SCENARIOS, get_scenario
from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import SPLITS, ScenarioError, UnknownSettingError, check_choice, check_count, fail

Range = tuple[float, float]
"""Least and greatest value of a setting, both included."""

BLOCK: Final = 10
"""Worlds in a row of the same drawn scenario: world i of a family plays scenario i // BLOCK."""
_OF_ALL: Final = {"version", "control_step", "physics_step", "horizon", "sonar_beams", "num_neighbours", "message_size"}
"""Settings on which the lengths of steps, episodes and observations depend, and the version."""


@dataclass(frozen=True, kw_only=True)
class Family:
    """Scenarios that are equal but for some settings, each drawn uniformly from its range.

    Made by :func:`posse.family`; accepted wherever worlds of several scenarios can be played: ``posse.batches``, and
    the commands and functions to train, tune, evaluate and compare.

    Attributes:
        name: Its name in results.
        base: The scenario that gives all other settings. The drawn ones have its name and version, so that a policy
            plays the settings that were tuned for it.
        ranges: Settings and their ranges; whole numbers where the setting is one.
    """

    name: str
    base: Scenario
    ranges: tuple[tuple[str, Range], ...]
    meaning: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.ranges:
            raise ScenarioError(f"family {self.name!r} has no ranges: give one, such as target_speed=(0.3, 0.7)")
        object.__setattr__(self, "ranges", tuple((name, _accepted(name, bounds)) for name, bounds in self.ranges))
        varied = dict(self.ranges)
        if "num_trackers" in varied and self.base.num_neighbours is None:
            fail(
                "num_trackers",
                varied["num_trackers"],
                "team sizes of a family need num_neighbours, so that all observations have one length",
            )
        fields = Declarations.of(self.base).fields
        corners = (itertools.product(*(bounds[::way] for _, bounds in self.ranges)) for way in (1, -1))
        some = (itertools.islice(each, 512) for each in corners)  # of many ranges: each end occurs
        for values in dict.fromkeys(itertools.chain(*some)):
            one = self.base.replace(**dict(zip(varied, values, strict=True)))  # raises what cannot hold
            if Declarations.of(one).fields != fields:
                fail("extra_fields", one.extra_fields, "a field's when= must be alike for all scenarios of a family")

    @property
    def version(self) -> int:
        """Version of the base."""
        return self.base.version

    @property
    def horizon(self) -> int:
        """Control steps of an episode."""
        return self.base.horizon

    @property
    def message_size(self) -> int:
        """Numbers of a message."""
        return self.base.message_size

    def draw(self, index: int, seed: int = 0, split: str = "train") -> Scenario:
        """Return a scenario of the family; it depends on nothing but index, seed and split."""
        split = check_choice("split", split, SPLITS)
        key = [check_count("seed", seed, 0), *split.encode(), check_count("index", index, 0)]
        shares = np.random.default_rng(key).random(len(self.ranges))
        values: dict[str, float] = {}
        for (name, (low, high)), share in zip(self.ranges, shares.tolist(), strict=True):
            values[name] = low + (int(share * (high - low + 1)) if isinstance(low, int) else share * (high - low))
        return self.base.replace(**values)

    def replace(self, **changes: Any) -> "Family":
        """Return a family with settings changed: each gets a range or one value, as in :func:`posse.family`."""
        return family(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Return name, ranges and the settings of the base as plain values."""
        ranges = {name: list(bounds) for name, bounds in self.ranges}
        return {"family": self.name, "ranges": ranges, **self.base.to_dict()}


def _accepted(name: str, bounds: Range) -> Range:
    """Return a range as the setting keeps its values, or raise ScenarioError."""
    known = Scenario.settings()
    if name not in known:
        raise UnknownSettingError(unknown("setting", name, known))
    if len(bounds) != 2:
        fail(name, bounds, "a range must be two numbers, (least, greatest)")
    if name in _OF_ALL:
        fail(name, bounds, f"a family cannot vary {name}, on which its policies and results rest: set it on its base")
    several = any(isinstance(value, (tuple, list)) for value in bounds)
    if several or ("int" not in known[name].kind and not known[name].kind.startswith("float")):
        fail(name, bounds, "a family varies settings that are one number")
    low, high = (known[name].accept(name, value) for value in bounds)
    if not low <= high < math.inf:
        fail(name, bounds, "the least must not be above the greatest, which must be finite")
    return low, high


def family(base: str | Scenario | Family, /, *, name: str | None = None, **settings: Any) -> Family:
    """Return a family: ``posse.family("smart", target_speed=(0.3, 0.7), num_obstacles=(0, 6))``.

    A setting given as two numbers is drawn from that range, both included: whole numbers where the setting is one. Any
    other value is set for all.

    Args:
        base: A scenario or its name; or a family or its name, whose settings are changed.
        name: Its name in results; default: that of the base and the varied settings.
        settings: Ranges and values.

    Raises:
        ScenarioError: An unknown or invalid setting, an empty range, one whose ends do not go together with the other
            settings, team sizes without ``num_neighbours``, or a setting that a family cannot vary.
    """
    if isinstance(base, str) and base in FAMILIES:
        start, meaning, ranges = FAMILIES[base]
        base = Family(name=base, base=get_scenario(start), ranges=tuple(ranges.items()), meaning=meaning)
    ranges, rest, kinds = dict(base.ranges) if isinstance(base, Family) else {}, {}, Scenario.settings()
    for setting, value in settings.items():
        of_several = setting in kinds and kinds[setting].kind.startswith(("tuple", "Mapping"))
        if isinstance(value, (tuple, list, np.ndarray)) and not of_several:
            ranges[setting] = tuple(value.tolist() if isinstance(value, np.ndarray) else value)
        else:
            ranges.pop(setting, None)
            rest[setting] = value
    items = tuple(ranges.items())
    if isinstance(base, Family):
        return dataclasses.replace(base, name=name or base.name, base=get_scenario(base.base, **rest), ranges=items)
    scenario = get_scenario(base, **rest)
    return Family(name=name or "-".join([scenario.name, "family", *ranges]), base=scenario, ranges=items)


FAMILIES: Final[dict[str, tuple[str, str, dict[str, Range]]]] = {
    "family-open": (
        "smart",
        "The open plane of smart, with slow and fast, agile and clumsy targets and trackers.",
        {"target_speed": (0.4, 0.7), "target_turn_rate": (1.0, 2.5), "tracker_turn_rate": (1.0, 2.0)},
    ),
    "family-arena": (
        "obstacles",
        "Arenas of many sizes with none to eight obstacles, and targets of many speeds.",
        {"arena": (18.0, 28.0), "num_obstacles": (0, 8), "target_speed": (0.3, 0.6)},
    ),
}
"""Named families: base, sentence, ranges."""


def family_names() -> tuple[str, ...]:
    """Return the names of all families."""
    return tuple(FAMILIES)


def scenario_or_family(given: str | Scenario | Family, **overrides: Any) -> Scenario | Family:
    """Return a scenario or a family, given it or its name, with settings changed."""
    if isinstance(given, Family) or (isinstance(given, str) and given in FAMILIES):
        return family(given, **overrides)
    if isinstance(given, str) and given not in SCENARIOS:
        raise ScenarioError(unknown("scenario", given, [*SCENARIOS, *FAMILIES]))
    return get_scenario(given, **overrides)


def blocks(given: Scenario | Family, worlds: range, seed: int, split: str) -> Iterator[tuple[Scenario, range]]:
    """Yield the scenario of each block of worlds: of a scenario one block, of a family its drawn scenarios."""
    if isinstance(given, Scenario):
        yield given, worlds
        return
    for k in range(worlds.start // BLOCK, math.ceil(worlds.stop / BLOCK)):
        inside = range(max(BLOCK * k, worlds.start), min(BLOCK * (k + 1), worlds.stop))
        yield given.draw(k, seed, split), inside
