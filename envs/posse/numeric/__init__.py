"""Numerical building blocks for rules, policies and users' own functions.

Arrays and records, lanes (blocks of eight numbers), the decorators that compile functions, and
distribution of work over threads. It depends on no other room, and every room may import it.
"""

from posse.numeric.arrays import BoolArray, FloatArray, OwnArrays, Record, Records
from posse.numeric.blocks import Blocks, blocks_of, divide, worlds_of
from posse.numeric.compiling import UNCOMPILED, checked_before_compiling, compiled, direct, kernel
from posse.numeric.simd.lanes import (
    WIDTH,
    Lanes,
    Mask,
    bits,
    choose,
    counts,
    eight,
    fetch,
    greater,
    least,
    lesser,
    load,
    load_fields,
    lowest_bit,
    root,
    store,
    store_fields,
    tag,
    tagged,
    transpose,
)
from posse.numeric.threads import MOST_THREADS, over_worlds, run_threads, threads_for

__all__ = [
    "MOST_THREADS",
    "UNCOMPILED",
    "WIDTH",
    "Blocks",
    "BoolArray",
    "FloatArray",
    "Lanes",
    "Mask",
    "OwnArrays",
    "Record",
    "Records",
    "bits",
    "blocks_of",
    "checked_before_compiling",
    "choose",
    "compiled",
    "counts",
    "direct",
    "divide",
    "eight",
    "fetch",
    "greater",
    "kernel",
    "least",
    "lesser",
    "load",
    "load_fields",
    "lowest_bit",
    "over_worlds",
    "root",
    "run_threads",
    "store",
    "store_fields",
    "tag",
    "tagged",
    "threads_for",
    "transpose",
    "worlds_of",
]
