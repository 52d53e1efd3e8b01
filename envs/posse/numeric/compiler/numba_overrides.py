"""How numba is made to compile: every private part that is overridden, and what it gains.

=========================== ======================================================================
``_InnerLibrary``           Functions are optimised only as parts of kernels: cold start.
``_InnerDispatcher``        Functions are compiled once for integers of all values: cold start.
``_PASSES``                 Inlined functions skip passes that change nothing in them: cold start.
``_remembering``            What an operator returns for given types is found once: cold start.
``_Library``                With :mod:`.llvm_hints`: speed 1.00, else 0.91 to 1.00.
``_KernelLibrary``          No short loop is vectorised: 1.00, else 0.92 to 1.00; cold start.
``noalias``                 LLVM may assume that arrays do not overlap: 1.00, else 0.93 to 1.00.
=========================== ======================================================================

Cold start: first step of ``smart``, no cached kernels. A test checks that numba has all of this.
"""

from __future__ import annotations

from collections.abc import Callable
from types import CodeType, SimpleNamespace
from typing import Any, Final

from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.registry import CPUDispatcher

from posse.numeric.compiler import collector, llvm_hints
from posse.numeric.compiler.function_type import FunctionType, widest

_PASSES: Final = (
    untyped.TranslateByteCode, untyped.FixupArgs, untyped.IRProcessing, untyped.DeadBranchPrune,
    untyped.GenericRewrites, untyped.ReconstructSSA, typed.NopythonTypeInference,
    typed.PreLowerStripPhis, typed.InlineOverloads, typed.NativeLowering, typed.NoPythonBackend,
)  # fmt: skip


class _Library(JITCodeLibrary):
    """LLVM code with hints, and of everything that it calls."""

    def add_ir_module(self, ir_module: Any) -> None:
        llvm_hints.forbid_runtime_unrolling(ir_module)
        llvm_hints.keep_out_of_line(ir_module)
        super().add_ir_module(ir_module)

    def add_linking_library(self, library: Any) -> None:
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for each in library._linking_libraries if isinstance(library, _InnerLibrary) else ():
                self.add_linking_library(each)


class _InnerLibrary(_Library):
    """LLVM code of one function, not optimised, without what it calls."""

    def add_llvm_module(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                function.linkage = "linkonce_odr"  # a kernel drops what it has inlined
        self._final_module = ll_module

    def add_linking_library(self, library: Any) -> None:
        self._linking_libraries.append(library)

    def finalize(self) -> None:
        self._finalized = True

    @property
    def codegen(self) -> Any:
        # numba would register the function's globals here, which requires machine code.
        return SimpleNamespace(set_env=lambda name, environment: None)


class _KernelLibrary(_Library):
    def _optimize_final_module(self) -> None:
        manager = self._codegen._module_pass_manager
        passes, builder = manager(loop_vectorize=False, slp_vectorize=True)
        passes.run(self._final_module, builder)


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

    def define_pipelines(self) -> list[Any]:
        (manager,) = super().define_pipelines()
        if not any(isinstance(each, CodeType) for each in self.state.func_id.code.co_consts):
            manager.passes = [(each, each.__name__) for each in _PASSES]
            manager.finalize()
        return [manager]


def _remembering(resolve: Callable[..., Any]) -> Callable[..., Any]:
    found: dict[Any, Any] = {}

    def look_up(function: Any, args: Any, kws: Any) -> Any:
        if kws or isinstance(function, str):  # "static_getitem" takes values, not types
            return resolve(function, args, kws)
        key = function, tuple(args)
        return found[key] if key in found else found.setdefault(key, resolve(*key, kws))

    return look_up


class KernelCompiler(_Compiler):
    """Compiles a kernel, assuming that its arrays do not overlap."""

    library = _KernelLibrary

    @collector.paused()  # numba's many live objects would be traversed again and again
    def compile_extra(self, func: Any) -> Any:  # noqa: D102 (numba's)
        self.state.flags.noalias = True
        types = self.state.typingctx
        types.resolve_function_type = _remembering(resolve := types.resolve_function_type)
        try:
            return super().compile_extra(func)
        finally:
            types.resolve_function_type = resolve


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
