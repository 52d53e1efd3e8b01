"""The demo with and without a learned team."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image
from tests.support.learned import any_policy
from tests.support.process import printed

from posse_training import demo
from posse_training.replay.page import read_replay


@pytest.mark.parametrize("learned", [False, True])
def test_it_ends_with_scripted_beside_learned_where_one_is_shipped(
    learned: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = tmp_path / "shipped"
    shipped.mkdir()
    monkeypatch.setattr("posse_baselines.registry.SHIPPED", shipped)
    monkeypatch.setattr(demo, "FOLDER", tmp_path)
    monkeypatch.setattr(demo, "SCENARIOS", ("constant", "smart"))
    monkeypatch.setattr(demo, "POLICIES", ("idle", "pursuit"))
    if learned:
        any_policy().with_card({"name": demo.LEARNED}).save(shipped / f"{demo.LEARNED}.safetensors")
    demo.demo(episodes=2, seconds=0.5)
    shown = capsys.readouterr().out
    assert (demo.LEARNED in shown) == learned
    page = read_replay(tmp_path / "replay.html")
    assert [player.name for player in page.players][1:] == ([demo.LEARNED] if learned else [])
    joined = "".join(shown.split())  # a table may wrap a long folder
    assert joined.index("constant.gif") < joined.index("smart.gif")
    with Image.open(tmp_path / "constant.gif") as film:
        assert film.width == film.height
    with Image.open(tmp_path / "smart.gif") as film:
        assert film.width == film.height * (1 + learned)  # two panels


def test_it_needs_no_torch() -> None:
    code = "import sys, posse_training.demo; print('torch' in sys.modules)"
    assert printed("-c", code).strip() == "False"
