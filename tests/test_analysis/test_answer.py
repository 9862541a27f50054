"""The answer: its numbers are those of the tables, in at most 12 lines of 80 columns."""

from __future__ import annotations

import html
import io
import itertools
import json
import math
import random
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from analysis import Axis, ColumnMap, WarningCode, analyse, print_analysis, write_analysis
from analysis.codes import AnalysisWarning
from analysis.results.answer import answer
from analysis.results.findings import ALPHA
from tests.test_analysis.shared import LEAST, files, loaded, put
from tests.test_analysis.tables import numbers

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import Analysis
    from analysis.results.answer import AnswerRow

NAN = math.nan
VALUES = [
    ("ok", 81.0, 74.0, 88.0, [81, 74, 88]),
    ("ok", 71.0, NAN, 90.0, [71, 60, 90]),
    ("lapse_at_bound", 150.0, 120.0, NAN, [150, 120, 60]),
    ("threshold_below_levels", NAN, NAN, 60.0, [60]),
    ("threshold_above_levels", NAN, 60.0, NAN, [60]),
    ("median_below_levels", NAN, NAN, 68.2, [68.2, 95]),
    ("median_above_levels", NAN, 55.3, NAN, [55.3, 95]),
    ("flat", NAN, NAN, NAN, []),
]
"""Status, threshold, limits and the numbers that are printed, where 60 is the only level."""
LIMITS = ["status", "threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"]
LEFT, RIGHT = 45.0, 80.0


@pytest.fixture(scope="module")
def least(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """An analysis of next to nothing, whose tables are replaced."""
    folder = tmp_path_factory.mktemp("least")
    return analyse(loaded(folder, LEAST + "1,left,60,left\n1,left,95,none\n"))


def rows_of(table: pd.DataFrame, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows with the columns of a table; what a row lacks is missing."""
    return pd.DataFrame(rows, columns=[*dict.fromkeys([*table.columns, *(rows or [{}])[0]])])


def with_warnings(analysis: Analysis, *warnings: AnalysisWarning) -> Analysis:
    """Return an analysis that has these warnings, whatever its tables are."""
    copy = replace(analysis)
    vars(copy)["warnings"] = warnings
    return copy


def drawn(least: Analysis, seed: int) -> tuple[Analysis, dict[str, list[float]]]:
    """Return an analysis whose tables are drawn at random, and the numbers of each condition."""
    rng: Any = random.Random(seed)
    names = [rng.choice(("c", "a long name of a condition")) + f"{n}" for n in range(seed % 5 + 1)]
    people, linear = rng.choice((1, 2, 5, 8)), rng.random() < 0.2
    shown, groups, each = {}, [], []
    for name in names:
        *value, printed = rng.choice(VALUES)
        shown[name] = printed
        row = {"condition": name} | dict(zip(LIMITS, value, strict=True))
        groups.append(row | {"participants": people})
        each += [row | {"participant": f"S{n}", "trials": 80} for n in range(people)]
    differences = []
    for a, b in itertools.combinations(names, 2) if not linear else ():
        low = rng.uniform(-6, 6)
        at = {"difference_db": low + 1, "low_db": low, "high_db": low + 2, "status": "ok"}
        at |= {"condition_a": a, "condition_b": b, "false_alarm_p": rng.choice((NAN, 0.01, 0.3))}
        of = [f"S{n}" for n in range(people)]
        differences += [at | {"participant": name} for name in (*of, "all")]
    blank = pd.DataFrame({"condition": names, "participant": "all", "presented": 60})
    blank = blank.assign(p=0.1, low=0.05, high=0.2, group_low=NAN, group_high=NAN)
    found = replace(
        least,
        loaded=replace(least.loaded, axis=Axis(x_scale="linear") if linear else Axis()),
        groups=rows_of(least.groups, groups),
        thresholds=rows_of(least.thresholds, each),
        differences=rows_of(least.differences, differences),
        levels=pd.DataFrame({"condition": names, "level_vpp": 60.0}),
        blank=blank if len(names) > 1 else blank.drop(columns="condition"),
        counts=replace(least.counts, trials=400, conditions=len(names), participants=people),
        detected_any=rng.choice((None, least.levels)),
    )
    return with_warnings(found), shown


def printed(analysis: Analysis, **options: Any) -> list[str]:
    """Return the lines on a terminal."""
    file = io.StringIO()
    print_analysis(analysis, file, **options)
    return file.getvalue().splitlines()


def of_kind(rows: list[AnswerRow], kind: str) -> list[AnswerRow]:
    return [row for row in rows if row.kind == kind]


@pytest.mark.parametrize("seed", range(20))
def test_the_numbers_of_the_answer_are_those_of_the_tables(least: Analysis, seed: int) -> None:
    analysis, shown = drawn(least, seed)
    rows = answer(analysis)
    people = analysis.groups["participants"].iloc[0]
    if len(shown) <= 5:
        found = {row.names[0] if row.names else "c0": row for row in of_kind(rows, "threshold")}
        for name, values in shown.items():
            row = found[name] if len(shown) > 1 else of_kind(rows, "threshold")[0]
            assert numbers(row.text) == [*values, people], row
    pairs = analysis.differences[analysis.differences["participant"].eq("all")]
    if 0 < len(pairs) <= 3:
        for (_, pair), row in zip(pairs.iterrows(), of_kind(rows, "difference"), strict=True):
            ends = [round(pair[name], 1) for name in ("difference_db", "low_db", "high_db")]
            assert numbers(row.text)[:3] == pytest.approx(ends, abs=0.051)
            assert row.names == (pair["condition_b"], pair["condition_a"])
    alarms = of_kind(rows, "false_alarms")[0]
    assert (10.0 in numbers(alarms.text)) == (analysis.detected_any is not None)


@pytest.mark.parametrize("seed", range(20))
def test_the_terminal_has_at_most_12_lines_of_80_columns(least: Analysis, seed: int) -> None:
    analysis, _ = drawn(least, seed)
    warnings = tuple(
        replace_code(code) for code in (*WarningCode,)[: random.Random(seed).randrange(12)]
    )
    lines = printed(with_warnings(analysis, *warnings), report="out/report.html")
    assert len(lines) <= 12
    assert max(map(len, lines)) <= 80
    assert lines[-1].endswith("out/report.html")
    assert any(re.search(rf"\b{len(warnings)}\b|none|more", line) for line in lines)


def replace_code(code: WarningCode) -> Any:
    from analysis import AnalysisWarning

    return AnalysisWarning(code, "a message")


def study(conditions: dict[str, float], people: int, *, kind: str = "none") -> str:
    """Write trials of people whose thresholds lie 1 dB apart, in yes/no or forced choice."""
    rng, simulated = np.random.default_rng(3), str(kind == "simulated").lower()
    rows = ["participant,trial,condition,kind,side,level_vpp,response,simulated"]
    for n in range(people):
        own = []
        for condition, at in conditions.items():
            for level in (40.0, 60.0, 80.0, 100.0, 140.0):
                z = (math.log10(level / at) - 0.05 * (n % 3 - 1)) / 0.1
                for _ in range(16):
                    felt = rng.random() < 0.5 * (1 + math.erf(z / math.sqrt(2)))
                    guess = rng.choice(["left", "right"]) if kind == "forced" else "none"
                    own.append(f"{condition},single,left,{level:g},{'left' if felt else guess}")
            blanks = ["left", *["none"] * 19] if kind != "forced" else []
            own += [f"{condition},blank,none,0,{said}" for said in blanks]
        own.append(f"{condition},practice,left,60,left")
        rows += [f"S{n},{at + 1},{one},{simulated}" for at, one in enumerate(own)]
    return "\n".join(rows) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("conditions", "people", "kind"),
    [
        ({"a": 60.0, "b": 95.0}, 3, "none"),
        ({"main": 70.0}, 1, "forced"),
        ({"main": 20.0}, 2, "simulated"),
    ],
)
def test_page_terminal_and_summary_have_the_same_answer(
    tmp_path: Path, conditions: dict[str, float], people: int, kind: str
) -> None:
    path = put(tmp_path / "t.csv", study(conditions, people, kind=kind))
    analysis = write_analysis([path], tmp_path / "out", columns=ColumnMap(), figures=False)
    made = files(tmp_path / "out")
    summary = json.loads(made["summary.json"])
    texts = [row["text"] for row in summary["answer"]]
    assert texts == [row.text for row in answer(analysis)]
    page = html.unescape(re.sub("</?bdi>", "", made["report.html"].decode()))
    first = page[page.index("<h1>") : page.index("<h2")]
    lines = " ".join(" ".join(printed(analysis)).split())
    assert all(f"<td>{text}</td>" in first and text in lines for text in texts)
    assert bool(analysis.mark) == (kind == "simulated")
    assert bool(analysis.mark) == lines.startswith(f"{analysis.mark or '-'}.")
    table = pd.read_csv(io.BytesIO(made["thresholds.csv"]), dtype={"participant": str})
    rows = table[table["participant"].eq("all" if people > 1 else "S0")]
    values = [numbers(row.text)[0] for row in of_kind(answer(analysis), "threshold")]
    expected = rows["threshold_vpp"].fillna(rows["threshold_high_vpp"])
    assert values == pytest.approx([*expected], abs=0.06)


@pytest.mark.parametrize("seed", range(10))
def test_each_condition_whose_sides_differ_has_both_thresholds(least: Analysis, seed: int) -> None:
    analysis, shown = drawn(least, seed)
    at = {"left": 45.0, "right": 80.0}
    sides = [
        {"condition": name, "side": side, "status": "ok", "threshold_vpp": value + n}
        | {"threshold_low_vpp": value + n - 4, "threshold_high_vpp": value + n + 4}
        | {"participants": seed % 2 + 1}
        for n, name in enumerate(shown)
        for side, value in at.items()
    ]
    table = rows_of(analysis.side_groups, sides)
    analysis = replace(analysis, side_groups=table, side_p=dict.fromkeys(shown, 0.01))
    rows = of_kind(answer(analysis), "side")
    assert [row.names for row in rows] == [(name,) * (len(shown) > 1) for name in shown]
    for n, row in enumerate(rows):
        assert {45.0 + n, 80.0 + n} <= {*numbers(row.text)}
    lines = printed(analysis, report="report.html")
    assert len(lines) <= 12
    text = "\n".join(lines)
    assert all(f"left {45 + n}.0 V" in text for n in range(len(shown)))
    assert all(re.search(rf"right\s+{80 + n}\.0\s+V", text) for n in range(len(shown)))


def test_equal_warnings_are_one_line_with_their_numbers(least: Analysis) -> None:
    analysis, _ = drawn(least, 0)
    codes = [WarningCode.FUNCTIONS_STEEP, *[WarningCode.CONDITION_ALWAYS_FIRST] * 6]
    warnings = tuple(AnalysisWarning(code, f"{n}") for n, code in enumerate(codes))
    remark = "main: all levels lie above the simulated threshold, 58.8 V."
    lines = printed(with_warnings(analysis, *warnings), report="R", remarks=[remark])
    at = next(n for n, line in enumerate(lines) if line.startswith("Warnings"))
    assert [line.split()[0] for line in lines[at + 1 : at + 3]] == ["2-7", "8"]
    assert lines[-1].split() == ["Report", "R"]
    assert not any("none" in line for line in lines[at:])


def test_sides_that_differ_come_first_with_both_thresholds(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    rows = [
        f"S{n},{side},{level},{side if rng.random() < p else 'none'}"
        for n in range(4)
        for side, at in (("left", LEFT), ("right", RIGHT))
        for level in (30, 45, 60, 80, 110)
        for p in [0.5 * (1 + math.erf(math.log10(level / at) / 0.1 / math.sqrt(2)))]
        for _ in range(10)
    ]
    rows += [f"S{n},none,0,none" for n in range(4) for _ in range(10)]
    analysis = analyse(loaded(tmp_path, LEAST + "\n".join(rows) + "\n"))
    first = answer(analysis)[0]
    assert first.kind == "side"
    left, low, high, right, *_ = numbers(first.text)
    assert low < LEFT < high < right < 1.1 * RIGHT
    assert left < 1.1 * LEFT
    assert [one.code for one in analysis.warnings] == [WarningCode.SIDES_DIFFER]
    assert analysis.sides.groupby("side")["presented"].sum().tolist() == [200, 200]
    exchanged = [row.replace("right", "left", 2) for row in rows if ",left," not in row]
    same = analyse(loaded(tmp_path, LEAST + "\n".join([*rows[:0], *exchanged]) + "\n"))
    assert not of_kind(answer(same), "side")


@pytest.mark.parametrize(
    ("text", "kind", "names"),
    [
        (LEAST + "1,left,60,left\n1,left,95,none\n", "false_alarms", []),
        (LEAST + "1,none,0,none\n", "threshold", []),
        (
            LEAST.replace("participant", "participant,condition")
            + "".join(
                f"a,{where},left,{level},{said if where == 'felt' else 'timeout'}\n"
                for where in ("dead", "felt")
                for level, said in ((60, "none"), (95, "left"), (130, "none"), (200, "left"))
            ),
            "threshold",
            ["felt", "dead"],
        ),
    ],
)
def test_missing_quantities_have_a_row(
    tmp_path: Path, text: str, kind: str, names: list[str]
) -> None:
    rows = of_kind(answer(analyse(loaded(tmp_path, text))), kind)
    assert rows
    assert all(row.text for row in rows)
    assert [name for row in rows for name in row.names] == names


def test_without_an_answer_none_the_task_is_a_forced_choice(tmp_path: Path) -> None:
    rows = "".join(f"1,{side},{level},left\n" for side in ("left", "right") for level in (60, 95))
    for answer_none, is_known in (("", False), ("1,left,60,none\n", True)):
        analysis = analyse(loaded(tmp_path, LEAST + rows + answer_none))
        assert (analysis.detected_any is not None) == is_known
        (row,) = of_kind(answer(analysis), "false_alarms")
        assert ("forced choice" in row.text) != is_known


@pytest.mark.parametrize(
    ("alarms", "differ"),
    [
        ({"a": (1, 1, 1, 1), "b": (1, 1, 1, 1)}, False),
        ({"a": (0, 0, 0, 0), "b": (0, 1, 0, 1)}, False),  # t would not, nor does the exact test
        ({"a": (0, 0, 0, 1), "b": (1, 1, 1, 2)}, False),  # t says so, the exact test does not
        ({"a": (0, 0, 1, 0), "b": (4, 5, 4, 5)}, True),
    ],
)
def test_the_exact_test_alone_decides_on_false_alarms(
    tmp_path: Path, alarms: dict[str, tuple[int, ...]], *, differ: bool
) -> None:
    rows = [
        f"S{n},{name},{kind},{level},{said}"
        for name, each in alarms.items()
        for n, k in enumerate(each)
        for kind, level, said in (
            *[("left", 60, "none"), ("left", 95, "left")] * 4,
            *[("none", 0, "left")] * k,
            *[("none", 0, "none")] * (20 - k),
        )
    ]
    header = LEAST.replace("participant", "participant,condition")
    analysis = analyse(loaded(tmp_path, header + "\n".join(rows) + "\n"))
    p = analysis.differences["false_alarm_p"].iloc[-1]
    assert (p < ALPHA) == differ
    codes = {one.code for one in analysis.warnings}
    assert (WarningCode.FALSE_ALARMS_DIFFER in codes) == differ
    row = of_kind(answer(analysis), "false_alarms")[0]
    assert numbers(row.text)[-1] == pytest.approx(max(p, 0.001), abs=0.006)


def test_one_level_has_no_difference_in_db(tmp_path: Path) -> None:
    rows = [
        f"{person},{condition},left,60,{'left' if n % 3 == 0 else 'none'}"
        for person in "abc"
        for condition in ("cold", "warm")
        for n in range(12)
    ]
    header = LEAST.replace("participant", "participant,condition")
    shown = of_kind(
        answer(analyse(loaded(tmp_path, header + "\n".join(rows) + "\n"))), "difference"
    )
    assert [row.text for row in shown] == ["no difference in dB: one level only"]
