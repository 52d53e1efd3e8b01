"""Learned policies: what is played is what was saved, and what does not fit is refused."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save_file

import posse
from posse.scenarios.formation import FORMATIONS, slot_offsets
from posse_baselines import PolicyError, play
from posse_baselines.learned.encoding import Encoder, Encoding
from posse_baselines.learned.features import NUM_FEATURES, assign
from posse_baselines.learned.network import LearnedPolicy, Network


def network_for(inputs: int, outputs: int = 2, seed: int = 0, **changes: Any) -> Network:
    generator = np.random.default_rng(seed)
    sizes = (inputs, 24, 16, outputs)

    def draw(*shape: int) -> Any:
        return generator.normal(size=shape).astype(np.float32)

    network = Network(
        mean=draw(inputs),
        scale=np.abs(draw(inputs)),
        limit=5.0,
        weights=tuple(draw(b, a) / np.float32(a**0.5) for a, b in itertools.pairwise(sizes)),
        biases=tuple(draw(b) for b in sizes[1:]),
        activation="tanh",
        output="clip",
    )
    return replace(network, **changes)


def policy_for(
    layout: posse.ObservationLayout, kind: str = "slots", **changes: Any
) -> LearnedPolicy:
    encoding = Encoding.of(layout, kind)
    return LearnedPolicy(network_for(encoding.size, **changes), encoding, {"name": "mine"})


def observations_of(scenario: str, worlds: int = 6, steps: int = 5, **overrides: Any) -> Any:
    batch = posse.batch(scenario, worlds, seed=3, **overrides)
    observations = batch.reset()
    generator = np.random.default_rng(0)
    for _ in range(steps):
        observations, *_ = batch.step(generator.uniform(-1, 1, batch.action_shape))
    return batch, observations


@pytest.mark.parametrize("kind", ["plain", "slots"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_compiled_and_plain_agree(kind: str, activation: str, output: str) -> None:
    batch, observations = observations_of("field")
    policy = policy_for(batch.layout, kind, activation=activation, output=output)
    actions, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(policy.encoding, batch.layout).encode(observations)
    expected = policy.network.forward(rows).reshape(actions.shape)
    np.testing.assert_allclose(actions, expected, atol=2e-5)
    assert np.abs(actions).max() <= 1
    assert np.ptp(actions) > 0.5  # the networks say something


def test_a_world_plays_alike_alone_and_in_a_batch() -> None:
    batch, observations = observations_of("smart", worlds=600)
    policy = policy_for(batch.layout)
    together, _ = policy.act(observations, policy.begin(batch.layout, 600))
    alone, _ = policy.act(observations[433:434], policy.begin(batch.layout, 1))
    np.testing.assert_array_equal(together[433], alone[0])


def test_returned_actions_are_never_overwritten() -> None:
    batch, observations = observations_of("smart")
    policy = policy_for(batch.layout)
    memory = policy.begin(batch.layout, 6)
    first, memory = policy.act(observations, memory)
    kept = first.copy()
    policy.act(observations + np.float32(0.1), memory)
    np.testing.assert_array_equal(first, kept)


def test_a_file_gives_back_the_policy(tmp_path: Path) -> None:
    batch, observations = observations_of("smart")
    policy = policy_for(batch.layout)
    path = tmp_path / "policy.safetensors"
    policy.save(path)
    again = LearnedPolicy.from_file(path)
    assert again.name == "mine"
    assert again.trained_splits == ("train",)
    assert again.encoding == policy.encoding
    mine, _ = policy.act(observations, policy.begin(batch.layout, 6))
    theirs, _ = again.act(observations, again.begin(batch.layout, 6))
    np.testing.assert_array_equal(mine, theirs)
    assert json.loads(path.with_suffix(".json").read_text())["name"] == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["policy.json", "policy.safetensors"]


def test_playing_a_file_needs_no_torch(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    policy_for(posse.ObservationLayout(posse.get_scenario("smart"))).save(path)
    code = (
        "import sys, posse; from posse_baselines.learned.network import LearnedPolicy;"
        f"p = LearnedPolicy.from_file({str(path)!r}); b = posse.batch('smart', 2);"
        "p.act(b.reset(), p.begin(b.layout, 2)); print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "False"


class TestDamage:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        path = tmp_path / "policy.safetensors"
        policy_for(posse.ObservationLayout(posse.get_scenario("smart"))).save(path)
        return path

    @settings(derandomize=True, deadline=None, max_examples=60)
    @given(where=st.floats(0, 0.999999), bit=st.integers(0, 7))
    def test_no_flipped_bit_goes_unnoticed(self, where: float, bit: int) -> None:
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "policy.safetensors"
            policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
            policy.save(path)
            content = bytearray(path.read_bytes())
            content[int(where * len(content))] ^= 1 << bit
            path.write_bytes(content)
            with pytest.raises(PolicyError, match=r"policy\.safetensors"):
                LearnedPolicy.from_file(path)

    @pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
    def test_a_file_cut_short(self, path: Path, share: float) -> None:
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(PolicyError, match="cut short"):
            LearnedPolicy.from_file(path)

    def test_a_file_of_something_else(self, tmp_path: Path) -> None:
        path = tmp_path / "other.safetensors"
        save_file({"a": np.zeros(3)}, path)
        with pytest.raises(PolicyError, match="holds no policy"):
            LearnedPolicy.from_file(path)

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(PolicyError, match="there is no policy file"):
            LearnedPolicy.from_file(tmp_path / "none.safetensors")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "policy.safetensors"
    policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
    policy.save(path)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("posse_baselines.learned.network.save_file", full)
    with pytest.raises(OSError, match="No space left"):
        policy.save(path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2


class TestNetworks:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"biases": (np.zeros(24, np.float32),)}, "as many biases"),
            ({"scale": np.ones(3, np.float32)}, "statistics"),
            ({"limit": 0.0}, "limit"),
            ({"activation": "gelu"}, "gelu"),
            ({"output": "sigmoid"}, "sigmoid"),
            ({"mean": np.full(10, np.nan, np.float32)}, "finite"),
        ],
    )
    def test_parts_that_do_not_fit(self, changes: dict[str, Any], message: str) -> None:
        with pytest.raises(PolicyError, match=message):
            network_for(10, **changes).check()

    def test_an_encoding_of_another_length(self) -> None:
        encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario("smart")))
        with pytest.raises(PolicyError, match="its encoding gives"):
            LearnedPolicy(network_for(10), encoding, {})


class TestLayouts:
    def test_another_sonar_is_refused_by_name(self) -> None:
        policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
        other = posse.ObservationLayout(posse.get_scenario("smart", sonar_beams=16))
        with pytest.raises(PolicyError, match="sonar"):
            policy.begin(other, 1)

    def test_a_policy_that_speaks_needs_messages(self) -> None:
        layout = posse.ObservationLayout(posse.get_scenario("smart", message_size=3))
        policy = LearnedPolicy(
            network_for(Encoding.of(layout).size, 5), Encoding.of(layout), {"name": "talker"}
        )
        assert policy.message_size == 3
        with pytest.raises(PolicyError, match="message_size"):
            policy.begin(posse.ObservationLayout(posse.get_scenario("smart")), 1)

    def test_longer_messages_than_it_uses_change_nothing(self) -> None:
        small, observations = observations_of("smart", steps=0)
        policy = policy_for(small.layout)
        large, more = observations_of("smart", steps=0, message_size=2)
        mine, _ = policy.act(observations, policy.begin(small.layout, 6))
        theirs, _ = policy.act(more, policy.begin(large.layout, 6))
        np.testing.assert_array_equal(theirs[:, :, :2], mine)
        assert not theirs[:, :, 2:].any()

    @pytest.mark.parametrize("trackers", [1, 2, 3, 12])
    def test_teams_of_another_size(self, trackers: int) -> None:
        policy = policy_for(posse.ObservationLayout(posse.get_scenario("smart")))
        batch = posse.batch("smart", 3, num_trackers=trackers)
        metrics = play(posse.batch("smart", 3, num_trackers=trackers, horizon=30), policy)
        assert np.isfinite(metrics["score"]).all()
        assert batch.layout.neighbours != 4 or trackers == 5

    def test_places_that_a_small_team_lacks_are_unknown(self) -> None:
        full = posse.ObservationLayout(posse.get_scenario("smart"))
        batch = posse.batch("smart", 1, num_trackers=2)
        rows = Encoder(Encoding.of(full), batch.layout).encode(batch.reset())
        named = full.views(rows)
        np.testing.assert_array_equal(named["neighbour_range"][:, 1:], -1)
        np.testing.assert_array_equal(named["neighbour_bearing"][:, 1:], 0)
        assert (named["neighbour_range"][:, 0] > 0).all()

    def test_fewer_places_keep_the_nearest(self) -> None:
        batch = posse.batch("smart", 2)
        observations = batch.reset()
        rows = Encoder(Encoding.of(batch.layout, neighbours=2), batch.layout).encode(observations)
        np.testing.assert_array_equal(rows, observations.reshape(10, -1)[:, : rows.shape[1]])

    def test_the_plain_encoding_is_the_observation(self) -> None:
        batch, observations = observations_of("radio")
        rows = Encoder(Encoding.of(batch.layout), batch.layout).encode(observations)
        np.testing.assert_array_equal(rows, observations.reshape(rows.shape))

    def test_unknown_kinds(self) -> None:
        layout = posse.ObservationLayout(posse.get_scenario("smart"))
        with pytest.raises(PolicyError, match="plain, slots"):
            Encoding.of(layout, "fancy")
        with pytest.raises(PolicyError, match="neighbours=-1"):
            Encoding.of(layout, neighbours=-1)


class TestFeatures:
    def test_own_slot_is_where_the_state_says(self) -> None:
        batch, observations = observations_of("constant", worlds=8, steps=30)
        rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
        features = rows[:, :NUM_FEATURES].reshape(8, 5, NUM_FEATURES)
        w, t = batch.worlds[:, None], batch.arrays.tracker
        slots = np.array(slot_offsets(batch.scenario))
        x = w["x"] + slots[:, 0] * w["frame_cos"] - slots[:, 1] * w["frame_sin"]
        y = w["y"] + slots[:, 0] * w["frame_sin"] + slots[:, 1] * w["frame_cos"]
        dx, dy = x[:, None] - t["x"][..., None], y[:, None] - t["y"][..., None]
        hc, hs = t["heading_cos"][..., None], t["heading_sin"][..., None]
        ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
        soft = features[:, :, 14 + 2 : 14 + 4]
        length = np.hypot(soft[..., 0], soft[..., 1])
        d = 3.0 * length / (1 - length)
        mine = soft / length[..., None] * d[..., None]
        away = np.hypot(ahead - mine[..., :1], left - mine[..., 1:])
        chosen = away.argmin(axis=2)
        np.testing.assert_allclose(away.min(axis=2), 0, atol=0.02)
        # With a perfect radio all come to the same assignment: nobody shares a slot.
        assert all(len(set(row)) == 5 for row in chosen)

    def test_nothing_known_of_the_target_is_zeros(self) -> None:
        batch = posse.batch("search", 4)
        observations = batch.reset()
        unknown = batch.layout.views(observations)["target_known"].reshape(-1) == 0
        assert unknown.any()
        rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
        assert not rows[unknown, 14:NUM_FEATURES].any()
        assert np.isfinite(rows).all()

    @settings(derandomize=True, deadline=None, max_examples=100)
    @given(robots=st.integers(1, 9), slots=st.integers(1, 12), seed=st.integers(0, 2**31))
    def test_no_swap_shortens_an_assignment(self, robots: int, slots: int, seed: int) -> None:
        ways = np.random.default_rng(seed).uniform(0, 10, (robots, slots)).astype(np.float32)
        chosen = np.empty(robots, np.float32)
        assign(robots, slots, ways.reshape(-1), chosen)
        given_out = [int(s) for s in chosen if s >= 0]
        assert len(given_out) == len(set(given_out)) == min(robots, slots)
        if robots <= slots:
            total = ways[np.arange(robots), chosen.astype(int)].sum()
            for i in range(robots):
                for j in range(i):
                    other = chosen.astype(int)
                    other[[i, j]] = other[[j, i]]
                    assert ways[np.arange(robots), other].sum() >= total - 1e-3

    @pytest.mark.parametrize("formation", FORMATIONS)
    def test_finite_for_every_formation(self, formation: str) -> None:
        batch, observations = observations_of(
            "constant", formation=formation, formation_distance=1.0, num_trackers=12
        )
        rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
        assert np.isfinite(rows).all()
        assert np.abs(rows[:, :NUM_FEATURES]).max() <= 4
