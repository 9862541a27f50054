"""A yes/no task with stimuli at one side: what is said of it, and what of sides is left out."""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from analysis import ColumnMap, print_analysis, write_analysis
from analysis.axis import VOLTS
from analysis.results.methods.presented import presented_words
from analysis.results.methods.task import detected_words, is_yes_no
from analysis.results.rows import PAGE, difference_rows
from analysis.results.summary import in_own_words
from analysis.results.tables import analyse
from tests.test_analysis.shared import LEAST, files, loaded, put

if TYPE_CHECKING:
    from pathlib import Path

HEAD = "participant,side,level_vpp,detected\n"
FELT = {"0": "nnynnn", "0.02": "nnnny", "0.05": "nynyn", "0.1": "yynyy",
        "0.159": "yynyt"}  # fmt: skip
ROWS = "".join(
    f"1,{'none' if level == '0' else 'right'},{level},{key}\n"
    for level, keys in FELT.items()
    for key in keys * 3
)
YES_NO = ColumnMap(
    task="yes/no",
    axis={"unit": "vol"},
    values={"detected": {"y": "1", "n": "0", "t": "timeout"}},
)


@pytest.mark.slow
def test_a_yes_no_task_at_one_side_is_told_without_sides(tmp_path: Path) -> None:
    path = put(tmp_path / "t.csv", HEAD + ROWS)
    analysis = write_analysis([path], tmp_path / "out", columns=YES_NO, figures=True)
    assert analysis.one_side == "right"
    made = files(tmp_path / "out")
    assert not any(name.startswith("confusion.") and name != "confusion.csv" for name in made)
    page = re.sub(r"\s+", " ", html.unescape(re.sub("<[^>]+>", "", made["report.html"].decode())))
    for absent in ("Side of wrong answers", "Mislocalised", "Other side", "named its side",
                   "peak-to-peak", "Guess rate", "plan "):  # fmt: skip
        assert absent not in page, absent
    for told in (
        "All stimuli were of one side, right, and so was each answer that names a side",
        "The task was yes/no: whether a stimulus was felt.",
        "There were 4 levels (0.02 to 0.159 vol), 15 trials of each for a participant, and 18 ",
        "and 18 blank (catch) trials.",
        "The 3 trials without an answer in time count as not felt.",
        "false-alarm rate",
        "half-way between gamma and 1 - lambda: detected (1 + gamma - lambda)/2 of the time",
        "The answer (threshold: half-way between false-alarm rate and 1 - lapse rate)",
        "The false-alarm rate of a fit is (a + 1/2)/(b + 1)",
        "If false-alarm rate 0",
        "felt half of the time: detected (1 + gamma - lambda)/2 of the time, half-way between",
        "the threshold in dB re 1 vol",
    ):
        assert told in page, told
    assert ("lapse at bound" in page) == ("The threshold may be reported" in page)
    printed = io.StringIO()
    print_analysis(analysis, printed)
    assert "both other" not in printed.getvalue()
    assert "were of one side, right, and" in printed.getvalue()


@pytest.mark.slow
def test_misses_at_high_levels_are_explained_below_the_table(tmp_path: Path) -> None:
    counts = {"10": "nnnnn" * 6, "30": "nyyyn" * 6, "90": "yyyyn" * 6, "200": "yyyyn" * 6}
    rows = (f"1,left,{at},{key}\n" for at, keys in counts.items() for key in keys)
    path = put(tmp_path / "t.csv", HEAD + "".join(rows))
    analysis = write_analysis([path], tmp_path / "out", columns=YES_NO, figures=False)
    assert analysis.thresholds["status"].tolist() == ["lapse_at_bound"]
    page = files(tmp_path / "out")["report.html"].decode()
    assert "The threshold may be reported" in page.partition("lapse at bound")[2]


def test_two_sides_are_told_as_before(tmp_path: Path) -> None:
    rows = "1,left,60,left\n1,right,95,right\n1,left,95,both\n1,none,0,none\n"
    analysis = analyse(loaded(tmp_path, LEAST + rows))
    assert not analysis.one_side
    assert not is_yes_no(analysis)
    assert detected_words(analysis).endswith("named its side and nothing else.")
    (told,) = presented_words(analysis)
    assert told.startswith("There were 2 levels (60 to 95 V), 1 to 2 trials of each for a ")
    assert told.endswith(" participant, and 1 blank (catch) trial.")
    one = analyse(loaded(tmp_path, LEAST + rows.replace("right,95,right", "left,95,right")))
    assert not one.one_side  # the other side was answered


@pytest.mark.slow
def test_of_one_place_no_output_tells_the_side_that_the_map_alone_states(tmp_path: Path) -> None:
    head = "participant,level_vpp,detected,rt_s\n"
    rows = "".join(
        f"{who},{at},{key},{'n/a' if key == 't' else 0.5}\n"
        for who in "12" for at, keys in FELT.items() for key in keys * 3
    )  # fmt: skip
    path = put(tmp_path / "t.csv", head + rows)
    mapped = replace(YES_NO, constant={"side": "right"}, axis={"unit": "mN"})
    analysis = write_analysis([path], tmp_path / "out", columns=mapped, figures=True)
    assert (analysis.one_side, analysis.one_place) == ("right", "right")
    printed = io.StringIO()
    print_analysis(analysis, printed)
    made = {name: content.decode() for name, content in files(tmp_path / "out").items()
            if name.endswith((".csv", ".html", ".txt"))}  # fmt: skip
    made["report.html"] = re.sub(
        "<style>.*</style>|<[^>]+>", "", made["report.html"], flags=re.DOTALL
    )
    for name, told in [("terminal", printed.getvalue()), *made.items()]:
        assert not re.search(r"right|\bleft\b(?! out| edge)|finger, |_vpp", told), name
    seldom = "Both-finger|simulated|without a device|masking noise|noise_ok|both 0"
    for told in (printed.getvalue(), made["report.html"]):
        assert not re.search(seldom, told)
    assert made["blank.csv"].startswith(
        "participant,felt,presented,p,low,high,group_low,group_high\n"
    )
    assert made["confusion.csv"].startswith(
        "condition,kind,felt,not_felt,timeout,invalid,presented"
    )
    *_, of = csv.DictReader(io.StringIO(made["thresholds.csv"]))
    assert (of["participant"], of["unit"]) == ("all", "mN")
    assert float(of["threshold_db"]) == pytest.approx(20 * math.log10(float(of["threshold"])))
    summary = json.loads(files(tmp_path / "out")["summary.json"])
    assert summary["axis"] == {"x_scale": "log10", "unit": "mN"}
    assert {"level", "unit"} <= {*summary["levels"][0]}
    assert not any("_vpp" in names for names in summary["definitions"])


def test_a_side_that_the_table_tells_stays(tmp_path: Path) -> None:
    analysis = analyse(loaded(tmp_path, HEAD + ROWS, YES_NO))
    assert (analysis.one_side, analysis.one_place) == ("right", "")
    assert "level_vpp" in in_own_words(analysis.levels, replace(analysis, axis=VOLTS))


def test_which_condition_came_first_is_a_column_where_it_is_known(tmp_path: Path) -> None:
    head = "participant,condition,level_vpp,detected\n"
    rows = "".join(
        f"1,{which},{at},{key}\n" for which in "ab" for at, keys in FELT.items() for key in keys
    )
    analysis = analyse(loaded(tmp_path, head + rows, replace(YES_NO, constant={"side": "left"})))
    [(_, header, cells)] = difference_rows(analysis, PAGE)
    assert "First" not in header
    assert {len(row) for row in cells} == {len(header)}
