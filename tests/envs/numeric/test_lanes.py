"""Each lane equals the scalar result, independent of the other lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse.numeric import (
    ONE,
    WIDTH,
    bits,
    choose,
    eight,
    greater,
    kernel,
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
    store(out, 88, choose(x == y, ONE, _TWO))
    store(out, 96, choose((x < y) & (x > ONE), x, y))
    store(out, 104, choose((x < y) | (x > ONE), x, y))
    store(out, 112, ONE - x)
    store(out, 120, eight(_TWO) * x + ONE)
    store(out, 128, choose(x > _TWO, ONE, x))


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
    lambda x, y: ONE if x == y else _TWO,
    lambda x, y: x if x < y and x > ONE else y,
    lambda x, y: x if x < y or x > ONE else y,
    lambda x, y: ONE - x,
    lambda x, y: _TWO * x + ONE,
    lambda x, y: ONE if x > _TWO else x,
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


@kernel
def move(numbers: Numbers, out: Numbers, index: npt.NDArray[np.int64], limit: np.float32) -> np.float32:
    """Transpose eight times eight numbers; write the places of those of the first eight above a limit."""
    a, b, c, d, e, f, g, h = transpose(
        load(numbers, 0),
        load(numbers, 8),
        load(numbers, 16),
        load(numbers, 24),
        load(numbers, 32),
        load(numbers, 40),
        load(numbers, 48),
        load(numbers, 56),
    )
    store(out, 0, a)
    store(out, 8, b)
    store(out, 16, c)
    store(out, 24, d)
    store(out, 32, e)
    store(out, 40, f)
    store(out, 48, g)
    store(out, 56, h)
    left, count = bits(load(numbers, 0) > limit), 0
    while left != 0:
        index[count] = lowest_bit(left)
        left &= left - 1
        count += 1
    return least(load(numbers, 3))


@kernel
def put_in_and_take_out(numbers: Numbers, number: int, out: Numbers) -> None:
    """Tag eight numbers, and read the tags."""
    both = tagged(load(numbers, 0), number)
    store(out, 0, both)
    store(out, 8, tag(both))


@kernel
def double_fix(trackers: Any) -> None:
    """Double the eight fields of the second tracker's fix, and keep its pose, which ends with whole numbers."""
    store_fields(trackers[1], FIX, load_fields(trackers[1], FIX) * _TWO)
    store_fields(trackers[1], POSE, load_fields(trackers[1], POSE))


@pytest.mark.parametrize("function", [alone, getattr(alone, "py_func", alone)])
@settings(derandomize=True, max_examples=100, deadline=None)
@given(x=sensible.map(np.float32), y=sensible.map(np.float32))
def test_functions_that_only_calculate_take_plain_numbers_too(
    function: Callable[..., Any], x: np.float32, y: np.float32
) -> None:
    assert function(x, y) == (min(x, y), max(x, y), abs(x), min(x, y))


@pytest.mark.parametrize("function", [move, getattr(move, "py_func", move)])
def test_rows_become_columns_and_masks_bits(function: Callable[..., np.float32]) -> None:
    numbers = np.random.default_rng(0).permutation(64).astype(np.float32)
    out, index = np.zeros(64, np.float32), np.full(WIDTH, -1)
    assert function(numbers, out, index, np.float32(30.0)) == numbers[3:11].min()
    np.testing.assert_array_equal(out.reshape(8, 8), numbers.reshape(8, 8).T)
    above = np.flatnonzero(numbers[:8] > 30.0)
    np.testing.assert_array_equal(index[: len(above)], above)
    assert (index[len(above) :] == -1).all()


@pytest.mark.parametrize(
    "function", [put_in_and_take_out, getattr(put_in_and_take_out, "py_func", put_in_and_take_out)]
)
@pytest.mark.parametrize("number", [0, 17, 63])
def test_a_tag_changes_its_number_by_a_131072nd_at_most(function: Callable[..., None], number: int) -> None:
    numbers, out = np.geomspace(2.0**-40, 1e9, WIDTH).astype(np.float32), np.zeros(2 * WIDTH, np.float32)
    function(numbers, number, out)
    np.testing.assert_allclose(out[:WIDTH], numbers, rtol=2**-17)
    assert out[WIDTH:].tolist() == [number] * WIDTH


@pytest.mark.parametrize("function", [double_fix, getattr(double_fix, "py_func", double_fix)])
def test_records_are_read_and_written_where_their_fields_are(function: Callable[..., None]) -> None:
    """Whole numbers keep their bits, some of which are nan as float32."""
    trackers = np.zeros(3, TRACKER)
    for k, name in enumerate(TRACKER.names or ()):
        trackers[name] = k + np.arange(3)
    trackers["broken_at"], trackers["breaks_at"] = 2**30, 0x7FA00001
    wanted = trackers.copy()
    for array in (wanted["fix_vx"], wanted["fix_vy"], *(wanted["fix"][name] for name in TRACKER["fix"].names or ())):
        array[1] *= 2
    function(trackers)
    assert trackers.tolist() == wanted.tolist()
