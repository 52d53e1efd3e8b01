"""Any function as a policy: the way in for what was learned with a library of your own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from posse.adapters.actions import MOTIONS
from posse.numeric import FloatArray
from posse_baselines.policy import BasePolicy, Memory, PolicyError

Function = Callable[[FloatArray], npt.ArrayLike]


class FunctionPolicy(BasePolicy):
    """What :func:`from_function` returns."""

    def __init__(self, function: Function, name: str, message_size: int, discrete_actions: bool) -> None:
        self.name = name
        self.message_size = message_size
        self._function = function
        self._discrete = discrete_actions

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the function's actions, (E, N, 2 + m), and the memory.

        Raises:
            PolicyError: The function returns something of another shape.
        """
        chosen = np.asarray(self._function(observations))
        leading = observations.shape[:2]
        if self._discrete:
            if chosen.shape != leading or chosen.dtype.kind not in "iu":
                raise self._wrong(chosen, f"{leading} of whole numbers")
            chosen = MOTIONS[chosen]
        if chosen.ndim != 3 or chosen.shape[:2] != leading:
            raise self._wrong(chosen, f"{leading} + (2 + message_size,)")
        spoken = memory.scenario.message_size
        silent = 2 + spoken - chosen.shape[2]
        if silent < 0:
            raise self._wrong(chosen, f"{(*leading, 2 + spoken)}")
        actions = np.pad(chosen.astype(np.float32), ((0, 0), (0, 0), (0, silent)))
        return actions, memory

    def _wrong(self, chosen: npt.NDArray[np.generic], wanted: str) -> PolicyError:
        return PolicyError(
            f"the function of policy {self.name!r} returned actions of shape {chosen.shape} "
            f"({chosen.dtype}), wanted {wanted}"
        )


def from_function(
    function: Function, *, name: str | None = None, message_size: int = 0, discrete_actions: bool = False
) -> FunctionPolicy:
    """Return a policy that calls a function, for all that takes a policy.

    Args:
        function: Observations (E, N, F) float32 -> actions (E, N, 2) in [-1, 1], or (E, N, 2 + m).
            It has no memory of earlier steps.
        name: Its name in results; default: the function's.
        message_size: Numbers that it adds to each broadcast, m.
        discrete_actions: Whether it returns numbers (E, N) of
            :data:`posse.adapters.actions.MOTIONS`.

    Raises:
        TypeError: ``function`` cannot be called.
    """
    if not callable(function):
        raise TypeError(f"function={function!r:.80} cannot be called")
    named: str = getattr(function, "__name__", "function") if name is None else name
    return FunctionPolicy(function, named, message_size, discrete_actions)
