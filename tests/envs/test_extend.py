"""Observation fields and reward terms of a user's module: the examples of the manual."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.user_modules import examples, lines_of, run, snippets

CHAPTER = "extend.md"
MOST_LINES = {"walls": 8, "closing": 10, "steady": 6}


@pytest.mark.parametrize("name", MOST_LINES)
def test_an_example_is_short(name: str) -> None:
    assert lines_of(examples(CHAPTER)[name]) <= MOST_LINES[name]


TWICE = """
import posse
from posse.numeric import choose


@posse.field("1", low=-1, high=lambda s: s.num_trackers, unknown=-1, size=2)
def twice(c, v):
    \"\"\"Whether it moves, and the team's size.\"\"\"
    return choose(v.speed > 0.0, 1.0, -1.0), c.num_trackers


@posse.field("1", low=0, high=40, size=20)
def told(c):
    \"\"\"Many settings.\"\"\"
    return (
        1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0,
        11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, c.num_trackers, 20.0,
    )
"""
PLAY = """
import pickle

import gymnasium
import numpy as np
import posse
import closing
import steady
import twice
import walls

settings = dict(
    extra_fields=("closing_speed", "wall_distance", "twice", "told"),
    target_motion="agent",
    reward_weights={"slot": 1.0, "steady": 0.5}, message_size=1, num_neighbours=4,
    breaks=BREAKS, num_trackers=4, tracker_speed=(1.0, 1.1, 1.2, 1.3),
)

batch = posse.batch("obstacles", 11, **settings)
alone = [posse.batch("obstacles", 1, first_world=e, **settings) for e in (0, 9)]
s, layout = batch.scenario, batch.layout
plain = posse.batch("obstacles", 11, **{**settings, "extra_fields": (), "reward_weights": {}})
names = [field.name for field in layout.fields]
assert [name for name in names if name not in {f.name for f in plain.layout.fields}] == [
    "wall_distance", "twice", "told", "closing_speed"
]
assert names.index("told") + 1 == names.index("sonar")
assert names.index("closing_speed") + 1 == names.index("neighbour_message")
low, high = layout.bounds()
rng = np.random.default_rng(0)
observed, expected = batch.reset(seed=1), plain.reset(seed=1)
singles = [single.reset(seed=1) for single in alone]
for step in range(60):
    o, other = layout.views(observed), plain.layout.views(expected)
    for name, view in other.items():
        np.testing.assert_array_equal(o[name], view, err_msg=name)
    assert (o["told"] == [*range(1, 19), 4, 20]).all()
    for single, e in zip(singles, (0, 9)):
        np.testing.assert_array_equal(single[0], observed[e])
    assert ((observed >= low) & (observed <= high)).all()
    state = batch.state
    x, y, heading, speed = (
        np.concatenate([state[f"tracker_{k}"], state[f"world_{k}"][:, None]], axis=1)
        for k in ("x", "y", "heading_cos", "speed")
    )
    rim = s.arena / 2 - s.robot_radius
    np.testing.assert_allclose(
        o["wall_distance"], rim - np.maximum(abs(x), abs(y)), rtol=1e-5, atol=1e-5
    )
    np.testing.assert_array_equal(o["twice"][..., 0], np.where(speed > 0, 1, -1))
    np.testing.assert_array_equal(o["twice"][..., 1], 4)
    if not s.breaks:
        velocity = speed * (heading + 1j * np.concatenate(
            [state["tracker_heading_sin"], state["world_heading_sin"][:, None]], axis=1
        ))
        for i in range(5):
            number = o["neighbour_number"][:, i].astype(int)
            apart = np.take_along_axis(x + 1j * y, number, 1) - (x + 1j * y)[:, i : i + 1]
            moving = np.take_along_axis(velocity, number, 1) - velocity[:, i : i + 1]
            closing_speed = -(apart.conj() * moving).real / abs(apart)
            there = number >= 0
            np.testing.assert_allclose(
                o["closing_speed"][:, i][there], closing_speed[there], rtol=1e-4, atol=2e-3
            )
            assert (o["closing_speed"][:, i][~there] == 0).all()
    actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
    observed, rewards, *_, infos = batch.step(actions)
    expected = plain.step(actions)[0]
    singles = [single.step(actions[e : e + 1])[0] for single, e in zip(alone, (0, 9))]
    terms = {name: infos[f"reward/{name}"] for name in ("slot", "steady")}
    turn = abs(batch.state["tracker_turn_rate"]) / s.tracker_turn_rate
    np.testing.assert_allclose(terms["steady"][:, :4], 1 - turn, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        rewards[:, :4], (terms["slot"] + 0.5 * terms["steady"])[:, :4], rtol=1e-5, atol=1e-5
    )
copy = pickle.loads(pickle.dumps(batch))
np.testing.assert_array_equal(copy.step(actions)[0], batch.step(actions)[0])
assert "steady" not in plain.__class__(posse.get_scenario("smart"), 1).term_names

own = {name: settings[name] for name in ("extra_fields", "reward_weights")}  # the same kernel
team = gymnasium.make("posse/Team-v0", scenario="obstacles", **own)
parallel = posse.parallel_env("obstacles", **own)
team.reset(seed=0)
parallel.reset(seed=0)
info = team.step(team.action_space.sample())[4]
assert info["reward/steady"].shape == (5,)
rewards, infos = parallel.step({agent: [0.0, 0.5] for agent in parallel.agents})[1::3]
for agent, info in infos.items():
    terms = {name: info[f"reward/{name}"] for name in ("slot", "steady")}
    assert abs(terms["steady"] - 0.5) < 1e-5
    assert abs(rewards[agent] - terms["slot"] - 0.5 * terms["steady"]) < 1e-5
print("hits", sum(batch._untyped.stats.cache_hits.values()))
"""


def play(folder: Path, breaks: int, **changed: str) -> tuple[str, str]:
    """Return the output and the errors of a game with the examples."""
    code = PLAY.replace("BREAKS", str(breaks))
    done = run(folder, code, **{**examples(CHAPTER), "twice": TWICE, **changed})
    return done.stdout, done.stderr


@pytest.mark.long
def test_the_examples_are_part_of_the_kernel(tmp_path: Path) -> None:
    """Of that of any scenario, which is also that of the environments and kept on disk."""
    for breaks in (0, 1):
        said, errors = play(tmp_path, breaks)
        assert said.startswith("hits"), errors
    assert said == "hits 1\n"


@pytest.mark.long
def test_an_edited_term_is_compiled_anew(tmp_path: Path) -> None:
    said, errors = play(tmp_path, 0)
    assert said.startswith("hits"), errors
    steady = examples(CHAPTER)["steady"].replace("return 1 -", "return 2 -")
    _, errors = play(tmp_path, 0, steady=steady)
    assert "Not equal to tolerance" in errors


def test_the_other_pieces_of_code_run(tmp_path: Path) -> None:
    for code in snippets(CHAPTER):
        done = run(tmp_path, code, **examples(CHAPTER))
        assert done.returncode == 0, done.stderr


UNKNOWN = {
    "extra_fields=['wall_distnce']": "unknown observation field 'wall_distnce' (did you mean 'wall_distance'",
    "reward_weights={'stedy': 1}": "unknown reward term 'stedy' (did you mean 'steady'?)",
    "extra_fields=['speed']": "'speed' is in every observation: leave it out",
    "extra_fields=['wall_distance'] * 2": "it must be a tuple of names, each once",
    "extra_fields=[1]": "extra_fields=[1] is refused: it must be a tuple of names",
}


@pytest.mark.parametrize("settings", UNKNOWN)
def test_a_setting_that_names_nothing_is_refused(settings: str, tmp_path: Path) -> None:
    code = f"import posse, steady, walls\nposse.batch('obstacles', {settings})"
    assert UNKNOWN[settings] in run(tmp_path, code, **examples(CHAPTER)).stderr
