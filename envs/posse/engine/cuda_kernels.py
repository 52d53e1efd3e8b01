"""The kernels of a GPU: one thread steps one world.

Imported only for ``device="cuda"``. With ``NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1`` numba
simulates the device in plain Python, slowly, for tests on machines without a GPU.
"""

from __future__ import annotations

import functools
import importlib.util
from typing import Any, Final

import numba
import numpy as np
import numpy.typing as npt

from posse.engine.kernels import LOOK, MOST_ACTION, START, Results, Tables, advance_worlds, prepare
from posse.engine.scratch import SCRATCH_FOR_ONE
from posse.numeric import BoolArray, FloatArray, Records
from posse.rules.declared import Rules
from posse.rules.state import WorldArrays
from posse.signals.parts import Parts, Sums, Writers, rules_for, sums_for, writers_for

CONFIG: Final[Any] = numba.config

if not CONFIG.ENABLE_CUDASIM and importlib.util.find_spec("numba_cuda") is None:
    raise ImportError("device='cuda' needs the package numba-cuda, which is not installed: pip install 'posse[cuda]'")

import numba.cuda  # noqa: E402 (after the check: older versions of numba include numba.cuda)

cuda: Final[Any] = numba.cuda
SIMULATED: Final = bool(CONFIG.ENABLE_CUDASIM)

DeviceArray = Any
"""numba's device array. It has ``__cuda_array_interface__``, so that torch, CuPy and JAX take it
without a copy (``torch.as_tensor(array, device="cuda")``), and ``copy_to_host()``."""

THREADS: Final = 32
"""Threads per block. Blocks share nothing, so the smallest size spreads worlds best."""

# Reported by the kernels: the flat position of the first action outside [-1, 1], the first world
# that waits for a reset, and the number of worlds whose episode is over.
BAD_ACTION: Final = 0
WAITING: Final = 1
OVER: Final = 2
NONE: Final = 2**62
NOTHING: Final = np.array([NONE, NONE, 0], np.int64)

_ONE: Final = np.float32(1.0)


@cuda.jit  # type: ignore[untyped-decorator]
def check_actions(
    world: Records, actions: FloatArray, clipped: FloatArray, report: DeviceArray, disabled: bool
) -> None:
    """Clip actions outside [-1, 1] by rounding, and write them to ``clipped``.

    Report actions farther out and, with autoreset disabled, worlds that are over.
    """
    e = cuda.grid(1)
    if e == 0:
        report[OVER] = 0
    if e < len(world):
        if disabled and world[e].over != 0:
            cuda.atomic.min(report, WAITING, e)
        rows, width = actions.shape[1], actions.shape[2]
        for i in range(rows):
            for k in range(width):
                action = actions[e, i, k]
                if action >= -MOST_ACTION and action <= MOST_ACTION:
                    clipped[e, i, k] = min(max(action, -_ONE), _ONE)
                else:
                    cuda.atomic.min(report, BAD_ACTION, (e * rows + i) * width + k)


@functools.cache
def stepping(parts: Parts) -> Any:
    """Return the kernel that steps worlds."""
    own, fixed, mate, reward, target_reward, empty, width, mate_width = writers_for(parts)
    draw_motion, set_goal, sees, measure = rules_for(parts)
    clear_sums, add_to_sums = sums_for(parts)

    @cuda.jit  # type: ignore[untyped-decorator]
    def advance(
        tables: Tables,
        worlds: WorldArrays,
        actions: FloatArray,
        results: Results,
        score: FloatArray,
        orders: npt.NDArray[np.uint8],
        report: DeviceArray,
    ) -> None:
        """Execute the order of each world, unless an error was reported."""
        e = cuda.grid(1)
        if e < len(worlds.world) and report[BAD_ACTION] == NONE and report[WAITING] == NONE:
            scratch = cuda.local.array(1, SCRATCH_FOR_ONE)
            if SIMULATED:
                scratch[:] = 0  # suppress warnings for unused lanes
            s = scratch[0]
            writers = Writers(own, fixed, mate, reward, target_reward, empty, width, mate_width)
            rules = Rules(draw_motion, set_goal, sees, measure)
            sums = Sums(clear_sums, add_to_sums)
            prepare(tables, worlds, writers, s)
            over = advance_worlds(e, 1, tables, worlds, actions, results, orders, rules, sums, writers, s)
            results.flags[2, e] = over
            score[e] = worlds.world[e].score
            if over:
                cuda.atomic.add(report, OVER, 1)

    return advance


@cuda.jit  # type: ignore[untyped-decorator]
def choose_worlds(
    world: Records,
    mask: BoolArray,
    orders: npt.NDArray[np.uint8],
    anew: bool,
    seed: np.uint64,
    split: int,
    first_world: int,
) -> None:
    """Order worlds to start an episode: the first of a seed, or the next."""
    e = cuda.grid(1)
    if e < len(world):
        orders[e] = LOOK
        if mask[e]:
            orders[e] = START
            w = world[e]
            if anew:
                w.seed = seed
                w.split = split
                w.index = first_world + e
                w.episode = 0
            else:
                w.episode += 1
