"""The audit of printed tables: the paper's Table I, exact limits, brute force, bad input."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import combinations_with_replacement, product
from typing import TYPE_CHECKING, Any

import pytest

from analysis.audit import HALF_EVEN, HALF_UP, TRUNCATED
from tests.test_analysis.shared import EXAMPLES, cases, put, run

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

TABLE_1 = EXAMPLES / "paper-table1.csv"
READINGS = {"rounded": (HALF_UP, HALF_EVEN), "truncated": (TRUNCATED,)}
HEAD = "label,min,mean,max,n,participants\n"


def audited(path: Path) -> dict[str, Any]:
    """Audit a table by the command, whose exit code says whether it is possible."""
    result = run("audit", path, "--json")
    report: dict[str, Any] = json.loads(result.stdout)
    assert (result.exit_code, result.stderr) == (0 if report["possible"] else 1, "")
    return report


def possible(row: dict[str, Any]) -> list[str]:
    return [verdict["reading"] for verdict in row["readings"] if verdict["possible"]]


def shortened(value: Fraction, convention: str, decimals: int) -> str:
    """Print a proportion, the definition that `Printed.stands_for` inverts."""
    scaled = value * 10**decimals
    whole = {
        HALF_UP: (scaled + Fraction(1, 2)).__floor__(),
        HALF_EVEN: round(scaled),
        TRUNCATED: scaled.__floor__(),
    }[convention]
    return f"{whole // 10**decimals}.{whole % 10**decimals:0{decimals}d}"


def least_mean_largest(counts: Sequence[int], n: int) -> tuple[Fraction, Fraction, Fraction]:
    values = [Fraction(k, n) for k in counts]
    return min(values), sum(values) / Fraction(len(values)), max(values)


def test_table_1_is_impossible_where_the_documentation_says() -> None:
    report = audited(TABLE_1)
    assert (report["schema"], report["decimals"], report["exchange_fits"]) == (1, 2, [])
    rows = report["rows"]
    assert [row["label"] for row in rows if not row["possible"]] == ["60", "95", "165"]
    assert rows[0]["n"] == [20, 40]
    first = rows[0]["readings"][0]
    assert (first["reading"], first["mean_high"]) == ("rounded", 0.815)
    assert first["least_trials"] == [20, 22, 29, 31, 33, 38, 40]
    assert [verdict["fitting_means"] for verdict in rows[0]["readings"]] == [[], []]
    assert all(len(v["reasons"]) == 1 for place in (1, 3) for v in rows[place]["readings"])
    # of proportions whose dropped zeros are told apart
    shown = [rows[place]["possible_as_shown"] for place in (0, 1, 3)]
    assert shown == [["truncated"], ["rounded"], ["truncated"]]


@pytest.mark.parametrize(("row", "readings"), cases("printed rows"))
def test_each_reading_has_its_verdict(tmp_path: Path, row: str, readings: list[str]) -> None:
    report = audited(put(tmp_path / "t.csv", f"\ufeff{HEAD}=1+1,{row}\n"))
    assert possible(report["rows"][0]) == readings
    assert report["possible"] == bool(readings)


@pytest.mark.slow
def test_the_verdict_is_that_of_trying_everything(tmp_path: Path) -> None:
    n, people = 6, 3
    tried: dict[str, set[tuple[str, ...]]] = {reading: set() for reading in READINGS}
    for counts in combinations_with_replacement(range(n + 1), people):
        values = least_mean_largest(counts, n)
        for reading, conventions in READINGS.items():
            for way in conventions:
                tried[reading].add(tuple(shortened(value, way, 1) for value in values))
    texts = [f"0.{digit}" for digit in range(10)] + ["1.0"]
    printed = [*product(texts, repeat=3)]
    for first in range(0, len(printed), 100):
        some = printed[first : first + 100]
        lines = "".join(f"60,{','.join(row)},{n},{people}\n" for row in some)
        report = audited(put(tmp_path / "t.csv", HEAD + lines))
        for texts_of_row, row in zip(some, report["rows"], strict=True):
            assert possible(row) == [name for name in READINGS if texts_of_row in tried[name]]


def test_exchanged_means_are_found(tmp_path: Path) -> None:
    rows = "label,min,mean,max\na,0.10,0.70,0.20\nb,0.60,0.15,0.80\n"
    report = audited(put(tmp_path / "t.csv", rows))
    assert not report["possible"]
    assert report["exchange_fits"] == ["rounded", "truncated"]
    assert report["rows"][0]["readings"][0]["fitting_means"] == ["0.15"]


@pytest.mark.parametrize(("text", "line", "parts"), cases("printed tables that are refused"))
def test_other_tables_are_refused_in_one_line(
    text: str, line: int | None, parts: str, tmp_path: Path
) -> None:
    result = run("audit", put(tmp_path / "t.csv", text), "--json")
    assert (result.exit_code, result.stdout) == (2, "")
    assert len(result.stderr.splitlines()) == 1
    assert line is None or f"t.csv:{line}: " in result.stderr
    assert all(part in result.stderr for part in parts.split("|"))
