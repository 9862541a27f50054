"""A yes/no task with stimuli at one side: which columns and figures leave the side out."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from typing import TYPE_CHECKING

import pytest

from analysis import Axis, ColumnMap, analyse, print_analysis, write_analysis
from tests.test_analysis.shared import LEAST, files, loaded, put

if TYPE_CHECKING:
    from pathlib import Path

HEAD = "participant,side,level_vpp,detected\n"
FELT = {"0": "nnynnn", "0.02": "nnnny", "0.05": "nynyn", "0.1": "yynyy", "0.159": "yynyt"}
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
def test_a_yes_no_task_at_one_side_has_no_confusion_of_sides(tmp_path: Path) -> None:
    path = put(tmp_path / "t.csv", HEAD + ROWS)
    analysis = write_analysis([path], tmp_path / "out", columns=YES_NO, figures=True)
    assert (analysis.one_side, analysis.one_place) == ("right", "")
    made = files(tmp_path / "out")
    assert [name for name in made if name.startswith("confusion.")] == ["confusion.csv"]
    assert (analysis.counts.single, analysis.counts.blank) == (60, 18)
    assert analysis.levels["presented"].tolist() == [15] * 4
    assert analysis.levels["timeouts"].sum() == 3


def test_two_sides_are_kept(tmp_path: Path) -> None:
    rows = "1,left,60,left\n1,right,95,right\n1,left,95,both\n1,none,0,none\n"
    assert not analyse(loaded(tmp_path, LEAST + rows)).one_side
    answered = rows.replace("right,95,right", "left,95,right")
    assert not analyse(loaded(tmp_path, LEAST + answered)).one_side


def test_a_forced_choice_known_as_right_and_wrong_has_no_sides_in_its_tables(
    tmp_path: Path,
) -> None:
    rows = "".join(f"{who},{level},{n % 2}\n" for who in "12" for level in (1, 2) for n in range(8))
    theirs = {"task": "forced choice", "constant": {"side": "left"}, "axis": {"unit": "vol"}}
    text = "participant,level_vpp,detected\n" + rows
    analysis = write_analysis(
        [put(tmp_path / "t.csv", text)],
        tmp_path / "out",
        columns=ColumnMap(**theirs),
        figures=False,
    )
    printed = io.StringIO()
    print_analysis(analysis, printed, details=True)
    markup = "<style>.*</style>|<[^>]+>"
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    page = re.sub(markup, "", page, flags=re.DOTALL)
    for shown in (printed.getvalue(), page):
        assert not re.search("(?i)right|left(?! out)|other side|Answers of each", shown)


@pytest.mark.slow
def test_of_one_place_no_output_has_the_side_that_the_map_alone_states(tmp_path: Path) -> None:
    head = "participant,level_vpp,detected,rt_s\n"
    rows = "".join(
        f"{who},{at},{key},{'n/a' if key == 't' else 0.5}\n"
        for who in "12"
        for at, keys in FELT.items()
        for key in keys * 3
    )
    path = put(tmp_path / "t.csv", head + rows)
    axis = Axis(unit="mN", peak_to_peak=False)
    mapped = YES_NO.model_copy(update={"constant": {"side": "right"}, "axis": axis})
    analysis = write_analysis([path], tmp_path / "out", columns=mapped, figures=True)
    assert (analysis.one_side, analysis.one_place) == ("right", "right")
    printed = io.StringIO()
    print_analysis(analysis, printed)
    texts = {
        name: content.decode()
        for name, content in files(tmp_path / "out").items()
        if name.endswith((".csv", ".html", ".txt"))
    }
    markup = "<style>.*</style>|<[^>]+>"
    texts["report.html"] = re.sub(markup, "", texts["report.html"], flags=re.DOTALL)
    for name, text in [("terminal", printed.getvalue()), *texts.items()]:
        assert not re.search(r"right|\bleft\b(?! out| edge)|_vpp", text), name
    assert texts["blank.csv"].startswith("participant,felt,presented,p,low,high,group_low,")
    assert texts["confusion.csv"].startswith("condition,kind,felt,not_felt,timeout,invalid,")
    *_, group = csv.DictReader(io.StringIO(texts["thresholds.csv"]))
    assert (group["participant"], group["unit"]) == ("all", "mN")
    assert float(group["threshold_db"]) == pytest.approx(20 * math.log10(float(group["threshold"])))
    summary = json.loads(files(tmp_path / "out")["summary.json"])
    assert summary["axis"] == {"x_scale": "log10", "unit": "mN"}
    assert {"level", "unit"} <= {*summary["levels"][0]}
    assert not any("_vpp" in name for name in json.loads(files(tmp_path / "out")["columns.json"]))
