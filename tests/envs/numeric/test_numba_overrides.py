"""The installed numba has the private parts that posse overrides, and the overrides work."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Iterator
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
import pytest
from llvmlite.binding import ModuleRef
from numba.core.codegen import JITCPUCodegen
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.typing.context import BaseContext
from numba.extending import overload

from posse.numeric import UNCOMPILED, compiled, kernel
from posse.numeric.compiler import numba_overrides

Floats = npt.NDArray[np.float64]

OURS = [
    each
    for each in vars(numba_overrides).values()
    if inspect.isclass(each)
    and each.__module__ == numba_overrides.__name__
    and any(base.__module__.startswith("numba.") for base in each.__mro__)
]
ADDED = {"__init__"}
OVERRIDES = [
    (each, name)
    for each in OURS
    for name, member in vars(each).items()
    if (inspect.isfunction(member) or isinstance(member, property)) and name not in ADDED
]
CALLED = [
    (CompilerBase, "compile_extra"),
    (DefaultPassBuilder, "define_nopython_pipeline"),
    (CompileResult, "_reduce"),
    (CompileResult, "_rebuild"),
    (JITCPUCodegen, "magic_tuple"),
    (JITCPUCodegen, "_module_pass_manager"),
    (BaseContext, "resolve_function_type"),
    (ModuleRef, "link_in"),
    (Flags, "noalias"),
    (Flags, "forceinline"),
]

pytestmark = pytest.mark.skipif(UNCOMPILED, reason="nothing is compiled")


@pytest.fixture(scope="module", autouse=True)
def nothing_cached(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """These tests require that a kernel is compiled."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("POSSE_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield


def test_the_overrides_are_found() -> None:
    assert len(OURS) >= 5
    assert len(OVERRIDES) >= 8


@pytest.mark.parametrize(("ours", "name"), OVERRIDES)
def test_numba_still_has_what_is_overridden(ours: type, name: str) -> None:
    theirs = [each for each in ours.__mro__ if each.__module__.startswith("numba.")]
    assert any(name in vars(each) for each in theirs), (
        f"numba {numba.__version__} no longer has {theirs[0].__name__}.{name}, which "
        f"{ours.__name__} overrides: see {numba_overrides.__name__} for what it buys, and drop it "
        "or follow numba"
    )


def test_numba_still_has_the_passes_that_are_skipped() -> None:
    ran: list[str] = []

    def listed(manager: Any, index: int, each: Any, state: Any) -> None:
        ran.append(each.name())
        run(manager, index, each, state)

    run = PassManager._runPass
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PassManager, "_runPass", listed)
        numba.njit(lambda x: x)(1.0)
        assert {"ir_legalization", "nopython_rewrites"} < set(ran), "numba renamed a pass"
        ran.clear()
        kernel(lambda x: x)(1.0)
        assert not {"ir_legalization", "nopython_rewrites"} & set(ran)
        assert "native_lowering" in ran


@pytest.mark.parametrize(("theirs", "name"), CALLED)
def test_numba_still_has_what_is_called(theirs: type, name: str) -> None:
    assert hasattr(theirs, name), (
        f"numba {numba.__version__} no longer has {theirs.__name__}.{name}, which {numba_overrides.__name__} uses"
    )


def test_a_function_is_compiled_once_for_all_integers() -> None:
    """A constant, and integers of 32 and of 64 bits."""

    @compiled
    def twice(x: int) -> int:
        return 2 * x

    @kernel
    def total(narrow: npt.NDArray[np.int32], wide: npt.NDArray[np.int64]) -> int:
        return twice(3) + twice(4) + twice(narrow[0]) + twice(wide[0])

    assert total(np.array([2**31 - 1], np.int32), np.array([2**40])) == 14 + 2 * (2**31 - 1 + 2**40)
    assert len(twice.inner.overloads) == 1  # type: ignore[attr-defined]


def test_a_function_inside_a_kernel_becomes_no_machine_code_of_its_own() -> None:
    @compiled
    def half(x: float) -> float:
        return 0.5 * x

    @kernel
    def quarter(x: float) -> float:
        return half(half(x))

    assert quarter(8.0) == 2.0
    (inner,) = half.inner.overloads.values()  # type: ignore[attr-defined]
    (outer,) = quarter.overloads.values()  # type: ignore[attr-defined]
    engine = outer.library._codegen._engine
    assert engine.is_symbol_defined(outer.fndesc.llvm_func_name)
    assert not engine.is_symbol_defined(inner.fndesc.llvm_func_name)
    assert half(8.0) == 4.0, "Python can call it all the same"


NOTHING: Any = None


def test_a_function_may_hold_inner_functions_and_branches_of_other_types() -> None:
    """With fewer of numba's passes than usual."""

    @compiled
    def with_inner(x: float) -> float:
        def double(y: float) -> float:
            return y + y

        return double(x)

    @compiled
    def with_branch(x: float) -> float:
        return x if NOTHING is None else NOTHING.no_such_name

    @kernel
    def both(x: float) -> float:
        return with_inner(x) + with_branch(x) + bool(x)

    assert both(2.0) == 7.0


@pytest.mark.parametrize("decorate", [kernel, compiled, numba.njit], ids=["kernel", "compiled", "njit"])
def test_a_function_is_linked_with_all_that_it_calls(decorate: Any) -> None:
    """Also where numba itself links, in functions of a user and those called from Python."""

    @compiled
    def lowest(x: float) -> float:
        return x + 1.0

    @compiled
    def left(x: float) -> float:
        return lowest(x) * max(x, 2.0)

    @compiled(seldom=True)
    def right(x: float) -> float:
        return 2.0 * lowest(x)

    @compiled
    def middle(x: float) -> float:
        return left(x) + right(x)

    def both(x: float) -> float:
        return middle(x) - left(x)

    outer = decorate(both)
    assert outer(1.0) == 4.0
    assert middle(1.0) == 8.0, "inner functions can be called from Python, too"
    if decorate is kernel:
        (form,) = outer.overloads.values()
        (used,) = lowest.inner.overloads.values()  # type: ignore[attr-defined]
        assert list(form.library.inlined).count(used.library) == 1


def test_a_wrong_call_is_refused_each_time() -> None:
    """What numba has found for a call is kept; an error is not."""

    @compiled
    def half(x: float) -> float:
        return 0.5 * x

    @kernel
    def wrong(x: float) -> float:
        return half(x, x)  # type: ignore[call-arg]

    for _ in range(2):
        with pytest.raises(numba.TypingError, match="half"):
            wrong(1.0)
    assert half(3.0) == 1.5


def test_no_garbage_is_collected_while_a_kernel_is_compiled() -> None:
    """It would take a tenth of the time; afterwards the collector runs as before."""
    seen = []

    def asked(x: float) -> float:
        raise NotImplementedError

    @overload(asked)
    def implement(x: float) -> Any:
        seen.append(gc.isenabled())

        def same(x: float) -> float:
            return x

        return same

    @kernel
    def ask(x: float) -> float:
        return asked(x)

    assert ask(2.0) == 2.0
    assert seen
    assert not any(seen)
    assert gc.isenabled()

    @kernel
    def wrong(x: float) -> float:
        return x.no_such_name  # type: ignore[attr-defined, no-any-return]

    with pytest.raises(numba.TypingError):
        wrong(1.0)
    assert gc.isenabled()


@pytest.fixture(scope="module")
def code(nothing_cached: None) -> str:
    """LLVM code of a kernel that loops over arrays."""

    @kernel
    def fill(out: Floats, source: Floats) -> None:
        for i in range(out.shape[0]):
            out[i] = source[0] / (1.0 + i)

    out = np.zeros(3)
    fill(out, np.ones(1))
    np.testing.assert_allclose(out, [1.0, 1 / 2, 1 / 3])
    (code,) = fill.inspect_llvm().values()  # type: ignore[attr-defined]
    return str(code)


def test_a_loop_of_unknown_length_is_not_vectorised() -> None:
    """Else LLVM makes a second loop, over vectors, and a test at run time of which one to take."""

    @kernel
    def double(out: Floats, source: Floats) -> None:
        for i in range(out.shape[0]):
            out[i] = 2.0 * source[i]

    double(np.zeros(3), np.ones(3))
    (code,) = double.inspect_llvm().values()  # type: ignore[attr-defined]
    assert "x double>" not in code


def test_a_rarely_called_function_is_not_inlined() -> None:
    @compiled(seldom=True)
    def apart_fn(x: float) -> float:
        return x + 12345.5

    @compiled
    def inline_fn(x: float) -> float:
        return x + 54321.5

    @kernel
    def both(x: float) -> float:
        return apart_fn(x) if x > 0.0 else inline_fn(x)

    assert both(1.0) == 12346.5
    (code,) = both.inspect_llvm().values()  # type: ignore[attr-defined]
    calls = [line for line in code.splitlines() if " call " in line]
    assert any("apart_fn" in line for line in calls)
    assert not any("inline_fn" in line for line in calls)


def test_a_loop_of_unknown_length_is_not_unrolled(code: str) -> None:
    assert code.count("store double") == 1


def test_a_kernels_arrays_are_said_not_to_overlap(code: str) -> None:
    assert "noalias" in code
