"""The replays of the manual: played when it is built, and kept under ``build/replays`` until a source changes."""

import functools
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mkdocs.exceptions import PluginError

import posse
import posse_baselines
import posse_training
from declared_tables import changed_settings, code
from posse_training.replay import record, write_replay

ROOT: Final = Path(__file__).parents[2]
CACHE: Final = ROOT / "build" / "replays"
PICTURES: Final = ROOT / "docs" / "media" / "scenarios"
SEED: Final = 7


@dataclass(frozen=True)
class Shown:
    """Who plays in a replay, on which scenario, against whom, and for how long, s."""

    scenario: str
    teams: tuple[str, str]
    seconds: float = 40.0
    target: str | None = None


REPLAYS: Final = {
    "smart": Shown("smart", ("ddcs-distributed", "learned-smart")),
    "search": Shown("search", ("pngl-l-phi", "ddcs-distributed")),
    "obstacles": Shown("obstacles", ("ddcs-distributed", "learned-obstacles")),
    "radio": Shown("radio", ("ddcs-distributed", "learned-radio")),
    "leader-loss": Shown("leader-loss", ("ddcs-centralized-no-exchange", "pngl-l-phi"), seconds=30.0),
    "field": Shown("field", ("ddcs-distributed", "learned-field")),
    "duel-evader": Shown("duel", ("ddcs-tuned", "learned-duel"), target="evader"),
    "paper-distributed": Shown("paper-distributed", ("pngl", "ddcs-distributed"), seconds=8.0),
}


def replay(name: str) -> str:
    """Return a replay in a frame, with a link to it alone."""
    if name not in REPLAYS:
        raise PluginError(f"no replay {name!r}; replays are: {', '.join(REPLAYS)}")
    shown, address = REPLAYS[name], f"site:media/replays/{name}.html"
    teams = " and ".join(code(team) for team in shown.teams)
    return (
        f'<iframe class="replay" src="{address}" loading="lazy" title="Replay of {shown.scenario}">'
        f'</iframe>\n\n{teams} in the same world. <a href="{address}">Open the replay alone</a>; '
        "<kbd>?</kbd> in it lists its keys.\n"
    )


def scenario(name: str) -> str:
    """Return a scenario of the gallery: its picture, meaning, replay and settings."""
    own = posse.get_scenario(name)
    picture = PICTURES / f"{name}.png"
    shown = f"![A team on {name}](media/scenarios/{name}.png){{ .scenario }}\n" if picture.is_file() else ""
    played = next((key for key, each in REPLAYS.items() if each.scenario == name), None)
    watch = f' <a href="site:media/replays/{played}.html">Replay</a>.' if played else ""
    changed = changed_settings(name)
    return f"{shown}{own.meaning} Version {own.version}.{watch}\n\n{changed or 'All settings have their defaults.'}\n"


def write_replays(site: Path) -> None:
    """Write the pages into a manual that was built."""
    (site / "media" / "replays").mkdir(parents=True, exist_ok=True)
    for name in REPLAYS:
        (site / "media" / "replays" / f"{name}.html").write_bytes(page(name).read_bytes())


def page(name: str) -> Path:
    """Return the file of a replay, played unless one of the same sources is there."""
    shown = REPLAYS[name]
    made_from = hashlib.sha256(f"{_sources()} {SEED} {shown}".encode()).hexdigest()[:12]
    path = CACHE / f"{name}-{made_from}.html"
    if not path.is_file():
        CACHE.mkdir(parents=True, exist_ok=True)
        played = record(
            list(shown.teams), shown.scenario, target=shown.target, seed=SEED, seconds=shown.seconds, observations=False
        )
        write_replay(played, path)
    return path


@functools.cache
def _sources() -> str:
    """Return a digest of all files of the packages."""
    packages = [Path(str(package.__file__)).parent for package in (posse, posse_baselines, posse_training)]
    files = [path for root in packages for path in sorted(root.rglob("*")) if "__pycache__" not in path.parts]
    digest = hashlib.sha256()
    for path in files:
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()
