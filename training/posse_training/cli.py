"""The command line: ``posse train | tune | compare | watch | replay | ...``.

Each command is imported when it is called: listing the scenarios does not import torch.
"""

import argparse
import difflib
import importlib
import io
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, Final

from posse_training.errors import UserError

GROUPS: Final = {
    "See what there is": {
        "demo": ("how a script, a learned team and the planner do; a replay and a film", "demo"),
        "scenarios": ("list the scenarios, or the settings of one", "commands.lists:scenarios"),
        "policies": ("list the policies", "commands.lists:policies"),
        "watch": ("show policies in a window, as a page or a film", "commands.watch"),
        "play": ("drive the target, or a tracker, in a window", "play"),
    },
    "Make a team and measure it": {
        "train": ("train a team", "commands.train"),
        "compare": ("score policies on the same worlds", "compare.compare"),
        "replay": ("write a replay of teams as a web page", "commands.replay"),
    },
    "Go further": {
        "tune": ("tune the settings of a scripted team", "tune"),
        "league": ("train teams and targets in turns against each other", "league"),
        "record": ("record episodes as a data set for offline learning", "datasets"),
        "export": ("write the network of a learned policy as ONNX", "commands.export"),
        "reproduce": ("repeat the paper's experiments", "reproduce.reproduce"),
        "submit": ("play for the leaderboard and write the claim", "leaderboard:submit_command"),
        "verify": ("check a claim on worlds of a fresh seed", "leaderboard:verify_command"),
    },
}
"""Commands in the order in which they are met: of each a summary, and the module whose ``main``, or ``:function``,
takes its arguments."""
RESUMED: Final = ("train", "tune", "league")
"""Commands that go on where they were interrupted."""
COMMANDS: Final = {name: command for group in GROUPS.values() for name, command in group.items()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit status.

    0: success; 1: part of the work failed, as the output says; 2: an error that the user can correct; 130: interrupted.
    """
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="surrogateescape")  # names of files may be no UTF-8
    try:
        try:
            return _run(arguments)
        finally:
            if sys.stdout is not None:  # closed, as a daemon's
                sys.stdout.flush()
    except BrokenPipeError:  # what reads the output, such as head, has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _run(arguments: Sequence[str] | None) -> int:
    parser = argparse.ArgumentParser("posse", "posse COMMAND ... [--import MODULE]", add_help=False, allow_abbrev=False)
    parser.add_argument("--import", dest="modules", action="append", default=[])
    known, given = parser.parse_known_args(arguments)
    if "" not in sys.path:  # the current folder, for modules of the user's own
        sys.path.append("")
    for module in known.modules:
        try:
            importlib.import_module(module)
        except (Exception, SystemExit) as error:  # whatever the module raises
            why = f"{type(error).__name__}: {error}; name a module that is installed, or in this folder"
            print(f"posse: --import {module}: {why}", file=sys.stderr)
            return 2
    if not given or given[0] in ("-h", "--help"):
        print(_usage())
        return 0
    if given[0] == "--version":
        print(f"posse {importlib.import_module('posse').__version__}")
        return 0
    name, rest = given[0], given[1:]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name[:80], COMMANDS, n=1)
        hint = f": did you mean {near[0]!r}?" if near else ""
        print(f"posse: unknown command {name!r:.80}{hint}\n\n{_usage()}", file=sys.stderr)
        return 2
    module, _, function = COMMANDS[name][1].partition(":")
    try:
        options = [word.partition("=")[0].replace("_", "-") for word in rest if word.startswith("--")]
        bare = [option.replace("--no-", "--", 1) for option in options]
        for option in bare:
            if bare.count(option) > 1:
                raise UserError(f"{option} is given twice: give it once, with all its values behind it")
        run: Callable[[list[str]], Any] = getattr(
            importlib.import_module(f"posse_training.{module}"), function or "main"
        )
        return run(rest) or 0
    except KeyboardInterrupt:
        resumes = "; the same command resumes it" * (name in RESUMED)
        print(f"\nposse {name}: interrupted{resumes}", file=sys.stderr)
        return 130
    except Exception as error:
        from posse import DeclarationError, ScenarioError
        from posse_baselines import PolicyError

        told = (UserError, ScenarioError, DeclarationError, PolicyError, OSError)
        if isinstance(error, BrokenPipeError) or not isinstance(error, told):
            raise
        print(f"posse {name}: {error}", file=sys.stderr)
        return 2


def _usage() -> str:
    lines = ["usage: posse COMMAND ... [--import MODULE]", ""]
    for group, commands in GROUPS.items():
        lines += [f"{group}:", *(f"  {name:<11} {summary}" for name, (summary, _) in commands.items()), ""]
    lines += ["--import MODULE first imports a module of your own declarations, from this folder too"]
    return "\n".join([*lines, "posse COMMAND --help lists its arguments"])


if __name__ == "__main__":
    sys.exit(main())
