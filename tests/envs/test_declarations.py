"""Declarations of users' modules: mistakes, declaring again, and the examples of the chapter *Extend posse*."""

import json
import re
from pathlib import Path
from typing import Final

import pytest
from tests.support.pages import blocks
from tests.support.process import printed, run

import posse

FIELD = '@posse.field({})\ndef own({}):\n    """Own."""\n    return {}\nposse.batch(extra_fields=["own"]).reset()'
TERM = '@posse.reward_term("1")\ndef own({}):\n    """Own."""\n    {}\nposse.batch(reward_weights={{"own": 1}})'
MOTION = '@posse.target_motion("own"{})\ndef own(c, w{}):\n    """Own."""\n    {}\nposse.batch(target_motion="own")'
SENSOR = (
    'def m({}):\n    return dx, dy\n@posse.sensor({})\ndef own(c, w, t, dx, dy):\n    """Own."""\n    return True\n'
)
AGAIN = (
    MOTION.format(', memory=["was"]', "", "w.x / 0.0").replace("posse.batch", "old = posse.batch")
    + "\nold.reset()\nsaved = old.save()\n"
    + MOTION.format("", "", "w.x / 0.0").replace("posse.batch", "new = posse.batch")
)

MISTAKES: Final = {
    # What is declared.
    "posse.reward_term('1')(int)": "reward term <class 'int'>: declare a function, made by def, not a type",
    "import functools\nposse.metric('1')(functools.partial(max))": "declare a function, made by def, not a partial",
    "posse.target_motion('own')(None)": "declare a function, made by def, not a NoneType",
    "posse.target_motion('own')(lambda c, w: None)": r"<lambda> \(main.py:1\): its docstring.* is missing",
    "@posse.reward_term\ndef own(c, w, t):\n    return 1": r'own \(main.py:1\): the decorator needs arguments: .*"1"',
    '@posse.metric("")\ndef own(c, w):\n    """?"""': r"own \(main.py:1\): unit='' must be a text",
    '@posse.metric(1)\ndef own(c, w):\n    """?"""': r"own \(main.py:1\): unit=1 must be a text",
    '@posse.metric("1")\ndef world(c, w):\n    """?"""': r"the name 'world' is that of another column of results",
    '@posse.reward_term("1")\ndef slot(c, w, t):\n    """?"""': r"slot \(main.py:1\): the name 'slot' is taken",
    '@posse.field("1", 0, 1)\ndef sonar(c, v):\n    """?"""': r"sonar \(main.py:1\): the name 'sonar' is taken",
    TERM.format("t", "return 1"): r"own \(main.py:1\): its parameters are \(t\), not \(c, w, t\) or",
    'def own(c, w):\n    """?"""\nown.__name__ = "a-b"\nposse.metric("1")(own)': "'a-b': use letters, digits, _$",
    FIELD.format('"1", 0, 1', "c, **v", "1"): r"its parameters are \(c, \*\*v\), not \(c\) or",
    FIELD.format('"1", 0, 1', "c", "1").replace('["own"]', '["wn"]'): r"unknown observation field 'wn' .*'own'\?",
    **{TERM.format("c, w, t", f"{field} = 0.0"): r"own \(main.py:1\): it assigns to a field of a record"
       for field in ("t.x", 't["x"]')},
    # Options.
    **{FIELD.format(f'"1", 0, 1, size={size}', "c, v", "v.own.x"): rf"size={size} must be a whole number from 1 to 256"
       for size in ("0", "2.0", "1000000000", "True")},
    FIELD.format('"1", 0, 1, "no"', "c, v", "v.own.x"): r"unknown='no' is not a number between low=0 and high=1",
    FIELD.format('"1", 1, 2', "c, v, m", "m.age"): r"unknown=0.0 is not a number between low=1 and high=2",
    FIELD.format('"1", 0, lambda s: s.arena', "c, v", "v.own.x"): r"high=inf in 'constant' is not a finite number",
    FIELD.format('"1", 0, 1e300', "c, v", "v.own.x"): r"high=1e\+300 in 'constant' is not a finite number that",
    '@posse.metric("1")\ndef own(s, w):\n    """?"""\n    return w["no"] / 0.0\n'
    'b = posse.batch(metrics=["own"])\nb.reset()\nb.metrics()': r"own \(main.py:1\): in 'constant': .*field of name no",
    FIELD.format('"1", 0, lambda s: s.sped', "c, v", "v.own.x"): r"high in 'constant': .*no attribute 'sped'",
    FIELD.format('"1", 1, 0', "c, v", "v.own.x"): r"low=1 is above high=0",
    FIELD.format('"1", 0, 1', "c, v", "v.own.x / 0.0"): r"it returned \S+, which is not from low=0 to high=1",
    FIELD.format('"m", -99, 99', "c, v", "posse.numeric.choose(v.step > 0.5, v.own.x / 0.0, v.own.x)")
    .replace("posse.batch", "b = posse.batch").replace(".reset()", "\nb.reset()\nb.step(np.zeros(b.action_shape))"):
        r"own \(main.py:1\): it returned \S+, which is not from low=-99",
    MOTION.format(", memory=3", "", "pass"): r"memory=3 must be a list of names",
    MOTION.format(', memory=["if"]', "", "pass"): r"invalid name 'if' of a memory",
    MOTION.format(', memory=["speed"]', "", "pass"): r"a world has a field 'speed'",
    SENSOR.format("c", '"own", fix="range"'): r"sensor own \(main.py:3\): unknown fix='range'; allowed: pos",
    SENSOR.format("c", '"own", measure=m'): r"sensor m \(main.py:1\): its parameters are \(c\), not \(c, w, number, dx",
    SENSOR.format("c, w, number, dx, dy", '"own", measure=m').replace("dx, dy\n@", "dx / 0.0, dy\n@")
    + 'posse.batch(sensor="own").reset()': "an observation is not finite: .*sensor='own' measures",
    **{f"{AGAIN}\n{call}": "declarations have changed since these worlds were made: make a new batch"
       for call in ("old.copies(1)", "new.restore(saved)", "pickle.loads(pickle.dumps(old))")},
    FIELD.format('"1", 0, 1', "c, v", "v.own.x").replace("posse.batch", "old = posse.batch").replace(".reset()", "\n")
    + FIELD.format('"1", 0, 1, size=2', "c, v", "v.step, 0").replace(".reset()", "\npickle.loads(pickle.dumps(old))"):
        "declarations have changed",
    # What the compiler says.
    FIELD.format('"1", 0, 1', "c, v", "v.x"): r"own \(main.py:1\): unknown field 'x'; there is fix.x and own.x",
    FIELD.format('"1", 0, 1', "c, v", "v.sped"): r"own \(main.py:1\): unknown field 'sped' \(did you mean 'own.speed'",
    MOTION.format("", "", 'w.goal_cos = "north"'): r"own \(main.py:1\): (.|\n)*to float32",
    TERM.format("c, w, t", "return [t.x][0]"): r"It creates an array, a list or a text",
    FIELD.format('"1", 0, 1, size=2', "c, v", "v.own.x"): r"it returns Lanes, not 2 numbers",
    FIELD.format('"1", 0, 1', "c, v", "v.step if v.step > 0 else 1"): r"write choose\(condition, one, other\), line \d",
}  # fmt: skip

ATTEMPTS = """
import json, pickle
import numpy as np
import posse
for code in {}:
    try:
        exec(compile(code, "main.py", "exec"), dict(__name__="main", posse=posse, np=np, pickle=pickle))
        message = "nothing"
    except Exception as error:
        message = type(error).__name__ + ": " + str(error)
    print(json.dumps(message))
"""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    found: dict[str, str] = {}
    for uncompiled in ("0", "1"):  # what is found in play is found without the half minute that a kernel takes, too
        codes = [code for code in MISTAKES if ("/ 0.0" in code) == (uncompiled == "1")]
        program = ATTEMPTS.format(json.dumps(codes))
        written = printed("-c", program, cwd=tmp_path_factory.mktemp("mistakes"), NUMBA_DISABLE_JIT=uncompiled)
        found.update(zip(codes, map(json.loads, written.splitlines()), strict=True))
    return found


@pytest.mark.parametrize("code", MISTAKES)
def test_a_mistake_names_the_function_the_line_and_the_reason(code: str, messages: dict[str, str]) -> None:
    assert messages[code].startswith(("DeclarationError: ", "ScenarioError: "))
    assert re.search(MISTAKES[code], messages[code]), messages[code]


RELOADED = """
import importlib, pickle
import numpy as np
import posse
import gains, steady

def value(batch):
    return float(batch.step(np.zeros(batch.action_shape))[-1]["reward/steady"][0, 0])

def made():
    batch = posse.batch("constant", 1, reward_weights={"steady": 1.0})
    batch.reset(seed=0)
    return batch

old = made()
pickled = pickle.dumps(old)
assert value(old) == 1.0
open("steady.py", "w").write(STEADY.replace("gain(1)", "gain(2)"))
importlib.reload(steady)
assert value(made()) == 2.0, "a new batch uses the new declaration"
assert value(old) == 1.0, "a running one keeps its own"
assert value(pickle.loads(pickled)) == 2.0
steady.gains.GAIN = 3.0
assert value(made()) == 6.0, "also what its function reaches"
print("done")
"""
STEADY = '''
import posse
import gains
from posse.numeric import compiled

@compiled
def gain(scale):
    return gains.GAIN * scale

@posse.reward_term("1")
def steady(c, w, t):
    """A number."""
    return gain(1)
'''


@pytest.mark.long
def test_a_declaration_is_replaced_for_batches_made_or_unpickled_afterwards(tmp_path: Path) -> None:
    code = f"STEADY = {STEADY!r}\n{RELOADED}"
    done = run(tmp_path, code, steady=STEADY, gains="GAIN = 1.0\n")
    assert done.stdout.endswith("done\n"), done.stderr


def test_the_generated_source_can_be_read() -> None:
    source = posse.kernel_source("smart")
    compile(source, "kernel", "exec")
    assert repr(posse.target_motion("own")) == "target motion"
    assert repr(posse.METRICS[0]).startswith("<metric 'score' [1]: Mean over the steps")
    for call in ("field_speed(c, v)", "field_neighbour_age(c, v, m)", "term_slot(c, w, t)", "draw_accelerating(c, w)"):
        assert call in source


def test_names_may_be_almost_those_of_generated_code() -> None:
    """What draws a motion has a name of its own there; a dash of a built-in sensor's is an underscore."""
    motion = MOTION.replace("own", "motion").format(", draw=draw", "", "pass")
    sensor = SENSOR.format("c, w, number, dx, dy", '"range_bearing"') + "posse.batch(sensor='range_bearing').reset()"
    printed("-c", f"import posse\ndef draw(c, w):\n    pass\n{motion}.reset()\n{sensor}", NUMBA_DISABLE_JIT="1")


EXAMPLES = {Path(title).stem: text for _, title, text in blocks("docs/extend.md") if title is not None}


def test_another_process_and_a_command_import_a_users_module(tmp_path: Path) -> None:
    code = """import functools, os, pickle, posse, subprocess, sys
sys.path[:] = [part for part in sys.path if os.path.realpath(part) != os.getcwd()]  # as where a program is installed
from posse_training.cli import main
from posse_training.parallel import apart
main("scenarios obstacles --import walls".split())
assert main("replay idle --scenario smart --set extra_fields=wall_distance, --import walls".split()) == 2
scenario = posse.get_scenario("obstacles", extra_fields=["wall_distance"])
read = "import pickle, sys; print(pickle.load(sys.stdin.buffer).extra_fields)"
subprocess.run([sys.executable, "-c", read], input=pickle.dumps(scenario), check=True)
print(apart(60.0, functools.partial(posse.get_scenario, "obstacles", extra_fields=["wall_distance"])).extra_fields)"""
    assert run(tmp_path, code, **EXAMPLES).stdout.count("('wall_distance',)") == 2


FIELDS_AND_TERMS = """
import numpy as np
import posse
import closing
import steady
import walls
from tests.support.reference.state import directions, points

@posse.field("m", -1, 500, unknown=-1)
def field_known(c, v):
    "It reads a mask of the view, and is named as a column of the next field might be."
    return posse.numeric.choose(v.target_known, v.target_distance, -1.0)

@posse.field("1", 0, 1)
def known_0(c, v):
    "A truth value."
    return c.num_trackers > 3

settings = dict(
    extra_fields=("closing_speed", "wall_distance", "field_known", "known_0"),
    target_motion="agent",
    reward_weights={"slot": 1.0, "steady": 0.5}, message_size=1, num_neighbours=4,
    num_trackers=4, tracker_speed=(1.0, 1.1, 1.2, 1.3),
)

batch = posse.batch("obstacles", 11, **settings)
s, layout = batch.scenario, batch.layout
plain = posse.batch("obstacles", 11, **{**settings, "extra_fields": (), "reward_weights": {}})
low, high = layout.bounds()
rng = np.random.default_rng(0)
observed, expected = batch.reset(seed=1), plain.reset(seed=1)
for step in range(60):
    o, other = layout.views(observed), plain.layout.views(expected)
    for name, view in other.items():
        np.testing.assert_array_equal(o[name], view, err_msg=name)
    assert ((observed >= low) & (observed <= high)).all()
    place, heading = (np.column_stack([each(batch, "tracker"), each(batch, "world")]) for each in (points, directions))
    speed = np.column_stack([batch.state["tracker_speed"], batch.state["world_speed"]])
    wall = s.arena / 2 - s.robot_radius - np.maximum(abs(place.real), abs(place.imag))
    np.testing.assert_allclose(o["wall_distance"], wall, rtol=1e-5, atol=1e-5)
    assert (o["field_known"] == o["target_range"]).all() and (o["known_0"] == 1).all()
    velocity = speed * heading
    for i in range(5):
        number = o["neighbour_number"][:, i].astype(int)
        apart = np.take_along_axis(place, number, 1) - place[:, i : i + 1]
        moving = np.take_along_axis(velocity, number, 1) - velocity[:, i : i + 1]
        closing_speed = -(apart.conj() * moving).real / abs(apart)
        there = number >= 0
        np.testing.assert_allclose(o["closing_speed"][:, i][there], closing_speed[there], rtol=1e-4, atol=2e-3)
        assert (o["closing_speed"][:, i][~there] == 0).all()
    actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
    observed, rewards, *_, infos = batch.step(actions)
    expected = plain.step(actions)[0]
    terms = {name: infos[f"reward/{name}"] for name in ("slot", "steady")}
    turn = abs(batch.state["tracker_turn_rate"]) / s.tracker_turn_rate
    np.testing.assert_allclose(terms["steady"][:, :4], 1 - turn, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(rewards[:, :4], (terms["slot"] + 0.5 * terms["steady"])[:, :4], rtol=1e-5, atol=1e-5)
assert "steady" not in posse.batch("smart").term_names
print("done")
"""


@pytest.mark.long
def test_fields_and_terms_are_part_of_the_kernel(tmp_path: Path) -> None:
    """Of that of any scenario, which is kept on disk until a term is edited."""
    for _ in range(2):
        done = run(tmp_path, FIELDS_AND_TERMS, **EXAMPLES)
        assert done.stdout == "done\n", done.stderr
    assert "compiling kernels" not in done.stderr
    steady = EXAMPLES["steady"].replace("return 1 -", "return 2 -")
    assert "Not equal to tolerance" in run(tmp_path, FIELDS_AND_TERMS, **{**EXAMPLES, "steady": steady}).stderr


MOTION_SENSOR_AND_METRIC = """
import numpy as np
import posse
import bearing
import distance
import unwind
from posse.signals.layout import StateLayout
from tests.support.reference.state import directions, points

@posse.metric("1")
def last_heading(s, w):
    '''Cosine of the target's heading at the end.'''
    return w["heading_cos"]

batch = posse.batch(
    "constant", 40, target_motion="unwind", sensor="bearing-only", sensing_range=6.0,
    num_trackers=3, radio_loss=0.1, metrics=["target_distance", "last_heading"], horizon=101,
)
s, layout = batch.scenario, StateLayout(batch.scenario)
low, high = batch.layout.bounds()
observations = batch.reset(seed=0)
heading, ever, bearings, losses, distances = [], 0, np.nan, 0, []
for step in range(100):
    o = batch.layout.views(observations)
    heading.append(np.angle(directions(batch, "world")))
    offset = points(batch, "world")[:, None] - points(batch, "tracker")
    told = o["target_bearing"] @ [1, 1j] * directions(batch, "tracker")
    seen, known = o["target_seen"] > 0, o["target_known"] > 0
    np.testing.assert_array_equal(seen, abs(offset) <= s.sensing_range)
    ever = ever | seen
    np.testing.assert_array_equal(known, ever)  # a bearing is not sent
    error = np.angle(told / offset)[seen]
    assert np.abs(error).max() <= 0.0601
    assert error.std() > 0.01
    kept = known & ~seen  # the direction stands, whoever moves
    np.testing.assert_allclose(told[kept], np.broadcast_to(bearings, told.shape)[kept], rtol=1e-4, atol=1e-4)
    bearings, losses = told.copy(), losses + kept.sum()
    assert (o["target_range"] == -1).all()
    assert (abs(told[~known]) == 0).all()
    for name in ("target_heading", "target_frame", "target_velocity"):
        assert (o[name] == 0).all()
    assert ((observations >= low) & (observations <= high)).all()
    distances += [abs(offset)] * (step > 0)
    observations, *_, infos = batch.step(np.ones(batch.action_shape))
assert losses > 0
turned = np.unwrap(heading, axis=0)
turned -= turned[0]
side = batch.state["world_unwind_side"]
assert set(side) == {-1.0, 1.0}
rates = s.target_turn_rate / (1 + 0.1 * s.control_step * np.arange(100))
expected = np.append(0, np.cumsum(rates[:-1] * s.control_step))
np.testing.assert_allclose(turned, side * expected[:, None], rtol=1e-4, atol=1e-3)
np.testing.assert_array_equal(layout.views(layout.vector(batch.arrays))["world_unwind_side"], side)
assert "world_unwind_side" not in StateLayout(posse.get_scenario("smart")).offsets

# The metric, at any time and at the end of the episode; beside the built-in ones, which it leaves.
metrics = batch.metrics()
assert list(metrics) == [metric.name for metric in posse.METRICS] + ["target_distance", "last_heading"]
np.testing.assert_array_equal(metrics["last_heading"], batch.state["world_heading_cos"])
distances.append(abs(points(batch, "world")[:, None] - points(batch, "tracker")))
np.testing.assert_allclose(metrics["target_distance"], np.mean(distances, (0, 2)), rtol=1e-5)
assert (infos["metrics/target_distance"] == 0).all()
infos = batch.step(np.ones(batch.action_shape))[-1]
batch.step(np.ones(batch.action_shape))  # the next episode's start: sums begin anew
assert (batch.state["world_target_distance_sum"] == 0).all()
print("done")
"""


@pytest.mark.long
def test_a_motion_a_sensor_and_a_metric_are_part_of_the_kernel(tmp_path: Path) -> None:
    done = run(tmp_path, MOTION_SENSOR_AND_METRIC, **EXAMPLES)
    assert done.stdout.endswith("done\n"), done.stderr
