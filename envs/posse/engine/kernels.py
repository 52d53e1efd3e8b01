"""A control step of one world, and the kernels that step all worlds.

Order: actions, faults, target's decision, physics (target first, then trackers by number), slot
frame, contacts, sensing, radio, score, reward, end of the episode, observation.

Only the kernels at the end loop over a batch; the other functions process one world, or eight that
are observed together.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.engine.scratch import SCRATCH
from posse.numeric import (
    ONE,
    WIDTH,
    ZERO,
    BoolArray,
    FloatArray,
    Lanes,
    Record,
    Records,
    choose,
    compiled,
    eight,
    fetch,
    kernel,
    least,
    lesser,
    load,
    stamp,
)
from posse.rules.contact import meet
from posse.rules.discs import find_gaps, lay_out, lay_out_constants, nonnegative
from posse.rules.faults import apply_faults
from posse.rules.motion import drift, motion
from posse.rules.score import occupy, settle
from posse.rules.senses.radio import hear, send, share_fixes
from posse.rules.senses.sensing import look
from posse.rules.start import draw_start, rest
from posse.rules.state import NEVER, WorldArrays, beam_directions, config_record, slot_records
from posse.scenarios import Scenario
from posse.signals.generate import Declarations, Generated, generated_for
from posse.signals.reward import weights_for
from posse.signals.rows import TOGETHER, observe_sonar, observe_together
from posse.signals.user_functions import check_functions


class Tables(NamedTuple):
    """Constants common to the worlds of a batch."""

    config: Records
    """(1,) :data:`posse.rules.state.CONFIG`."""
    slots: Records
    """(N,) :data:`posse.rules.state.SLOT`."""
    beams: FloatArray
    """(2, S) cosine and sine of the sonar's beams."""
    weights: FloatArray
    """(K,) weight of each reward term."""
    target_weights: FloatArray
    """(K,) the same for a target that is an agent."""


class Results(NamedTuple):
    """Outputs of a pass over the worlds."""

    observations: FloatArray
    """(E, rows, F)."""
    rewards: FloatArray
    """(E, rows)."""
    terms: FloatArray
    """(E, rows, K)."""
    flags: BoolArray
    """(2, E): terminated, truncated."""


@compiled
def sense(c: Record, worlds: WorldArrays, e: int, made: Generated, scratch: Record) -> None:
    """Target sensors and radio of every tracker of world e."""
    w, trackers = worlds.world[e], worlds.tracker[e]
    seeing = look(c, w, trackers, worlds.odometry[e], made.sees, made.measure, scratch)
    if c.perfect_radio:
        if seeing < c.num_trackers:  # otherwise all have a fix of this step
            share_fixes(c, trackers)
    else:
        broadcast, message = worlds.broadcast[e], worlds.message[e]
        send(c, w, trackers, worlds.odometry[e], broadcast)
        hear(c, w, trackers, worlds.heard[e], broadcast, worlds.heard_message[e], message)


@compiled(out_of_line=True)
def begin(c: Record, worlds: WorldArrays, e: int, made: Generated) -> None:
    """Initialise an episode of world e, whose poses are set, except for sensing."""
    w = worlds.world[e]
    rest(c, w, worlds.tracker[e])
    made.clear_sums(w)
    worlds.heard[e]["step"][:] = -1
    worlds.heard_message[e][:] = ZERO
    worlds.message[e][:] = ZERO
    worlds.broadcast[e]["sent"][:] = 0
    worlds.command[e][:, :, 0] = -ONE
    worlds.command[e][:, :, 1] = ZERO
    if c.drifts != 0:
        for i in range(c.num_trackers):
            o = worlds.odometry[e, i]
            o.x, o.y, o.heading, o.cos, o.sin = ZERO, ZERO, ZERO, ONE, ZERO


@compiled
def reward(
    c: Record, w: Record, trackers: Records, tables: Tables, made: Generated, rewards: FloatArray, terms: FloatArray
) -> None:
    """Write the reward of every agent (rows,) and its terms (rows, K)."""
    for i in range(c.num_trackers):
        rewards[i] = made.reward(c, w, trackers[i], tables.weights, terms[i])
    if c.target_agent != 0:
        n = c.num_trackers
        rewards[n] = made.target_reward(c, w, tables.target_weights, terms[n])


@compiled
def act(c: Record, worlds: WorldArrays, e: int, actions: FloatArray, made: Generated, scratch: Record) -> None:
    """Move all robots of world e by a control step, and store the messages."""
    w, trackers, message = worlds.world[e], worlds.tracker[e], worlds.message[e]
    apply_faults(c, w, trackers)
    motion(c, w, trackers, worlds.obstacle[e], actions, worlds.command[e], made.set_goal, scratch)
    w.step += 1
    if c.drifts != 0:
        drift(c, w, worlds.odometry[e])
    slot = w.step % (c.radio_delay + 1)
    for i in range(c.num_trackers):
        works = trackers[i].broken_at == NEVER
        for k in range(c.message_size):
            message[slot, i, k] = actions[i, 2 + k] if works else ZERO


@compiled
def end_step(c: Record, w: Record, trackers: Records, slots: Records, made: Generated) -> None:
    """Add the step to the episode's sums, and determine whether the episode is over."""
    made.add_to_sums(c, w, trackers, slots)
    settle(c, w)
    if c.terminate_on_contact:
        for i in range(c.num_trackers):
            if trackers[i].touching:
                w.terminated = 1
    w.over = w.terminated != 0 or w.step >= c.horizon


@compiled
def fetch_all(array: npt.NDArray[Any]) -> None:
    """Prefetch an array that is written soon."""
    for offset in range(0, array.size * array.itemsize, LINE):
        fetch(array, offset)


STEP: Final = 0
START: Final = 1
START_FROM_POSES: Final = 2
LOOK: Final = 3

LINE: Final = 64
"""Bytes of a cache line."""
FETCHED: Final = 16
"""Greatest team size whose prefetched data fit in the first-level cache."""


@compiled
def advance_worlds(
    first: int,
    count: int,
    tables: Tables,
    worlds: WorldArrays,
    actions: FloatArray,
    results: Results,
    orders: npt.NDArray[np.uint8],
    made: Generated,
    scratch: Record,
) -> int:
    """Execute the orders of ``count`` worlds from ``first`` on; return how many are over.

    ================== =============================================================================
    STEP               a control step, or the start of the next episode if this one is over
    START              start of an episode with drawn poses
    START_FROM_POSES   start of an episode from the poses in the arrays
    LOOK               observations only
    ================== =============================================================================

    ``count`` is at most TOGETHER. The scratch memory must be initialised by
    :func:`posse.rules.discs.lay_out_constants`.
    """
    c, over = tables.config[0], 0
    for e in range(first, first + count):
        w, trackers, obstacles = worlds.world[e], worlds.tracker[e], worlds.obstacle[e]
        observations, flags = results.observations[e], results.flags
        rewards, terms = results.rewards[e], results.terms[e]
        if count > 1 and trackers.shape[0] <= FETCHED:
            fetch_all(observations)  # written below, after the loop
        order = orders[e]
        if order == STEP and w.over != 0:
            w.episode += 1
            order = START
        if order == STEP:
            act(c, worlds, e, actions[e], made, scratch)
        elif order != LOOK:
            if order == START:
                draw_start(c, w, trackers, obstacles, made.draw_motion)
            begin(c, worlds, e, made)
        lay_out(c, w, trackers, obstacles, scratch)
        find_gaps(c, scratch)
        if order != LOOK:
            meet(c, w, trackers, obstacles, scratch)
            sense(c, worlds, e, made, scratch)
            occupy(c, w, trackers, tables.slots, scratch)
        if order == STEP:
            end_step(c, w, trackers, tables.slots, made)
            reward(c, w, trackers, tables, made, rewards, terms)
        else:
            if order != LOOK:
                w.held, w.score = 0, ZERO
            rewards[:] = ZERO
            terms[:, :] = ZERO
        flags[0, e] = w.terminated != 0
        flags[1, e] = w.over != 0 and w.terminated == 0
        over += w.over != 0
        observe_sonar(c, w, trackers, scratch, observations, made.width)
    observe_together(c, worlds, first, count, made, scratch, results.observations)
    return over


def tables_of(scenario: Scenario) -> Tables:
    """Return the tables of a scenario."""
    return Tables(
        config_record(scenario),
        slot_records(scenario),
        beam_directions(scenario),
        weights_for(scenario, dict(scenario.reward_weights)),
        weights_for(scenario, dict(scenario.target_reward_weights)),
    )


def kernel_of(declarations: Declarations) -> Callable[..., int]:
    """Return the kernel that steps worlds of any scenario with these declarations.

    It executes the orders of worlds ``first`` to ``end`` (:func:`advance_worlds`), and returns the number of those
    whose episodes are over. It is compiled again when a value that a user's function reaches has changed.

    Raises:
        DeclarationError: A user's function cannot be compiled.
    """
    check_functions(declarations, SCRATCH)
    return _kernel_of(declarations, stamp(*filter(callable, generated_for(declarations))))


@functools.cache
def _kernel_of(declarations: Declarations, state: str) -> Callable[..., int]:
    made = generated_for(declarations)

    @kernel
    def advance(
        tables: Tables,
        worlds: WorldArrays,
        actions: FloatArray,
        results: Results,
        orders: npt.NDArray[np.uint8],
        scratch: Records,
        first: int,
        end: int,
    ) -> int:
        s = scratch[0]
        if s.prepared[0] == ZERO:
            lay_out_constants(tables.config[0], tables.beams, s)
            s.prepared[0] = ONE
        over = 0
        for e in range(nonnegative(first), end, TOGETHER):
            count = min(TOGETHER, end - e)
            over += advance_worlds(e, count, tables, worlds, actions, results, orders, made, s)
        return over

    return advance


@kernel
def first_over(world: Records) -> int:
    """Return the first world whose episode is over, or -1."""
    for e in range(len(world)):
        if world[e].over != 0:
            return e
    return -1


MOST_ACTION: Final = np.float32(1 + 1e-6)
"""Actions up to this are clipped to 1, since rounding may exceed it."""
IN_BOX: Final = -1
TO_CLIP: Final = -2
_AT_ONCE: Final = 4 * WIDTH


@compiled
def _in_box(action: Lanes) -> Lanes:
    return (action >= -ONE) & (action <= ONE)


@kernel
def bad_action(actions: FloatArray) -> int:
    """Return the flat position of the first action that is outside [-1, 1], beyond rounding.

    :data:`IN_BOX` if there is none; :data:`TO_CLIP` if some lie outside by rounding.
    """
    flat = actions.reshape(-1)
    whole, worst = len(flat) // _AT_ONCE * _AT_ONCE, eight(ZERO)
    for at in range(0, whole, _AT_ONCE):
        k = nonnegative(at)
        first = _in_box(load(flat, k)) & _in_box(load(flat, k + WIDTH))
        last = _in_box(load(flat, k + 2 * WIDTH)) & _in_box(load(flat, k + 3 * WIDTH))
        worst = lesser(worst, choose(first & last, ZERO, -ONE))
    outside = least(worst) < ZERO
    for k in range(whole, len(flat)):
        outside |= not _in_box(flat[k])
    if not outside:
        return IN_BOX
    for k in range(len(flat)):
        if not (flat[k] >= -MOST_ACTION and flat[k] <= MOST_ACTION):
            return k
    return TO_CLIP
