"""The two halves of a control step, with a correction of the wanted velocity in between.

The correction comes before the safeguard, so that a corrected team avoids contact as well as the
team itself does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from posse.numeric import Blocks, FloatArray, Record, Records, compiled, kernel, worlds_of
from posse_baselines.ddcs.belief import write_belief
from posse_baselines.ddcs.controller import carry_out, feel_body, plan
from posse_baselines.laws.geometry import length
from posse_baselines.laws.heading import regulate


@compiled
def write_proposal(d: Record, body: Record, proposal: FloatArray) -> None:
    """Write the wanted velocity, ahead and to the left, as a share of the greatest speed."""
    c, s = body.heading_cos, body.heading_sin
    proposal[0] = (d.wish_x * c + d.wish_y * s) / body.max_speed
    proposal[1] = (d.wish_y * c - d.wish_x * s) / body.max_speed


@compiled
def correct(d: Record, body: Record, ahead: float, left: float) -> None:
    """Add to the wanted velocity, in shares of the greatest speed, which also limits the sum.

    The command changes by what regulation of the two velocities differs by, so that a small
    correction changes little, whatever law the command came from.
    """
    if ahead == 0.0 and left == 0.0:
        return
    c, s, top = body.heading_cos, body.heading_sin, body.max_speed
    x = d.wish_x + top * (ahead * c - left * s)
    y = d.wish_y + top * (ahead * s + left * c)
    excess = max(1.0, length(x, y) / max(top, length(d.wish_x, d.wish_y)))
    x, y = x / excess, y / excess
    old_speed, old_omega = regulate(body, d.wish_x, d.wish_y, 0.0)
    speed, omega = regulate(body, x, y, 0.0)
    d.wish_x, d.wish_y = x, y
    d.wish_speed += speed - old_speed
    d.wish_omega += omega - old_omega


@kernel
def propose_all(
    offsets: Records,
    settings: Records,
    slots: Records,
    outermost: float,
    minds: Records,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    observations: FloatArray,
    costs: FloatArray,
    work: FloatArray,
    bodies: Records,
    proposals: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Plan in a thread's worlds, and write the wanted velocities (E, N, 2)."""
    f, s = offsets[0], settings[0]
    for e in worlds_of(thread, blocks):
        for i in range(observations.shape[1]):
            plan(
                f,
                s,
                slots,
                outermost,
                minds[e, i],
                mates[e, i],
                seen[e, i],
                observations[e, i],
                costs[thread],
                work[thread],
                bodies[thread],
            )
            write_proposal(minds[e, i], bodies[thread], proposals[e, i])


@kernel
def correct_all(
    offsets: Records,
    settings: Records,
    slots: Records,
    minds: Records,
    mates: Records,
    observations: FloatArray,
    beams: FloatArray,
    discs: Records,
    bodies: Records,
    plays: Records,
    corrections: FloatArray,
    actions: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Carry out the corrected plans of a thread's worlds."""
    f, s = offsets[0], settings[0]
    for e in worlds_of(thread, blocks):
        for i in range(observations.shape[1]):
            d, o, body = minds[e, i], observations[e, i], bodies[thread]
            feel_body(f, o, body)
            correct(d, body, float(corrections[e, i, 0]), float(corrections[e, i, 1]))
            carry_out(f, s, slots, d, mates[e, i], o, beams, discs[thread], body, plays[thread], actions[e, i])


@kernel
def write_beliefs(
    offsets: Records,
    settings: Records,
    slots: Records,
    minds: Records,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    observations: FloatArray,
    beliefs: FloatArray,
    thread: int,
    blocks: Blocks,
) -> None:
    """Write the beliefs (E, N, BELIEF_SIZE) of a thread's worlds."""
    f, s = offsets[0], settings[0]
    for e in worlds_of(thread, blocks):
        for i in range(observations.shape[1]):
            write_belief(f, s, slots, minds[e, i], mates[e, i], seen[e, i], observations[e, i], beliefs[e, i])
