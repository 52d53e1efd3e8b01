"""Every override of numba's private parts, and what each one buys.

=========================== ======================================================================
``_InnerLibrary``           A function inside a kernel is optimised and turned into machine code
                            with the kernel, not by itself as well: cold start 11 s, else 17 s.
``_InnerDispatcher``        A function is compiled once for all integers that it is called with,
                            not for each constant and each width: cold start 11 s, else 16 s.
``_Library.add_ir_module``  Loops of unknown length (over trackers, beams, slots: a few rounds) are
                            not unrolled: batches run at 1.00, else at 0.95 to 0.97.
``_InnerType``              Functions can be passed to a kernel's functions in named tuples, and the
                            kernel still be cached: numba's own type has an address for a value.
``noalias``                 LLVM may assume that a kernel's arrays do not overlap: 1.00, else 0.95.
=========================== ======================================================================

Cold start: first step of ``smart`` in a new process, nothing cached. A test checks that numba still
has all that is overridden or called here.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final

from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.extending import models, register_model
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher

_NO_RUNTIME_UNROLL: Final = "llvm.loop.unroll.runtime.disable"


class _Library(JITCodeLibrary):
    """LLVM code in which loops of unknown length are not unrolled; others may be."""

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            _mark_loops(ir_module, function)
        super().add_ir_module(ir_module)  # type: ignore[no-untyped-call]


def _mark_loops(module: Any, function: Any) -> None:
    """Forbid unrolling at run time for every loop, known by its jump backwards."""
    position = {id(block): k for k, block in enumerate(function.blocks)}
    option = module.add_metadata([_NO_RUNTIME_UNROLL])
    loops: dict[int, Any] = {}
    for k, block in enumerate(function.blocks):
        jump = block.terminator
        for target in jump.operands if jump is not None and jump.opname == "br" else ():
            if position.get(id(target), len(position)) > k:
                continue
            if id(target) not in loops:
                # LLVM identifies a loop by a node whose first operand is the node itself.
                node = module.add_metadata([f"{function.name} {target.name}"])
                node.operands = (node, option)
                loops[id(target)] = node
            jump.set_metadata("llvm.loop", loops[id(target)])


class _InnerLibrary(_Library):
    """LLVM code that is only linked into kernels, and optimised there."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True  # without handing it to LLVM's engine, which makes machine code

    @property
    def codegen(self) -> Any:
        """Where numba registers a function's globals, which needs machine code."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class _Compiler(CompilerBase):
    """numba's own passes, into a library of ours."""

    library: type[JITCodeLibrary] = _Library

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]  # type: ignore[no-untyped-call]


class _InnerCompiler(_Compiler):
    """Compiles a function that kernels link."""

    library = _InnerLibrary


class KernelCompiler(_Compiler):
    """Compiles a kernel, whose arrays do not overlap."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call]
        self.state.flags.noalias = True


class CompiledFunction(CPUDispatcher):
    """A function in two forms: for Python, compiled when Python calls it; and for kernels to link.

    Args:
        function: What to compile.
        options: numba's, of both forms.
        inline: Whether it becomes part of every place that calls it. Else LLVM decides.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any], inline: bool) -> None:
        options = {**options, "nopython": True, "boundscheck": None}
        super().__init__(function, targetoptions=options)
        inner = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.inner = _InnerDispatcher(
            function, None, {**inner, "forceinline": inline}, _InnerCompiler
        )

    @property
    def _numba_type_(self) -> types.Dispatcher:
        return _InnerType(self.inner)


class _InnerType(types.Dispatcher):
    """A function as compiled code has it: a type, which says what to call, and no value."""


register_model(_InnerType)(models.OpaqueModel)


@lower_constant(_InnerType)  # type: ignore[no-untyped-call, untyped-decorator]
def _lower_function(context: Any, builder: Any, kind: Any, function: Any) -> Any:
    return context.get_dummy_value()


class _InnerDispatcher(CPUDispatcher):
    """The form for kernels, compiled once for all integers."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(
            tuple(_widest(kind) for kind in args),
            {name: _widest(kind) for name, kind in kws.items()},
        )


def _widest(kind: Any) -> Any:
    plain = types.unliteral(kind)  # type: ignore[no-untyped-call]
    return types.int64 if plain in (types.int32, types.uint8) else plain
