"""The report: complete, self-contained, with every foreign text as text."""

from __future__ import annotations

import csv
import io
import re
from html import escape, unescape
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

from analysis import ColumnMap, ResultFileError, write_analysis
from analysis.results.figures.figures import Picture
from analysis.results.files import NAMES
from analysis.results.report import report_html
from analysis.results.tables import analyse
from tests.test_analysis.shared import LEAST, files, loaded, put

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Simulate

HOSTILE = (
    *("=1+1", "<script>alert(1)</script>", "</style><script>alert(1)</script>"),
    *('"><img src=x onerror=alert(1)>', "' onmouseover='alert(1)", "&lt;b&gt;"),
    *("+7 dB", "@SUM(A1)", "אבגד", "W" * 64),
)
FOLDED = ("Files that were read", "Versions")
HEADER = "participant,trial,condition,kind,side,level_vpp,response,simulated"
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


def report(
    folder: Path,
    names: tuple[str, ...] = ("S1",),
    *,
    simulated: bool = False,
    figures: bool = False,
) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER.split(","))
    told = "true" if simulated else "false"
    for number, name in enumerate(names):
        condition = names[number % 2]
        for trial in range(12):
            answer = "left" if trial > trial % 3 * 2 - 3 else "right"
            level = (60, 95, 130)[trial % 3]
            writer.writerow([name, trial + 1, condition, "single", "left", level, answer, told])
        writer.writerow([name, 13, condition, "practice", "left", 60, "left", told])
    trials = put(folder / "trials.csv", text.getvalue())
    write_analysis([trials], folder / "out", columns=ColumnMap(), figures=figures)
    return (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    report(folder, HOSTILE, figures=True)
    return folder / "out"


@pytest.fixture(scope="module")
def html(hostile: Path) -> str:
    return (hostile / "report.html").read_text(encoding="utf-8")


def test_foreign_names_are_text_and_nothing_else(html: str) -> None:
    outline = Outline(html)
    assert outline.open == []
    assert not {tag for tag, _ in outline.tags} & {"script", "iframe", "a", "object", "form"}
    assert all("on" not in {name[:2] for name in given} for _, given in outline.tags)
    assert all(name in outline.text for name in HOSTILE)


@pytest.mark.slow
def test_names_in_the_sentences_of_the_answer_are_text_too(tmp_path: Path) -> None:
    told = report(tmp_path, HOSTILE[1:3])
    assert f"condition <bdi>{escape(HOSTILE[1])}</bdi> the threshold of" in told
    assert "\u2068" not in told
    assert not {tag for tag, _ in Outline(told).tags} & {"script"}


def test_the_page_asks_for_nothing_and_may_not(html: str, hostile: Path) -> None:
    pictures = len([*hostile.glob("*.svg")])
    outline = Outline(html)
    loaded = [g[k] for _, g in outline.tags for k in ("src", "href", "action", "data") if k in g]
    assert len(outline.of("img")) == pictures >= 4
    assert len(loaded) == pictures + 1  # and an icon, which browsers ask for where there is none
    assert all(one.startswith("data:") for one in loaded)
    assert not re.search(r"url\(|@import|https?://", html)
    [policy] = [given["content"] for given in outline.of("meta") if "http-equiv" in given]
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy


def test_headings_are_in_order_and_everything_has_words(html: str) -> None:
    outline = Outline(html)
    levels = [int(tag[1]) for tag, _ in outline.tags if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert set(levels[1:]) == {2}
    assert outline.tags[0] == ("html", {"lang": "en"})
    assert all(given["alt"] for given in outline.of("img"))
    assert html.count("<table") == html.count("<caption>") == html.count("<thead")
    assert all(given["scope"] in {"col", "row"} for given in outline.of("th"))
    assert "<title>" in html


def test_foreign_names_are_harmless_in_every_csv_file(hostile: Path) -> None:
    tables = list(hostile.glob("*.csv"))
    assert {path.name for path in tables} >= {"trials_clean.csv", "thresholds.csv", "levels.csv"}
    for path in tables:
        with path.open(encoding="utf-8", newline="") as stream:
            for cell in (cell for row in csv.reader(stream) for cell in row):
                assert cell[:1] not in "=+@" or cell == "", (path.name, cell)


@pytest.mark.parametrize("mark", ["\t", "\x1b", "\x00", "\u2028", "\ue000"])
def test_control_characters_are_refused_in_names(tmp_path: Path, mark: str) -> None:
    with pytest.raises(ResultFileError) as refused:
        report(tmp_path, (f"S{mark}1",))
    assert str(refused.value).isprintable()
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("mark", ["\u202e", "\u200f", "\u2066", "\u200b"])
def test_marks_that_show_no_sign_are_spelled_out_in_every_file(tmp_path: Path, mark: str) -> None:
    report(tmp_path, (f"S{mark}1", "S1"), figures=True)
    made = files(tmp_path / "out")
    assert all(name.endswith(".png") or mark.encode() not in made[name] for name in made)
    assert f"S<U+{ord(mark):04X}>1," in made["participants.csv"].decode()


@pytest.mark.slow
def test_trials_clean_reads_back_to_the_same_numbers(hostile: Path, tmp_path: Path) -> None:
    write_analysis([hostile / "trials_clean.csv"], tmp_path, columns=ColumnMap(), figures=False)
    for name in ("participants.csv", "levels.csv"):
        here, there = (
            sorted(row.split(",")[-6:] for row in (place / name).read_text("utf-8").splitlines())
            for place in (hostile, tmp_path)
        )
        assert here == there


def test_trials_clean_has_every_trial_with_its_reason(hostile: Path) -> None:
    with (hostile / "trials_clean.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 13 * len(HOSTILE)
    for row in rows:
        left_out = row["kind"] == "practice"
        assert row["counted"] == ("false" if left_out else "true")
        assert row["reason"] == ("practice" if left_out else "n/a")


@pytest.mark.slow
def test_the_report_says_what_was_counted_and_left_out(tmp_path: Path) -> None:
    told = re.sub(r"\s*\n", "", Outline(report(tmp_path, ("S1", "S2"))).text)
    counted = "26 trials of 2 participants in 2 sessions, 2 conditions"
    left_out = ("S111", "S211", "all22", "Left out2", "All that were read26")
    for words in (counted, *left_out, "status is ok", "trials.csv", "numpy"):
        assert words in told


@pytest.mark.slow
@pytest.mark.parametrize(("simulated", "marks"), [(True, 1), (False, 0)])
def test_simulated_participants_are_marked(tmp_path: Path, *, simulated: bool, marks: int) -> None:
    text = report(tmp_path, simulated=simulated)
    assert text.count('<p class="mark">Simulated participants.</p>') == marks


@pytest.mark.slow
def test_a_report_without_figures_has_its_tables_and_is_the_same_on_a_rerun(tmp_path: Path) -> None:
    one, two = (report(tmp_path / place, HOSTILE[:3]) for place in ("one", "two"))
    assert files(tmp_path / "one" / "out") == files(tmp_path / "two" / "out")
    assert set(files(tmp_path / "one" / "out")) < set(NAMES)
    assert one == two
    assert "<img" not in one
    assert "Detection by level" in one


def test_every_table_stands_in_a_box_that_can_be_scrolled(html: str) -> None:
    tables = [*re.finditer("<table", html)]
    assert all(html[: one.start()].endswith('<div class="scroll">\n') for one in tables)


@pytest.mark.slow
def test_long_tables_are_folded_and_short_ones_are_not(tmp_path: Path) -> None:
    told = report(tmp_path / "few", ("S1", "S2"))
    folded = re.findall("<summary>(.*?)</summary>", told)
    assert folded == ["What the numbers mean", *(f"<bdi>{one}</bdi>" for one in FOLDED)]
    told = report(tmp_path / "many", tuple(f"S{n}" for n in range(40)))
    folded = re.findall("<summary>(.*?)</summary>", told)
    assert "<bdi>Thresholds of participants, condition S0</bdi> (20 rows)" in folded


@pytest.mark.slow
def test_the_report_says_whose_the_plates_numbers_are(tmp_path: Path, simulate: Simulate) -> None:
    by = '\n[strip]\nmeasured_cutoff_hz = 2500\nmeasured_by = "<i>A. Person"\n'
    write_analysis(
        [simulate(tmp_path / "lab", by, participants=2)], tmp_path / "out", figures=False
    )
    told = Outline((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
    assert told.count("strip.measured_cutoff_hz") == 1
    assert "measured (by: <i>A. Person; on: not stated)" in told
    assert "measured by the paper" not in told
    write_analysis([simulate(tmp_path / "paper")], tmp_path / "out-paper", figures=False)
    told = Outline((tmp_path / "out-paper" / "report.html").read_text(encoding="utf-8")).text
    assert "measured by the paper (figure 4)" in told
    assert "plan and simulated people have 0.01 (assumed), the check tries 0.005 and 0.02" in told
    for key in ("strip.edge_loss", "burst.frequency_hz", "design.levels_vpp", "level_db.main.left"):
        assert told.count(key) == 1
    clamped = [simulate(tmp_path / "clamped", '\n[strip]\nedge = "clamped"\n')]
    write_analysis(clamped, tmp_path / "out-clamped", figures=False)
    told = Outline((tmp_path / "out-clamped" / "report.html").read_text(encoding="utf-8")).text
    assert "computed from clamped edges" in told
    assert "by its value" not in told


@pytest.mark.slow
def test_a_number_that_the_file_states_is_told_as_the_studys(
    tmp_path: Path, simulate: Simulate
) -> None:
    again = "\n[burst]\nfrequency_hz = 500\n"
    write_analysis([simulate(tmp_path / "lab", again)], tmp_path / "out", figures=False)
    told = Outline((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
    assert re.search(r"burst.frequency_hz\s*500\s*yours", told)
    assert re.search(r"burst.cycles\s*1\s*the paper's", told)


@pytest.mark.slow
def test_the_report_says_how_the_fingers_lay_on_the_plate(
    tmp_path: Path, simulate: Simulate
) -> None:
    contact = '\n[contact]\ncontrol = "held"\nhow = "<b>20 g on the nail"\n'
    write_analysis([simulate(tmp_path / "lab", contact, participants=2)], tmp_path / "out",
                   figures=False)  # fmt: skip
    told = Outline((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
    pasted = " ".join(told.partition("Methods, to paste")[2].split())
    for words in (
        "67 GPa",
        "cut-off frequency (2900 Hz, measured by the paper",
        "log-normal with a median of 2 dB (0.1 log10 units)",
        "by a factor e every 3 dB",
        "The prior of lambda was Beta(1, 10), cut off at 0.1",
        "half-normal prior with a scale of 6 dB",
        "Skellam",
    ):
        assert words in pasted
    assert "in simulations of five and of six people" in told
    protocol, _, to_paste = told.partition("Methods, to paste")
    assert protocol.count("held: <b>20 g on the nail") == 1
    assert to_paste.count("held: <b>20 g on the nail") == 1
    heading = "Force and contact of the fingers"
    assert heading not in Outline(report(tmp_path)).text


@pytest.mark.slow
def test_a_report_of_tables_without_plans_says_that_no_plate_is_known(tmp_path: Path) -> None:
    told = report(tmp_path)
    assert "The tables do not tell of apparatus and stimuli." in told
    assert "plan" not in told.partition("How it was measured")[2].partition("Definitions")[0]
    # Of one participant there is no group, nor what its intervals rest on.
    assert "effective" not in told.partition("Methods, to paste")[2]
    assert "Franco" not in told


@pytest.mark.slow
def test_pages_of_many_people_come_after_what_is_told_of_all(tmp_path: Path) -> None:
    trials = LEAST + "1,left,60,left\n1,left,90,left\n"
    analysis = analyse(loaded(tmp_path, trials))

    def page(sheets: int) -> str:
        names = ["detection", *["participants"] * sheets, "thresholds"]
        drawn = [
            Picture(figure=name, name=name, title=f"{name} drawn", caption="", alt="", png=b"",
                    svg=b"")
            for name in names
        ]  # fmt: skip
        return report_html(analysis, drawn)

    for sheets in (1, 3):
        told = page(sheets)
        assert told.count("participants drawn") == sheets
        tables = told.index("<h2>Detection by level</h2>")
        assert told.index("thresholds drawn") < tables
        assert (told.index("participants drawn") > tables) == (sheets > 1)


@pytest.mark.slow
def test_numbers_that_look_alike_are_told_apart_where_they_stand(tmp_path: Path) -> None:
    """Of yes/no with sides and enough blank trials: guess rate, false alarms, their intervals."""
    felt = {60: 1, 95: 9, 130: 11}
    rows = [
        f"{who},{side},{level},{side if at < k else 'none'}\n"
        for who in "ab" for side in ("left", "right") for level, k in felt.items()
        for at in range(12)
    ]  # fmt: skip
    rows += [f"{who},none,0,{'left' if at < 3 else 'none'}\n" for who in "ab" for at in range(24)]
    analysis = analyse(loaded(tmp_path, LEAST + "".join(rows)))
    page = report_html(analysis, ())
    assert "The guess rate is no false-alarm rate." in page
    assert "If guess rate" not in page
    assert 'To quote: the share of all with the interval under "Group, 95 %"' in unescape(page)
    assert "Looked for in each of 2 participants: sides swapped (p" in unescape(page)
    few = analyse(loaded(tmp_path, LEAST + "".join(rows[:-10])))
    assert "If guess rate 0" in report_html(few, ())
