"""The report and the methods: complete, self-contained, names as text, numbers of the tables."""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
from dataclasses import fields
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import (
    ColumnMap,
    WarningCode,
    analyse,
    write_analysis,
)
from analysis.results.methods import methods_of
from analysis.results.protocol import measured_bursts
from analysis.results.rendering import phrases, read_toml
from analysis.results.tables import make_tables
from experiment.record.entries import MeasuredRow, StimulusMeasured
from tests.plates import PAPER_PLATE
from tests.test_analysis.shared import LEAST, files, loaded, put
from tests.test_analysis.tables import numbers

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import Analysis
    from tests.conftest import Simulate

HOSTILE = (
    *("=1+1", "<script>alert(1)</script>", "</style><script>alert(1)</script>"),
    *('"><img src=x onerror=alert(1)>', "' onmouseover='alert(1)", "&lt;b&gt;"),
    *("+7 dB", "@SUM(A1)", "אבגד", "W" * 64),
)
EMPTY = {"meta", "link", "img"}


class Outline(HTMLParser):
    """What stands in a page: tags with attributes, and the text outside the style."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data

    def of(self, tag: str) -> list[dict[str, str]]:
        return [given for name, given in self.tags if name == tag]


def report(folder: Path, names: tuple[str, ...] = ("S1",), *, figures: bool = False) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["participant", "trial", "condition", "kind", "side", "level_vpp", "response"])
    for number, name in enumerate(names):
        condition = names[number % 2]
        for trial in range(12):
            answer = "left" if trial > trial % 3 * 2 - 3 else "right"
            level = (60, 95, 130)[trial % 3]
            writer.writerow([name, trial + 1, condition, "single", "left", level, answer])
        writer.writerow([name, 13, condition, "practice", "left", 60, "left"])
    trials = put(folder / "trials.csv", text.getvalue())
    write_analysis([trials], folder / "out", columns=ColumnMap(), figures=figures)
    return (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def least(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    return analyse(loaded(tmp_path_factory.mktemp("least"), LEAST + "1,left,60,left\n"))


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    report(folder, HOSTILE, figures=True)
    return folder / "out"


@pytest.fixture(scope="module")
def page(hostile: Path) -> str:
    return (hostile / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_foreign_names_are_text_in_the_page_and_harmless_in_tables(
    page: str, hostile: Path
) -> None:
    outline = Outline(page)
    assert outline.open == []
    assert not {tag for tag, _ in outline.tags} & {"script", "iframe", "object", "form"}
    assert all("on" not in {name[:2] for name in given} for _, given in outline.tags)
    assert all(name in outline.text for name in HOSTILE)
    assert "\u2068" not in page
    tables = list(hostile.glob("*.csv"))
    assert {path.name for path in tables} >= {"trials_clean.csv", "thresholds.csv", "levels.csv"}
    for path in tables:
        with path.open(encoding="utf-8", newline="") as stream:
            cells = [cell for row in csv.reader(stream) for cell in row if cell]
        assert not [cell for cell in cells if cell[0] in "=+@"], path.name


@pytest.mark.slow
def test_the_page_asks_for_nothing_and_can_be_read_by_everybody(page: str, hostile: Path) -> None:
    pictures = len([*hostile.glob("*.svg")])
    outline = Outline(page)
    keys = ("src", "href", "action", "data")
    asked = [g[k] for tag, g in outline.tags for k in keys if k in g and tag != "a"]
    anchors = {given["id"] for _, given in outline.tags if "id" in given}
    linked = [given["href"] for given in outline.of("a")]
    assert len(linked) >= 6
    assert {*linked} <= {f"#{anchor}" for anchor in anchors}
    assert len(outline.of("img")) == pictures >= 4
    assert len(asked) == pictures + 1  # and an icon, which browsers ask for where there is none
    assert all(one.startswith("data:") for one in asked)
    assert not re.search(r"url\(|@import|https?://", page)
    [policy] = [given["content"] for given in outline.of("meta") if "http-equiv" in given]
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy
    levels = [int(tag[1]) for tag, _ in outline.tags if re.fullmatch("h[1-6]", tag)]
    assert (levels[0], {*levels[1:]}) == (1, {2})
    assert outline.tags[0] == ("html", {"lang": "en"})
    assert all(given["alt"] for given in outline.of("img"))
    assert page.count("<table") == page.count("<caption>") == page.count("<thead")
    assert page.count("<table") == page.count('<div class="scroll">\n<table')
    assert all(given["scope"] in {"col", "row"} for given in outline.of("th"))


@pytest.mark.slow
def test_trials_clean_has_every_trial_and_reads_back(hostile: Path, tmp_path: Path) -> None:
    with (hostile / "trials_clean.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 13 * len(HOSTILE)
    for row in rows:
        practice = row["kind"] == "practice"
        expected = ("false", "practice") if practice else ("true", "n/a")
        assert (row["counted"], row["reason"]) == expected
    write_analysis([hostile / "trials_clean.csv"], tmp_path, columns=ColumnMap(), figures=False)
    for name in ("participants.csv", "levels.csv"):
        here, there = (
            sorted(row.split(",")[-6:] for row in (place / name).read_text("utf-8").splitlines())
            for place in (hostile, tmp_path)
        )
        assert here == there


@pytest.mark.slow
def test_a_rerun_writes_the_same_and_long_tables_are_folded(tmp_path: Path) -> None:
    one, two = (report(tmp_path / place, HOSTILE[:3]) for place in ("one", "two"))
    assert files(tmp_path / "one" / "out") == files(tmp_path / "two" / "out")
    assert one == two
    assert "<img" not in one
    folded = one.count("<summary>")
    many = report(tmp_path / "many", tuple(f"S{n}" for n in range(40)))
    assert many.count("<summary>") > folded


@pytest.mark.slow
@pytest.mark.parametrize(
    ("study", "values"),
    [
        ("", {"design.levels_vpp": ""}),
        ("\n[burst]\nfrequency_hz = 500\n", {"burst.frequency_hz": "500"}),
        ('\n[contact]\ncontrol = "held"\nhow = "<b>20 g"\n', {"design.levels_vpp": ""}),
    ],
)  # fmt: skip # rows of a table
def test_the_report_has_the_numbers_of_the_study_once(
    tmp_path: Path, simulate: Simulate, study: str, values: dict[str, str]
) -> None:
    out = tmp_path / "out"
    write_analysis([simulate(tmp_path / "lab", study)], out, figures=False)
    outline = Outline((out / "report.html").read_text(encoding="utf-8"))
    for key, value in values.items():
        assert len(re.findall(rf"{re.escape(key)}\s*{value}", outline.text)) == 1
    assert re.search(r"Plate\s*25 mm wide, 200 mm long, 0.5 mm thick\s*Material", outline.text)
    assert "Cut-off frequency" in outline.text
    assert ("<b>20 g" in outline.text) == ("<b>20 g" in study)
    methods = (out / "methods.txt").read_text(encoding="utf-8")
    assert ("20 g" in methods) == ("20 g" in study)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["mark"]
    assert f'<p class="mark">{summary["mark"]}' in (out / "report.html").read_text("utf-8")


FELT = {"0": 1, "1": 2, "1.6": 5, "2.5": 11, "4": 18, "6.3": 19}
ODD = {"0": 0, "1": 12, "1.6": 0, "2.5": 20, "4": 4, "6.3": 20}
MAP_SECTIONS: dict[str, Any] = {
    "task": "yes/no",
    "columns": {"condition": "place", "level_vpp": "um", "detected": "felt"},
    "values": {"detected": {"yes": "1", "no": "0"}},
    "constant": {"side": "left"},
    "rows": {"skip": {"part": "practice"}},
    "axis": {"unit": "um"},
}
MAP = ColumnMap(**MAP_SECTIONS)


def made(counts: dict[str, int], *people: str) -> str:
    """Return a lab's table of people with these numbers of yes of 20, two practice rows each."""
    rows = [f"{who},{place},practice,6.3,yes" for who in people for place in ("thumb", "palm")]
    rows += [
        f"{who},{place},test,{level},{'yes' if at < k else 'no'}"
        for who in people
        for place in ("thumb", "palm")
        for level, k in counts.items()
        for at in range(20)
    ]
    return "participant,place,part,um,felt\n" + "\n".join(rows) + "\n"


def of(folder: Path, counts: dict[str, int] = FELT, people: str = "ab") -> Analysis:
    return analyse(loaded(folder, made(counts, *people), MAP))


def test_methods_have_the_numbers_of_design_and_counts_and_cite_in_order(tmp_path: Path) -> None:
    methods = methods_of(of(tmp_path))
    short = numbers(methods.paragraphs[0])
    assert {2, 5, 1, 6.3, 20, 4} <= {*short}  # levels and their ends, trials, rows left out
    values = {*numbers(methods.text())}
    assert {5.0, 0.071, 12, 0.01, 95} <= values  # guess rate, priors, fit
    cited = re.findall(r"\[(\d+)\]", " ".join([*methods.paragraphs, *methods.supplement]))
    assert 120 <= len(" ".join(methods.paragraphs).split()) <= 300
    assert [*dict.fromkeys(map(int, cited))] == [*range(1, len(methods.references) + 1)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("skip", "unread", "files_unread"),
    [
        ({"part": "practice"}, 4, 0),
        ({"participant": "a"}, 242, 0),
        ({"felt": "yes", "part": "practice"}, 228, 0),
        ({"file-": "b"}, 0, 1),
    ],
)
def test_what_a_map_leaves_out_is_counted(
    tmp_path: Path, skip: dict[str, Any], unread: int, files_unread: int
) -> None:
    for who in "ab":
        put(tmp_path / "data" / f"{who}.csv", made(FELT, who))
    columns = ColumnMap(**MAP_SECTIONS | {"rows": {"skip": skip}})
    analysis = write_analysis([tmp_path / "data"], tmp_path / "out", columns=columns, figures=False)
    assert (analysis.counts.unread, analysis.counts.unread_files) == (unread, files_unread)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    (left_out,) = (row["text"] for row in summary["answer"] if row["kind"] == "left_out")
    assert (unread or files_unread) in numbers(left_out)
    assert (unread or files_unread) in numbers(methods_of(analysis).paragraphs[0])


def test_who_broke_off_is_warned_of_and_the_map_is_named(tmp_path: Path) -> None:
    rows = [
        f"{who},{phase},{level},{'yes' if level > 2 or (level, who, n) == (0, 'b', 3) else 'no'}\n"
        for who in "abcde"
        for n in range(6 if who == "c" else 12)
        for phase, level in (("warm", 4), ("main", 0), ("main", 1), ("main", 2.5), ("main", 4))
    ]
    rows_read = {"keep": {"phase": ["warm", "main"]}, "skip": {"phase": "warm"}}
    theirs = {"level_vpp": "um", "detected": "felt"}
    columns = ColumnMap(**MAP_SECTIONS | {"columns": theirs, "rows": rows_read})
    text = "".join(["participant,phase,um,felt\n", *rows, "a,pause,4,no\n"])
    analysis = analyse(loaded(tmp_path, text, columns))
    assert analysis.loaded.left_out_by == "[rows.keep] phase (1) and [rows.skip] phase (54)"
    warning = analysis.warnings[0]
    assert warning.code == WarningCode.FEWER_TRIALS_THAN_OTHERS
    assert numbers(warning.message) == [24, 4, 5, 48]
    assert warning.data["trials"] == {"c": 24}
    assert {12, 6, 55} <= {*numbers(methods_of(analysis).paragraphs[0])}


@pytest.mark.slow
def test_levels_in_db_give_what_their_amplitudes_give(tmp_path: Path) -> None:
    levels_db = {0.0: 1, 4.0: 2, 8.0: 6, 12.0: 12, 16.0: 18, 20.0: 19}
    found = []
    for scale in ("dB", "um"):
        rows = [
            f"{who},{place},{shown if scale == 'dB' else 10 ** (shown / 20)!r},left,{int(at < k)}"
            for who in "abc"
            for place in ("thumb", "palm")
            for shown, k in levels_db.items()
            for at in range(20 - 3 * (place == "palm"))
        ]
        rows += [
            f"{who},{place},n/a,none,{int(at < 1)}"
            for who in "abc"
            for place in ("thumb", "palm")
            for at in range(20)
        ]
        columns = ColumnMap(
            task="yes/no",
            columns={"condition": "place", "level_vpp": "level"},
            axis={"unit": scale, "x_scale": "dB" if scale == "dB" else "log10"},
        )
        text = "participant,place,level,side,detected\n" + "\n".join(rows) + "\n"
        found.append(analyse(loaded(tmp_path, text, columns)))
    in_db, amplitudes = found
    for table in ("thresholds", "differences"):
        some = getattr(in_db, table).filter(regex="_db$|status|lapse|deviance|guess")
        others = getattr(amplitudes, table)[some.columns]
        alike = some.columns.str.startswith("threshold_guess")
        pd.testing.assert_frame_equal(some.loc[:, ~alike], others.loc[:, ~alike], rtol=1e-6)
    for name in ("threshold_vpp", "threshold_low_vpp", "new_high_vpp"):
        as_db = 20 * amplitudes.groups[name].map(math.log10)
        pd.testing.assert_series_equal(in_db.groups[name], as_db, rtol=1e-6)
    sigma = (20 * amplitudes.thresholds["sigma"]).tolist()
    assert in_db.thresholds["sigma"].tolist() == pytest.approx(sigma, rel=1e-6)


@pytest.mark.slow
def test_functions_that_do_not_fit_are_a_warning_with_their_p(tmp_path: Path) -> None:
    analysis = of(tmp_path, ODD, "a")
    assert analysis.thresholds["deviance_p"].tolist() == [0.002, 0.002]
    messages = {one.code: one.message for one in analysis.warnings}
    assert numbers(messages[WarningCode.FUNCTION_MISFIT]) == [2, 2, 0.01, 0.02, 0.002, 0.002]
    assert WarningCode.FUNCTION_MISFIT not in {one.code for one in of(tmp_path).warnings}


FIVE_LEVELS = """
[burst]
window = "hann"
[design]
levels_vpp = [40, 50, 60, 80, 100]
trials_per_side = 40
blank_trials = 60
"""


def words_of(page: str) -> list[str]:
    """Return the words that a reader finds on a page, the folded ones included."""
    text = re.sub("<style>.*?</style>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub("<[^>]+>", " ", text)).split()


@pytest.mark.slow
def test_the_page_of_five_participants_is_short_and_has_title_and_date(
    tmp_path: Path, simulate: Simulate
) -> None:
    folder = simulate(tmp_path / "lab", participants=5, study=PAPER_PLATE + FIVE_LEVELS)
    write_analysis([folder], tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert len(words_of(page)) <= 1800
    headers = [json.loads(path.read_text("utf-8")) for path in folder.rglob("header.json")]
    assert min(header["begun"] for header in headers)[:10] in page[: page.index("<h2")]
    title = page[page.index("<title>") + 7 : page.index("</title>")]
    assert title in page[page.index("<h1>") : page.index("</h1>")]


def test_every_table_of_the_report_has_one_section() -> None:
    shown = [name for section in phrases()["sections"].values() for name in section["tables"]]
    assert sorted(shown) == sorted(read_toml("tables.toml"))


def test_measured_bursts_are_counted_by_condition_channel_and_planned_peak(least: Analysis) -> None:
    same: dict[str, Any] = dict.fromkeys(StimulusMeasured.model_fields)
    same |= {"tap": "output", "unit": "V", "noted": []}
    left = same | {"planned": (30.0, 0.0), "late_s": -1e-4}
    rows = [
        left | {"peaks": (29.0, 0.1), "burst_verified": "output"},
        left | {"peaks": (31.0, 0.1), "burst_verified": "false", "noted": ["late"]},
        left | {"peaks": (None, None), "late_s": None},
        same | {"planned": (0.0, 0.0), "peaks": (0.1, 0.1), "burst_verified": None},
    ]
    trial: dict[str, Any] = dict.fromkeys(field.name for field in fields(MeasuredRow))
    trial |= {"condition": "main"}
    frame = measured_bursts(
        [
            MeasuredRow(**trial | {"measured": StimulusMeasured.model_construct(**row)})
            for row in rows
        ],
        ("left", "right"),
    )
    (table,) = make_tables("measured", frame, least)
    assert [row[1:] for row in table.rows] == [
        ["left", "30 V", "30", "29 to 31", "3", "1", "1", "1", "1", "0.100 ms", "0.100 ms"],
        ["none", "0 V", "", "", "1", "0", "0", "1", "0", "", ""],
    ]


def test_the_meaning_of_every_column_stands_beside_the_tables_once(tmp_path: Path) -> None:
    path = put(tmp_path / "t.csv", made(FELT, "a", "b"))
    write_analysis([path], tmp_path / "out", columns=MAP, figures=False)
    wrote = files(tmp_path / "out")
    meanings = json.loads(wrote["columns.json"])
    for name, content in wrote.items():
        if name.endswith(".csv") and name != "trials_clean.csv":
            columns = content.decode().splitlines()[0].replace("_a,", ",").replace("_b,", ",")
            known = {"participant", "condition", "level", "unit", *meanings}
            known |= {name.removesuffix("_a").removesuffix("_b") for name in meanings}
            assert known >= {*columns.split(",")}, name
    assert meanings["criterion"].encode() not in wrote["summary.json"] + wrote["report.html"]


@pytest.mark.slow
@pytest.mark.parametrize("drawn", [False, True])
def test_the_page_and_methods_txt_have_the_same_text(tmp_path: Path, *, drawn: bool) -> None:
    path = put(tmp_path / "t.csv", made(FELT, "a", "b<i>"))
    write_analysis([path], tmp_path / "out", columns=MAP, figures=drawn)
    wrote = files(tmp_path / "out")
    assert ("detection.svg" in wrote) == drawn
    text = html.unescape(re.sub("<[^>]+>", "", wrote["report.html"].decode()))
    for line in wrote["methods.txt"].decode().splitlines():
        words = line.partition("] ")[2] if re.match(r"\[\d+\]", line) else line
        assert words in text
