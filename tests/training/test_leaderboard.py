"""Claims for the leaderboard: written into a folder of their own, measured again on fresh worlds."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posse_baselines.registry import shipped
from posse_training import cli, evaluate, leaderboard
from posse_training.errors import PlayError, SettingsError
from posse_training.leaderboard import CLAIM, Standing, measure, read_standings, standings_text, submit, verify

SCENARIO = "paper-distributed"
WORLDS = 60
HOSTILE = ["![p](https://x.invalid/p){: onerror=alert(1) }", "<script>", "a|b", "a\nb"]


@pytest.fixture(scope="module")
def claim(tmp_path_factory: pytest.TempPathFactory) -> Standing:
    return submit("pngl", tmp_path_factory.mktemp("claim") / "sent", SCENARIO, episodes=WORLDS)


def sent(folder: Path, claim: Standing, **changes: Any) -> Path:
    """Write a claim as anyone could."""
    row = standings_text([claim]).splitlines()
    values = dict(zip(row[0].split(","), row[1].split(","), strict=True)) | {n: str(v) for n, v in changes.items()}
    (folder / CLAIM).write_text(f"{row[0]}\n{','.join(values.values())}\n", encoding="utf-8")
    return folder


def test_a_claim_is_what_an_evaluation_measures_and_holds_on_fresh_worlds(claim: Standing, tmp_path: Path) -> None:
    played = evaluate("pngl", SCENARIO, WORLDS, 2026)
    assert claim.safe_score == pytest.approx(played["safe_score"].mean(), abs=1e-6, rel=0)
    assert (claim.seed, claim.worlds, claim.reads_state) == (2026, WORLDS, False)
    assert cli.main(["verify", str(sent(tmp_path, claim)), "--episodes", str(WORLDS), "--seed", "3"]) == 0
    drawn = [verify(tmp_path, episodes=2)[1].seed for _ in range(2)]
    assert len({2026, *drawn}) == 3


def test_a_raised_claim_does_not_hold_and_the_measured_score_stands(claim: Standing, tmp_path: Path) -> None:
    folder = sent(tmp_path, claim, **{name: getattr(claim, name) + 0.1 for name in ("safe_score", "low", "high")})
    with pytest.raises(SettingsError, match="the claim's own worlds"):
        verify(folder, seed=claim.seed)
    raised, measured = verify(folder, episodes=WORLDS, seed=3)
    assert not raised.agrees(measured)
    assert not replace(measured, reads_state=True).agrees(measured)
    assert measured.seed == 3
    assert measured.low <= measured.safe_score < claim.safe_score + 0.1
    assert cli.main(["verify", str(folder), "--episodes", str(WORLDS), "--seed", "3"]) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        *(({"label": label}, "label=|must have one row|line 2") for label in HOSTILE),
        *(({"label": label}, "is empty or that of a policy") for label in (" ", "planner")),
        ({"policy": "../p.safetensors"}, "policy="),
        ({"scenario": "nowhere"}, "no scenario 'nowhere'"),
        ({"version": 99}, "of version 99"),
        ({"seed": 7}, "claims are of seed 2026"),
        *((wrong, "no play has such") for wrong in ({"worlds": -5}, {"low": 0.99}, {"contact_free": 2.5})),
        ({"worlds": 1000, "low": 0.0, "high": 1.0}, "no play has such"),
        ({"safe_score": "high"}, "could not convert"),
        ({"label": "mine", "policy": "forged_module:Policy"}, "--run-code"),
    ],
)
def test_an_invalid_claim_is_named(claim: Standing, tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        verify(sent(tmp_path, claim, **changes))
    with pytest.raises(PlayError, match="LocalError"):
        verify(sent(tmp_path, claim, label="me", policy="tests.support.bad_policies:Raises"), run_code=True, episodes=2)


def test_a_policy_file_travels_with_its_claim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = tmp_path / "mine.safetensors"
    given.write_bytes(content := shipped()["learned-smart"].read_bytes())
    out = tmp_path / "sent"
    replaced = lambda *claim: (given.write_bytes(b"by a training"), measure(*claim))[1]  # noqa: E731
    monkeypatch.setattr(leaderboard, "measure", replaced)
    words = ["submit", str(given), "--scenario", SCENARIO, "--episodes", "3", "--out", str(out)]
    assert cli.main(words) == 2, "its name is that of a shipped one"
    assert cli.main([*words, "--name", "mine"]) == 0
    assert (out / given.name).read_bytes() == content, "the one that played"
    given.unlink()
    assert sorted(file.name for file in out.iterdir()) == ["mine.safetensors", CLAIM]
    assert verify(out, episodes=3)[1].policy == "mine.safetensors"


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "kept.txt").write_text("mine", encoding="utf-8")
    assert cli.main(["submit", "pursuit", "--out", str(tmp_path)]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["kept.txt"]
    assert cli.main(["submit", "pursuit", "--scenario", "family-open", "--out", str(tmp_path / "sent")]) == 2
    assert cli.main(["submit", "tests.support.bad_policies:Raises", "--out", str(tmp_path / "failed")]) == 2
    assert {path.name for path in tmp_path.rglob("*")} == {"kept.txt", "failed"}, "nothing in it, and no lock"


def test_rows_of_one_label_and_scenario_are_refused(claim: Standing, tmp_path: Path) -> None:
    (tmp_path / CLAIM).write_text(standings_text([claim, claim]), encoding="utf-8")
    with pytest.raises(SettingsError, match="two rows have one label and scenario"):
        read_standings(tmp_path / CLAIM)
