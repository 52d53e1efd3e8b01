"""Work of many processes: a call in a process of its own, and jobs that a Ray cluster does in shards of worlds.

A world depends on nothing but its index, and how worlds are cut into shards not on the workers. So the results of a
cluster are those of one process, bit for bit, on processors of the same kind.
"""

import contextlib
import faulthandler
import hashlib
import importlib
import operator
import os
import pickle
import pickletools
import platform
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import cloudpickle
import numpy as np
import numpy.typing as npt

from posse.declarations import users_modules
from posse_baselines.files import replacing
from posse_baselines.registry import is_code
from posse_training.errors import ClusterError, PlayError, TimeLimitError, require
from posse_training.provenance import installed, sources

Arrays = dict[str, npt.NDArray[Any]]
"""Results of some worlds, by name; the first axis runs over the worlds."""

WORK: Final = Path("runs/shards")
"""Folder of finished shards while others are missing."""
RETRIES: Final = 3
"""How often Ray does a call again whose worker died."""
_GRACE: Final = 3.0  # s beyond a time limit, in which a policy may notice it by itself
_PATIENCE: Final = 10.0  # s until an address that does not answer is an error


def cut(count: int, size: int) -> list[range]:
    """Return the shards of ``count`` worlds: ranges of their indices, of ``size`` worlds at most."""
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


def joined(parts: Sequence[Arrays]) -> Arrays:
    """Return arrays whose first axis runs over the worlds of all parts."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def apart(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return ``function(*arguments)``, computed in a process of its own. That is no sandbox.

    Raises:
        TimeLimitError: It took longer than the limit, s; the process was ended.
        PlayError: The process died.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", f"from {__name__} import _answer; _answer()"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            input=cloudpickle.dumps((limit, installed(), users_modules(), function, *arguments)),
            stdout=subprocess.PIPE,
            timeout=limit + _GRACE,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise TimeLimitError(f"it exceeded the time limit of {limit:g} s and was ended") from error
    if not done.stdout:
        raise PlayError(f"its process ended with exit code {done.returncode}")
    value = pickle.loads(done.stdout)  # noqa: S301 (our own process wrote it)
    if isinstance(value, Exception):
        raise value
    return value


def _answer() -> None:
    """Compute what the standard input asks for, and write it, or the error, to the standard output."""
    limit, *call = pickle.load(sys.stdin.buffer)  # noqa: S301 (our parent wrote it)
    with os.fdopen(os.dup(1), "wb") as found, Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)  # what a policy prints is no part of the answer
        # Ends a policy that hangs, also if the parent was killed.
        faulthandler.dump_traceback_later(limit + 2 * _GRACE, exit=True, file=nowhere)
        found.write(cloudpickle.dumps(_work(*call)))
        ending = threading.Timer(_GRACE / 3, os._exit, (0,))  # ends threads that a policy left, too
        ending.daemon = True
        ending.start()


# --- a Ray cluster --------------------------------------------------------------------------------


@contextlib.contextmanager
def connected(ray: bool | str, *, log: bool = False) -> Iterator[None]:
    """Connect to a Ray cluster; a connection that there is already is used and left open.

    Args:
        ray: ``HOST:PORT``, ``auto``, ``ray://HOST:PORT`` or ``local``; ``True``: the address in ``RAY_ADDRESS``, else
            the cluster that this machine belongs to, else all cores of this machine; ``False``: no connection.
        log: Show what the workers print.

    Raises:
        MissingExtraError: Ray is not installed.
        ClusterError: There is no such cluster.
    """
    if ray is False:
        yield
        return
    require("cluster", "ray")
    import ray as cluster

    if cluster.is_initialized():
        yield
        return
    address = ray if isinstance(ray, str) else None
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    try:
        if host and port.isdecimal():  # Ray itself notices only after minutes that nothing answers there
            socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
        cluster.init(address=address, log_to_driver=log, logging_level="warning")
    except (OSError, OverflowError, ValueError, RuntimeError) as error:
        fix = "start one (ray start --head), or leave out the address to use this machine's cores"
        raise ClusterError(f"no Ray cluster at {address!r} ({error}): {fix}") from error
    try:
        yield
    finally:
        cluster.shutdown()


def on_ray(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
    """Yield the index and the result of each call as it finishes, on one core each of the connected cluster.

    A result is an exception if the function raised one, or if the workers of a call died again and again.
    """
    import ray

    task = ray.remote(num_cpus=1, max_retries=RETRIES)(_work)
    modules = users_modules()
    running = {task.remote(installed(), modules, function, *call): k for k, call in enumerate(calls)}
    try:
        while running:
            ready, _ = ray.wait(list(running))
            for k, reference in [(running.pop(reference), reference) for reference in ready]:
                try:
                    yield k, ray.get(reference)
                except ray.exceptions.RayTaskError as error:  # the function or an argument cannot be imported there
                    yield k, ClusterError(f"a worker cannot begin: {' '.join(str(error.cause).split()):.300}")
                except ray.exceptions.RayError as error:
                    why = f"{type(error).__name__}: {' '.join(str(error).split()):.200}"
                    yield k, PlayError(f"{RETRIES + 1} workers died with it; the last one: {why}")
    finally:
        for reference in running:
            ray.cancel(reference, force=True)


def all_on_ray(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Return the results of :func:`on_ray` in the order of the calls; raise one that is an exception."""
    results = dict(on_ray(function, calls))
    for result in results.values():
        if isinstance(result, Exception):
            raise result
    return [results[k] for k in range(len(calls))]


def _work(expected: str, modules: Sequence[str], function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a function, or the exception that it raised: Ray prints those that it is told of.

    Modules with declarations of users are imported first.
    """
    if installed() != expected:
        what = f"node {platform.node()} has {installed()}, and the driver {expected}"
        return ClusterError(f"{what}: install the same on all nodes")
    try:
        for module in modules:
            importlib.import_module(module)
        return function(*arguments)
    except Exception as error:
        return error


class Job(NamedTuple):
    """Work whose shards can be done anywhere, in any order."""

    play: Callable[[range], Arrays]
    """Returns the arrays of a shard."""
    shards: Sequence[range]

    @property
    def folder(self) -> Path:
        """Folder of finished shards; its name is a digest of all that their arrays depend on."""
        call = cloudpickle.dumps(self.play)
        digest = hashlib.sha256(call + installed().encode())
        texts = {text for _, text, _ in pickletools.genops(call) if isinstance(text, str)}
        modules = {text.partition(":")[0] for text in texts if text in sys.modules or is_code(text)}
        for package in sorted({module.partition(".")[0] for module in modules} - sys.stdlib_module_names):
            digest.update(sources(package).encode())
        return WORK / digest.hexdigest()[:24]


@contextlib.contextmanager
def gathered(jobs: Sequence[Job], ray: bool | str, done: Callable[[], object]) -> Iterator[list[Arrays | Exception]]:
    """Do all jobs at once on a Ray cluster; give the joined arrays of each, or the exception that ended it.

    Each finished shard is a file, where the same jobs find it again after an interruption. The files are removed when
    the context ends without an exception. ``done`` is called after each shard that is done or was found.
    """
    with connected(ray):
        import ray as cluster

        folders = [job.folder for job in jobs]
        parts: list[dict[range, Arrays]] = []
        for job, folder in zip(jobs, folders, strict=True):
            files = {shard: folder / f"{shard.start}-{shard.stop}.npz" for shard in job.shards}
            parts.append({shard: dict(np.load(file)) for shard, file in files.items() if file.exists()})
            for _ in parts[-1]:
                done()
        calls = [(k, shard) for k, job in enumerate(jobs) for shard in job.shards if shard not in parts[k]]
        sent = [cluster.put(job.play) for job in jobs]  # to each node once, not with each shard
        failed: dict[int, Exception] = {}
        for call, result in on_ray(operator.call, [(sent[k], shard) for k, shard in calls]):
            k, shard = calls[call]
            if isinstance(result, ClusterError):
                raise result
            if isinstance(result, Exception):
                failed.setdefault(k, result)
            elif k not in failed:
                parts[k][shard] = result
                folders[k].mkdir(parents=True, exist_ok=True)
                with replacing(folders[k] / f"{shard.start}-{shard.stop}.npz") as partial:
                    np.savez(partial, allow_pickle=False, **result)
                done()
    yield [failed.get(k) or joined([parts[k][shard] for shard in job.shards]) for k, job in enumerate(jobs)]
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    with contextlib.suppress(OSError):  # others are in it
        os.removedirs(WORK)
