"""The arrays of a memory."""

from __future__ import annotations

from tests.support.minds import Mind


def test_the_arrays_are_views_of_every_field() -> None:
    m = Mind()
    memory = m.memory
    arrays = m.policy.arrays(memory)
    fields = {f"minds.{name}" for name in memory.minds.dtype.names}
    fields |= {f"mates.{name}" for name in memory.mates.dtype.names}
    assert set(arrays) == {"seen"} | fields
    arrays["minds.slot"][0, 1], arrays["mates.x"][0, 1, 2], arrays["seen"][0, 1, 3] = 4, 2.5, 7
    assert (m.d.slot, m.mates[2].x, m.seen[3]) == (4, 2.5, 7)
