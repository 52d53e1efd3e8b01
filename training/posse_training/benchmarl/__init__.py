"""posse's scenarios as tasks of BenchMARL; needs BenchMARL, which wants a torchrl before 0.12."""

from __future__ import annotations

from posse_training.errors import MissingExtraError

try:
    import benchmarl  # noqa: F401
except ImportError as error:
    raise MissingExtraError(
        f"benchmarl cannot be imported ({error}). It wants a virtual environment of its own: "
        "`make recipes`, from a clone, makes one"
    ) from error

from posse_training.benchmarl.task import PosseTask, PosseTaskClass, register

__all__ = ["PosseTask", "PosseTaskClass", "register"]
