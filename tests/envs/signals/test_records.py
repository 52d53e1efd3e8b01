"""Records are read by name: another order of fields changes nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import posse

GAME = """
import hashlib, numpy, posse
digest = hashlib.sha256()
for name, settings in (("field", {}), ("constant", {"target_motion": "agent"})):
    batch = posse.batch(name, 2, num_trackers=3, **settings)
    digest.update(batch.reset(seed=1).tobytes())
    for _ in range(4):
        digest.update(batch.step(numpy.full(batch.action_shape, 0.5))[0].tobytes())
print(digest.hexdigest())
"""


def play(folder: Path, file: str = "", one: str = "", other: str = "") -> subprocess.CompletedProcess[str]:
    """Play with a copy of posse in which two fields have changed places."""
    copy = folder / "posse"
    shutil.copytree(Path(posse.__file__).parent, copy)
    if file:
        text = (copy / file).read_text(encoding="utf-8")
        assert text.count(one) == text.count(other) == 1
        exchanged = text.replace(one, "HERE").replace(other, one).replace("HERE", other)
        (copy / file).write_text(exchanged, encoding="utf-8")
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", GAME],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def as_it_is(tmp_path_factory: pytest.TempPathFactory) -> str:
    done = play(tmp_path_factory.mktemp("as_it_is"))
    assert done.returncode == 0, done.stderr
    return done.stdout


STATE, VIEWS = "rules/state.py", "signals/views.py"


@pytest.mark.parametrize(
    ("file", "one", "other"),
    [
        (STATE, '("per_speed", _F)', '("per_turn_rate", _F)'),  # of a tracker
        (STATE, "    max_speed: Lanes", "    max_turn_rate: Lanes"),  # of a block of eight
        (STATE, '("split", _I)', '("index", np.int64)'),  # of a world
        (VIEWS, "    x: Lanes\n", "    y: Lanes\n"),  # of a view
        (VIEWS, "    distance: Lanes\n", "    ahead: Lanes\n"),  # of a team-mate
    ],
)
def test_another_order_changes_nothing(file: str, one: str, other: str, as_it_is: str, tmp_path: Path) -> None:
    done = play(tmp_path, file, one, other)
    assert done.stdout == as_it_is, done.stderr
