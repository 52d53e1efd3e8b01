"""Every command of the README and the manual's pages runs, read from the pages themselves.

A page is followed from top to bottom in an empty folder, its Python and its shell, with the smallest budgets; commands
on Ray only where it is installed, since ``tests/training/cluster`` has them.
"""

import contextlib
import functools
import importlib.util
import io
import re
from pathlib import Path

import pytest
from tests.support.pages import END, PAGES, ROOT, blocks, named, script_of
from tests.support.process import printed

from posse_training.cli import COMMANDS, main

NOT_RUN = {
    "pip install": "it changes the environment: tests/package installs the wheel into an empty one",
    "ray start": "it starts a cluster that outlives the test: tests/training/cluster has one of two nodes",
    "ray stop": "it stops every cluster of this machine",
    "10.0.0.1": "the address of another machine",
    "...": "what the dots stand for is elsewhere on the page",
    "posse export": "onnx is in the recipes' environment: tests/training/test_export.py",
    "class Tracker(Node)": "a listing for ROS 2, which is no Python package",
}
"""Parts of commands and Python that are not run, and why not."""
SHORTER = {
    r"^posse demo$": r"posse demo --episodes 2 --seconds 1",
    r"^posse train .*": r"\g<0> --steps 512 --num-worlds 19 --rollout 16 --minibatch 64 --evaluate-worlds 2",
    r"^posse league .*$": r"\g<0> --generations 1 --target-steps 256 --team-steps 256"
    " --episodes 2 --training num_worlds=24 evaluate_worlds=2",
    "generation-04": "generation-01",
    r"^posse compare (?!.*--scenario).*$": r"\g<0> --scenario smart",
    r"^posse compare .*$": r"\g<0> --episodes 2 --no-figures --planner-episodes 0",
    r"^posse submit .*$": r"\g<0> --episodes 4 --name mine",
    r"^posse verify .*$": r"\g<0> --episodes 4 --seed 3",
    r"^posse tune .*$": r"\g<0> --generations 1 --population 4 --worlds 2 --validation-worlds 2",
    r"^posse (replay|watch .*--page).*$": r"\g<0> --seconds 1",
    r"--seconds \d+": "--seconds 1",
    r"episodes=[\d_]+": "episodes=2",
    r"(evaluate\((?!.*episodes=).*)\)": r"\1, episodes=2)",
    r" (--[a-z-]+)(?: (?!--)\S+)*(?= .*\1 )": "",  # instead of the page's own
    r"(?<!training )num_worlds=[\d_]+": "num_worlds=2",
    r"learn\([\d_]+\)": "learn(64)",
    r"n_steps=\d+, batch_size=\d+": "n_steps=8, batch_size=80",
}
"""Smallest budgets: replacements by regular expression."""
GIVEN = {
    "mypackage/mine.py": "from posse_baselines.policies.simple import Idle as Policy\n",
    "my_targets.py": "class Zigzag:\n    def __new__(cls):\n"
    "        from posse_baselines import load_target\n        return load_target('evader').policy\n",
    "my_policy": "from posse_baselines import load; my_policy = load('pursuit')",
    "choose": "choose = lambda observations: 0 * observations[..., :2]",
    "mask": "import numpy; mask = numpy.array([True, False])",
}
"""What a page leaves to its reader: names of Python, or files."""
FOLLOWED = [page for page in sorted(PAGES) if any("--8<--" not in text for _, _, text in blocks(page))]


@pytest.mark.long
@pytest.mark.parametrize("page", FOLLOWED)
def test_a_page_can_be_followed(page: str, tmp_path: Path) -> None:
    no_ray = importlib.util.find_spec("ray") is None
    script = script_of(page, [*NOT_RUN, *["--ray"] * no_ray], SHORTER, GIVEN)
    (tmp_path / "page.py").write_text(script, encoding="utf-8")
    assert printed("page.py", cwd=tmp_path, seconds=300, BROWSER="true").endswith(f"{END}\n")


@functools.cache
def help_of(command: str) -> str:
    if command not in COMMANDS:
        return ""
    with contextlib.redirect_stdout(io.StringIO()) as shown, pytest.raises(SystemExit, match="0"):
        main([command, "--help"])
    return shown.getvalue()


@pytest.mark.parametrize("page", [page for page in sorted(PAGES) if named(page)])
def test_every_command_that_a_page_names_is_there(page: str) -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for line in named(page):
        program, word, *rest = [*line.split(), ""]
        if program == "posse":
            assert word in COMMANDS, line
            missing = [option for option in rest if re.match("--[a-z]", option) and option not in help_of(word)]
            assert not missing, f"{line}: {missing}"
        elif program == "make":
            assert "=" in word or word in ["", *targets], line
        elif program == "python" and word != "-m":
            assert (ROOT / word).is_file(), line
