"""Which cluster, and where results are kept until all are there."""

from __future__ import annotations

import contextlib
import math
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from posse_training.errors import ClusterError, SettingsError

WORLDS: Final = 500
"""Worlds of a shard: those that a local evaluation plays at once."""

_PATIENCE: Final = 10.0  # s

RayOption = Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="[ADDRESS]")]
"""Type of the option ``--ray``: without an address, with one, or left out (``None``)."""


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """A Ray cluster.

    Raises:
        SettingsError: A number out of its range.
    """

    address: str | None = None
    """``HOST:PORT``, ``auto``, ``ray://HOST:PORT`` or ``local``; default: the address in
    ``RAY_ADDRESS``, else the cluster that this machine belongs to, else all cores of this
    machine."""
    work: str | Path = Path("runs/cluster")
    """Folder of the shards' results while the work is going on; a killed driver resumes from it."""
    worlds: int = WORLDS
    """Worlds of a shard. With fewer, more workers can take part. By default a shard is what a local
    evaluation plays at once, so that results are the same bit for bit for any policy; with another
    number they are for policies that play each world alone, as all that ship do."""
    attempts: int = 4
    """How many workers may die with one shard before its job fails."""

    def __post_init__(self) -> None:
        for name, most in (("worlds", 100_000), ("attempts", 1_000)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 1 <= value <= most):
                raise SettingsError(f"{name}={value!r} is out of range: 1 to {most:,}")


def check_reachable(address: str | None) -> None:
    """Raise if nothing answers at ``HOST:PORT``; Ray itself says so after minutes.

    Raises:
        ClusterError: Nothing does.
    """
    host, sign, port = (address or "").removeprefix("ray://").rpartition(":")
    if not (sign and port.isdecimal() and int(port) < 2**16):
        return  # "auto", "local" and the like
    try:
        socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
    except OSError as error:
        raise no_cluster(address, error) from error


def no_cluster(address: str | None, error: Exception) -> ClusterError:
    """Return the error of a cluster that cannot be connected to."""
    return ClusterError(
        f"no Ray cluster at {address!r}: {error}. Start one (ray start --head), or leave out the "
        "address to use this machine's cores"
    )


def as_cluster(ray: bool | str | Cluster) -> Cluster | None:
    """Return the cluster of an argument ``ray``; ``None``: this process alone."""
    if isinstance(ray, Cluster):
        return ray
    if isinstance(ray, str):
        return Cluster(address=ray)
    return Cluster() if ray else None


def of_option(given: tuple[str, ...] | None, work: Path) -> Cluster | None:
    """Return the cluster of an option ``--ray``; ``None``: it was left out.

    Raises:
        SettingsError: More than one address.
    """
    if given is None:
        return None
    if len(given) > 1:
        raise SettingsError(
            f"--ray takes one address at most, not {' '.join(given)!r:.100}: put it after the "
            "arguments that have no name"
        )
    return Cluster(address=given[0] if given else None, work=work)


def work_of(out: Path) -> Path:
    """Return the folder, beside ``out``, of the shards' results of what is written there."""
    out = out.resolve()
    return out.with_name(f".{out.name}.work")


@contextlib.contextmanager
def how_to_resume(given: tuple[str, ...] | None) -> Iterator[None]:
    """Print how to resume work on a cluster that the user interrupts."""
    try:
        yield
    except KeyboardInterrupt:
        if given is not None:
            sys.stderr.write("\nto resume: run the same command again\n")
        raise
