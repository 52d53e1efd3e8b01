"""Damaged and forged files: policies, checkpoints, settings of runs, and replay pages.

Run it for as long as you like::

    python -m tests.fuzz.forged --minutes 30 --seed 1

Bytes are flipped, cut and overwritten; or the contents are changed and the digest is written
anew, as by somebody who means harm. A file is refused by a named error, or taken for what it says:
policies then play actions within the bounds, trainings go on, pages can be read. Nothing is
imported, run, or written elsewhere.
"""

from __future__ import annotations

import copy
import functools
import json
import random
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from safetensors import safe_open
from tests.fuzz.campaign import main
from tests.support.learned import any_policy, policy_for
from tests.support.replays import short
from tests.support.runs import quiet, small

import posse
from posse_baselines import PolicyError
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.policy_file import write_policy_file
from posse_training.errors import OWN
from posse_training.replay import read_replay, write_replay
from posse_training.replay.episode import join
from posse_training.runs.saved.checkpoint import read_checkpoint, write_checkpoint
from posse_training.runs.train import resume, train

REFUSED: Final = (*OWN, PolicyError, posse.ScenarioError)
STEPS: Final = 320
PLANTED: Final = "tests.support.planted"
"""A module that is imported only if a file's text is taken for code."""
IMPORTED: Final = ("import", PLANTED)
OF_KERNELS: Final = ("numba", "posse", "copyreg", "numpy", "builtins", "types", "llvmlite")
"""Modules that the kernel cache names, which is code."""
VALUES: Final[tuple[Any, ...]] = (
    None,
    True,
    "",
    "x",
    "\0",
    "x" * 5000,
    0,
    -1,
    1,
    2,
    255,
    2**31,
    2**63,
    10**400,
    0.5,
    -1.5,
    1e300,
    float("nan"),
    float("inf"),
    [],
    {},
    [[]],
    [1, 2],
    {"a": 1},
    [0.5] * 1000,
    f"{PLANTED}:Planted",
    "../../planted",
    "/etc/passwd",
    "planner",
    "ddcs-distributed",
)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Return bytes of which some are changed, cut off or added."""
    made = bytearray(content)
    way = rng.randrange(5)
    if way == 0:
        for _ in range(rng.choice((1, 1, 8, 100))):
            made[rng.randrange(len(made))] ^= 1 << rng.randrange(8)
    elif way == 1:
        del made[rng.randrange(len(made)) :]
    elif way == 2:
        first = rng.randrange(len(made))
        made[first : first + 64] = rng.randbytes(64)
    elif way == 3:
        made += rng.randbytes(rng.randrange(1, 100))
    else:
        first, end = sorted((rng.randrange(len(made)), rng.randrange(len(made))))
        del made[first : min(end, first + 100)]
    return bytes(made)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return every place in a nest of dictionaries and lists."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value[:4])
    return [path, *(place for key, item in items for place in places(item, (*path, key)))]


def forged(value: Any, rng: random.Random) -> Any:
    """Return JSON with another value in one place or more, or something missing or added."""
    made = copy.deepcopy(value)
    for _ in range(rng.choice((1, 1, 1, 3))):
        place = rng.choice(places(made)[1:] or [()])
        if not place:
            return rng.choice(VALUES)
        inner = made
        for key in place[:-1]:
            inner = inner[key]
        if rng.random() < 0.2:
            del inner[place[-1]]
        else:
            old = inner[place[-1]]
            numeric = isinstance(old, (int, float)) and rng.random() < 0.5
            inner[place[-1]] = old * rng.choice((-1, 2, 0.5, 10**6)) if numeric else rng.choice(VALUES)
        if isinstance(inner, dict) and rng.random() < 0.1:
            inner[rng.choice(("", "x" * 5000, "new"))] = rng.choice(VALUES)
    return made


def forged_arrays(arrays: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return arrays one of which has other numbers, another shape or type, or is gone."""
    made, name = dict(arrays), rng.choice(sorted(arrays))
    array, way = np.array(arrays[name]), rng.randrange(6)
    if way == 0:
        del made[name]
    elif way == 1:
        made[name] = array.reshape(-1)[: rng.randrange(array.size + 1)]
    elif way == 2:
        made[name] = array.astype(rng.choice((np.float64, np.int64, np.uint8, np.float16)))
    elif way == 3 and array.size:
        flat = array.reshape(-1)
        extreme: tuple[Any, ...] = (np.nan, np.inf, 3e38, -3e38, 0) if array.dtype.kind == "f" else (0, 1, -1)
        with np.errstate(all="ignore"):
            flat[rng.randrange(flat.size)] = np.array(rng.choice(extreme)).astype(array.dtype)
        made[name] = flat.reshape(array.shape)
    elif way == 4:
        raw = bytearray(array.tobytes())
        for _ in range(min(len(raw), rng.choice((1, 20)))):
            raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        made[name] = np.frombuffer(bytes(raw), array.dtype).reshape(array.shape)
    else:
        made[f"{name}.more"] = array
    return made


# Each kind of file: whole ones are made once, a case forges one and uses it.


@functools.cache
def _folder() -> Path:
    kept = tempfile.TemporaryDirectory()
    _KEPT.append(kept)
    return Path(kept.name)


_KEPT: list[Any] = []


def _plays(policy: LearnedPolicy) -> None:
    batch = posse.batch("smart", 3, horizon=4, settle_time=0.1, message_size=policy.message_size)
    observations, memory = batch.reset(), policy.begin(batch.layout, 3)
    for _ in range(4):
        actions, memory = policy.act(observations, memory)
        assert np.isfinite(actions).all()
        assert (np.abs(actions) <= 1).all()
        observations, *_ = batch.step(actions)


def a_policy(folder: Path, rng: random.Random) -> None:
    path = folder / "mine.safetensors"
    whole = rng.choice((any_policy(), policy_for(posse.ObservationLayout(posse.get_scenario("smart")), "plain")))
    whole.save(path)
    if rng.random() < 0.4:
        path.write_bytes(damaged(path.read_bytes(), rng))
    else:
        with safe_open(path, framework="numpy") as file:
            description = json.loads(file.metadata()["posse-policy"])
        tensors = whole.network.tensors()
        if rng.random() < 0.5:
            description = forged(description, rng)
        else:
            tensors = forged_arrays(tensors, rng)
        write_policy_file(path, tensors, description)
    _plays(LearnedPolicy.from_file(path))


@functools.cache
def _run(algorithm: str) -> Path:
    folder = _folder() / algorithm
    train(small(folder, algorithm, steps=STEPS), console=quiet())
    return folder


def a_checkpoint(folder: Path, rng: random.Random) -> None:
    shutil.copytree(_run(rng.choice(("ppo", "sac"))), folder, dirs_exist_ok=True)
    path = folder / "checkpoint.safetensors"
    if rng.random() < 0.3:
        path.write_bytes(damaged(path.read_bytes(), rng))
    else:
        arrays, state = read_checkpoint(folder)
        if rng.random() < 0.6:
            state = forged(state, rng)
        else:
            arrays = forged_arrays(arrays, rng)
        write_checkpoint(folder, arrays, state)
    resume(folder, console=quiet(), steps=STEPS + rng.choice((0, 80)))


def some_settings(folder: Path, rng: random.Random) -> None:
    shutil.copytree(_run("ppo"), folder, dirs_exist_ok=True)
    path = folder / "settings.json"
    if rng.random() < 0.3:
        path.write_bytes(damaged(path.read_bytes(), rng))
    else:
        path.write_text(json.dumps(forged(json.loads(path.read_text()), rng)))
    # What is forged may ask for a long training, which is no fault: it is only begun.
    from posse_training.runs.settings import read_settings
    from posse_training.runs.train import check_before

    check_before(read_settings(path))


@functools.cache
def _page() -> tuple[str, str, str, str]:
    """Return what a page consists of: before the header, the header, up to the data, the rest."""
    path = write_replay(short("constant"), _folder() / "page.html")
    text = path.read_text()
    first, second = 'id="header">', 'id="data">'
    header = text.index(first) + len(first)
    end = text.index("</script>", header)
    data = text.index(second) + len(second)
    return text[:header], text[header:end], text[end:data], text[data:]


def a_page(folder: Path, rng: random.Random) -> None:
    path = folder / "page.html"
    before, header, between, data = _page()
    way = rng.randrange(3)
    if way == 0:
        made = damaged("".join((before, header, between, data)).encode(), rng)
    elif way == 1:
        made = (before + json.dumps(forged(json.loads(header), rng)) + between + data).encode()
    else:
        letters, rest = data.split("</script>", 1)
        text = damaged(letters.encode(), rng).decode(errors="replace")
        made = (before + header + between + text + "</script>" + rest).encode()
    path.write_bytes(made)
    write_replay(join([read_replay(path)]), folder / "again.html")


KINDS: Final[tuple[Callable[[Path, random.Random], None], ...]] = (
    a_policy,
    a_policy,
    a_page,
    some_settings,
    a_checkpoint,
)


@functools.cache
def _watched() -> list[str]:
    """Return a list to which whatever a file must not cause is added, from now on."""
    seen: list[str] = []
    bad = ("os.system", "os.exec", "os.posix_spawn", "os.spawn", "subprocess.Popen", "pickle.find_class")

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        harmless = event == "pickle.find_class" and arguments[0].startswith(OF_KERNELS)
        if _WATCHING and not harmless and (event in bad or (event, arguments[0]) == IMPORTED):
            seen.append(f"{event} {arguments!r:.200}")

    sys.addaudithook(hook)
    return seen


_WATCHING: list[bool] = []


def case(seed: int, number: int) -> None:
    """Forge one file, and use it."""
    rng = random.Random(f"{seed} {number}")
    forge = KINDS[number % len(KINDS)]
    seen = _watched()
    if forge in (a_checkpoint, some_settings):
        _run("ppo"), _run("sac")
    with tempfile.TemporaryDirectory() as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        beside = Path(temporary)
        folder = beside / "folder"
        folder.mkdir()
        _WATCHING.append(True)
        try:
            forge(folder, rng)
        except REFUSED as error:
            message = str(error)
            assert 0 < len(message) <= 2000, f"{forge.__name__}: {message[:500]}"
        finally:
            _WATCHING.clear()
        assert [path.name for path in beside.iterdir()] == ["folder"], "written elsewhere"
    found, seen[:] = list(seen), []
    found = [event for event in found if "git" not in event]  # the commit on a policy's card
    assert not found, f"{forge.__name__}: {found}"


if __name__ == "__main__":
    main(__doc__, case)
