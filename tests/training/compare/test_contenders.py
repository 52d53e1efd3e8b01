"""Labels of contenders: distinct, printable, and shown as they are."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from posse_baselines import PolicyError
from posse_training.cli import main
from posse_training.compare.contenders import read_contenders


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a\0b=idle", "printable characters"),
        ("a\nb=idle", "printable characters"),
        ("\x1b[31mred=idle", "printable characters"),
        ("x" * 400 + "=idle", r"400 characters\) must have at most 100"),
        ("x" * 5000, "unknown policy 'x"),
        ("a\0b", "unknown policy"),
        ("", "unknown policy ''"),
        ("/" + "d" * 3000 + ".safetensors", "there is no policy file"),
        ("mine=" + "x" * 5000, "unknown policy 'x"),
    ],
)
def test_labels_that_no_report_can_show(text: str, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        read_contenders(("pursuit", text))


def test_a_file_may_have_an_equals_sign_in_its_path(tmp_path: Path) -> None:
    from tests.support.learned import any_policy

    path = tmp_path / "seed=1.safetensors"
    any_policy().save(path)
    (contender,) = read_contenders((str(path),))
    assert contender.label == "mine"


def test_brackets_and_dollars_are_shown_as_they_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    labels = ("[bold]a[/bold]", "[/]", "$x^{$", "_hidden")
    policies = [f"{label}=idle" for label in labels]
    options = ["--scenarios", "constant", "--episodes", "1"]
    assert main(["compare", *policies, *options, "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert all(label in shown for label in labels)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [row["policy"] for row in summary["comparison"]] == [*labels, "planner"]
    drawn = (tmp_path / "out" / "scenarios.svg").read_text()
    assert all(f"{label}</text>" in drawn for label in labels)
