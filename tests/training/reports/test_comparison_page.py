"""The comparison page: numbers agree with the results, and hand-written text is kept."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from benchmarks import comparison

import posse
from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_training import evaluate
from posse_training.reports.statistics import Estimate, difference

ROOT = Path(__file__).parents[3]


def make(path: Path, seed: int) -> LearnedPolicy:
    encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario("constant")), "plain")
    weight = np.random.default_rng(seed).normal(size=(2, encoding.size)).astype(np.float32)
    network = Network(
        np.zeros(encoding.size, np.float32),
        np.ones(encoding.size, np.float32),
        5.0,
        (weight / np.float32(8),),
        (np.array([0.5, 0], np.float32),),
        "tanh",
        "clip",
    )
    score = Estimate(0.25, 0.2, 0.3, 50).to_dict()
    card = {
        "name": path.stem,
        "scenarios": [{"name": "constant"}],
        "seed": 2,
        "training_seeds": [
            {"seed": k, "score": score, "steps": 1000, "commit": f"abc{k}", "command": f"posse train --seed {k}"}
            for k in (1, 2, 3)
        ],
    }
    policy = LearnedPolicy(network, encoding, card)
    policy.save(path)
    return policy


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "shipped").mkdir()
    monkeypatch.setattr("posse_baselines.registry.SHIPPED", tmp_path / "shipped")
    page = tmp_path / "docs" / "comparison.md"
    page.parent.mkdir()
    page.write_text(f"# By hand\n\n{comparison.MARK}\n\nold\n\n{comparison.END}\n\nAfter it\n")
    return page


def fill(page: Path, *more: str) -> str:
    options = ["--scenarios", "constant", "radio", "--episodes", "12", "--sweep-episodes", "0"]
    options += ["--planner-episodes", "2"]
    rows = str(page.parent / "rows")
    comparison.main([*options, "--page", str(page), "--rows", rows, *more])
    return page.read_text()


def test_with_nothing_shipped_the_page_stays(page: Path) -> None:
    before = page.read_text()
    assert fill(page) == before


@pytest.mark.long
def test_the_page_says_what_was_played(page: Path, tmp_path: Path) -> None:
    policy = make(tmp_path / "shipped" / "learned-any.safetensors", 1)
    files = [tmp_path / f"{k}.safetensors" for k in range(3)]
    seeds = [make(path, k) for k, path in enumerate(files)]
    text = fill(page, "--groups", f"mine={','.join(map(str, files))}")
    assert text.startswith(f"# By hand\n\n{comparison.MARK}\n\nMade by `make results`")
    assert text.endswith(f"{comparison.END}\n\nAfter it\n")
    assert "\nold" not in text
    assert text.index("![") < text.index("### Safe score"), "figures first"

    def scores(who: str | LearnedPolicy, scenario: str) -> npt.NDArray[np.float64]:
        return evaluate(who, scenario, 12, 2026, progress=False)["safe_score"]

    base = {name: scores("ddcs-tuned", name) for name in ("constant", "radio")}
    mine = {name: scores(policy, name) for name in base}
    cells = []
    for name, mark in (("constant", "&nbsp;†"), ("radio", "")):
        gap = difference(mine[name], base[name])
        cells.append(f"{gap.value:+.3f}{mark}<br>[{gap.low:+.3f},&nbsp;{gap.high:+.3f}]")
    assert f"| `learned-any` | {cells[0]} | {cells[1]} |" in text
    rows = [line for line in text.splitlines() if line.startswith("| `ddcs-tuned` |")]
    assert "&nbsp;†<br>" in rows[0].split("|")[3], "tuned for radio"
    assert f"{base['constant'].mean():.3f}" in rows[0].split("|")[2]
    expected = difference([scores(seed, "constant") for seed in seeds], base["constant"])
    assert f"| constant | `mine` | 3 | {expected} |" in text
    assert "| `learned-any` | 2 (shipped) | 0.250 [0.200, 0.300] | 1,000 |" in text
    for seed in (1, 2, 3):
        assert f"posse train --seed {seed}  # learned-any, commit abc{seed}" in text
    for name in re.findall(r"\(media/(\S+)\)", text):
        assert (page.parent / "media" / name).is_file()
    assert text.count("](media/") == 2, "two figures, without sweeps and learning curves"
    # Made again, the page is the same.
    again = fill(page, "--groups", f"mine={','.join(map(str, files))}")
    assert again == text


def test_the_manuals_page_has_its_marks() -> None:
    text = (ROOT / "docs" / "comparison.md").read_text()
    assert text.count(comparison.MARK) == text.count(comparison.END) == 1
    assert text.index(comparison.MARK) < text.index(comparison.END)
