"""A page of the README or the manual as a script: its Python and the lines of its shell, in order."""

import contextlib
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from posse_training.cli import main

ROOT = Path(__file__).parents[2]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}
PAGES |= {name: (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "CONTRIBUTING.md")}
PROGRAMS = ("posse", "make", "python", "pip", "ray")
SHIPPED = ROOT / "baselines/posse_baselines/shipped"
FENCE = re.compile(r"^( *)```([^\n]*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`((?:posse|make|python) [^`]+)`")


def shell_lines(text: str) -> list[str]:
    """Return the commands of a block, or none if it is no shell's."""
    text = text.replace("\\\n", " ")
    lines = [line.removeprefix("$ ").partition("  #")[0].strip() for line in text.splitlines() if line.strip()]
    return lines if lines and all(line.startswith(PROGRAMS) for line in lines) else []


def blocks(page: str) -> Iterator[tuple[str, str | None, str]]:
    """Yield the blocks of a page: "python" or "shell", the title, and the text or one command."""
    for _, info, body in FENCE.findall(PAGES[page]):
        text, title = textwrap.dedent(body), re.search(r'title="(.+?)"', info)
        if "python" in info:
            yield "python", title and title[1], text
        else:
            assert shell_lines(text) or info not in ("console", "sh", "bash"), f"{page}: unknown program in {text!r}"
            yield from (("shell", None, line) for line in shell_lines(text))


def named(page: str) -> set[str]:
    """Return every command that a page names, in its blocks or its sentences."""
    inline = {" ".join(command.split()) for command in _INLINE.findall(FENCE.sub("", PAGES[page]))}
    return inline | {text for kind, _, text in blocks(page) if kind == "shell"}


def script_of(page: str, not_run: Iterable[str], shorter: Mapping[str, str], given: Mapping[str, str]) -> str:
    """Return a page as a script.

    Args:
        page: Its name.
        not_run: Parts of commands, of lines of Python, or of the first lines of its blocks, that are left out.
        shorter: Replacements by regular expression, in commands and Python.
        given: What the page leaves to its reader: names of Python, or files, and their text.
    """
    parts = ["from tests.support.pages import END, MODULES, close_windows, provide, sh, write", "close_windows()"]
    for name, text in given.items():
        parts.append(f"write({name!r}, {text!r})" if "." in name else text)
    for kind, title, text in blocks(page):
        first, *others = text.splitlines()
        if "--8<--" in first or any(part in first for part in not_run):
            continue
        text = "\n".join([first, *(line for line in others if not any(part in line for part in not_run))])
        for pattern, replacement in shorter.items():
            text = re.sub(pattern, replacement, text, flags=re.MULTILINE)
        parts += [f"provide({name!r})" for name in re.findall(r"[\w./-]+\.safetensors", text)]
        if title is not None:
            name = Path(title).stem
            parts.append(f"write({title!r}, {text!r})\nimport {name}\nMODULES.append({name!r})")
        else:
            parts.append(text if kind == "python" else f"sh(*{shlex.split(text)!r})")
    return "\n".join([*parts, "print(END)"]) + "\n"


def write(name: str, text: str) -> None:
    """Write a file of the reader."""
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


PROVIDED: list[Path] = []


def provide(name: str) -> None:
    """Let the reader have a policy file: a shipped one."""
    if not Path(name).exists():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(SHIPPED / ("targets/evader.safetensors" if "target" in name else "learned-smart.safetensors"), name)
        PROVIDED.append(Path(name))


END = "followed to the end"
MODULES: list[str] = []
"""Names of the modules that a page has its reader write, which are imported."""


def sh(program: str, *words: str) -> None:
    """Run a command of a page; make only says what it would do, since it installs everything.

    It runs in this process, which has imported what it needs, unless a command would find the reader's modules there.
    """
    while words[:1] == ("train",) and PROVIDED:  # which does not write where files of no run are
        PROVIDED.pop().unlink()
    if program == "posse" and not MODULES:
        assert not main(list(words)), words
        return
    code = f"import sys; from {__name__} import close_windows, main; close_windows(); sys.exit(main(sys.argv[1:]))"
    commands = {
        "make": ["make", "--dry-run", "--directory", str(ROOT), *words],
        "posse": [sys.executable, "-c", code, *words],
        "python": [sys.executable, *(str(ROOT / word) if word.endswith(".py") else word for word in words)],
    }
    subprocess.run(commands[program], check=True)


def close_windows() -> None:
    """From now on close every window after half a second, as a reader would some time."""

    def close() -> None:
        while True:
            time.sleep(0.5)
            pygame: Any = sys.modules.get("pygame")
            with contextlib.suppress(AttributeError, RuntimeError):  # missing, half imported, or without a window
                pygame.event.post(pygame.event.Event(pygame.QUIT))

    threading.Thread(target=close, daemon=True).start()
