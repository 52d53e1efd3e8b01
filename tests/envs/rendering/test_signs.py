"""Links, tasks, contacts, breaks and sight in a picture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.drawing import advance, colour_at, like, picture, placed, worlds

from posse.rendering.content.scene import read_scene
from posse.rendering.renderer import Renderer
from posse.rendering.style import CONTACT, INK, LINK, TASK_COLOURS, TRACKER


def test_links_are_drawn_between_trackers_that_hear_each_other() -> None:
    poses = [(3.0, 0.0, 0.0), (5.0, 0.0, 0.0), (-9.0, 0.0, 0.0)]
    limited: dict[str, Any] = {"radio_range": 4.0, "radio_delay": 0, "radio_loss": 0.0, "sensing_range": math.inf}
    batch = placed(poses, scenario="radio", **limited)
    scene = read_scene(batch)
    np.testing.assert_array_equal(scene.links, [[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    renderer = Renderer(batch.scenario)
    linked = np.array(colour_at(renderer, picture(renderer, batch), 4, 0))
    assert np.abs(linked - LINK).sum() < np.abs(np.array((248, 249, 251)) - LINK).sum() - 100
    perfect = placed(poses)
    assert not read_scene(perfect).links.any()


def test_links_fade_when_nothing_is_heard_any_more() -> None:
    batch = placed([(3, 0, 0), (5, 0, math.pi / 2)], scenario="radio", radio_range=2.5, radio_loss=0.0)
    strength = []
    for _ in range(30):
        strength.append(read_scene(batch).links[0, 1])
        batch.step(np.array([[[-1, 0], [1, 0]]], np.float32))
    assert max(strength) == 1
    falling = strength[strength.index(1) :]
    assert falling == sorted(falling, reverse=True)
    assert falling[-1] == 0
    assert any(0 < value < 1 for value in falling)


def test_tasks_colour_the_trackers_and_leaders_are_marked() -> None:
    batch = placed([(3, 3, 0), (-3, 3, 0), (3, -3, 0), (-3, -3, 0)])
    renderer = Renderer(batch.scenario)
    plain = picture(renderer, batch)
    told = {"task": [[0, 1, 2, 3]], "leader": [[2, 2, 2, 2]]}
    frame = picture(renderer, batch, annotations=told)
    for (x, y), colour in zip(((3, 3), (-3, 3), (3, -3), (-3, -3)), TASK_COLOURS, strict=True):
        assert like(colour_at(renderer, frame, x, y - 0.07), colour)
        assert like(colour_at(renderer, plain, x, y - 0.07), TRACKER)
    # The mark is drawn over the leader only.
    above = renderer.project([[3, 3], [-3, 3], [3, -3], [-3, -3]]) - (0, 20)
    inked = [like(tuple(frame[row, column].tolist()), INK) for column, row in above.round().astype(int)]
    assert inked == [False, False, True, False]


@pytest.mark.parametrize(
    ("told", "wrong"),
    [
        ({"task": [0, 1]}, r"task.*shape \(2,\).*wanted integers of shape \(1, 2\)"),
        ({"leader": [[0.5, 1.0]]}, "leader.*float64.*wanted integers"),
    ],
)
def test_annotations_that_do_not_fit_are_named(told: dict[str, Any], wrong: str) -> None:
    batch = placed([(3, 3, 0), (-3, 3, 0)])
    with pytest.raises(ValueError, match=wrong):
        Renderer(batch.scenario).draw(batch, annotations=told)


def test_contacts_flash_and_the_flash_goes_out() -> None:
    batch = placed([(3, 0, 0), (3.5, 0, math.pi)])
    renderer = Renderer(batch.scenario)
    reddest = []
    for k in range(25):
        frame = picture(renderer, batch)
        reddest.append(int((np.abs(frame.astype(int) - CONTACT).sum(axis=-1) < 90).sum()))
        # Into each other, then still.
        batch.step(np.array([[[1, 0], [1, 0]]] if k < 5 else [[[-1, 0], [-1, 0]]], np.float32))
    assert int(batch.state["world_contacts_tracker"][0]) > 0
    assert reddest[0] == 0
    assert max(reddest) > 20
    assert reddest[-1] == 0


def test_a_broken_tracker_is_crossed_out() -> None:
    batch = worlds("leader-loss", break_window=(0.0, 0.01))
    renderer = Renderer(batch.scenario)
    advance(batch, 8)
    scene = read_scene(batch)
    assert scene.broken.sum() == 1
    frame = picture(renderer, batch)
    for k, broken in enumerate(scene.broken):
        x, y = scene.position[k]
        assert like(colour_at(renderer, frame, x, y), INK) == broken


def test_a_tracker_without_the_target_in_sight_is_pale() -> None:
    batch = placed([(3, 0, 0), (8, 0, 0)], scenario="radio", sensing_range=4.0)
    renderer = Renderer(batch.scenario)
    frame = picture(renderer, batch)
    sees, blind = (colour_at(renderer, frame, x, -0.07) for x in (3, 8))
    assert like(sees, TRACKER)
    assert sum(blind) > sum(sees) + 100
