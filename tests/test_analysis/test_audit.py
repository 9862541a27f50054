"""The audit of printed tables: the paper's Table I, exact limits, brute force, bad input."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import combinations_with_replacement, product
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_analysis.shared import EXAMPLES, put

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

TABLE_1 = EXAMPLES / "paper-table1.csv"
few = settings(deadline=None, max_examples=40)


def row(*three: str, n: int | None = None, people: int | None = None) -> PrintedRow:
    least, mean, largest = (Printed(text=text) for text in three)
    trials = None if n is None else (n, n)
    return PrintedRow(
        label="60", least=least, mean=mean, largest=largest, trials=trials, participants=people
    )


def shortened(value: Fraction, convention: str, decimals: int) -> str:
    """Print a proportion, the definition that `Printed.stands_for` inverts."""
    scaled = value * 10**decimals
    whole = {
        HALF_UP: (scaled + Fraction(1, 2)).__floor__(),
        HALF_EVEN: round(scaled),
        TRUNCATED: scaled.__floor__(),
    }[convention]
    return f"{whole // 10**decimals}.{whole % 10**decimals:0{decimals}d}"


def summed_up(counts: Sequence[int], n: int) -> tuple[Fraction, Fraction, Fraction]:
    values = [Fraction(k, n) for k in counts]
    return min(values), sum(values) / Fraction(len(values)), max(values)


def test_table_1_is_found_impossible_where_the_documentation_says() -> None:
    found = audit(read_table(TABLE_1))
    assert [one.row.label for one in found.rows if not one.possible] == ["60", "95", "165"]
    assert found.exchange_fits == ()
    first = found.rows[0].verdicts[0]
    assert (first.reading, first.mean_high) == ("rounded", 0.815)
    assert first.least_trials == (20, 22, 29, 31, 33, 38, 40)
    assert [verdict.fitting_means for verdict in found.rows[0].verdicts] == [(), ()]
    for place, mean, least in ((1, "0.87", "0.9"), (3, "0.9", "0.96")):
        for verdict in found.rows[place].verdicts:
            assert verdict.reasons == (f"the mean {mean} is below the least value {least}",)
    # dropped zeros are told apart
    shown = [found.rows[place].possible_as_shown for place in (0, 1, 3)]
    assert shown == [("truncated",), ("rounded",), ("truncated",)]


@pytest.mark.parametrize(
    ("value", "readings"),
    [
        # 0.625 is rounded up to 0.63, to the even digit 0.62, and cut to 0.62
        (row("0.63", "0.63", "0.63", n=8), ("rounded",)),
        (row("0.62", "0.62", "0.62", n=8), ("rounded", "truncated")),
        # 2/3
        (row("0.67", "0.67", "0.67", n=3), ("rounded",)),
        (row("0.66", "0.66", "0.66", n=3), ("truncated",)),
        (row("0.65", "0.65", "0.65", n=3), ()),
        # a single participant has one value
        (row("0.50", "0.55", "0.60", people=1), ()),
        (row("0.50", "0.50", "0.50", n=10, people=1), ("rounded", "truncated")),
        # two participants with 10 stimuli: a mean between is a multiple of 1/20
        (row("0.50", "0.75", "1.00", n=10, people=2), ("rounded", "truncated")),
        (row("0.50", "0.70", "1.00", n=10, people=2), ()),
        (row("0.9", "0.5", "0.1"), ()),
        (row("0.1", "0.95", "0.9"), ()),
        (row("0", "1", "1", people=3), ("rounded",)),
        (row("0.0", "1.0", "1.0", people=3), ()),
        # five participants' mean of values printed so exactly
        (row("0.4500000", "0.8100001", "0.9000000", people=5), ()),
        (row("0.4500000", "0.8100000", "0.9000000", people=5), ("rounded", "truncated")),
    ],
)
def test_each_reading_has_its_verdict(value: PrintedRow, readings: tuple[str, ...]) -> None:
    [found] = audit([value]).rows
    assert tuple(verdict.reading for verdict in found.verdicts if verdict.possible) == readings
    assert found.possible == bool(readings)


@pytest.mark.slow
@few
@given(st.data(), st.sampled_from(CONVENTIONS), st.integers(1, 3))
def test_what_was_measured_is_never_impossible(
    data: st.DataObject, convention: str, places: int
) -> None:
    n, people = data.draw(st.integers(1, 40)), data.draw(st.integers(1, 6))
    counts = data.draw(st.lists(st.integers(0, n), min_size=people, max_size=people))
    printed = [shortened(value, convention, places) for value in summed_up(counts, n)]
    [found] = audit([row(*printed, n=n, people=people)]).rows
    reading = next(name for name, ways in READINGS.items() if convention in ways)
    assert next(one for one in found.verdicts if one.reading == reading).possible


@pytest.mark.slow
def test_the_verdict_is_that_of_trying_everything() -> None:
    n, people = 6, 3
    possible: dict[str, set[tuple[str, ...]]] = {reading: set() for reading in READINGS}
    for counts in combinations_with_replacement(range(n + 1), people):
        three = summed_up(counts, n)
        for reading, conventions in READINGS.items():
            for way in conventions:
                possible[reading].add(tuple(shortened(value, way, 1) for value in three))
    texts = [f"0.{digit}" for digit in range(10)] + ["1.0"]
    for printed in product(texts, repeat=3):
        [found] = audit([row(*printed, n=n, people=people)]).rows
        for verdict in found.verdicts:
            assert verdict.possible == (printed in possible[verdict.reading])


@pytest.mark.slow
@given(st.integers(0, 1000), st.integers(1, 1000), st.sampled_from(CONVENTIONS))
def test_a_printed_number_stands_for_what_is_printed_so(k: int, n: int, convention: str) -> None:
    value = Fraction(min(k, n), n)
    here = shortened(value, convention, 2)
    for step in (-1, 0, 1):
        near = Fraction(here) + Fraction(step, 100)
        if 0 <= near <= 1:
            printed = Printed(text=f"{float(near):.2f}")
            assert printed.stands_for(convention, 2).holds(value) == (step == 0)


def test_exchanged_means_are_found() -> None:
    rows = [row("0.10", "0.70", "0.20"), row("0.60", "0.15", "0.80")]
    found = audit(rows)
    assert not found.possible
    assert found.exchange_fits == ("rounded", "truncated")
    assert found.rows[0].verdicts[0].fitting_means == ("0.15",)


@pytest.mark.parametrize("text", ["1.01", "-0.1", "1e-1", "nan", "", "86", "0,5", "٠.٥", "0.", "."])
def test_other_texts_are_no_proportion(text: str) -> None:
    with pytest.raises(ValueError, match="must be a number from 0 to 1"):
        Printed(text=text)


def test_the_command_answers_no_with_exit_1() -> None:
    result = run("audit", TABLE_1)
    assert (result.exit_code, result.stderr) == (1, "")
    assert result.stdout.endswith("Impossible under every reading: 60, 95, 165.\n")
    assert "No order of the means fits all rows." in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 80
    result = run("audit", TABLE_1, "--json")
    assert result.exit_code == 1
    told = json.loads(result.stdout)
    assert (told["schema"], told["possible"]) == (1, False)
    assert (told["decimals"], told["exchange_fits"]) == (2, [])
    assert [one["label"] for one in told["rows"] if not one["possible"]] == ["60", "95", "165"]
    assert told["rows"][0]["n"] == [20, 40]


def test_a_possible_table_is_exit_0(tmp_path: Path) -> None:
    text = "\ufefflabel,min,mean,max,participants\n=1+1,0.5,0.6,0.7,n/a\n"
    result = run("audit", put(tmp_path / "t.csv", text))
    assert (result.exit_code, result.stderr) == (0, "")
    assert "Impossible under every reading: none." in result.stdout


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "1: the file is empty"),
        ("level,min,mean,max\n", "1: a header and no rows"),
        ("level,min,mean\n60,0,1\n", "1: no column max"),
        ("min,mean,max\n0,0,0\n", "1: one of level_vpp, level, label must name the rows, got none"),
        ("level,label,min,mean,max\n1,1,0,0,0\n", "1: one of level_vpp, level, label"),
        ("level,min,mean,max,colour\n60,0,0,0,red\n", "1: unknown column 'colour'"),
        ("level,min,mean,max\n60,0,0.5,1\n95,45,86,90\n", "3: a printed proportion must be"),
        ("level,min,mean,max\n,0,0.5,1\n", "2: column 'level' must have 1 to 64"),
        ("level,min,mean,max,n\n60,0,0.5,1,40-20\n", "2: trials must be from 1 to"),
        ("level,min,mean,max,n\n60,0,0.5,1,1-1002\n", "at most 1000 apart, got (1, 1002)"),
        ("level,min,mean,max,n\n60,0,0.5,1,many\n", "2: n must be a number or a range"),
        ("level,min,mean,max,participants\n60,0,0.5,1,0\n", "2: participants must be from 1"),
        ("level,min,mean,max,participants\n60,0,0.5,1,2.5\n", "2: participants must be a whole"),
        ("level,min,mean,max\n" + "60,0,0.5,1\n" * 101, "rows must hold from 1 to 100"),
    ],
)
def test_other_tables_are_refused_in_one_line(text: str, told: str, tmp_path: Path) -> None:
    result = run("audit", put(tmp_path / "t.csv", text), "--json")
    assert (result.exit_code, result.stdout) == (2, "")
    assert len(result.stderr.splitlines()) == 1
    assert told in result.stderr
