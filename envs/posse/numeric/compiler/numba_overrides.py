"""Every use of numba's private parts, and what each one gains.

=========================== ======================================================================
``_InnerLibrary``           A function inlined into a kernel becomes machine code only as a part of
                            the kernel, not separately as well: cold start 14 s, else 20 s.
``_InnerDispatcher``        A function is compiled once for all integers that it is called with,
                            not for each constant and each width: cold start 14 s, else 19 s.
``_Library``                Loops of unknown length are not unrolled, and rarely called functions
                            not inlined (:mod:`.llvm_hints`): speed 1.00, else 0.91 to 1.00.
``_KernelLibrary``          Adjacent operations are vectorised, short loops are not; one round of
                            LLVM's passes, not two: 1.00, else 0.92 to 1.00; cold start 2 s less.
``noalias``                 LLVM may assume that arrays do not overlap: 1.00, else 0.93 to 1.00.
``KernelCache``             Warm start 0.6 s; numba's own cache goes stale and reads damaged files.
=========================== ======================================================================

Cold start: first step of ``smart``, no cached kernels. A test checks that numba has all of this.
"""

from __future__ import annotations

import contextlib
import functools
import pickle
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps

from posse.numeric.compiler import collector, kernel_files
from posse.numeric.compiler.function_type import FunctionType, widest
from posse.numeric.compiler.llvm_hints import forbid_runtime_unrolling, keep_out_of_line
from posse.numeric.compiler.stamps import Stamp


class _Library(JITCodeLibrary):
    """LLVM code with hints."""

    def add_ir_module(self, ir_module: Any) -> None:
        forbid_runtime_unrolling(ir_module)
        keep_out_of_line(ir_module)
        super().add_ir_module(ir_module)


class _InnerLibrary(_Library):
    """LLVM code that is only linked into kernels, where it is optimised."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True  # without LLVM's engine, which would generate machine code

    @property
    def codegen(self) -> Any:
        # numba would register the function's globals here, which requires machine code.
        return SimpleNamespace(set_env=lambda name, environment: None)


class _Compiler(CompilerBase):
    """numba's standard passes with another library class."""

    library: type[JITCodeLibrary] = _Library

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class _InnerCompiler(_Compiler):
    library = _InnerLibrary


class _KernelLibrary(_Library):
    def _optimize_final_module(self) -> None:
        manager = self._codegen._module_pass_manager
        passes, builder = manager(loop_vectorize=False, slp_vectorize=True)
        passes.run(self._final_module, builder)


class KernelCompiler(_Compiler):
    """Compiles a kernel, assuming that its arrays do not overlap."""

    library = _KernelLibrary

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags.noalias = True

    # numba's many live objects would be traversed again and again.
    compile_extra = collector.paused()(CompilerBase.compile_extra)


class CompiledFunction(CPUDispatcher):
    """A function in two compiled forms: one for calls from Python, one to link into kernels."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=options)
        inner = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.inner = _InnerDispatcher(function, None, inner, _InnerCompiler)

    @property
    def _numba_type_(self) -> FunctionType:
        return FunctionType(self.inner)


class _InnerDispatcher(CPUDispatcher):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        named = {name: widest(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(widest, args)), named)


class KernelCache(NullCache):
    """Cache in which numba looks a kernel up before compiling, and stores it afterwards."""

    def __init__(self, *stamped: Any) -> None:
        self._stamped = stamped
        self.before_compiling: Callable[[], None] = lambda: None

    @functools.cached_property
    def _stamp(self) -> Stamp:
        return Stamp(*self._stamped)  # lazily: a kernel may call functions defined below it

    def _name(self, sig: Any, codegen: Any) -> str:
        return self._stamp.hexdigest(str(sig), *map(str, codegen.magic_tuple()))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kernel for these types, or None."""
        with contextlib.suppress(Exception):  # after any error, compile
            kept = kernel_files.read(self._name(sig, target_context.codegen()))
            signature, parts = pickle.loads(kept) if kept is not None else (None, ())  # noqa: S301
            if signature == sig:
                return CompileResult._rebuild(target_context, *parts)
        self.before_compiling()
        kernel_files.announce()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a kernel for these types."""
        with contextlib.suppress(Exception):
            if self._stamp.holds() and not data.library.has_dynamic_globals:
                kernel_files.write(self._name(sig, data.codegen), dumps((sig, data._reduce())))
