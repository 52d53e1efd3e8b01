"""Every use of numba's private parts, and what each one gains.

==================== ===============================================================================
``_InnerLibrary``    A function inlined into a kernel is optimised only there: 16 s less.
``_Library``         It is linked once: 2 s less. With :mod:`.llvm_hints`: 1.00, else 0.91.
``skipped``          Passes that change nothing in our functions: 1 s less.
``remembering``      The types of a call are looked up once in a kernel: 4 s less.
``_InnerDispatcher`` A function is compiled once for all integers, not for each constant: 9 s.
``_KernelLibrary``   No short loop is vectorised: 1.00, else 0.92 to 1.00. One round of passes: 3 s.
``noalias``          LLVM may assume that arrays do not overlap: 1.00, else 0.93 to 1.00.
``KernelCache``      Warm start 0.6 s; numba's own cache goes stale and reads damaged files.
==================== ===============================================================================

Seconds less to the first step of ``smart`` with nothing cached, now 17 to 24; 1.00: throughput.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps

from posse.numeric.compiler.function_type import FunctionType, widest
from posse.numeric.compiler.kernel_store import KernelStore
from posse.numeric.compiler.llvm_hints import add_hints, drop_if_inlined
from posse.numeric.compiler.sparing import paused_collector, remembering, wrapped


class _Library(JITCodeLibrary):
    """LLVM code with hints; whatever an inlined function calls is linked to it, too."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.inlined: dict[_InnerLibrary, None] = {}  # each once, callees included

    def add_ir_module(self, ir_module: Any) -> None:
        add_hints(ir_module)
        super().add_ir_module(ir_module)

    def add_linking_library(self, library: Any) -> None:
        if isinstance(library, _InnerLibrary):
            self.inlined |= {library: None} | library.inlined
            for each in library._linking_libraries:
                self.add_linking_library(each)
        elif library not in self._linking_libraries:
            super().add_linking_library(library)

    def finalize(self) -> None:
        for each in self.inlined:
            self._final_module.link_in(each._final_module, preserve=True)
        super().finalize()


class _InnerLibrary(_Library):
    """LLVM code of one function, which is optimised where it is linked."""

    def add_llvm_module(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        drop_if_inlined(ll_module)
        self._final_module = ll_module

    def finalize(self) -> None:
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        module = self._final_module.clone()  # for numba's libraries, which do not use "inlined"
        for each in self.inlined:
            module.link_in(each._final_module, preserve=True)
        for each in self._linking_libraries:
            module.link_in(each._get_module_for_linking(), preserve=True)
        return module

    # numba would register the function's globals here, which requires machine code.
    codegen: Any = SimpleNamespace(set_env=lambda name, environment: None)


class _Compiler(CompilerBase):
    """numba's standard passes with another library class."""

    library: type[JITCodeLibrary] = _Library

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        manager = DefaultPassBuilder.define_nopython_pipeline(state)
        skipped = "ir_legalization", "nopython_rewrites"
        manager.passes = [each for each in manager.passes if each[0]._name not in skipped]
        return [manager]


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

    def compile_extra(self, func: Any) -> Any:  # noqa: D102 (numba's)
        self.state.flags.noalias = True
        types = self.state.typingctx
        with paused_collector(), wrapped(types, "resolve_function_type", remembering):
            return super().compile_extra(func)


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


class KernelCache(KernelStore, NullCache):
    """What numba asks for a kernel before compiling it, and gives it to afterwards."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: D102 (numba's)
        target = target_context.codegen().magic_tuple()
        return self.load(sig, target, lambda *parts: CompileResult._rebuild(target_context, *parts))

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: D102 (numba's)
        if not data.library.has_dynamic_globals:
            self.save(sig, data.codegen.magic_tuple(), lambda: dumps((sig, data._reduce())))
