"""What rules, policies and a user's own functions are written with.

Arrays and records, lanes (eight numbers at a time), the decorators that compile, and the spread of
many worlds over threads. Knows nothing of worlds: every other room may import it.
"""

from posse.numeric.arrays import BoolArray, FloatArray, OwnArrays, Record, Records
from posse.numeric.compiling import UNCOMPILED, compiled, direct, kernel
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
from posse.numeric.threads.turn_code import Numbers, parts_of, worlds_of
from posse.numeric.threads.turns import all_at_once, by_turns, threads_for
from posse.numeric.written import written

__all__ = [
    "UNCOMPILED",
    "WIDTH",
    "BoolArray",
    "FloatArray",
    "Lanes",
    "Mask",
    "Numbers",
    "OwnArrays",
    "Record",
    "Records",
    "all_at_once",
    "bits",
    "by_turns",
    "choose",
    "compiled",
    "counts",
    "direct",
    "eight",
    "fetch",
    "greater",
    "kernel",
    "least",
    "lesser",
    "load",
    "load_fields",
    "lowest_bit",
    "parts_of",
    "root",
    "store",
    "store_fields",
    "tag",
    "tagged",
    "threads_for",
    "transpose",
    "worlds_of",
    "written",
]
