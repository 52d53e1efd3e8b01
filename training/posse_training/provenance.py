"""What results depend on: the commit, the versions and the sources."""

import functools
import hashlib
import importlib.util
import platform
import subprocess
import sys
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Final

import posse
from posse_baselines.registry import is_code

_SUFFIXES: Final = (".py", ".json", ".safetensors", ".toml")


def commit() -> str | None:
    """Return the commit of the sources, with ``+`` if they have changes; ``None``: unknown."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", *arguments], cwd=here, capture_output=True, text=True, check=True, timeout=10)
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", Path(__file__).name)  # else it is installed within another repository
        # Changes of pages and results do not count.
        sources = [f":/{root}" for root in ("envs", "baselines", "training")]
        changed = git("status", "--porcelain", "--", *sources, ":(exclude,top)**/shipped/*")
        return git("rev-parse", "--short=12", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


def software(*packages: str) -> dict[str, str]:
    """Return the versions of posse, Python and some packages."""
    ours = {"posse": posse.__version__, "python": platform.python_version()}
    return ours | {name: version(name) for name in packages}


@functools.cache
def installed() -> str:
    """Return the versions that the numbers of an episode depend on, and a digest of posse's sources."""
    ours = "".join(map(sources, ("posse", "posse_baselines", "posse_training")))
    versions = software("numpy", "numba", "llvmlite") | {"sources": hashlib.sha256(ours.encode()).hexdigest()[:12]}
    return ", ".join(f"{name} {value}" for name, value in versions.items())


def digests(names: Iterable[str]) -> dict[str, str]:
    """Return ``digest of NAME`` of each that is a file, or ``module:WHAT`` and loaded: a run goes on with the same."""
    loaded = {name: getattr(sys.modules[name.split(":")[0]], "__file__", "") for name in names if is_code(name)}
    files = {name: Path(loaded.get(name, name) or "") for name in names}
    contents = {name: file.read_bytes() for name, file in files.items() if file.is_file()}
    return {f"digest of {name}": hashlib.sha256(content).hexdigest()[:12] for name, content in contents.items()}


@functools.cache
def sources(package: str) -> str:
    """Return a digest of the files of a package, or of a module's and those beside it; empty: it has none."""
    spec = None if package == "__main__" else importlib.util.find_spec(package)
    if spec is None or not (spec.has_location or spec.submodule_search_locations):
        return ""
    inside = spec.submodule_search_locations
    roots = map(Path, inside) if inside else [Path(spec.origin or "").parent]
    files = {file for root in roots for file in root.glob("**/*" if inside else "*") if file.suffix in _SUFFIXES}
    digest = hashlib.sha256(package.encode())
    for file in sorted(files):
        digest.update(f"{file.name}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
