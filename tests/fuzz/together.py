"""Two processes at once in one folder, or writing one file.

Run it for as long as you like::

    python -m tests.fuzz.together --minutes 30 --seed 1

Each succeeds, or is refused by an error that names the place; and the result is that of one of
them, bit for bit.
"""

from __future__ import annotations

import random
import tempfile
import time
from pathlib import Path

from tests.fuzz.campaign import main
from tests.fuzz.commands import COMMANDS, prepare, reference
from tests.fuzz.elsewhere import Running, run


def case(seed: int, number: int) -> None:
    """Start one command, and soon after it another."""
    rng = random.Random(f"{seed} {number}")
    names = list(COMMANDS)
    name = names[number % len(names)]
    command, whole = COMMANDS[name], reference(name)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "folder"
        prepare(name, folder)
        second = command.old or rng.choice((command.first, command.again))
        running = [Running(command.first(folder))]
        time.sleep(rng.choice((0.0, rng.uniform(0, 0.2), rng.uniform(0, 1.2 * whole.seconds))))
        running.append(Running(second(folder)))
        ended = [each.ended() for each in running]
        for each in ended:
            assert each.status in (0, 2), f"{name}: {each}"
            assert each.status == 0 or str(folder) in each.printed, f"{name}: {each}"
        assert 0 in [each.status for each in ended], f"{name}: {ended}"
        results = (whole.left, whole.left if command.old is None else whole.old)
        possible = [result for result, each in zip(results, ended, strict=True) if not each.status]
        assert command.left(folder) in possible, f"{name}: neither one's result"
        left = [path.name for path in folder.rglob(".posse-*")]
        assert not left, f"{name}: {left}"
        if command.never_fails:
            again = run(command.first(folder))
            assert again.printed.strip() == "2 of 2 loaded", f"{name}: {again}"


if __name__ == "__main__":
    main(__doc__, case)
