"""How numba's compiler is driven: what it leaves out, and what it tells LLVM.

numba's front end, not LLVM, is most of what a kernel takes to compile, so functions that kernels
link skip what would be thrown away or finds nothing in plain scalar code.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Final

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager

_NO_RUNTIME_UNROLL: Final = "llvm.loop.unroll.runtime.disable"

_NEEDLESS: Final = frozenset(
    {
        # For code that ours is not: with-blocks, inner functions, inlined Python, literals, raises.
        "WithLifting", "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables",
        "InlineOverloads", "FindLiterallyCalls", "LiteralUnroll",
        "LiteralPropagationSubPipelinePass", "RewriteDynamicRaises",
        # Arrays as expressions; branches that constants decide, which LLVM finds too, so that both
        # sides of one have to make sense; where a variable is let go of, for what is counted.
        "NopythonRewrites", "RewriteSemanticConstants", "DeadBranchPrune", "IRLegalization",
        # For people to read.
        "AnnotateTypes", "DumpParforDiagnostics", "NoPythonSupportedFeatureValidation",
    }
)  # fmt: skip
"""Passes of numba's that a plain scalar function does without."""


class LinkedForm(CompilerBase):
    """numba's compiler for a function that kernels link: fewer passes, no machine code."""

    _passes: ClassVar[_Passes | None] = None  # the same for all

    def __init__(self, typing: Any, target: Any, *others: Any) -> None:
        # numba would look what was added to all it knows, as it just did for what links this one.
        with _instead(typing, refresh=_nothing), _instead(target, refresh=_nothing):
            super().__init__(typing, target, *others)  # type: ignore[no-untyped-call]
        vars(self.state.targetctx).pop("refresh", None)  # a copy of the target
        self.state.flags = _PlainFlags(self.state.flags)  # type: ignore[no-untyped-call]

    def define_pipelines(self) -> list[Any]:
        """Return the passes (numba's name for it)."""
        _give_library(self.state, _LinkedLibrary if self.state.flags.forceinline else _ApartLibrary)
        if LinkedForm._passes is None:
            LinkedForm._passes = _Passes(self.state)
        return [LinkedForm._passes]


class Kernel(CompilerBase):
    """numba's compiler for a kernel."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a kernel and all below it (numba's name for it).

        Millions of objects live until the end of it, and to look for those that do not takes a
        tenth of the time.
        """
        typing = self.state.typingctx
        collects = gc.isenabled()
        gc.disable()
        try:
            with _instead(typing, resolve_function_type=_remembered(typing.resolve_function_type)):
                return super().compile_extra(func)  # type: ignore[no-untyped-call]
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """Return the passes (numba's name for it)."""
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]  # type: ignore[no-untyped-call]


class ShortLoops(Kernel):
    """numba's compiler for a kernel whose inner loops are short, and whose arrays are apart."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call]
        self.state.flags.noalias = True

    def define_pipelines(self) -> list[Any]:
        """Return the passes (numba's name for it)."""
        _give_library(self.state, _ShortLoopsLibrary)
        self.state.library.enable_object_caching()
        return super().define_pipelines()


def _give_library(state: Any, library: type[JITCodeLibrary]) -> None:
    """Set where the LLVM code of what is compiled goes to."""
    state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)


class _Passes(PassManager):
    """The passes of a linked function, one after the other.

    numba's own would tell who listens of each, time it, print the types of all arguments, and take
    its lock, which the kernel that links the function holds.
    """

    def __init__(self, state: Any) -> None:
        super().__init__("nopython")  # type: ignore[no-untyped-call]
        whole = DefaultPassBuilder.define_nopython_pipeline(state)  # type: ignore[no-untyped-call]
        self.passes = [p for p in whole.passes if p[0].__name__ not in _NEEDLESS]
        self.finalize()  # type: ignore[no-untyped-call]

    def _runPass(self, index: int, pss: Any, internal_state: Any) -> None:  # noqa: N802 (numba's)
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)


@contextmanager
def _instead(context: Any, **methods: Callable[..., Any]) -> Iterator[None]:
    """Let one of numba's contexts do something else for a while (it holds its lock meanwhile)."""
    own = vars(context)
    before = {name: own[name] for name in methods if name in own}
    own.update(methods)
    try:
        yield
    finally:
        for name in methods:
            del own[name]
        own.update(before)


def _nothing() -> None:
    pass


def _remembered(resolve: Callable[..., Any]) -> Callable[..., Any]:
    """Return numba's search for what a call of these types returns, with a memory.

    It tries every form of an operator anew wherever the operator stands, for an eighth of the time.
    """
    found: dict[Any, Any] = {}

    def look_up(function: Any, args: Any, kws: Any) -> Any:
        # What is only a name to numba ("static_getitem") takes values, not types.
        if kws or isinstance(function, str):
            return resolve(function, args, kws)
        key = function, tuple(args)
        if key not in found:
            found[key] = resolve(function, args, kws)
        return found[key]

    return look_up


class _PlainFlags(Flags):
    """numba's flags, compared by what is set alone.

    They are part of a key that is looked up for every operator of every function, where numba
    lists and sorts all its defaults each time, for a sixth of the time to compile.
    """

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flags) and bool(self._values == other._values)


class _LoopsAsWritten(JITCodeLibrary):
    """LLVM code in which no loop of unknown length is unrolled.

    Loops over blocks and trackers run once or a few times: copies of their bodies for long runs
    would only be jumped over, and take time to compile. A loop of known length is unrolled.
    """

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            _mark_loops(ir_module, function)
        super().add_ir_module(ir_module)  # type: ignore[no-untyped-call]


def _mark_loops(module: Any, function: Any) -> None:
    """Forbid LLVM to unroll at run time what any jump backwards in a function repeats."""
    place = {id(block): k for k, block in enumerate(function.blocks)}
    wish = module.add_metadata([_NO_RUNTIME_UNROLL])
    loops: dict[int, Any] = {}
    for k, block in enumerate(function.blocks):
        jump = block.terminator
        for target in jump.operands if jump is not None and jump.opname == "br" else ():
            if place.get(id(target), len(place)) > k:
                continue
            if id(target) not in loops:
                # A loop is known by a node whose first part is the node itself.
                node = module.add_metadata([f"{function.name} {target.name}"])
                node.operands = (node, wish)
                loops[id(target)] = node
            jump.set_metadata("llvm.loop", loops[id(target)])


class _LinkedLibrary(_LoopsAsWritten):
    """LLVM code that waits for a kernel to link, optimise and run it."""

    def _optimize_functions(self, ll_module: Any) -> None:
        # numba would go over all that are only called here, too: four of five.
        codegen: Any = self._codegen
        ll_module.data_layout = codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = codegen._function_pass_manager()
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True  # and not handed to the engine, which would make machine code

    @property
    def codegen(self) -> Any:
        """What numba gives the function's Python environment to: there is none."""
        return _NoEnvironment


class _ApartLibrary(_LinkedLibrary):
    """LLVM code of a function that is not to become part of the one place that calls it."""

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            if function.blocks and "alwaysinline" not in function.attributes:
                function.attributes.add("noinline")
        super().add_ir_module(ir_module)


class _NoEnvironment:
    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        pass


class _ShortLoopsLibrary(_LoopsAsWritten):
    """LLVM code whose vectors come from what stands side by side, not from turns of a loop."""

    def _optimize_final_module(self) -> None:
        # Once, not twice: numba's first round serves its reference counts, of which there are none.
        codegen: Any = self._codegen
        passes, builder = codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=True)
        passes.run(self._final_module, builder)
