"""The engine on an NVIDIA GPU: the same functions as on the CPU, compiled by numba-cuda.

One thread steps one world. State, actions, observations, rewards and flags stay on the device.
Imported only for ``device="cuda"``.

With ``NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1`` numba simulates the device in plain Python,
slowly, for tests on machines without a GPU.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.engine.arguments import action_error, options_of
from posse.engine.batch import Batch, Snapshot
from posse.engine.cuda_kernels import (
    CONFIG,
    NONE,
    NOTHING,
    SIMULATED,
    THREADS,
    DeviceArray,
    check_actions,
    choose_worlds,
    cuda,
    stepping,
)
from posse.engine.kernels import LOOK, STEP, Results, Tables
from posse.numeric import FloatArray, Records
from posse.rules.state import SPLITS, WorldArrays
from posse.scenarios import Scenario
from posse.signals.metrics import episode_metrics
from posse.signals.parts import parts_for


class _DeviceResults:
    """Output arrays of one pass, on the device."""

    def __init__(self, observation_shape: tuple[int, int, int], term_names: tuple[str, ...]) -> None:
        worlds, rows, _ = observation_shape
        self.observations = cuda.device_array(observation_shape, np.float32)
        self.rewards = cuda.device_array((worlds, rows), np.float32)
        self.terms = cuda.device_array((worlds, rows, len(term_names)), np.float32)
        self.flags = cuda.device_array((3, worlds), np.bool_)
        self.score = cuda.device_array(worlds, np.float32)
        self.terminated, self.truncated, self.over = (self.flags[k] for k in range(3))
        self.reward_terms = {name: self.terms[:, :, k] for k, name in enumerate(term_names)}

    def arrays(self) -> Results:
        """Return the arrays that CPU kernels write, too."""
        return Results(self.observations, self.rewards, self.terms, self.flags)


class CudaBatch(Batch):
    """A batch of E worlds on an NVIDIA GPU.

    Same arguments as :class:`posse.Batch`, and the same worlds for the same seeds. Random draws are
    bit-identical; float32 results differ by rounding, since a GPU contracts ``a * b + c`` and
    implements sine and cosine differently.

    :meth:`reset` and :meth:`step` return numba device arrays, which torch reads without a copy:
    ``torch.as_tensor(observations, device="cuda")``. There are two sets, used alternately: results
    are **overwritten by the second call after**. Copy them to keep them longer.

    Everything runs on the legacy default stream of the current CUDA device, which is torch's
    default. The first reset of a process compiles for about a minute.

    Raises:
        ImportError: numba-cuda is not installed.
        RuntimeError: No GPU is usable.
        ValueError: As :class:`posse.Batch`; ``num_threads`` or ``own_kernel`` given.
    """

    def __init__(self, scenario: Scenario, num_worlds: int, **settings: Any) -> None:
        check_device()
        for name, unset in (("num_threads", None), ("own_kernel", False)):
            if settings.get(name, unset) != unset:
                raise ValueError(f"{name}={settings[name]!r} is for device='cpu' alone: leave it out")
        super().__init__(scenario, num_worlds, **settings)

    def _prepare(self) -> None:
        """Copy the batch to the device; the host arrays are updated on demand."""
        super()._prepare()
        self._advance = stepping(parts_for(self.scenario))
        self._device_tables: Any = Tables(*map(cuda.to_device, self._tables))
        self._device_arrays: Any = WorldArrays(*map(cuda.to_device, self._arrays))
        self._device_actions = cuda.device_array(self.action_shape, np.float32)
        self._all_step = cuda.to_device(np.full(self.num_worlds, STEP, np.uint8))
        self._all_look = cuda.to_device(np.full(self.num_worlds, LOOK, np.uint8))
        self._chosen = cuda.device_array(self.num_worlds, np.uint8)
        self._report = cuda.to_device(NOTHING)
        # In the mode "same_step" a step may take two sets.
        count = 4 if self.autoreset == "same_step" else 2
        self._results = itertools.cycle([_DeviceResults(self.observation_shape, self.term_names) for _ in range(count)])
        self._last, self._next = next(self._results), next(self._results)

    def __getstate__(self) -> dict[str, Any]:
        self._download()
        device = (
            "_advance",
            "_device_tables",
            "_device_arrays",
            "_device_actions",
            "_all_step",
            "_all_look",
            "_chosen",
            "_report",
            "_results",
            "_last",
            "_next",
        )
        return {k: v for k, v in super().__getstate__().items() if k not in device}

    def __setstate__(self, state: dict[str, Any]) -> None:
        check_device()
        super().__setstate__(state)

    @property
    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Every state array by name: copies on the host."""
        return self.arrays.copy().by_name()

    @property
    def worlds(self) -> Records:
        """The worlds' records, (E,) :func:`posse.rules.state.world_record`: copies on the host."""
        records: Records = self._device_arrays.world.copy_to_host()
        return records

    @property
    def arrays(self) -> WorldArrays:
        """The state arrays: copies on the host."""
        self._download()
        return self._arrays

    @property
    def score(self) -> DeviceArray:
        """(E,) the score of the current step."""
        return self._last.score

    @property
    def terminated(self) -> DeviceArray:
        """(E,) whether the episode is terminated."""
        return self._last.terminated

    @property
    def truncated(self) -> DeviceArray:
        """(E,) whether the episode is truncated."""
        return self._last.truncated

    def metrics(self) -> dict[str, npt.NDArray[np.float64]]:
        """Return every metric of the current episodes by name, (E,), on the host."""
        return episode_metrics(self.scenario, self.worlds)

    def save(self) -> Snapshot:
        """Return the worlds as they stand, on the host, for :meth:`restore`, here or on a CPU.

        Raises:
            ResetNeeded: Before the first :meth:`reset`.
        """
        self._check_started("save")
        return Snapshot(self.scenario, self.arrays.copy())

    def restore(self, snapshot: Snapshot) -> DeviceArray:
        """Restore a snapshot and return its observations."""
        super().restore(snapshot)
        self._upload()
        return self._pass(self._all_look).observations

    def observe(self) -> DeviceArray:
        """Return the current observations (E, rows, F)."""
        if not self._started:
            raise ResetNeeded("observe before reset: call reset() first")
        return self._pass(self._all_look).observations

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> DeviceArray:
        """Start an episode in every world and return its observations, as :class:`posse.Batch`.

        ``options["reset_mask"]`` may be on the device. With start poses the whole state is copied
        to the host and back.
        """
        options = options_of(options)
        mask = _as_device_array(options.get("reset_mask"))
        if mask is not None:
            # Not checked on the device, which would synchronise.
            options["reset_mask"] = mask.copy_to_host() if not self._started else None
            if mask.dtype != np.bool_ or tuple(mask.shape) != (self.num_worlds,):
                raise ValueError(
                    f"reset_mask must be a bool array of shape ({self.num_worlds},), got "
                    f"{mask.dtype} of shape {tuple(mask.shape)}"
                )
        chosen = self.check_reset(seed, options)
        if options.keys() & {"tracker_pose", "target_pose"}:
            if mask is not None:
                options["reset_mask"] = mask.copy_to_host()
            self._download()
            super().reset(seed=seed, options=options)
            self._upload()
            return self._pass(self._all_look).observations
        anew = seed is not None or not self._started
        self.seed, self._started = self.seed if seed is None else int(seed), True
        return self._begin(cuda.to_device(chosen) if mask is None else mask, anew)

    def step(
        self, actions: Any, *, check: bool = True
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray, DeviceArray, dict[str, Any]]:
        """Advance every world by one control step.

        Args:
            actions: (E, rows, 2 + message_size) numbers in [-1, 1]. A contiguous float32 array on
                the device (a torch tensor, or anything else with ``__cuda_array_interface__``) is
                read in place; anything else is copied.
            check: Whether to check for actions outside [-1, 1] and for ended episodes, which
                synchronises with the device. ``False``, in the mode "next_step": the step is only
                queued, actions are not checked, and ``infos`` holds no metrics. The other modes
                always synchronise.

        Returns:
            What :meth:`posse.Batch.step` returns, on the device. Only ``infos["metrics"]``
            and ``infos["_metrics"]`` are numpy arrays; for them, the worlds' records are copied to
            the host in steps in which episodes end.

        Raises:
            ResetNeeded: Before the first :meth:`reset`, or after an end with autoreset disabled.
            ValueError: Actions of a wrong type or shape, not finite, or outside [-1, 1]. Nothing is
                changed.
        """
        if not self._started:
            raise ResetNeeded("step before reset: call reset() first")
        given = array = self._take(actions)
        waits = check or self.autoreset != "next_step"
        if waits:
            disabled = self.autoreset == "disabled"
            array = self._device_actions
            world = self._device_arrays.world
            self._launch(check_actions, world, given, array, self._report, disabled)
        self._launch_advance(array, self._all_step)
        over = self._wait(given) if waits else 0
        done = self._turn()
        infos: dict[str, Any] = {"score": done.score, "reward_terms": dict(done.reward_terms)}
        observations = done.observations
        if over:
            infos["metrics"], infos["_metrics"] = self.metrics(), done.over.copy_to_host()
            if self.autoreset == "same_step":
                infos["final_obs"], infos["_final_obs"] = observations, done.over
                infos["final_info"] = {k: infos[k] for k in ("score", "metrics", "_metrics")}
                infos["_final_info"] = done.over
                observations = self._begin(done.over, anew=False)
        return observations, done.rewards, done.terminated, done.truncated, infos

    def stepper(self, *arrays: FloatArray) -> Any:
        """Not available: environments of one world run on the CPU."""
        raise NotImplementedError("a batch on the GPU has no stepper(): call step()")

    def _take(self, actions: Any) -> DeviceArray:
        """Return the actions on the device, contiguous float32 of the right shape."""
        array = _as_device_array(actions)
        if array is None:
            self._device_actions.copy_to_device(self.cast_actions(actions))
            return self._device_actions
        if array.dtype != np.float32 or tuple(array.shape) != self.action_shape:
            raise ValueError(
                f"actions on the device are {array.dtype} of shape {tuple(array.shape)}, wanted "
                f"float32 of shape {self.action_shape}: (worlds, agents, 2 + message_size)"
            )
        if not array.is_c_contiguous():
            raise ValueError("actions on the device are not contiguous: make them so first")
        return array

    def _wait(self, actions: DeviceArray) -> int:
        """Return how many episodes are over, or raise the error that prevented the step."""
        bad, waiting, over = (int(number) for number in self._report.copy_to_host())
        if bad == NONE and waiting == NONE:
            return over
        self._report.copy_to_device(NOTHING)
        if waiting != NONE:
            raise ResetNeeded(
                f"step after the end of world {waiting}, and perhaps more: "
                'call reset(options={"reset_mask": mask}) first'
            )
        e, i, k = (int(index) for index in np.unravel_index(bad, self.action_shape))
        raise action_error((e, i, k), actions[e : e + 1].copy_to_host()[0, i, k])

    def _begin(self, mask: DeviceArray, anew: bool) -> DeviceArray:
        """Start an episode in the worlds of a mask; return every world's observations."""
        self._launch(
            choose_worlds,
            self._device_arrays.world,
            mask,
            self._chosen,
            anew,
            np.uint64(self.seed),
            SPLITS.index(self.split),
            self.first_world,
        )
        return self._pass(self._chosen).observations

    def _pass(self, orders: DeviceArray) -> _DeviceResults:
        """Execute orders other than a step, and return the results."""
        self._launch_advance(self._device_actions, orders)
        return self._turn()

    def _turn(self) -> _DeviceResults:
        """Return the results of the last pass; the next one writes to the other set."""
        self._last, self._next = self._next, next(self._results)
        return self._last

    def _launch_advance(self, actions: DeviceArray, orders: DeviceArray) -> None:
        done = self._next
        self._launch(
            self._advance,
            self._device_tables,
            self._device_arrays,
            actions,
            done.arrays(),
            done.score,
            orders,
            self._report,
        )

    def _launch(self, kernel: Any, *arguments: Any) -> None:
        if SIMULATED:
            arguments = tuple(map(_as_in_a_kernel, arguments))
        kernel[-(-self.num_worlds // THREADS), THREADS](*arguments)

    def _download(self) -> None:
        """Update the host arrays."""
        for device, host in zip(self._device_arrays, self._arrays, strict=True):
            if host.size:
                device.copy_to_host(host)

    def _upload(self) -> None:
        """Update the device arrays."""
        for device, host in zip(self._device_arrays, self._arrays, strict=True):
            if host.size:
                device.copy_to_device(host)


def check_device() -> None:
    """Raise if the GPU cannot be used, with the reason and the fix."""
    if CONFIG.ENABLE_CUDASIM:
        if not CONFIG.DISABLE_JIT:
            raise RuntimeError("NUMBA_ENABLE_CUDASIM=1 simulates the GPU in plain Python: set NUMBA_DISABLE_JIT=1 too")
        return
    if CONFIG.DISABLE_JIT:
        raise RuntimeError(
            "device='cuda' compiles the worlds for the GPU, which NUMBA_DISABLE_JIT=1 forbids: "
            "unset it, or set NUMBA_ENABLE_CUDASIM=1 too, to simulate"
        )
    if not cuda.is_available():
        raise RuntimeError(
            "device='cuda' found no GPU that it can use: check that `nvidia-smi` lists one and "
            "that the extra is complete (pip install 'posse[cuda]'), or take device='cpu'. "
            f"The driver says: {cuda.cuda_error() or 'nothing'}"
        )


def _as_in_a_kernel(argument: Any) -> Any:
    """Return an argument for the simulated kernel, since the simulator skips arrays in tuples.

    There, fields are attributes of an array's elements.
    """
    if not isinstance(argument, tuple):
        return argument
    from numba.cuda.simulator.cudadrv.devicearray import FakeWithinKernelCUDAArray

    return type(argument)(*map(FakeWithinKernelCUDAArray, argument))


def _as_device_array(array: Any) -> DeviceArray | None:
    """Return a device array as numba's, without a copy; None for any other."""
    if getattr(array, "__cuda_ndarray__", False):  # numba's own; the simulator's too
        return array
    if hasattr(array, "__cuda_array_interface__"):
        return cuda.as_cuda_array(array)
    return None
