"""l-l formation control: a follower keeps its distances from two leaders (section 3.4).

Desai, Ostrowski and Kumar (2001). Symbols as in :mod:`~posse_baselines.laws.l_phi`, for the two
leaders i and k.
"""

from __future__ import annotations

import math

from posse.numeric import compiled
from posse_baselines.laws.l_phi import point_velocity


@compiled
def l_l_velocity(
    l_i: float,
    along_i: float,
    across_i: float,
    gamma_i: float,
    l_k: float,
    along_k: float,
    across_k: float,
    gamma_k: float,
    wanted_crossing: float,
    min_crossing_sine: float,
) -> tuple[float, float]:
    """Return (v_j, d ω_j), m/s, that keep a follower's distances to two leaders i and k.

    Both dl/dt equations, solved for v_j and d ω_j::

        cos(γ_i) v_j + sin(γ_i) d ω_j = A_i
        cos(γ_k) v_j + sin(γ_k) d ω_j = A_k

    The determinant is sin(γ_k - γ_i), the sine of the angle at which the two lines cross.
    Two distances fit two places, one on each side of the line through the leaders:
    ``wanted_crossing`` (rad), γ_k - γ_i in the wanted place, says which. Where the lines
    are nearly parallel (a sine below ``min_crossing_sine``, in (0, 1)), or the follower is on the
    wrong side, it keeps its place on the nearer leader instead, by l-φ.

    A (``along``) and B (``across``) of each leader come from
    :func:`~posse_baselines.laws.l_phi.l_phi_demand`; B is used by the fallback only. Without limits
    each distance error decays as exp(-α_1 t) otherwise.
    """
    determinant = math.sin(gamma_k - gamma_i)
    side = 1.0 if math.sin(wanted_crossing) >= 0.0 else -1.0
    if side * determinant < min_crossing_sine:
        if l_i <= l_k:
            return point_velocity(along_i, across_i, gamma_i)
        return point_velocity(along_k, across_k, gamma_k)
    speed = (along_i * math.sin(gamma_k) - along_k * math.sin(gamma_i)) / determinant
    sideways = (along_k * math.cos(gamma_i) - along_i * math.cos(gamma_k)) / determinant
    return speed, sideways
