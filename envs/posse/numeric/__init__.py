"""Numerical building blocks for rules, policies and users' own functions.

Arrays and records, constants, lanes (blocks of eight numbers), the decorators that compile functions, and
distribution of work over threads. It depends on no other room, and every room may import it.
"""

from posse.numeric.arrays import HALF, ONE, TINY, ZERO, BoolArray, FloatArray, OwnArrays, Record, Records, record_type
from posse.numeric.compile import UNCOMPILED, compiled, kernel
from posse.numeric.lanes import WIDTH, Lanes, Mask, choose, eight, greater, lesser, load, root, store
from posse.numeric.threads import MOST_THREADS, over_worlds

__all__ = [
    "HALF",
    "MOST_THREADS",
    "ONE",
    "TINY",
    "UNCOMPILED",
    "WIDTH",
    "ZERO",
    "BoolArray",
    "FloatArray",
    "Lanes",
    "Mask",
    "OwnArrays",
    "Record",
    "Records",
    "choose",
    "compiled",
    "eight",
    "greater",
    "kernel",
    "lesser",
    "load",
    "over_worlds",
    "record_type",
    "root",
    "store",
]
