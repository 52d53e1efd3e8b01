"""Actions of every supported form are read correctly."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from tests.support.adapters import same

import posse
from posse.adapters.actions import ActionReader, agent_names
from posse.scenarios import get_scenario

VALUES = np.array([[0.5, -0.25], [1.0, -1.0], [0.0, 0.75]], np.float32)


def frozen(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


FORMS: dict[str, Any] = {
    "float32": lambda array: array,
    "read-only": frozen,
    "of a transposed array": lambda array: np.asfortranarray(array),
    "every other": lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    "backwards": lambda array: np.flip(array.copy(), -1).copy()[..., ::-1],
    "float64": lambda array: array.astype(np.float64),
    "float16": lambda array: array.astype(np.float16),
    "big-endian": lambda array: array.astype(">f4"),
    "list": lambda array: array.tolist(),
    "tuple": lambda array: tuple(array.tolist()),
    "memoryview": lambda array: memoryview(array.copy()),
}


def reader() -> ActionReader:
    return ActionReader(get_scenario("smart", num_trackers=3), discrete=False)


@pytest.mark.parametrize("form", FORMS.values(), ids=list(FORMS))
def test_any_form_of_the_same_numbers_is_the_same_action(form: Any) -> None:
    by_agent, by_row = reader(), reader()
    names = agent_names(get_scenario("smart", num_trackers=3))
    by_agent.by_agent({name: form(row) for name, row in zip(names, VALUES, strict=True)})
    by_row.by_row(form(VALUES))
    assert np.array_equal(by_agent.read[0], VALUES)
    assert np.array_equal(by_row.read[0], VALUES)


OUTSIDE = 1 + 1e-6  # as far as rounding may carry an action


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_what_rounding_carried_outside_is_taken_for_the_bound(kind: Any) -> None:
    names = agent_names(get_scenario("smart", num_trackers=3))
    array = np.array([[OUTSIDE, -OUTSIDE], [-OUTSIDE, 0.5], [OUTSIDE, 0.0]], kind)
    given = frozen(array)
    for form in (FORMS["float32"], FORMS["list"]):
        by_agent, by_row = reader(), reader()
        by_agent.by_agent({name: form(row) for name, row in zip(names, given, strict=True)})
        by_row.by_row(form(given))
        for read in (by_agent, by_row):
            assert read.read[0].tolist() == [[1, -1], [-1, 0.5], [1, 0]]
        assert np.array_equal(reader().one("tracker_0", form(given[0])), [1, -1])
        far = np.array([[0, 0], [0, 1 + 1.2e-6], [0, 0]], kind)
        with pytest.raises(ValueError, match=r"tracker_1: turn rate = 1\.00000"):
            by_row.by_row(form(far))
        with pytest.raises(ValueError, match=r"tracker_1: turn rate = 1\.00000"):
            by_agent.by_agent({name: form(row) for name, row in zip(names, far, strict=True)})


BOUNDS = np.sign(VALUES + 0.1)


@pytest.mark.parametrize(
    ("make", "actions"),
    [
        (lambda: posse.batch("smart", num_trackers=3), lambda a: a[None]),
        (lambda: posse.parallel_env("smart", num_trackers=3), lambda a: {f"tracker_{i}": a[i] for i in range(3)}),
        (lambda: gymnasium.make("posse/Team-v0", scenario="smart", num_trackers=3).unwrapped, lambda a: a),
        (lambda: gymnasium.make("posse/Solo-v0", scenario="smart").unwrapped, lambda a: a[0]),
        (lambda: gymnasium.make_vec("posse/Team-v0", 1, scenario="smart", num_trackers=3), lambda a: a[None]),
        (lambda: gymnasium.make_vec("posse/Solo-v0", 1, scenario="smart"), lambda a: a[:1]),
    ],
    ids=["batch", "parallel", "team", "solo", "team vector", "solo vector"],
)
def test_a_step_from_just_outside_is_the_bound_s(make: Any, actions: Any) -> None:
    one, other = make(), make()
    one.reset(seed=0)
    other.reset(seed=0)
    given = frozen(BOUNDS * np.float32(OUTSIDE))
    assert same(one.step(actions(given))[:4], other.step(actions(BOUNDS))[:4])
    with pytest.raises(ValueError, match=r"1\.00000\d* is not a number in \[-1, 1\]"):
        one.step(actions(BOUNDS * np.float32(1 + 1.2e-6)))


def test_actions_are_read_by_name_and_not_by_order() -> None:
    read = reader()
    read.by_agent({f"tracker_{i}": VALUES[i] for i in (2, 0, 1)})
    assert np.array_equal(read.read[0], VALUES)


@pytest.mark.parametrize(
    "strange",
    [
        np.array([True, False]),
        np.array([0.5, 0.5], np.complex64),
        np.array([0.5, 0.5], object),
        b"\0" * 8,
        np.zeros(8, np.uint8),
        np.zeros((2, 1), np.float32),
    ],
    ids=["bool", "complex", "object", "bytes", "as many bytes", "a column"],
)
def test_what_is_no_action_is_refused_whatever_came_before(strange: Any) -> None:
    env = posse.parallel_env("smart", num_trackers=3)
    env.reset(seed=0)
    good = {f"tracker_{i}": VALUES[i] for i in range(3)}
    env.step(good)
    before = env.state()
    with pytest.raises(ValueError, match="tracker_1"):
        env.step({**good, "tracker_1": strange})
    assert np.array_equal(env.state(), before)
