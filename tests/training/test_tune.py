"""``posse tune``: what it finds, how it resumes, and what it refuses."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.runs import killed_at, quiet

from posse.numeric import FloatArray
from posse_baselines import DDCS, Memory, tunables
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import Tunable, tuned
from posse_training.errors import RunFolderError, SettingsError
from posse_training.tune import Space, TuneSettings, _Run, tune

BEST = 0.35


@dataclass(frozen=True)
class Bias:
    """Two settings, of which one does nothing."""

    bias: float = tuned(0.8, "", 0.0, 1.0)
    idle: float = tuned(0.5, "s", 0.1, 1.0)


class Biased(DDCS):
    """``ddcs-distributed`` with a turn command that is off unless ``bias`` is ``BEST``."""

    def __init__(self, settings: Bias | None = None) -> None:
        super().__init__(name="biased")
        self.bias = settings or Bias()
        self._settings, self.settings = self.settings, self.bias  # type: ignore[assignment]

    def settings_for(self, scenario: Any) -> Any:
        return self._settings

    def with_settings(self, **values: Any) -> "Biased":
        return Biased(dataclasses.replace(self.bias, **values))

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        actions, memory = super().act(observations, memory)
        actions[..., 1] = np.clip(actions[..., 1] + 2.0 * (self.bias.bias - BEST), -1.0, 1.0)
        return actions, memory


class Deaf(Biased):
    """The same, which plays its defaults whatever its settings."""

    def with_settings(self, **values: Any) -> "Deaf":
        return self


POLICY = "tests.training.test_tune:Biased"


def small(out: Path, **changes: Any) -> TuneSettings:
    """Settings of a tuning that takes a second."""
    values: dict[str, Any] = {"policy": POLICY, "scenario": "paper-distributed", "seed": 3, "out": out, "every": 2}
    values |= {"generations": 5, "population": 6, "worlds": 4, "validation_worlds": 6}
    return TuneSettings(**(values | changes))


def card_of(settings: TuneSettings) -> dict[str, Any]:
    card: dict[str, Any] = json.loads(tune(settings, console=quiet()).read_text())
    return card


def test_it_recovers_a_known_optimum(tmp_path: Path) -> None:
    card = card_of(small(tmp_path / "run", generations=12, every=4))
    assert card["searched"] == ["bias"]  # the other one changes nothing
    assert card["settings"]["bias"] == pytest.approx(BEST, abs=0.1)
    tuned, untuned = (card["scores"][k]["safe_score"]["value"] for k in ("tuned", "untuned"))
    assert tuned > untuned + 0.1
    assert card["curve"][0]["generation"] == 0
    points = {point["generation"]: point["score"] for point in card["curve"]}
    assert points[card["generation"]] == max(points.values())
    assert card["command"].startswith(f"posse tune {POLICY} --scenario paper-distributed --gen")


def test_a_killed_run_resumes_to_the_same_result(tmp_path: Path) -> None:
    whole = card_of(small(tmp_path / "whole"))
    with killed_at(_Run, "_generation", 4):
        tune(small(tmp_path / "killed"), console=quiet())
    assert not (tmp_path / "killed/tuned.json").exists()
    assert card_of(small(tmp_path / "killed")) == whole


def test_time_stops_a_run_after_a_whole_generation(tmp_path: Path) -> None:
    card = card_of(small(tmp_path / "run", generations=None, minutes=0.001))
    generations = int(card["command"].split("--generations ")[1].split()[0])
    assert card_of(small(tmp_path / "again", generations=generations)) == card


def test_a_policy_whose_settings_change_nothing_is_refused(tmp_path: Path) -> None:
    deaf = small(tmp_path / "run", policy="tests.training.test_tune:Deaf")
    with pytest.raises(SettingsError, match=r"no setting of '.*Deaf' has an effect on 'paper-distributed'"):
        tune(deaf, console=quiet())


def test_a_folder_of_another_run_or_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run"
    tune(small(run, generations=1), console=quiet())
    with pytest.raises(RunFolderError, match="holds a run with seed=3, not 4"):
        tune(small(run, seed=4), console=quiet())
    monkeypatch.setattr("posse_training.tune.software", lambda *names: dict.fromkeys(names, "0"))
    monkeypatch.setattr("posse_training.tune.digests", lambda names: {f"digest of {POLICY}": "0" for _ in names})
    with pytest.raises(RunFolderError, match=rf"cmaes='[0-9.]+', not '0', .*digest of {POLICY}='.*', not '0'"):
        tune(small(run), console=quiet())
    monkeypatch.undo()
    (tmp_path / "tuned.json").touch()
    with pytest.raises(RunFolderError, match=r"has tuned\.json, but no settings\.json"):
        tune(small(tmp_path), console=quiet())
    (run / "state.json").write_text((run / "state.json").read_text()[:100])
    with pytest.raises(RunFolderError, match=r"state\.json is damaged"):
        tune(small(run), console=quiet())


def test_every_point_is_a_setting_that_can_be_played_and_the_start_is_the_default() -> None:
    settings = FAMILY["ddcs-distributed"]
    found = tunables(settings)
    space = Space(found, [t.name for t in found])
    narrow = Space((Tunable("a", 0.5, 1 / 3, 2 / 3, "", ""), Tunable("b", 0.5, 0.0, 2 / 3, "", "a")), ["a"])
    assert narrow.values(np.zeros(1))["a"] == 1 / 3
    assert narrow.values(np.ones(1))["b"] == 2 / 3
    rng = np.random.default_rng(1)
    for point in [*rng.random((200, len(found))), np.zeros(len(found)), np.ones(len(found))]:
        DDCS(settings).with_settings(**space.values(point))
    assert space.values(space.start) == pytest.approx({t.name: t.default for t in found}, rel=1e-5, abs=1e-9)
