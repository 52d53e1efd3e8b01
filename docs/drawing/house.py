"""Draws docs/media/house.svg: the rooms of the packages with purpose and size of each.

    python docs/drawing/house.py

Purposes (the first paragraph of a room's docstring) and sizes are read from the sources. A room of
``posse`` imports only rooms below it, which tests/test_imports.py checks.
"""

import ast
import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

ROOT = Path(__file__).parents[2]
SOURCES = {"posse_training": "training", "posse_baselines": "baselines", "posse": "envs"}
COLOURS = {"posse_training": "#d5e8f0", "posse_baselines": "#e8e3f1", "posse": "#fbe8cf"}
# Rooms from top to bottom.
LINES = (
    ("posse_training.cli",),
    ("posse_training.commands", "posse_training.leaderboard"),
    ("posse_training.play", "posse_training.film", "posse_training.league"),
    ("posse_training.datasets", "posse_training.tune", "posse_training.reproduce"),
    ("posse_training.train", "posse_training.replay", "posse_training.compare"),
    ("posse_training.torchrl", "posse_training.evaluation"),
    ("posse_baselines.learned", "posse_baselines.policies"),
    ("posse_baselines.tuned",),
    ("posse_baselines.ddcs",),
    ("posse_baselines.laws",),
    ("posse.adapters",),
    ("posse.rendering",),
    ("posse.engine",),
    ("posse.signals",),
    ("posse.rules",),
    ("posse.scenarios",),
    ("posse.numeric",),
)
PACKAGES = [line[0].partition(".")[0] for line in LINES]
PACKAGE_BEGINS = {PACKAGES.index(name): name for name in SOURCES}
WIDTH, HEIGHT, STEP, GAP = 8.0, 0.78, 0.95, 0.16


def room_of(module: str) -> str:
    """Return the room of a module: its package and the first folder below."""
    parts = module.split(".")
    return ".".join(parts[:2]) if len(parts) > 1 else module


def modules() -> dict[str, Path]:
    """Return every module by its dotted name."""
    found = {}
    for package, source in SOURCES.items():
        for path in sorted((ROOT / source / package).rglob("*.py")):
            parts = path.relative_to(ROOT / source).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def purpose_of(room: str) -> str:
    """Return the first paragraph of a room's docstring."""
    package, _, name = room.partition(".")
    folder = ROOT / SOURCES[package] / package / name
    source = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    if not source.exists():
        return ""
    docstring = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return " ".join(docstring.split("\n\n")[0].replace("``", "").split())


def rooms_in(room: str) -> str:
    """Return the names of the folders of a room that contain modules."""
    package, _, name = room.partition(".")
    folder = ROOT / SOURCES[package] / package / name
    return ", ".join(path.parent.name for path in sorted(folder.glob("*/__init__.py")))


def size_of(room: str) -> str:
    """Return the number of files and lines of a room."""
    paths = [path for module, path in modules().items() if room_of(module) == room]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)
    return f"{len(paths)} file{'s' * (len(paths) > 1)}, {lines:,} lines"


def draw() -> None:
    """Draw the picture."""
    plt.rcParams["svg.hashsalt"] = "posse"  # the same sources give the same file
    figure, axes = plt.subplots(figsize=(10, 11.2))
    for row, rooms in enumerate(LINES):
        width = (WIDTH - GAP * (len(rooms) - 1)) / len(rooms)
        for column, room in enumerate(rooms):
            x, y = column * (width + GAP), -STEP * row
            package, _, name = room.partition(".")
            axes.add_patch(
                FancyBboxPatch(
                    (x, y),
                    width,
                    HEIGHT,
                    boxstyle="round,pad=0.02",
                    facecolor=COLOURS[package],
                    edgecolor="#334455",
                    linewidth=0.9,
                )
            )
            purpose = textwrap.fill(purpose_of(room), int(width * 13.5), max_lines=2, placeholder=" ...")
            axes.text(x + 0.1, y + HEIGHT - 0.1, name, va="top", fontsize=10, fontweight="bold")
            axes.text(
                x + width - 0.1, y + HEIGHT - 0.12, size_of(room), ha="right", va="top", fontsize=7.5, color="#445566"
            )
            axes.text(x + 0.1, y + HEIGHT - 0.34, purpose, va="top", fontsize=8)
            if inner := rooms_in(room):
                axes.text(
                    x + width - 0.1,
                    y + 0.06,
                    f"contains {inner}",
                    ha="right",
                    va="bottom",
                    fontsize=7.5,
                    color="#445566",
                )
        if PACKAGE_BEGINS.get(row):
            axes.text(-0.15, y + HEIGHT, PACKAGE_BEGINS[row], ha="right", va="top", fontsize=11)
    bottom = -STEP * (len(LINES) - 1)
    axes.add_patch(
        FancyArrowPatch(
            (WIDTH + 0.35, HEIGHT), (WIDTH + 0.35, bottom), arrowstyle="-|>", mutation_scale=16, color="#334455"
        )
    )
    axes.text(WIDTH + 0.5, bottom / 2, "imports", rotation=270, va="center", fontsize=10)
    axes.set_xlim(-2.1, WIDTH + 0.9)
    axes.set_ylim(bottom - 0.1, HEIGHT + 0.1)
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(ROOT / "docs/media/house.svg", metadata={"Date": None})


if __name__ == "__main__":
    draw()
