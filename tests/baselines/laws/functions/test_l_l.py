"""The two distances of l-l, and where it falls back on the nearer leader."""

from __future__ import annotations

import math

import pytest
from tests.support.minds import turn
from tests.support.plain import plain

l_l = plain("laws.l_l")


@pytest.mark.parametrize("wanted", [1.2, -1.2])
@pytest.mark.parametrize("crossing", [0.1, 0.2, 1.5, 2.9, -0.1, -0.2, -1.5, -2.9])
@pytest.mark.parametrize("nearer", ["i", "k"])
def test_both_rates_are_as_asked_for_unless_the_lines_hardly_cross_on_the_wanted_side(
    crossing: float, wanted: float, nearer: str
) -> None:
    gamma_i, gamma_k = 0.4, 0.4 + crossing
    l_i, l_k = (1.0, 2.0) if nearer == "i" else (2.0, 1.0)
    found = complex(*l_l.l_l_velocity(l_i, 0.3, 0.7, gamma_i, l_k, -0.5, 0.2, gamma_k, wanted, 0.15))
    if math.copysign(1.0, wanted) * math.sin(crossing) < 0.15:
        demand, gamma = (0.3 + 0.7j, gamma_i) if nearer == "i" else (-0.5 + 0.2j, gamma_k)
        assert found == pytest.approx(demand * turn(gamma))
    else:
        rates = (found / turn(gamma_i)).real, (found / turn(gamma_k)).real
        assert rates == pytest.approx((0.3, -0.5))
