"""Kill commands at random moments (kill -9), then resume or repeat them.

Run it for as long as you like::

    python -m tests.fuzz.kills --minutes 30 --seed 1

After a kill every file is whole, and the old result or the new one is there. After the last run the
result equals that of a command that was never killed, bit for bit.
"""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

from tests.fuzz.campaign import main
from tests.fuzz.commands import COMMANDS, judge_unfinished, prepare, reference
from tests.fuzz.elsewhere import Running, run

MOST_KILLS = 3


def case(seed: int, number: int) -> None:
    """Kill one command up to three times."""
    rng = random.Random(f"{seed} {number}")
    names = list(COMMANDS)
    name = names[number % len(names)]
    command, whole = COMMANDS[name], reference(name)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "folder"
        prepare(name, folder)
        arguments = command.first(folder)
        for _ in range(rng.randint(1, MOST_KILLS)):
            running = Running(arguments)
            if not running.wait(rng.uniform(0, 1.1 * whole.seconds)):
                running.kill()
            ended = running.ended()
            assert ended.status in (0, -9), f"{name}: {ended}"
            if ended.status == 0:
                break
            judge_unfinished(name, folder)
            arguments = command.again(folder)
        else:
            ended = run(arguments)
            assert ended.status == 0, f"{name}: {ended}"
        assert command.left(folder) == whole.left, f"{name}: the results differ"


if __name__ == "__main__":
    main(__doc__, case)
