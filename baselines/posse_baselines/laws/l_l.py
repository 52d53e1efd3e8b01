"""l-l formation control: a follower keeps its distances from two leaders (section 3.4).

Desai, Ostrowski and Kumar (2001). Symbols as in :mod:`~posse_baselines.laws.l_phi`, for the two
leaders i and k.
"""

from __future__ import annotations

import math

from posse.numeric import compiled
from posse_baselines.laws.l_phi import Demand, point_velocity


@compiled
def l_l_velocity(i: Demand, k: Demand, wanted_crossing: float, min_crossing_sine: float) -> complex:
    """Return v_j + i d ω_j (m/s) that keeps a follower's distances to two leaders i and k.

    Both dl/dt equations, solved for v_j and d ω_j::

        cos(γ_i) v_j + sin(γ_i) d ω_j = A_i
        cos(γ_k) v_j + sin(γ_k) d ω_j = A_k

    The determinant is sin(γ_k - γ_i), the sine of the angle at which the two lines cross.
    Two distances fit two places, one on each side of the line through the leaders:
    ``wanted_crossing`` (rad), γ_k - γ_i in the wanted place, says which. Where the lines
    are nearly parallel (a sine below ``min_crossing_sine``, in (0, 1)), or the follower is on the
    wrong side, it keeps its place on the nearer leader instead, by l-φ. Without limits each distance error decays as
    exp(-α_1 t) otherwise.
    """
    determinant = math.sin(k.gamma - i.gamma)
    side = 1.0 if math.sin(wanted_crossing) >= 0.0 else -1.0
    if side * determinant < min_crossing_sine:
        return point_velocity(i) if i.l <= k.l else point_velocity(k)
    a_i, a_k = i.velocity.real, k.velocity.real
    speed = (a_i * math.sin(k.gamma) - a_k * math.sin(i.gamma)) / determinant
    sideways = (a_k * math.cos(i.gamma) - a_i * math.cos(k.gamma)) / determinant
    return complex(speed, sideways)
