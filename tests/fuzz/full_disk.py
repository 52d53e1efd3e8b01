"""Fill the disk at random moments of a command.

Run it for as long as you like::

    python -m tests.fuzz.full_disk --minutes 30 --seed 1

Where the rights are there the disk is a small one in memory (tmpfs) on which so much is left free.
Elsewhere, and in every third case, no file may have more than so many bytes: writing stops in the
middle of it. A command then says so and names the place, leaves no file half written and the old
ones as they were; where there is room again it ends as if nothing had been.
"""

from __future__ import annotations

import atexit
import functools
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.fuzz.campaign import main
from tests.fuzz.commands import COMMANDS, judge_unfinished, prepare, reference
from tests.fuzz.elsewhere import Ended, run

DISK = 16 * 2**20
PAGE = 4096


@functools.cache
def small_disk() -> Path | None:
    """Return the root of a small disk of this process's own; ``None`` without the rights."""
    mount = shutil.which("mount")
    if mount is None or not hasattr(os, "geteuid") or os.geteuid() != 0:
        return None
    root = tempfile.mkdtemp()
    done = subprocess.run(
        [mount, "-t", "tmpfs", "-o", f"size={DISK},mode=0700", "tmpfs", root], capture_output=True, check=False
    )
    if done.returncode:
        Path(root).rmdir()
        return None
    atexit.register(_unmount, root)
    return Path(root)


def _unmount(root: str) -> None:
    subprocess.run(["umount", root], capture_output=True, check=False)
    Path(root).rmdir()


def case(seed: int, number: int) -> None:
    """Give one command less room than it needs, mostly."""
    rng = random.Random(f"{seed} {number}")
    names = list(COMMANDS)
    name = names[number % len(names)]
    share = rng.choice((rng.uniform(0, 0.2), rng.uniform(0, 2.2)))
    size = reference(name).size
    disk = small_disk()
    if disk is None or rng.random() < 1 / 3:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) / "folder"
            prepare(name, folder)
            judge(name, folder, run(COMMANDS[name].first(folder), int(share * size)))
        return
    folder, ballast = disk / "folder", disk / "ballast"
    try:
        prepare(name, folder)
        free = os.statvfs(disk).f_bavail * PAGE
        room = int(share * size) // PAGE * PAGE
        with ballast.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(PAGE, free - room))
        ended = run(COMMANDS[name].first(folder))
        ballast.unlink()
        judge(name, folder, ended)
    finally:
        ballast.unlink(missing_ok=True)
        shutil.rmtree(folder)


def judge(name: str, folder: Path, ended: Ended) -> None:
    """Raise if a command with too little room has not ended well, or cannot be repeated."""
    command, whole = COMMANDS[name], reference(name)
    assert ended.status in ((0,) if command.never_fails else (0, 2)), f"{name}: {ended}"
    assert "Traceback" not in ended.printed, f"{name}: {ended}"
    if ended.status:
        assert str(folder) in ended.printed, f"{name} names no place: {ended}"
        judge_unfinished(name, folder)
        left = [path.name for path in folder.rglob(".posse-*")]
        assert not left, f"{name}: {left}"
        ended = run(command.again(folder))
        assert ended.status == 0, f"{name}: {ended}"
    assert command.left(folder) == whole.left, f"{name}: the results differ"


if __name__ == "__main__":
    if small_disk() is None:
        sys.stdout.write("no rights to mount a disk: files are limited in size instead\n")
    main(__doc__, case)
