"""What users pass as actions is read for what it is, whatever form it comes in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import posse
from posse.adapters.actions import ActionReader, agent_names
from posse.scenarios.named import get_scenario

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
