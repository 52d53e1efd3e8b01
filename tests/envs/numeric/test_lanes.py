"""Each lane equals the scalar result, independent of the other lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse import numeric as lanes
from posse.numeric import kernel

Numbers = npt.NDArray[np.float32]

_TWO = np.float32(2.0)


def forms(function: Callable[..., Any]) -> pytest.MarkDecorator:
    """Test a kernel compiled and as plain Python."""
    return pytest.mark.parametrize("function", [function, getattr(function, "py_func", function)])


@kernel
def calculate(a: Numbers, b: Numbers, out: Numbers) -> None:
    """Every operation, a block of eight results each."""
    x, y = lanes.load(a, 0), lanes.load(b, 0)
    lanes.store(out, 0, x + y)
    lanes.store(out, 8, x - y)
    lanes.store(out, 16, x * y)
    lanes.store(out, 24, x / y)
    lanes.store(out, 32, lanes.lesser(x, y))
    lanes.store(out, 40, lanes.greater(x, y))
    lanes.store(out, 48, lanes.root(x * x))
    lanes.store(out, 56, lanes.choose(x < y, abs(x), -y))
    lanes.store(out, 64, lanes.choose(x <= y, x, y))
    lanes.store(out, 72, lanes.choose(x > y, x, y))
    lanes.store(out, 80, lanes.choose(x >= y, x, y))
    lanes.store(out, 88, lanes.choose(x == y, lanes.ONE, _TWO))
    lanes.store(out, 96, lanes.choose((x < y) & (x > lanes.ONE), x, y))
    lanes.store(out, 104, lanes.choose((x < y) | (x > lanes.ONE), x, y))
    lanes.store(out, 112, lanes.ONE - x)
    lanes.store(out, 120, lanes.eight(_TWO) * x + lanes.ONE)
    lanes.store(out, 128, lanes.choose(x > _TWO, lanes.ONE, x))


NUMBER_BY_NUMBER: tuple[Callable[[np.float32, np.float32], np.float32], ...] = (
    lambda x, y: x + y,
    lambda x, y: x - y,
    lambda x, y: x * y,
    lambda x, y: x / y,
    lambda x, y: x if x <= y else y,
    lambda x, y: x if x >= y else y,
    lambda x, y: np.sqrt(x * x),
    lambda x, y: abs(x) if x < y else -y,
    lambda x, y: x if x <= y else y,
    lambda x, y: x if x > y else y,
    lambda x, y: x if x >= y else y,
    lambda x, y: lanes.ONE if x == y else _TWO,
    lambda x, y: x if x < y and x > lanes.ONE else y,
    lambda x, y: x if x < y or x > lanes.ONE else y,
    lambda x, y: lanes.ONE - x,
    lambda x, y: _TWO * x + lanes.ONE,
    lambda x, y: lanes.ONE if x > _TWO else x,
)

sensible = st.floats(-1e6, 1e6, width=32).filter(lambda x: abs(x) > 1e-6)
eight_numbers = st.lists(sensible, min_size=lanes.WIDTH, max_size=lanes.WIDTH)


@forms(calculate)
@settings(derandomize=True, max_examples=100, deadline=None)
@given(eight_numbers, eight_numbers)
def test_a_lane_is_what_a_number_alone_would_be(
    function: Callable[..., Any], first: list[float], second: list[float]
) -> None:
    a, b = np.array(first, np.float32), np.array(second, np.float32)
    b[:2] = a[:2]  # equal ones, too
    found = np.zeros(lanes.WIDTH * len(NUMBER_BY_NUMBER), np.float32)
    function(a, b, found)
    expected = [alone(x, y) for alone in NUMBER_BY_NUMBER for x, y in zip(a, b, strict=True)]
    np.testing.assert_array_equal(found, np.array(expected, np.float32))


@kernel
def move(numbers: Numbers, out: Numbers, index: npt.NDArray[np.int64], limit: np.float32) -> np.float32:
    """Transpose eight times eight numbers; write the places of those of the first eight above a limit."""
    x, y, z = lanes.load(numbers, 0), lanes.load(numbers, 8), lanes.load(numbers, 16)
    rows = lanes.transpose(x, y, z, lanes.load(numbers, 24), x + y, y + z, x + z, x)
    lanes.store(out, 0, rows[0])
    lanes.store(out, 8, rows[1])
    lanes.store(out, 16, rows[6])
    lanes.store(out, 24, rows[7])
    left, count = lanes.bits(x > limit), 0
    while left != 0:
        index[count] = lanes.lowest_bit(left)
        left &= left - 1
        count += 1
    return lanes.least(lanes.load(numbers, 3))


@forms(move)
def test_rows_become_columns_and_masks_bits(function: Callable[..., np.float32]) -> None:
    numbers = np.random.default_rng(0).permutation(32).astype(np.float32)
    out, index = np.zeros(32, np.float32), np.full(lanes.WIDTH, -1)
    assert function(numbers, out, index, np.float32(15.0)) == numbers[3:11].min()
    x, y, z, last = numbers.reshape(4, 8)
    np.testing.assert_array_equal(out.reshape(4, 8), np.array([x, y, z, last, x + y, y + z, x + z, x]).T[[0, 1, 6, 7]])
    above = np.flatnonzero(x > 15.0)
    np.testing.assert_array_equal(index, [*above, *[-1] * (lanes.WIDTH - len(above))])


PART = np.dtype([("a", np.float32), ("b", np.float32), ("count", np.int32)])
RECORD = np.dtype([("first", np.int32), ("numbers", np.float32), ("part", PART), ("rest", np.float32), ("last", PART)])


@kernel
def double_numbers(records: Any) -> None:
    """Double the numbers of the second record from byte 4 on; whole numbers are copied."""
    read = lanes.load_fields(records[1], 4)
    lanes.store_fields(records[1], 4, lanes.choose(lanes.counts(read) > np.float32(1e9), read * _TWO, read))


@forms(double_numbers)
def test_records_are_read_and_written_where_their_fields_are(function: Callable[..., None]) -> None:
    """Also in records within them; small whole numbers keep their bits."""
    records = np.zeros(3, RECORD)
    for k, words in enumerate(records.view(np.float32).reshape(3, -1)):
        words[:] = 1.0 + k
    for whole in (records["first"], records["part"]["count"], records["last"]["count"]):
        whole[:] = 7
    before = records.copy()
    function(records)
    before["numbers"][1] = before["rest"][1] = 4.0
    for part in (before["part"][1], before["last"][1]):
        part["a"] = part["b"] = 4.0
    np.testing.assert_array_equal(records, before)
