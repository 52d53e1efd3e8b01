"""A sparkline shows scores against the line of a baseline."""

from __future__ import annotations

from posse_training.sparkline import sparkline


def heights(rows: list[str], width: int) -> list[int]:
    """The height of each bar in eighths of a row."""
    eighths = {bar: k for k, bar in enumerate(" ▁▂▃▄▅▆▇█")} | {"╌": 0}
    return [sum(eighths[row[k]] for row in rows) for k in range(width)]


def test_bars_rise_with_the_scores_and_the_best_is_the_highest() -> None:
    rows = sparkline([0.2, 0.4, 0.6, 0.5], width=6, height=4)
    found = heights(rows, 6)
    assert found[0] < found[1] < found[3] < found[2] == 32
    assert found[4:] == [0, 0]
    assert rows[0].endswith("0.600")
    assert rows[3].endswith("0.200")
    assert not [row for row in rows if "╌" in row]


def test_the_line_lies_between_worse_and_better_scores() -> None:
    rows = sparkline([0.1, 0.2, 0.3, 0.9], 0.6, width=6, height=4)
    (dashed,) = [row for row in rows if "╌" in row]
    assert dashed.endswith("0.600")
    place = rows.index(dashed)
    assert dashed[:3] == "╌╌╌", "worse scores stay below the line"
    assert rows[place][3] == "█", "a better one reaches beyond it"
    assert rows[0][3] != " "
    assert sparkline([0.1], 0.9, width=3)[0] == "╌╌╌ 0.900"


def test_the_latest_scores_are_shown() -> None:
    rows = sparkline([1.0] * 50 + [0.0] * 3, width=5)
    assert heights(rows, 5)[:2] == [32, 32]
    assert max(heights(rows, 5)[2:]) < 8
    assert len(sparkline([0.5], 0.5)) == 4
