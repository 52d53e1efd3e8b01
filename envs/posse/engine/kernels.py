"""A control step of one world, and the kernels that step all worlds.

Order: faults, actions, target's decision, physics (target first, then trackers by number), slot
frame, contacts, sensing, radio, score, end of the episode, reward, observation.

Only the kernels at the end loop over a batch; the other functions process one world, or eight that
are observed together.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.declarations import Declarations, reward_term
from posse.numeric import WIDTH, ZERO, BoolArray, FloatArray, Record, Records, compiled, kernel
from posse.numeric.compile import stamp
from posse.numeric.lanes import fetch
from posse.rules.contact import find_contacts
from posse.rules.discs import find_gaps, lay_out
from posse.rules.faults import apply_faults, draw_coming_faults
from posse.rules.motion import drift, motion
from posse.rules.randomness import mix
from posse.rules.score import find_occupied, settle
from posse.rules.senses.radio import hear, keep_messages, send, share_fixes
from posse.rules.senses.sensing import look
from posse.rules.senses.sonar import write_sonar
from posse.rules.start import begin, draw_start, is_clear, target_can_turn
from posse.rules.state import WorldArrays, config_record, new_scratch, slot_records
from posse.scenarios import Scenario
from posse.signals.generate import generated_for
from posse.signals.user_functions import check_functions
from posse.signals.views import Generated, observe_together

Orders = npt.NDArray[np.uint8]
"""What every world is to do, (E,); see :func:`advance_worlds`."""


class Fixed(NamedTuple):
    """The arguments of a kernel that stay the same for a batch."""

    config: Records  # (1,) CONFIG
    slots: Records  # (N,) SLOT
    weights: FloatArray  # (K,) weight of each reward term
    target_weights: FloatArray  # (K,) the same for a target that is an agent
    worlds: WorldArrays
    scratch: Records  # (threads,) SCRATCH


class Results(NamedTuple):
    """Outputs of a pass over the worlds."""

    observations: FloatArray  # (E, rows, F)
    rewards: FloatArray  # (E, rows)
    terms: FloatArray  # (E, rows, K)
    scores: FloatArray  # (E,)
    terminated: BoolArray  # (E,)
    truncated: BoolArray  # (E,)


@compiled
def sense(c: Record, worlds: WorldArrays, e: int, made: Generated, scratch: Record) -> None:
    """Target sensors and radio of every tracker of world e."""
    w, trackers = worlds.world[e], worlds.tracker[e]
    seeing = look(c, w, trackers, worlds.odometry[e], made.sees, made.measure, scratch)
    if c.perfect_radio:
        if seeing < c.num_trackers:  # otherwise all have a fix of this step
            share_fixes(c, trackers)
    else:
        send(c, worlds, e)
        hear(c, worlds, e)


@compiled
def reward(
    c: Record, w: Record, trackers: Records, fixed: Fixed, made: Generated, rewards: FloatArray, terms: FloatArray
) -> None:
    """Write the reward of every agent (rows,) and its terms (rows, K)."""
    for i in range(c.num_trackers):
        rewards[i] = made.reward(c, w, trackers[i], fixed.weights, terms[i])
    if c.target_is_agent:
        n = c.num_trackers
        rewards[n] = made.target_reward(c, w, fixed.target_weights, terms[n])


@compiled
def end_step(c: Record, w: Record, trackers: Records, slots: Records, made: Generated) -> None:
    """Add the step to the episode's sums, and determine whether the episode is over."""
    made.add_to_sums(c, w, trackers, slots)
    settle(c, w)
    if c.terminate_on_contact:
        for t in trackers:
            if t.touching:
                w.terminated = 1
    w.over = w.terminated != 0 or w.step >= c.horizon


STEP: Final = 0
START: Final = 1
START_FROM_POSES: Final = 2
LOOK: Final = 3


@compiled
def advance_worlds(
    first: int,
    end: int,
    fixed: Fixed,
    orders: Orders,
    actions: FloatArray,
    results: Results,
    made: Generated,
    scratch: Record,
) -> int:
    """Execute the orders of the worlds ``first`` to ``end``, at most WIDTH; return how many are over.

    ================== =============================================================================
    STEP               a control step, or the start of the next episode if this one is over
    START              start of an episode with drawn poses
    START_FROM_POSES   start of an episode from the poses in the arrays
    LOOK               observations only
    ================== =============================================================================

    Control steps alone read ``actions`` (E, rows, 2 + m).
    """
    worlds, c, over = fixed.worlds, fixed.config[0], 0
    for e in range(first, end):
        w, trackers, obstacles = worlds.world[e], worlds.tracker[e], worlds.obstacle[e]
        observations, rewards, terms = results.observations[e], results.rewards[e], results.terms[e]
        if end - first > 1 and trackers.shape[0] <= 16:  # larger teams' would not fit in the first-level cache
            # Written below, after the loop; without prefetching 16,384 worlds take a third longer.
            for offset in range(0, observations.size * observations.itemsize, 64):  # bytes of a cache line
                fetch(observations, offset)
        order = orders[e]
        if order == STEP and w.over:
            w.episode += 1
            order = START
        if order == STEP:
            apply_faults(c, w, trackers)
            motion(c, worlds, e, actions[e], made.set_goal, scratch)
            w.step += 1
            if c.drifts:
                drift(c, w, worlds.odometry[e])
            if c.message_size > 0:
                keep_messages(c, w, trackers, actions[e], worlds.message[e])
        elif order != LOOK:
            if order == START:
                draw_start(c, w, trackers, obstacles, made.begin_motion)
            begin(c, worlds, e)
            made.clear_sums(w)
        lay_out(c, w, trackers, obstacles, scratch)
        find_gaps(c, scratch)
        if order != LOOK:
            find_contacts(c, w, trackers, obstacles, scratch)
            sense(c, worlds, e, made, scratch)
            find_occupied(c, w, trackers, fixed.slots, scratch)
        if order == STEP:
            end_step(c, w, trackers, fixed.slots, made)
            reward(c, w, trackers, fixed, made, rewards, terms)
        else:
            if order != LOOK:
                w.held, w.score = 0, ZERO  # a start is no step: what find_occupied() found does not count
            rewards[:] = ZERO
            terms[:, :] = ZERO
        results.scores[e] = w.score
        results.terminated[e] = w.terminated != 0
        results.truncated[e] = w.over != 0 and w.terminated == 0
        over += w.over
        # Here, since scratch memory holds the discs of this world.
        write_sonar(c, w, trackers, scratch, observations, made.own_size)
    observe_together(c, worlds, first, end, made, scratch, results.observations)
    return over


def fixed_for(scenario: Scenario, terms: Iterable[reward_term], worlds: WorldArrays, threads: int) -> Fixed:
    """Return the arguments of a scenario with these reward terms; those that it does not weight count 0."""
    given = dict(scenario.reward_weights), dict(scenario.target_reward_weights)
    weights, target_weights = (np.array([each.get(term.name, 0.0) for term in terms], np.float32) for each in given)
    scratch = new_scratch(scenario, threads)
    return Fixed(config_record(scenario), slot_records(scenario), weights, target_weights, worlds, scratch)


def kernel_of(declarations: Declarations) -> Callable[..., int]:
    """Return the kernel that steps worlds of any scenario with these declarations.

    As thread ``thread`` it executes the orders of worlds ``first`` to ``end`` (:func:`advance_worlds`), and returns the
    number of those whose episodes are over. It is compiled again when a value that a user's function reaches has
    changed.
    """
    added = (function for each in declarations.added for function in each.functions)
    return _kernel_of(declarations, stamp(*added))


@functools.cache
def _kernel_of(declarations: Declarations, state: str) -> Callable[..., int]:
    check_functions(declarations)
    made = generated_for(declarations)

    @kernel
    def advance(
        fixed: Fixed, orders: Orders, actions: FloatArray, results: Results, thread: int, first: int, end: int
    ) -> int:
        scratch, over = fixed.scratch[thread], 0
        for e in range(first, end, WIDTH):
            over += advance_worlds(e, min(e + WIDTH, end), fixed, orders, actions, results, made, scratch)
        return over

    return advance


def direct(function: Callable[..., int]) -> Callable[..., int]:
    """Return the machine code of a kernel, which does not check the types of its arguments.

    numba's dispatch looks up the type of every argument, which takes longer than a world's step. Callers must pass
    arguments of the types of the kernel's first call. One that has not been called yet, or with several types, or
    that is no dispatcher, is returned unchanged.
    """
    forms = list(getattr(function, "overloads", {}).values())
    return forms[0].entry_point if len(forms) == 1 else function


@kernel
def draw_anew(config: Records, world: Records, tracker: Records, count: int, seed: int, alike: bool) -> None:
    """Give copies, ``count`` consecutive ones per world, new keys, and redraw their faults."""
    c = config[0]
    for i in range(len(world)):
        w = world[i]
        number = np.uint64(0) if alike else np.uint64(i % count + 1)
        copies = mix(w.key, np.uint64(0x636F70696573))  # other keys than those of episodes
        w.key = mix(mix(mix(copies, np.uint64(seed)), np.uint64(w.step)), number)
        w.seed = mix(w.key, np.uint64(1)) & np.uint64(2**63 - 1)
        draw_coming_faults(c, w, tracker[i], w.step + 1, w.step)


@kernel
def first_bad_start(
    config: Records, world: Records, tracker: Records, obstacle: Records, chosen: BoolArray
) -> tuple[int, int]:
    """Return the first chosen world in which a robot starts in another, an obstacle or a wall, and this robot's number.

    The target is robot N; the number is N + 1 if a scripted target has no room to turn. (-1, -1): there is none.
    """
    c, n = config[0], tracker.shape[1]
    for e in range(len(world)):
        w, trackers, obstacles = world[e], tracker[e], obstacle[e]
        for i in range(n + 1 if chosen[e] else 0):
            x, y = (trackers[i].x, trackers[i].y) if i < n else (w.x, w.y)
            if not is_clear(c, trackers[:i], obstacles, x, y, ZERO):
                return e, i
        if chosen[e] and c.target_speed > 0 and not target_can_turn(c, w, obstacles):
            return e, n + 1
    return -1, -1
