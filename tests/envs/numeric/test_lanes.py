"""Each lane equals the scalar result, independent of the other lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse.numeric.compile import kernel
from posse.numeric.lanes import (
    WIDTH,
    bits,
    choose,
    eight,
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
from posse.rules.state import FIX, POSE, TRACKER

Numbers = npt.NDArray[np.float32]

_ONE = np.float32(1.0)
_TWO = np.float32(2.0)


@kernel
def calculate(a: Numbers, b: Numbers, out: Numbers) -> None:
    """Every operation, a block of eight results each."""
    x, y = load(a, 0), load(b, 0)
    store(out, 0, x + y)
    store(out, 8, x - y)
    store(out, 16, x * y)
    store(out, 24, x / y)
    store(out, 32, lesser(x, y))
    store(out, 40, greater(x, y))
    store(out, 48, root(x * x))
    store(out, 56, choose(x < y, x, y))
    store(out, 64, choose(x <= y, x, y))
    store(out, 72, choose(x > y, x, y))
    store(out, 80, choose(x >= y, x, y))
    store(out, 88, choose(x == y, _ONE, _TWO))
    store(out, 96, choose((x < y) & (x > _ONE), x, y))
    store(out, 104, choose((x < y) | (x > _ONE), x, y))
    store(out, 112, _ONE - x)
    store(out, 120, eight(_TWO) * x + _ONE)
    store(out, 128, choose(x > _TWO, _ONE, x))


NUMBER_BY_NUMBER: tuple[Callable[[np.float32, np.float32], np.float32], ...] = (
    lambda x, y: x + y,
    lambda x, y: x - y,
    lambda x, y: x * y,
    lambda x, y: x / y,
    lambda x, y: x if x <= y else y,
    lambda x, y: x if x >= y else y,
    lambda x, y: np.sqrt(x * x),
    lambda x, y: x if x < y else y,
    lambda x, y: x if x <= y else y,
    lambda x, y: x if x > y else y,
    lambda x, y: x if x >= y else y,
    lambda x, y: _ONE if x == y else _TWO,
    lambda x, y: x if x < y and x > _ONE else y,
    lambda x, y: x if x < y or x > _ONE else y,
    lambda x, y: _ONE - x,
    lambda x, y: _TWO * x + _ONE,
    lambda x, y: _ONE if x > _TWO else x,
)

plain_function: Callable[..., Any] = getattr(calculate, "py_func", calculate)
sensible = st.floats(-1e6, 1e6, width=32).filter(lambda x: abs(x) > 1e-6)
eight_numbers = st.lists(sensible, min_size=WIDTH, max_size=WIDTH)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(eight_numbers, eight_numbers, st.permutations(range(WIDTH)))
def test_a_lane_is_what_a_number_alone_would_be(first: list[float], second: list[float], order: list[int]) -> None:
    a, b = np.array(first, np.float32), np.array(second, np.float32)
    b[:2] = a[:2]  # equal ones, too
    size = WIDTH * len(NUMBER_BY_NUMBER)
    compiled, plain, swapped = (np.zeros(size, np.float32) for _ in range(3))
    calculate(a, b, compiled)
    plain_function(a, b, plain)
    calculate(a[order], b[order], swapped)
    expected = [function(x, y) for function in NUMBER_BY_NUMBER for x, y in zip(a, b, strict=True)]
    np.testing.assert_array_equal(compiled, np.array(expected, np.float32))
    np.testing.assert_array_equal(plain, compiled)
    np.testing.assert_array_equal(swapped.reshape(-1, WIDTH), compiled.reshape(-1, WIDTH)[:, order])


@kernel
def alone(x: np.float32, y: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """The functions that take plain numbers, too."""
    return lesser(x, y), greater(x, y), root(x * x), choose(x < y, x, y)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(sensible, sensible)
def test_functions_that_only_calculate_take_plain_numbers_too(first: float, second: float) -> None:
    x, y = np.float32(first), np.float32(second)
    expected = (min(x, y), max(x, y), abs(x), min(x, y))
    assert alone(x, y) == expected
    assert (lesser(x, y), greater(x, y), root(x * x), choose(x < y, x, y)) == expected


@kernel
def turn(rows: Numbers, out: Numbers) -> None:
    """Swap rows and columns."""
    a, b, c, d, e, f, g, h = transpose(
        load(rows, 0),
        load(rows, 8),
        load(rows, 16),
        load(rows, 24),
        load(rows, 32),
        load(rows, 40),
        load(rows, 48),
        load(rows, 56),
    )
    store(out, 0, a)
    store(out, 8, b)
    store(out, 16, c)
    store(out, 24, d)
    store(out, 32, e)
    store(out, 40, f)
    store(out, 48, g)
    store(out, 56, h)


@pytest.mark.parametrize("function", [turn, getattr(turn, "py_func", turn)])
def test_rows_become_columns(function: Callable[..., None]) -> None:
    rows, out = np.arange(64, dtype=np.float32), np.zeros(64, np.float32)
    function(rows, out)
    np.testing.assert_array_equal(out.reshape(8, 8), rows.reshape(8, 8).T)


@kernel
def the_least(a: Numbers) -> np.float32:
    """The least of eight numbers that stand between others."""
    return least(load(a, 1))


@pytest.mark.parametrize("function", [the_least, getattr(the_least, "py_func", the_least)])
@pytest.mark.parametrize("place", range(WIDTH))
def test_the_least_may_be_in_any_lane(function: Callable[..., np.float32], place: int) -> None:
    numbers = np.arange(3, 3 + WIDTH + 2, dtype=np.float32)
    numbers[0] = numbers[-1] = -5.0  # beside the eight that are looked at
    numbers[1 + place] = -2.0
    assert function(numbers) == -2.0


@kernel
def places(a: Numbers, limit: np.float32, out: npt.NDArray[np.int64]) -> int:
    """Write the places of those of eight numbers that are above a limit; return how many."""
    left, count = bits(load(a, 0) > limit) << 56, 0
    while left != 0:
        out[count] = lowest_bit(left) - 56
        left &= left - 1
        count += 1
    return count


@pytest.mark.parametrize("function", [places, getattr(places, "py_func", places)])
@pytest.mark.parametrize("mask", [0, 1, 0b10000000, 0b01101001, 0b11111111])
def test_a_mask_has_a_bit_for_each_lane(function: Callable[..., int], mask: int) -> None:
    chosen = [k for k in range(WIDTH) if mask >> k & 1]
    numbers, out = np.zeros(WIDTH, np.float32), np.zeros(WIDTH, np.int64)
    numbers[chosen] = 5.0
    count = function(numbers, np.float32(1.0), out)
    assert out[:count].tolist() == chosen


@kernel
def put_in_and_take_out(a: Numbers, number: int, out: Numbers) -> None:
    """Tag eight numbers, and read the tags."""
    both = tagged(load(a, 0), number)
    store(out, 0, both)
    store(out, 8, tag(both))


@settings(derandomize=True, max_examples=200, deadline=None)
@given(st.lists(st.floats(2.0**-40, 1e9, width=32), min_size=WIDTH, max_size=WIDTH), st.integers(0, 63))
def test_a_tag_is_kept_and_changes_its_number_by_a_131072nd_at_most(values: list[float], number: int) -> None:
    a = np.array(values, np.float32)
    for function in (put_in_and_take_out, getattr(put_in_and_take_out, "py_func", None)):
        if function is not None:
            out = np.zeros(2 * WIDTH, np.float32)
            function(a, number, out)
            np.testing.assert_allclose(out[:WIDTH], a, rtol=2**-17)
            assert out[WIDTH:].tolist() == [number] * WIDTH


@kernel
def double_fix(trackers: Any) -> None:
    """Double the eight fields of the second tracker's fix."""
    store_fields(trackers[1], FIX, load_fields(trackers[1], FIX) * _TWO)


@kernel
def keep_pose(trackers: Any) -> None:
    """Read and write eight fields from x on, of which the last two are whole numbers."""
    store_fields(trackers[1], POSE, load_fields(trackers[1], POSE))


@pytest.mark.parametrize("function", [double_fix, getattr(double_fix, "py_func", double_fix)])
def test_records_are_read_and_written_where_their_fields_are(function: Callable[..., None]) -> None:
    names = ("fix_x", "fix_y", "fix_cos", "fix_sin", "fix_frame_cos", "fix_frame_sin", "fix_vx", "fix_vy")
    trackers = np.zeros(3, TRACKER)
    for k, name in enumerate(TRACKER.names or ()):
        trackers[name] = k + np.arange(3)
    before = trackers.copy()
    function(trackers)
    for name in TRACKER.names or ():
        factor = 2 if name in names else 1
        np.testing.assert_array_equal(trackers[name], before[name] * [1, factor, 1], name)


@pytest.mark.parametrize("function", [keep_pose, getattr(keep_pose, "py_func", keep_pose)])
def test_whole_numbers_among_the_fields_keep_their_bits(function: Callable[..., None]) -> None:
    """For any bits, some of which are nan as float32."""
    trackers = np.zeros(2, TRACKER)
    trackers["broken_at"], trackers["breaks_at"] = 2**30, 0x7FA00001
    before = trackers.copy()
    function(trackers)
    assert trackers.tolist() == before.tolist()
