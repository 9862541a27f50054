"""What an author pastes into a section of methods, and the warning of functions that do not fit."""

from __future__ import annotations

import html
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd
import pytest

from analysis import ColumnMap, write_analysis
from analysis.axis import Axis
from analysis.groups.criterion import with_criterion
from analysis.reading.load import read_inputs
from analysis.results.answer import answer
from analysis.results.compared import compared, own_model_words
from analysis.results.figures.composed import LOOKS
from analysis.results.methods.caption import LOOK_WORDS, caption_words
from analysis.results.methods.looked import each_participant, looked_words
from analysis.results.methods.misfit import misfits
from analysis.results.methods.paragraphs import methods_of
from analysis.results.methods.presented import order_words
from analysis.results.methods.task import detected_words
from analysis.results.methods.words import plain
from analysis.results.summary import versions
from analysis.results.tables import analyse
from analysis.thresholds.people import Guessing, GuessRate, PersonCounts
from tests.test_analysis.shared import LEAST, SINGLE, felt, files, loaded, put

if TYPE_CHECKING:
    from analysis.results.tables import Analysis

HEAD = "participant,place,part,um,felt\n"
FELT = {"0": 1, "1": 2, "1.6": 5, "2.5": 11, "4": 18, "6.3": 19}
MAP = ColumnMap(
    task="yes/no",
    columns={"condition": "place", "level_vpp": "um", "detected": "felt"},
    values={"detected": {"yes": "1", "no": "0"}},
    constant={"side": "left"},
    rows={"skip": {"part": "practice"}},
    axis={"unit": "um"},
)


def made(counts: dict[str, int], *people: str, n: int = 20) -> str:
    """Return a lab's table of people with these numbers of yes, two practice rows each."""
    rows = [f"{who},{place},practice,6.3,yes" for who in people for place in ("thumb", "palm")]
    rows += [
        f"{who},{place},test,{level},{'yes' if at < k else 'no'}"
        for who in people for place in ("thumb", "palm") for level, k in counts.items()
        for at in range(n)
    ]  # fmt: skip
    return HEAD + "\n".join(rows) + "\n"


def of(tmp_path: Path, counts: dict[str, int] = FELT, people: tuple[str, ...] = ("a", "b"),
       **changes: Any) -> Analysis:  # fmt: skip
    """Return the analysis of that table."""
    return analyse(loaded(tmp_path, made(counts, *people, **changes), MAP))


def ordered(firsts: dict[str, tuple[str | None, ...]]) -> pd.DataFrame:
    """Return differences of people, in whom these conditions of a, b, c came first."""
    pairs = (("a", "b"), ("b", "c"), ("a", "c"))
    rows = [(who, *pair, first) for who, each in firsts.items()
            for pair, first in zip(pairs, each, strict=False)]  # fmt: skip
    return pd.DataFrame(rows, columns=["participant", "condition_a", "condition_b", "first"])


def short_of(folder: Path, missed: dict[str, str]) -> str:
    """Return the short version of one person's methods, who so answers what was not felt."""
    rows = [
        f"1,{side},{level},{side if at < k else answer}\n"
        for side, answer in missed.items() for level, k in ((60, 1), (95, 9), (130, 18))
        for at in range(20)
    ]  # fmt: skip
    folder.mkdir()
    return methods_of(analyse(loaded(folder, LEAST + "".join(rows)))).paragraphs[0]


def test_methods_tell_task_counts_priors_intervals_and_what_is_left_out(tmp_path: Path) -> None:
    told = methods_of(of(tmp_path)).text
    for words in (
        "The task was yes/no",
        "Condition palm had 5 levels (1 to 6.3 um), 20 trials of each for a participant, and 20 ",
        "as if felt in 2 of 40 (5.0 %) in condition palm, in 2 of 40 (5.0 %) in condition thumb.",
        "after a false alarms in a participant's b = 20 blank (catch) trials, with a mean ",
        "gamma the false-alarm rate, lambda the lapse rate, sigma the width",
        "a mean (a + 1/2)/(b + 1) of 0.071; a function that is drawn has the posterior mean of ",
        "The mean difference had a normal prior with mean 0 and a standard deviation of 12 dB",
        "It refused none of 4 functions at p < 0.01",
        "95 % equal-tailed credible intervals, between the 2.5 % and the 97.5 % point",
    ):
        assert words in told, words
    assert "plan" not in told
    assert "left" not in told.replace("left out", "")


def skipped(folder: Path, text: str, columns: ColumnMap, **skip: str | list[str]) -> str:
    """Return answer and short methods of a table, of which a map leaves rows out."""
    folder.mkdir()
    of_rows = replace(columns, rows={"skip": {**columns.rows.get("skip", {}), **skip}})
    analysis = analyse(loaded(folder, text, of_rows))
    return " ".join([answer(analysis).statements[2], methods_of(analysis).paragraphs[0]])


@pytest.mark.slow
def test_what_a_map_leaves_out_is_never_called_nothing(tmp_path: Path) -> None:
    rows = made(FELT, "a", "b")
    counts = "participant,um,k,n\na,1,2,20\na,2,11,20\na,4,19,20\nb,1,3,20\n"
    of_counts = ColumnMap(
        task="yes/no", columns={"level_vpp": "um"}, axis={"unit": "um"},
        table={"detected": "k", "presented": "n"},
    )  # fmt: skip
    none = replace(MAP, rows={})
    for name, text, columns, skip, told in (
        ("practice", rows, MAP, {}, "4 rows"),
        ("person", rows, none, {"participant": "a"}, "242 rows"),
        ("people", made(FELT, "a", "b", "c"), none, {"participant": ["a", "b"]}, "484 rows"),
        ("key", rows, MAP, {"felt": "yes"}, "228 rows"),
        ("one row", rows + "b,palm,demo,1,no\n", none, {"part": "demo"}, "1 row"),
        ("counts", counts, of_counts, {"participant": "b"}, "1 row"),
    ):  # fmt: skip
        words = skipped(tmp_path / name, text, columns, **skip)
        assert "othing was left out" not in words, name
        assert f"he map leaves out {told} more" in words, name
        assert re.search(rf"; {told} of the tables (was|were) left out \[say what was in", words), (
            name
        )
    statuses = {"test": "ok", "practice": "voided"}
    both = replace(
        none,
        columns={**MAP.columns, "status": "part"},
        values={"detected": {"yes": "1", "no": "0"}, "status": statuses},
    )
    words = skipped(tmp_path / "both", rows, both, participant="a")
    assert "voided" not in words
    assert "2 of 242 trials (0.8 %) are left out: presented again 2; 242 rows of the" in words


def unfinished(folder: Path) -> Analysis:
    """Return an analysis of five people, c of whom broke off after half of the trials."""
    rows = [
        f"{who},{phase},{level},{'yes' if level > 2 or (level, who, n) == (0, 'b', 3) else 'no'}\n"
        for who in "abcde"
        for n in range(6 if who == "c" else 12)
        for phase, level in (("warm", 4), ("main", 0), ("main", 1), ("main", 2.5), ("main", 4))
    ]
    data = "".join(["participant,phase,um,felt\n", *rows, "a,pause,4,no\n"])
    return analyse(loaded(folder, data, replace(
        MAP, columns={"level_vpp": "um", "detected": "felt"},
        rows={"keep": {"phase": ["warm", "main"]}, "skip": {"phase": "warm"}},
    )))  # fmt: skip


def test_who_broke_off_and_whose_false_alarms_are_the_most_is_told(tmp_path: Path) -> None:
    analysis = unfinished(tmp_path)
    told = methods_of(analysis)
    assert "(1 to 4 um) with 12 (6 for 1 of 5 participants) trials of each." in told.paragraphs[0]
    assert analysis.left_out_by == "[rows.keep] phase (1) and [rows.skip] phase (54)"
    assert (
        "55 rows of the tables were left out [say what was in them; left out by rows.keep"
        in (told.paragraphs[0])
    )
    assert analysis.warnings == (
        "participant c has 24 trials, 4 of 5 have 48: was a session broken off?",
    )
    of = next(row[2] for row in answer(analysis).rows if row[0] == "False alarms")
    assert plain(of).startswith("1 of 54 blank trials, participant b the most with 1 of 12")


def test_levels_in_db_give_what_their_amplitudes_give(tmp_path: Path) -> None:
    levels_db = {0.0: 1, 4.0: 2, 8.0: 6, 12.0: 12, 16.0: 18, 20.0: 19}
    rows = [
        f"{who},{place},{shown if scale == 'dB' else 10 ** (shown / 20)!r},{scale},{int(at < k)}"
        for scale in ("dB", "um") for who in "abc" for place in ("thumb", "palm")
        for shown, k in levels_db.items() for at in range(20 - 3 * (place == "palm"))
    ]  # fmt: skip
    rows += [f"{who},{place},n/a,{scale},{int(at < 1)}" for scale in ("dB", "um") for who in "abc"
             for place in ("thumb", "palm") for at in range(20)]  # fmt: skip
    found = []
    for unit, x_scale in (("dB", "dB"), ("um", "log10")):
        columns = ColumnMap(
            task="yes/no",
            columns={"condition": "place", "level_vpp": "level", "side": "level"},
            values={
                "side": {"n/a": "none"}
                | {row.split(",")[2]: "left" for row in rows if ",n/a," not in row},
            },
            rows={"keep": {"scale": unit}},
            axis={"unit": unit, "x_scale": x_scale},
        )
        text = "participant,place,level,scale,detected\n" + "\n".join(rows) + "\n"
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
    assert in_db.thresholds["sigma"].tolist() == pytest.approx(
        (20 * amplitudes.thresholds["sigma"]).tolist(), rel=1e-6
    )
    assert " times (" in str(answer(amplitudes))
    told = str(answer(in_db)) + methods_of(in_db).text
    assert " times (" not in told
    assert "Thresholds and their differences are posterior medians" in told
    assert "by a factor e every 3 dB" in told
    widths = re.findall(r"half-width [\d.]+ dB", str(answer(in_db)))
    assert len(widths) == 2
    assert re.findall(r"half-width [\d.]+ dB", str(answer(amplitudes))) == widths


def test_files_that_a_map_leaves_out_are_told_by_number(tmp_path: Path) -> None:
    for who in ("a", "b"):
        put(tmp_path / f"{who}.csv", made(FELT, who))
    whole = replace(MAP, rows={"skip": {"file-": "b"}})
    analysis = analyse(read_inputs([tmp_path], whole))
    assert (analysis.counts.unread, analysis.counts.unread_files) == (0, 1)
    assert "The map leaves out 1 file more." in answer(analysis).statements[2]
    assert "1 file of the tables was left out [say what was" in methods_of(analysis).paragraphs[0]


def test_who_is_cited_is_who_the_citation_file_names() -> None:
    file = Path("CITATION.cff").read_text(encoding="utf-8")
    page = Path("analysis/results/methods/methods.jinja").read_text(encoding="utf-8")
    assert "name: The tactstrip developers" in file
    assert re.findall(r"developers.*?(20\d\d)", page) == 2 * re.findall(r"released: (\d+)-", file)


def test_methods_begin_with_a_short_version_that_stands_alone(tmp_path: Path) -> None:
    methods = methods_of(of(tmp_path))
    short, details, *others = methods.paragraphs
    assert details == methods.DETAILS
    assert len(others) >= 5
    assert "were analysed; 4 rows of the tables were left out [say what was in them" in short
    assert len(re.findall(r"\.(?: |$)", short)) == 11  # sentences
    for words in (
        "In each a participant had 5 levels (1 to 6.3 um) with 20 trials of each.",
        "The task was yes/no: a stimulus was detected where the answer was that it was felt.",
        "The false-alarm rate of each participant was estimated from blank (catch) trials.",
        "fitted to the counts of each participant in each condition by Bayesian inference",
        "The threshold is the level at which this function is half-way between the false-alarm ",
        "95 % equal-tailed credible intervals",
        "their intervals are for the population mean, of people like the participants",
        f"with tactstrip {versions()['tactstrip']} (The tactstrip developers, 2026).",
    ):
        assert words in short, words


@pytest.mark.slow
def test_the_short_version_says_what_was_asked_of_tasks_with_sides(tmp_path: Path) -> None:
    offered = short_of(tmp_path / "none", {"left": "none", "right": "none"})
    assert "whether they felt a stimulus, and at which side: a stimulus was detected" in offered
    assert "was assumed to be small (a Beta(1, 10) prior), for want of blank trials" in offered
    forced = short_of(tmp_path / "forced", {"left": "right", "right": "left"})
    assert "at which side" not in forced
    assert "was that of guessing, for who felt nothing could not say so" in forced


def test_the_test_of_false_alarms_is_in_the_methods_where_the_answer_has_it(tmp_path: Path) -> None:
    same = of(tmp_path)
    assert "exact test" not in methods_of(same).text
    printed = "higher by 3.0 dB (1.0 to 5.0), 1.41 times (1.12 to 1.78)"
    table = same.differences.assign(
        status="ok", difference_db=3.0, low_db=1.0, high_db=5.0, printed=printed
    )
    apart = methods_of(replace(same, differences=table)).text
    assert "by the exact Cochran-Mantel-Haenszel test (two-sided, a stratum for each" in apart
    assert "for want of enough participants on it rests whether they differ" in apart
    assert "p = 1.000 of thumb against palm)" in apart
    assert "estimated within participants by a model of its own and is to be quoted; " in apart


@pytest.mark.slow
def test_simulations_are_told_of_only_in_a_study_like_them(tmp_path: Path) -> None:
    for people, n, like in (("abcdef", 20, True), ("abcdef", 19, False), ("abcde", 20, False)):
        (tmp_path / f"{people}{n}").mkdir()
        short = methods_of(of(tmp_path / f"{people}{n}", people=(*people,), n=n)).paragraphs[0]
        assert "with 95 % credible intervals for the population mean" in short
        assert ("in simulations of 6 and of 12 people with 20 blank" in short) == like


def test_the_interval_by_which_false_alarms_differ_is_in_the_methods(tmp_path: Path) -> None:
    same = of(tmp_path)
    assert "Student's t" not in methods_of(same).text.partition("Detection proportions")[0]
    alarms = {f"false_alarm_difference{end}": value
              for end, value in (("", 0.006), ("_low", -0.035), ("_high", 0.046))}  # fmt: skip
    short, *others = methods_of(
        replace(same, differences=same.differences.assign(**alarms))
    ).paragraphs
    assert "compared by the mean of the participants' differences, with a 95 %" in short
    told = plain(" ".join(others))
    assert (
        "which is of people like the participants: +0.6 percentage points (-3.5 to +4.6) in" in told
    )
    assert "in thumb against palm." in told


@pytest.mark.slow
def test_both_finger_trials_are_told_where_there_are_any(tmp_path: Path) -> None:
    rows = [f"{who},{side},{level},{side if at < k else 'none'}\n"
            for who in "12" for side in ("left", "right")
            for level, k in ((60, 1), (95, 9), (130, 18)) for at in range(20)]  # fmt: skip
    single = methods_of(analyse(loaded(tmp_path, LEAST + "".join(rows))))
    assert "both-finger" not in single.text
    rows += ["1,both,95,both\n"] * 7 + ["1,none,n/a,none\n", "2,none,n/a,none\n"] * 4
    some = methods_of(analyse(loaded(tmp_path, LEAST + "".join(rows))))
    assert "all 255 trials count; 7 both-finger trials enter no threshold." in some.paragraphs[0]
    assert (
        "40 trials of each for a participant, 4 blank (catch) trials, and 0 to 7 both-finger "
        in some.text
    )
    assert "both-finger trials (at 95 V), which enter no threshold." in some.text
    assert "trials enter no threshold" not in " ".join(some.paragraphs[1:])  # said above them


def test_trials_without_an_answer_are_counted_in_words(tmp_path: Path) -> None:
    same = of(tmp_path, people=("a",))
    for late, invalid, words in (
        (1, 0, "The 1 trial without an answer in time counts as not felt."),
        (3, 0, "The 3 trials without an answer in time count as not felt."),
        (1, 2, "The 1 trial without an answer in time and 2 with another key count as not felt."),
    ):
        counts = replace(same.counts, timeouts=late, invalid=invalid)
        told = replace(same, counts=counts)
        assert detected_words(told).endswith(words)
        assert words in methods_of(told).paragraphs[0]


def test_with_which_condition_participants_began_is_told_where_it_is_known(tmp_path: Path) -> None:
    same = of(tmp_path)
    assert "began with" not in methods_of(same).text
    assert not order_words(replace(same, differences=ordered({"1": (None,)})))
    turns, one, other, none = ("interleaved",), ("a",), ("b",), (None,)
    how = "[say how]"
    for words, firsts in (
        ("1 participant began with condition a, 2 with b.", (one, other, other)),
        ("1 participant began with condition a.", (("a", None, "a"),)),
        (f"In 2 participants the conditions were interleaved {how}.", (turns, turns)),
        (f"In 1 participant blocks of the conditions alternated {how}.", (("alternated",),)),
        (f"1 participant began with condition b, in 2 the conditions were interleaved {how}.",
         (turns, other, turns)),
        ("1 participant began with condition b, of 1 the order is not known.", (other, none)),
    ):  # fmt: skip
        rows = ordered({str(at): first for at, first in enumerate(firsts)})
        assert plain(order_words(replace(same, differences=rows))) == words


@pytest.mark.slow
def test_intervals_of_thresholds_may_overlap_is_told_within_participants(tmp_path: Path) -> None:
    words = "intervals of two thresholds may overlap although the interval of their difference"
    assert words in methods_of(of(tmp_path)).text
    head, *rows = made(FELT, "a", "b").splitlines(keepends=True)
    apart = [row for row in rows if row.startswith(("a,palm", "b,thumb"))]
    assert words not in methods_of(analyse(loaded(tmp_path, head + "".join(apart), MAP))).text


def test_a_caption_tells_the_signs_that_the_figure_has(tmp_path: Path) -> None:
    assert len(LOOK_WORDS) == len(LOOKS)
    group = of(tmp_path)
    told = plain(caption_words(group))
    for words in (
        "Detection probability by level (um) of 2 participants in conditions palm (circles, solid ",
        "line) and thumb (squares, dashed line), side by side at each level. Open symbols are ",
        "means of the participants with 95 % credible intervals for the population mean (bars; ",
        "small symbols are single participants",
        "pointwise 95 % credible bands",
        "at the left edge are mean false-alarm rates as counted (the share of blank (catch) ",
        "trials answered as felt); the functions start at their posterior means and end below 1",
        "with 95 % credible intervals (thick bars",
        "thinner, where another participant's is expected (95 %); at the foot, the means less",
    ):
        assert words in told, words
    assert len(re.findall(r"\.(?: |$)", told)) == 3  # sentences
    none = group.thresholds.assign(guess_basis="assumed", status="flat")
    groups = group.groups.assign(status="flat", threshold_vpp=math.nan)
    told = caption_words(replace(group, thresholds=none, groups=groups))
    for absent in ("left edge", "bands", "at the foot", "arrows"):
        assert absent not in told, absent


@pytest.mark.slow
def test_the_caption_of_one_participant_speaks_of_proportions(tmp_path: Path) -> None:
    one = of(tmp_path, people=("a",))
    told = caption_words(one)
    assert " of 1 participant in conditions " in told
    assert "Open symbols are proportions with 95 % Wilson intervals (bars); lines are the " in told
    assert "false-alarm rates with 95 % intervals" in told
    assert "at the foot, deviance residuals" in told
    for absent in ("group", "small symbols", "mean", "arrows"):
        assert absent not in told.replace("at their posterior means", ""), absent
    cut = one.thresholds.assign(threshold_high_vpp=math.nan)
    assert "(thick bars; arrows: open ends)" in caption_words(replace(one, thresholds=cut))


def test_the_ratio_of_thresholds_is_told_where_it_is_not_that_of_the_difference(
    tmp_path: Path,
) -> None:
    same = of(tmp_path)
    printed = "higher by 3.0 dB (1.0 to 5.0), 1.41 times (1.12 to 1.78)"
    table = same.differences.assign(
        status="ok", difference_db=3.0, low_db=1.0, high_db=5.0, printed=printed
    )
    for threshold_vpp, other in ((2.0, False), (1.3, True)):  # 3 dB are 1.41 times
        found = {"palm": 2.0 / 1.41, "thumb": threshold_vpp}
        groups = same.groups.assign(threshold_vpp=same.groups["condition"].map(found))
        analysis = replace(same, differences=table, groups=groups)
        told = " ".join(compared(analysis))
        assert ("a model of its own and is to be quoted; the ratio" in told) is other
        assert ("thresholds, here 0.92" in told) is other
        assert (", here" in own_model_words(analysis)) is other


def test_what_is_not_looked_for_stands_in_a_table_of_each_participant() -> None:
    rows = [
        SINGLE | {"participant": who, "side": side, "response": said, "rt_s": t,
                  "kind": "blank" if side == "none" else "single"}
        for who, side, said, t in (
            ("10", "left", "left", 0.5), ("10", "right", "left", 0.9), ("10", "none", "right", 0.7),
            ("9", "right", "right", 0.25), ("9", "right", "right", 0.5), ("9", "none", "none", 1.0),
            ("9", "left", "timeout", math.nan),
        )
    ]  # fmt: skip
    both = SimpleNamespace(
        trials=pd.DataFrame(rows), one_side="", detected_any=pd.DataFrame(),
        counts=SimpleNamespace(conditions=1),
    )  # fmt: skip
    heads, cells = each_participant(cast("Analysis", both))
    assert heads[2:5] == ["False alarms", "The other side", "Said left : right"]
    assert cells == [
        ["9", "4", "0 of 1", "0 of 3", "0 : 2", "1", "0.375"],
        ["10", "3", "1 of 1", "1 of 2", "2 : 1", "0", "0.500"],
    ]


@pytest.mark.slow
def test_what_was_looked_for_is_told_and_whom_it_names(tmp_path: Path) -> None:
    analysis = of(tmp_path)  # whose rows begin with every yes
    told = plain(looked_words(analysis))
    drifts = "a threshold that drifts within a session (p < 0.001 and at least 3 dB)"
    assert f"Found: {drifts} (a, b)." in told
    told = looked_words(replace(analysis, doubts=()))
    assert told.startswith("Looked for in each of 2 participants: answers no better than guessing")
    assert "sides" not in told  # there is one place only
    assert "None of these was found. Not looked for: many false alarms, the same data" in told
    odd = {"0": 0, "1": 12, "1.6": 0, "2.5": 20, "4": 4, "6.3": 20}
    named = plain(looked_words(of(tmp_path, odd, ("a",))))
    assert named.startswith("Looked for in the one participant: ")
    assert " a function that does not fit (p < 0.01) (a)." in named.partition("Found:")[2]


def test_every_reference_of_the_methods_is_cited_in_their_order(tmp_path: Path) -> None:
    methods = methods_of(of(tmp_path))
    cited = re.findall(r"\[(\d+)\]", " ".join(methods.paragraphs))
    assert [*dict.fromkeys(map(int, cited))] == [*range(1, len(methods.references) + 1)]


@pytest.mark.slow
@pytest.mark.parametrize("drawn", [False, True])
def test_the_page_and_methods_txt_have_the_same_text(tmp_path: Path, *, drawn: bool) -> None:
    path = put(tmp_path / "t.csv", made(FELT, "a", "b<i>"))
    write_analysis([path], tmp_path / "out", columns=MAP, figures=drawn)
    wrote = files(tmp_path / "out")
    assert (b"\nCaption of detection.svg, to paste\n" in wrote["methods.txt"]) == drawn
    assert ("detection.svg" in wrote) == drawn
    page = html.unescape(re.sub("<[^>]+>", "", wrote["report.html"].decode()))
    for line in wrote["methods.txt"].decode().splitlines():
        words = line.partition("] ")[2] if re.match(r"\[\d+\]", line) else line
        assert words in page


def test_functions_that_do_not_fit_are_a_warning_with_what_chance_gives(tmp_path: Path) -> None:
    odd = {"0": 0, "1": 12, "1.6": 0, "2.5": 20, "4": 4, "6.3": 20}
    analysis = of(tmp_path, odd, ("a",))
    assert analysis.thresholds["deviance_p"].tolist() == [0.002, 0.002]
    (told,) = [one for one in analysis.warnings if "do not fit" in one]
    assert told.startswith(
        "2 of 2 psychometric functions do not fit (bootstrap p < 0.01; 0.02 expected by chance): "
        "participant a in condition palm, p <= 0.002; participant a in condition thumb, "
        "p <= 0.002; "
        "0.002 is the least that 499 tables can show. "
    )
    assert "It refused 2 of 2 functions at p < 0.01" in methods_of(analysis).text


def test_of_many_functions_that_do_not_fit_the_worst_are_named() -> None:
    rows = [(str(at), 0.002 + at / 10_000) for at in range(9)]
    table = pd.DataFrame(rows, columns=["participant", "deviance_p"]).assign(condition="main")
    (told,) = misfits(table)
    assert "participant 5, p = 0.003; and 3 more; 0.002 is the least that" in told
    assert not [*misfits(table.assign(deviance_p=0.01))]


def test_a_misfit_is_said_to_be_where_counts_and_function_lie_furthest_apart() -> None:
    guess = Guessing(rate=GuessRate(mean=0.2), basis="blanks")
    people = PersonCounts(
        names=(("main", "1"),), level_vpp=np.array([[0.0, 20.0, 40.0]]),
        detected=np.array([[0.0, 9.0, 20.0]]), presented=np.full((1, 3), 20.0), guesses=(guess,),
    )  # fmt: skip
    row = {"participant": "1", "condition": "main", "deviance_p": 0.002, "guess_rate": 0.2,
           "mle_threshold_vpp": 20.0, "mle_sigma": 4.0, "mle_lapse_rate": 0.0,
           "guess_basis": "blanks"}  # fmt: skip
    (told,) = misfits(pd.DataFrame([row]), people, Axis(x_scale="dB", unit="dB"))
    # 20 (0.2 + 0.8 Phi(-5)) = 4.0, and of the middle 20 (0.2 + 0.8 / 2) = 12, as near as z = 1.4
    counts = "at 0 dB detected in 0 of 20 trials, expected in 4.0."
    assert f"with the guess rate that blank trials tell: {counts}" in told
    row |= {"guess_basis": "forced choice", "mle_sigma": 1e-3}  # a step: 0/0 at the highest level
    (told,) = misfits(pd.DataFrame([row]), people, Axis(x_scale="dB", unit="dB"))
    assert f"with the guess rate of guessing: {counts}" in told


def test_an_order_that_tables_do_not_number_is_not_told() -> None:
    parts = [felt([9, 18], [60.0, 95.0], condition=name, session="01", block=1) for name in "ab"]
    trials = pd.concat(parts, ignore_index=True)
    trials["trial"] = range(1, len(trials) + 1)
    pair = pd.DataFrame([{"condition_a": "a", "condition_b": "b", "participant": "1"}])
    none = pd.DataFrame(columns=["condition", "participant", "level_vpp", "felt", "presented",
                                 "false_alarms", "blanks", "d_prime"])  # fmt: skip
    told = [with_criterion(pair, trials, none, numbered=one)["first"][0] for one in (True, False)]
    assert told == ["a", None]


def test_a_misfit_that_residuals_do_not_show_is_told_as_one_of_the_guess_rate() -> None:
    rows = [("1", 0.3, 0.03, 0.2), ("2", 0.004, 0.031, 0.147), ("3", 0.002, 0.03, 0.04)]
    names = ["participant", "deviance_p", "guess_rate", "guess_posterior"]
    (told,) = misfits(pd.DataFrame(rows, columns=names).assign(condition="main"))
    assert told.count("the test holds the guess rate at") == 1
    assert (
        "Of participant 2 the test holds the guess rate at 3.1 %, as blank trials tell it; the "
        "function drawn starts at 14.7 %, by the weak levels too" in told
    )
