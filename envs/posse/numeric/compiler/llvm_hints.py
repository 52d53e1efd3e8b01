"""Hints to LLVM in the code that numba hands to it, by llvmlite's public interface."""

from __future__ import annotations

from typing import Any


def add_hints(module: Any) -> None:
    """Add all hints to a module."""
    forbid_runtime_unrolling(module)
    keep_out_of_line(module)


def forbid_runtime_unrolling(module: Any) -> None:
    """Mark every loop, so that LLVM does not unroll those of unknown length.

    Loops over blocks and trackers run a few times: copies of their bodies for long runs would only
    be jumped over. A loop of known length is unrolled.
    """
    option = module.add_metadata(["llvm.loop.unroll.runtime.disable"])
    for function in module.functions:
        loops: dict[int, Any] = {}  # by their first block: a jump to an earlier one is a loop
        for block in function.blocks:
            loops[id(block)] = None
            jump = block.terminator
            for target in jump.operands if jump is not None and jump.opname == "br" else ():
                if id(target) in loops:
                    if loops[id(target)] is None:
                        # LLVM identifies a loop by a node whose first operand is the node.
                        node = module.add_metadata([f"{function.name} {target.name}"])
                        node.operands = (node, option)
                        loops[id(target)] = node
                    jump.set_metadata("llvm.loop", loops[id(target)])


def keep_out_of_line(module: Any) -> None:
    """Forbid LLVM to inline functions that are not always inlined."""
    for function in module.functions:
        if function.blocks and "alwaysinline" not in function.attributes:
            function.attributes.add("noinline")


def drop_if_inlined(module: Any) -> None:
    """Let LLVM drop the functions of a parsed module wherever all their calls are inlined."""
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "linkonce_odr"
