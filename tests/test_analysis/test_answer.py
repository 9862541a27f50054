"""The answer: every sentence of it is true of the tables, and says no more than they have."""

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
from scipy.stats import fisher_exact

from analysis import ColumnMap, group_interval, print_analysis, write_analysis
from analysis.answers.doubts import Doubt
from analysis.axis import VOLTS, Axis, bounded, times, with_limits
from analysis.definitions import TOTAL
from analysis.groups.criterion import BESIDE_COLUMNS, rates_apart, same_rates_p
from analysis.groups.sensitivity import BY_LEVEL_COLUMNS
from analysis.groups.tables import DIFFERENCE_COLUMNS, GROUP_COLUMNS
from analysis.results.answer import Answer, answer
from analysis.results.compared import pairs_of
from analysis.results.files import harmless
from analysis.results.methods.left_out import REASONS
from analysis.results.methods.words import plain
from analysis.results.rows import PAGE, blank_cells, forced_choice
from analysis.results.tables import Analysis, analyse
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD
from analysis.thresholds.table import THRESHOLD_COLUMNS, WORDS
from tests.test_analysis.shared import LEAST, files, loaded, put

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

LEVELS = [60.0, 95.0, 130.0, 200.0]
SILENT = LEAST.replace("participant", "participant,condition") + "".join(
    f"{who},{where},left,{level},{answer if where == 'felt' else 'timeout'}\n"
    f"{who},{where},none,0,{'none' if where == 'felt' else 'timeout'}\n"
    for who in "ab"
    for where in ("dead", "felt", "mute")
    for level, answer in ((60, "none"), (95, "left"), (130, "none"), (200, "left"))
)
"""Two people who answer in one condition of three."""
LOST_BLANKS = LEAST + "".join(
    (
        *(f"1,left,{level},{word}\n" for level in (60, 200) for word in ("none", "left")),
        "2,left,60,timeout\n2,none,0,timeout\n",
    )
)
"""Of two people the one who got a blank trial never answered."""
NUMBER = r"[-+]?\d+(?:\.\d+)?"
END = rf"(?:(?:below|above) )?{NUMBER}"
TEST = (
    r"(?:least )?p (?:=|<) [01]\.\d\d\d, (?:exact Cochran-Mantel-Haenszel test within these "
    r"participants|Fisher's exact test of the totals)"
)
BASIS = (
    rf"\((?:{TEST}|95 % intervals in the table(?:; {TEST})?|"
    rf"{NUMBER} points in \S+ against \S+, 95 % interval {NUMBER} to {NUMBER} by Student's t)\)"
)
FUNCTIONS = r"functions?(?: with a threshold)?"
PUSH = (
    r"they were (?:more frequent in \S+, where the threshold is higher, and a laxer criterion "
    r"there would hide part of the difference rather than cause it|rarer in \S+, where the "
    r"threshold is higher, and a stricter criterion there may bring the difference about in "
    r"(?:whole or in )?part)"
)


def close(told: str, value: float) -> bool:
    """Tell whether a number was rounded to the decimals that stand there."""
    decimals = len(told.partition(".")[2])
    return abs(float(told) - value) <= 0.5 * 10.0**-decimals + 1e-9


def is_end(told: str, limit: float, open_word: str, level: float) -> bool:
    """Tell whether an end is the limit, or is told as open at the outermost level."""
    if math.isnan(limit):
        return told == f"{open_word} {level:g}"
    return close(told, limit)


def check_width(told: str, low: float, high: float, axis: Axis = VOLTS) -> None:
    """Check what is told to be half of how far limits lie apart."""
    half = re.fullmatch(rf"half-width ({NUMBER}) dB", told)
    assert half
    assert close(half[1], (high - low) / 2 if axis.signed else 10 * math.log10(high / low))


def check_value(said: str, row: pd.Series[Any], *, axis: Axis | None) -> None:
    """Check what is said of a threshold against its row."""
    status = row["status"]
    at, low, high = (row[f"threshold_{name}vpp"] for name in ("", "low_", "high_"))
    value = re.fullmatch(
        rf"is ({NUMBER}) \S+ \(posterior median, 95 % interval ({END}) to ({END})"
        r"(?:, ([^)]+ dB))?\)(, slope unknown)?",
        said,
    )
    assert bool(value) == (status in WITH_THRESHOLD), said
    if value:
        assert close(value[1], at)
        assert is_end(value[2], low, "below", LEVELS[0])
        assert is_end(value[3], high, "above", LEVELS[-1])
        assert bool(value[5]) == (status == "separated")
        assert bool(value[4]) == (axis is not None and not math.isnan(low + high))
        if value[4] and axis:
            check_width(value[4], low, high, axis)
    elif found := re.fullmatch(rf"is at (most|least) ({NUMBER}) \S+ \(end of the 95 % .*", said):
        limit, other = (high, low) if found[1] == "most" else (low, high)
        assert status in BOUNDED
        assert close(found[2], limit)
        assert math.isnan(other)
        assert LEVELS[0] <= float(found[2]) <= LEVELS[-1]
    elif found := re.fullmatch(rf"is (below|above) the \S+ level, ({NUMBER}) \S+ \(97.5 .*", said):
        assert status in BOUNDED
        below = found[1] == "below"
        assert float(found[2]) == (LEVELS[0] if below else LEVELS[-1])
        assert high <= LEVELS[0] if below else low >= LEVELS[-1]
    elif said == "is not bounded by these levels":
        assert math.isnan(low)
        assert math.isnan(high)
    else:
        assert said == f"cannot be told: {WORDS[status].removeprefix('no threshold: ')}"
        assert math.isnan(at)


def threshold(found: re.Match[str], analysis: Analysis) -> None:
    groups = analysis.groups
    condition = found["condition"] or groups["condition"].iloc[0]
    assert bool(found["condition"]) == (analysis.counts.conditions > 1)
    [(_, group)] = groups[groups["condition"].eq(condition)].iterrows()
    alone = group["participants"] == 1
    people = analysis.thresholds[analysis.thresholds["condition"].eq(condition)]
    assert bool(found["session"]) == alone
    check_value(
        found["said"],
        people.iloc[0] if alone else group,
        axis=None if alone or not analysis.axis.is_logarithmic else analysis.axis,
    )
    if found["who"]:
        share = analysis.counts.simulated / analysis.counts.trials
        kind = "simulated " if share == 1 else "simulated or real " if share else ""
        others = analysis.thresholds.loc[
            analysis.thresholds["condition"].lt(condition), "participant"
        ]
        which = "the" if others.empty or {*others} & {*people["participant"]} else "another"
        of_all = f"{which} group of {group['participants']} {kind}participants"
        name = people["participant"].iloc[0]
        assert found["who"] == (f"{kind}participant {name}" if alone else of_all)


def pair_of(found: re.Match[str], analysis: Analysis) -> tuple[pd.Series[Any], pd.DataFrame]:
    table = analysis.differences
    rows = table[table["condition_a"].eq(found["a"]) & table["condition_b"].eq(found["b"])]
    people = rows[rows["participant"].ne("all")]
    group = rows[rows["participant"].eq("all")].iloc[0]
    of = f"{len(people)} participant{'s' * (len(people) != 1)} in both"
    if group["status"] == "one_participant" and len(people) == 1:
        group = people.iloc[0]
        of = f"participant {group['participant']} only, in these sessions"
    elif people.empty:
        of = "different participants in each"
    if "of" in found.groupdict():
        assert found["of"] == of
    return group, people


def apart(found: re.Match[str], analysis: Analysis) -> None:
    row, _ = pair_of(found, analysis)
    assert row["status"] == "ok"
    sign = 1 if found["more"] == "higher" else -1
    assert close(found["at"], sign * row["difference_db"])
    for name, of in (("times", "difference"), ("least", "low"), ("most", "high")):
        assert bool(found[name]) is not analysis.axis.signed
        assert analysis.axis.signed or close(found[name], 10 ** (row[f"{of}_db"] / 20))
    assert close(found["low"], row["low_db"])
    assert close(found["high"], row["high_db"])
    assert min(sign * float(found["low"]), sign * float(found["high"])) > 0


def together(found: re.Match[str], analysis: Analysis) -> None:
    row, _ = pair_of(found, analysis)
    assert row["status"] == "ok"
    assert close(found["low"], row["low_db"])
    assert close(found["high"], row["high_db"])
    assert float(found["low"]) <= 0 <= float(found["high"])


def half_open(found: re.Match[str], analysis: Analysis) -> None:
    row, _ = pair_of(found, analysis)
    least = row["status"] == "at_least"
    assert row["status"] in {"at_least", "at_most"}
    assert math.isnan(row["high_db"] if least else row["low_db"])
    end = row["low_db"] if least else row["high_db"]
    if "more" in found.groupdict():
        assert found["more"] == ("higher" if least else "lower")
        assert close(found["end"], abs(end))
        assert float(found["end"]) > 0
    else:
        assert found["bound"] == ("at least" if least else "at most")
        assert close(found["end"], end)
        assert float(found["end"]) <= 0 if least else float(found["end"]) >= 0


def own_model(found: re.Match[str], analysis: Analysis) -> None:
    told = [one for one in pairs_of(analysis.differences) if one.row["status"] == "ok"]
    assert any(one.apart for one in told)
    assert bool(found["several"]) == (len(told) > 1)
    assert bool(found["within"]) == any("participants in both" in one.of for one in told)
    if found["ratio"]:
        at = analysis.groups.set_index("condition")["threshold_vpp"]
        a, b = at[told[0].a], at[told[0].b]
        assert close(found["ratio"], b - a if analysis.axis.signed else b / a)


def lapsing(found: re.Match[str], analysis: Analysis) -> None:
    status = analysis.thresholds["status"]
    assert int(found["number"]) == status.eq("lapse_at_bound").sum()
    of = status.isin(WITH_THRESHOLD).sum()
    assert int(found["of"]) == of
    assert bool(found["many"]) == (of >= 5 and int(found["number"]) >= 0.3 * of)


def unbounded(found: re.Match[str], analysis: Analysis) -> None:
    assert pair_of(found, analysis)[0]["status"] == "unknown"


def alone(found: re.Match[str], analysis: Analysis) -> None:
    row, people = pair_of(found, analysis)
    assert row["status"] == "one_participant"
    assert people.empty


def totals(analysis: Analysis) -> pd.DataFrame:
    return analysis.blank[analysis.blank["participant"].eq("all")]


def false_alarms(found: re.Match[str], analysis: Analysis) -> None:
    each = re.findall(
        rf"({NUMBER}) % \(({NUMBER}) to ({NUMBER}) %\) of blank trials(?: in condition (\S+?))?"
        r"(?:, |$)",
        found["each"],
    )
    assert len(each) == len(totals(analysis))
    for (at, low, high, condition), (_, row) in zip(each, totals(analysis).iterrows(), strict=True):
        assert close(at, 100 * row["p"])
        of = "" if math.isnan(row["group_low"]) else "group_"
        assert close(low, 100 * row[f"{of}low"])
        assert close(high, 100 * row[f"{of}high"])
        assert condition == (row.get("condition") or "")


def left_out(found: re.Match[str], analysis: Analysis) -> None:
    counts = analysis.counts
    assert (int(found["out"]), int(found["all"])) == (counts.left_out, counts.trials)
    assert close(found["part"], 100 * counts.left_out / counts.trials)
    told = dict(re.findall(r"([^,]+?) (\d+)(?:, |$)", found["why"]))
    words = {words: reason for reason, words in REASONS.items()}
    by_reason = analysis.excluded.groupby("reason")["trials"].sum().to_dict()
    assert {words[name]: int(number) for name, number in told.items()} == by_reason
    assert sum(map(int, told.values())) == counts.left_out


def several(found: re.Match[str], analysis: Analysis) -> None:
    apart = pairs = 0
    for _, rows in analysis.differences.groupby(["condition_a", "condition_b"]):
        one = len(rows) == 2 and rows["status"].iloc[-1] == "one_participant"
        row = rows.iloc[0 if one else -1]  # a pair of one participant is that one's
        apart += round(row["low_db"], 1) > 0 or round(row["high_db"], 1) < 0
        pairs += 1
    assert [int(found[name]) for name in ("pairs", "apart", "others")] == [
        *(pairs, apart, pairs - apart)
    ]


def told_groups(analysis: Analysis) -> pd.DataFrame:
    """Return the groups of which, or of whose only person, a threshold or a bound is told."""
    ends = ["threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"]
    alone = analysis.thresholds.drop_duplicates("condition").set_index("condition")
    known = analysis.groups[ends].notna().any(axis="columns")
    of_one = (
        analysis.groups["condition"].map(alone[ends].notna().any(axis="columns")).eq(other=True)
    )
    one = analysis.groups["participants"].eq(1)
    return analysis.groups[(one & of_one) | (~one & known)]


def few(analysis: Analysis) -> list[str]:
    groups = told_groups(analysis)
    of = groups["participants"].between(2, 4) & groups["spread_db"].notna()
    return [*groups.loc[of, "condition"]]


def mostly_prior(found: re.Match[str], analysis: Analysis) -> None:
    assert few(analysis)
    all_are = len(few(analysis)) == len(analysis.groups)
    told = re.split(", | and ", found["which"]) if found["which"] else []
    assert told == ([] if all_are else few(analysis))


def doubted(found: re.Match[str], analysis: Analysis) -> None:
    kind = "swapped" if found["what"] == "sides look swapped" else "guessing"
    names = {
        one.participant
        for one in analysis.doubts
        if one.kind == kind and one.condition in ("", found["condition"] or one.condition)
    }
    if found["number"]:
        assert int(found["number"]) == len(names) > 3
    else:
        assert {*re.split(", | and ", found["who"])} == names


def unswapped(found: re.Match[str], analysis: Analysis) -> None:
    assert analysis.unswapped is not None
    condition = found["condition"] or analysis.groups["condition"].iloc[0]
    [(_, row)] = analysis.unswapped[analysis.unswapped["condition"].eq(condition)].iterrows()
    check_value(found["said"], row, axis=analysis.axis if analysis.axis.is_logarithmic else None)


def silent(found: re.Match[str], analysis: Analysis) -> None:
    answers = analysis.trials.groupby("condition")["response"].unique()
    which = re.split(", | and ", found["which"])
    assert which == [name for name in answers.index if [*answers[name]] == ["timeout"]]
    assert not {*which} & {*analysis.thresholds["condition"], *analysis.differences["condition_a"]}


def rates(analysis: Analysis) -> dict[str, float]:
    table = totals(analysis)
    return dict(zip(table["condition"], table["p"], strict=True)) if "condition" in table else {}


def is_true(test: Callable[[Analysis], object]) -> Callable[[re.Match[str], Analysis], None]:
    def check(found: re.Match[str], analysis: Analysis) -> None:
        assert test(analysis), found[0]

    return check


def counted_pairs(analysis: Analysis) -> int:
    return int(analysis.differences["participant"].eq("all").sum())


# What may stand in an answer: nothing else, and each only where its check passes.
def some_offered(analysis: Analysis) -> bool:
    of = analysis.trials
    return True in [one for one in of.loc[of["reason"].eq(""), "none_offered"] if one is not pd.NA]


def some_blank(analysis: Analysis) -> bool:
    return len(analysis.trials) > 0 and "blank" in {*analysis.trials["kind"]}


def always_first(match: re.Match[str], analysis: Analysis) -> None:
    table = analysis.differences
    people = table[table["participant"].ne(TOTAL)]
    said = [own for _, own in people.groupby(["condition_a", "condition_b"])
            if {*own["first"]} == {match["first"]}]  # fmt: skip
    assert int(match["number"]) in [len(own) for own in said]


SENTENCES: dict[str, Callable[[re.Match[str], Analysis], None]] = {
    r"(?:in condition (?P<condition>\S+) )?(?:it|the threshold of (?P<who>.+?)) "
    r"(?P<said>(?:is|cannot be told:) .+?)(?P<session> in (?:this session|these \d+ sessions))?":
        threshold,
    "there is no threshold, for no trial with a single stimulus counts": is_true(
        lambda one: one.groups.empty
    ),
    r"the thresholds of \d+ conditions stand in the table": is_true(
        lambda one: len(one.groups) > 3
    ),
    "thresholds rest on an assumed guess rate, for want of blank trials": is_true(
        lambda one: "assumed" in {*one.thresholds["guess_basis"]} and len(told_groups(one))
    ),
    "a participant's interval is for that session, another day may bring another": is_true(
        lambda one: told_groups(one)["participants"].eq(1).any()
    ),
    r"with fewer than five participants(?: in conditions? (?P<which>.+))? it is mostly the prior "
    "that says how much people differ": mostly_prior,
    rf"the threshold in condition (?P<b>\S+) is (?P<at>{NUMBER}) dB (?P<more>higher|lower) than in "
    rf"(?P<a>[^\s,]+)(?:, (?P<times>{NUMBER}) times \((?P<least>{NUMBER}) to "
    rf"(?P<most>{NUMBER})\) as high)? \(posterior median, 95 % interval "
    rf"(?P<low>{NUMBER}) to (?P<high>{NUMBER}) dB; "
    r"(?P<of>.+)\)": apart,
    r"conditions (?P<a>\S+) and (?P<b>\S+) cannot be told apart with these data: between "
    rf"(?P<low>{NUMBER}) and (?P<high>{NUMBER}) dB \(95 % interval of the threshold in (?P=b) "
    r"against (?P=a); (?P<of>.+)\)": together,
    r"conditions (?P<a>\S+) and (?P<b>\S+) cannot be told apart with these data: "
    rf"(?P<bound>at least|at most) (?P<end>{NUMBER}) dB \(end of the 95 % interval of the "
    r"threshold in (?P=b) against (?P=a), the other is open; (?P<of>.+)\)": half_open,
    r"the threshold in condition (?P<b>\S+) is (?P<more>higher|lower) than in (?P<a>\S+) by at "
    rf"least (?P<end>{NUMBER}) dB \(end of the 95 % interval, the other is open; (?P<of>.+)\)":
        half_open,
    r"these levels bound no difference of conditions (?P<a>\S+) and (?P<b>\S+) \((?P<of>.+)\)":
        unbounded,
    r"one participant alone cannot tell how groups differ in conditions (?P<a>\S+) and (?P<b>\S+)":
        alone,
    r"of (?P<pairs>\d+) pairs of conditions (?P<apart>\d+) differ in threshold, and "
    r"(?P<others>\d+) cannot be told apart with these data \(95 % intervals, in the table\)":
        several,
    r"these intervals are not corrected for \d+ comparisons": is_true(
        lambda one: counted_pairs(one) > 1
    ),
    r"a difference may be one of criterion, of which only blank trials can tell"
    r"(?P<beside>; d' at single levels is in the table)?": is_true(
        lambda one: one.detected_any is not None and len(rates(one)) < len(one.groups)
    ),
    rf"false alarms were not equally frequent (?:in \d+ of these \d+ pairs of conditions )?{BASIS}"
    r"(?:; where they are rarer at the higher threshold, a difference may be one of criterion, in "
    rf"whole or in part|: {PUSH})(?P<beside>; d' at single levels is in the table)?": is_true(
        lambda one: one.detected_any is not None and len({*rates(one).values()}) > 1
    ),
    rf"false alarms are not told apart {BASIS}"
    r"(?:; in a paper this interval is enough, without d')?": is_true(
        lambda one: one.detected_any is not None and len(rates(one)) > 1
    ),
    rf"if anything {PUSH}": is_true(
        lambda one: one.detected_any is not None and len({*rates(one).values()}) > 1
    ),
    r"of (?P<number>\d+) levels?(?: at which at most 90 % were felt in both)?, d' is lower in \S+ "
    r"than in \S+ at (?:\d+|none) of them and higher at (?:\d+|none) "
    r"\(95 % intervals, each by itself\)"
    r"(?:, which a difference of criterion alone would hardly bring about|, and one level alone "
    r"decides nothing)?": is_true(lambda one: len(one.d_prime_differences)),
    r"all (?P<number>\d+) participants had condition (?P<first>\S+) first: practice, fatigue and "
    r"what else changed in between are part of the difference(?: of \S+ and \S+)?": always_first,
    r"conditions are not compared, for a difference in dB needs levels above 0, or in dB "
    r'\(\[axis\] x_scale = "log10" or "dB"\)': is_true(
        lambda one: one.axis.x_scale == "linear" and len(one.groups) > 1
    ),
    'false alarms are not told, for "none" was not an answer as far as the files tell': is_true(
        lambda one: one.detected_any is None and not some_offered(one) and not one.task
    ),
    'false alarms are not told, for "none" is not known to be an answer in all trials': is_true(
        lambda one: one.detected_any is None and some_offered(one)
    ),
    'false alarms are not told, for "none" was not an answer: forced choice, as the map says':
        is_true(
            lambda one: one.detected_any is None and one.task and not some_offered(one)
        ),
    "false alarms are not known, for there were no blank trials": is_true(
        lambda one: one.detected_any is not None and one.blank.empty and not some_blank(one)
    ),
    "false alarms are not known, for no blank trial counts": is_true(
        lambda one: one.detected_any is not None and one.blank.empty and some_blank(one)
    ),
    "false alarms stand in the table": is_true(lambda one: len(totals(one)) > 3),
    r"false alarms: (?P<each>.+)": false_alarms,
    "equal counts have unequal intervals where participants differ more in one condition":
        is_true(lambda one: len({*totals(one)["group_high"]}) > 1),
    "counts were read, which do not tell what was left out of them": is_true(
        lambda one: one.trials.empty and one.counts.trials
    ),
    r"nothing was left out: all \d+ trials count": is_true(
        lambda one: not one.counts.left_out and not one.counts.unread
    ),
    r"all \d+ trials that were read count": is_true(
        lambda one: not one.counts.left_out and one.counts.unread
    ),
    rf"(?P<out>\d+) of (?P<all>\d+) trials \((?P<part>{NUMBER}) %\) are left out: (?P<why>.+)":
        left_out,
    r"see \d+ warnings? below": is_true(lambda one: one.warnings),
    r"the map leaves out \d+ rows? more": is_true(lambda one: one.counts.unread),
    r"nothing counts of \d+ participants?: .+": is_true(
        lambda one: {*one.trials["participant"]}
        - {*one.trials.loc[one.trials["reason"].eq(""), "participant"]}
    ),
    r"\d+ sessions?, lost after recording, took no part": is_true(lambda one: one.lost),
    r"(?:participants? (?P<who>.+)|(?P<number>\d+) participants) counts?"
    r"(?: in condition (?P<condition>\S+))?, though their (?P<what>sides look swapped|answers "
    r"cannot be told from guesses) \(see the warnings\)": doubted,
    r"without .+? the threshold of the group(?: in condition (?P<condition>\S+))? "
    r"(?P<said>(?:is|cannot be told:) .+)": unswapped,
    r"there is no threshold in conditions? (?P<which>.+), where nobody answered": silent,
    r"(?:the difference is|(?P<several>differences are)) estimated "
    r"(?P<within>within participants )?by (?:a model of its|models of their) own and (?:is|are) "
    r"to be quoted; (?:the (?:ratio|difference) of the two|(?:ratio|difference)s of the) thresholds"
    rf"(?:, here (?P<ratio>{NUMBER})(?: dB)?,)? need not equal (?:it|them)": own_model,
    rf"\d+ of \d+ {FUNCTIONS} rises? in one step \(status \"separated\".*?\): (?:it|they) "
    r"cannot be tested for fit, and the intervals? of .+ on the prior of the slope": is_true(
        lambda one: one.thresholds["status"].eq("separated").any()
    ),
    rf"(?P<number>\d+) of (?P<of>\d+) {FUNCTIONS} fits? best at the largest lapse rate allowed, "
    r'10 % \(status "lapse at bound".*?\), (?:which is common .+ leave a threshold out|'
    r"(?P<many>no reason .+ 0.6 dB too high))": lapsing,
}  # fmt: skip


def checked(found: Answer, analysis: Analysis) -> set[str]:
    """Check every sentence, and return which there are."""
    used = []
    assert len(found.statements) == 3
    for statement in found.statements:
        assert statement.endswith(".")
        for sentence in re.split(r"\. (?=[A-Z0-9])", plain(statement)[:-1]):
            told = sentence[0].lower() + sentence[1:]
            [one] = [p for p in SENTENCES if re.fullmatch(p, told)] or [""]
            assert one, told
            match = re.fullmatch(one, told)
            assert match
            SENTENCES[one](match, analysis)
            used.append(one)
    kinds = [*SENTENCES]
    groups, pairs = len(analysis.groups), counted_pairs(analysis)
    assert used.count(kinds[0]) == (groups if groups <= 3 else 0)
    assert sum(used.count(kinds[i]) for i in range(6, 12)) == (pairs if pairs <= 3 else 0)
    told = told_groups(analysis)
    assert (kinds[4] in used) == bool(told["participants"].eq(1).any())
    assert (kinds[5] in used) == bool(few(analysis))
    said = plain(" ".join(found.statements))
    assert ("; d' at single levels" in said) <= bool(len(analysis.d_prime_differences))
    return {*used}


@pytest.fixture(scope="module")
def least(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """An analysis of next to nothing, whose tables are put in the place of."""
    folder = tmp_path_factory.mktemp("least")
    return analyse(loaded(folder, LEAST + "1,left,60,left\n1,left,95,none\n"))


class Made:
    """Tables as an analysis may have them, drawn at random: any status, any number of people."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.conditions = ["main"]
        if self.rng.random() < 0.7:
            self.conditions = [f"c{n}" for n in range(self.rng.choice((2, 2, 2, 3, 4)))]
        self.people = self.rng.choice((1, 2, 4, 5, 8, 40))

    def value(self) -> dict[str, Any]:
        """Return a status with the numbers that it may have, and its words."""
        rng = self.rng
        status = rng.choice(["ok", *WORDS])
        at, low, high = (math.nan,) * 3
        if status in WITH_THRESHOLD:
            low, at, high = sorted(rng.uniform(LEVELS[0], LEVELS[-1]) for _ in range(3))
            low, high = (x if rng.random() < 0.7 else math.nan for x in (low, high))
            ends = (-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high)
            words = with_limits(at, *ends, "V", LEVELS)
            words += ", slope unknown" if status == "separated" else ""
        elif status in BOUNDED:
            kind = rng.choice(("below", "above", "neither"))
            limit = rng.choice((LEVELS[0] if kind == "below" else LEVELS[-1], rng.uniform(60, 200)))
            low, high = (limit if kind == one else math.nan for one in ("above", "below"))
            ends = (-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high)
            words = bounded(*ends, "V", LEVELS)
        else:
            words = WORDS[status]
        return {"status": status, "threshold_vpp": at, "threshold_low_vpp": low,
                "threshold_high_vpp": high, "printed": words}  # fmt: skip

    def groups(self) -> pd.DataFrame:
        rows = []
        for name in self.conditions:
            row: dict[str, Any] = {"condition": name, "participants": self.people}
            row |= dict.fromkeys(GROUP_COLUMNS, math.nan) | row | self.value()
            if self.people == 1:
                row["status"] = "one_participant"
            elif row["status"] in WITH_THRESHOLD:
                row |= {"spread_db": 2.04, "spread_low_db": 0.51, "spread_high_db": 4.49}
                row["printed"] += "; between people 2.0 dB (0.5 to 4.5)"
                row["new_high_vpp"] = self.rng.choice((math.nan, 180.0))
            rows.append(row)
        return pd.DataFrame(rows, columns=list(GROUP_COLUMNS))

    def thresholds(self) -> pd.DataFrame:
        basis = self.rng.choice(("blanks", "assumed"))
        rows = [
            dict.fromkeys(THRESHOLD_COLUMNS, math.nan)
            | {"participant": f"S{n}", "condition": name, "trials": 80, "guess_basis": basis}
            | {"varied_printed": "50 to 150 V"}
            | self.value()
            for name in self.conditions
            for n in range(self.people)
        ]
        return pd.DataFrame(rows, columns=list(THRESHOLD_COLUMNS))

    def difference(self, axis: Axis) -> dict[str, Any]:
        rng = self.rng
        status = rng.choice(("ok", "ok", "ok", "at_least", "at_most", "unknown"))
        low, at, high = sorted(rng.uniform(-6, 6) for _ in range(3))
        if rng.random() < 0.2:
            low = rng.choice((-0.04, 0.04, 0.06))
            at, high = low + 1, low + 2
        if status != "ok":
            at = math.nan
            low = low if status == "at_least" else math.nan
            high = high if status == "at_most" else math.nan
        d_prime = rng.choice((math.nan, rng.uniform(0, 3)))
        ratio = "" if axis.signed or status != "ok" else f", {times(at, low, high)}"
        return {"status": status, "difference_db": at, "low_db": low, "high_db": high,
                "printed": f"words{ratio}", "first": rng.choice((None, "a 2, b 1")),
                "d_prime_a": d_prime, "d_prime_b": d_prime / 2}  # fmt: skip

    def differences(self, axis: Axis) -> pd.DataFrame:
        rows: list[dict[str, Any]] = []
        for a, b in itertools.combinations(self.conditions, 2 if axis.is_logarithmic else 99):
            pair = {"condition_a": a, "condition_b": b}
            both = self.rng.choice((0, self.people))
            rows += [pair | {"participant": f"S{n}"} | self.difference(axis) for n in range(both)]
            group = self.difference(axis)
            if both == 1 or (not both and self.people == 1):
                group = dict.fromkeys(group, math.nan) | {"status": "one_participant"}
            rows.append(pair | {"participant": "all"} | group)
        return pd.DataFrame(rows, columns=[*DIFFERENCE_COLUMNS, *BESIDE_COLUMNS])

    def blank(self) -> pd.DataFrame:
        rows = []
        for name in self.conditions if self.rng.random() < 0.7 else ():
            left, right, of = self.rng.randrange(3), self.rng.randrange(2), 60
            left += 40 * (right and name == "c1")
            row = {"condition": name, "participant": "all", "left": left, "right": right, "both": 1}
            p = (left + right + 1) / of
            group = (p / 3, 3 * p) if self.people > 1 else (math.nan, math.nan)
            row |= dict(zip(("group_low", "group_high"), group, strict=True))
            rows.append(row | {"presented": of, "p": p, "low": p / 2, "high": 2 * p})
        columns = ["participant", "left", "right", "both", "presented", "p", "low", "high",
                   "group_low", "group_high"]  # fmt: skip
        table = pd.DataFrame(rows, columns=["condition", *columns])
        return table if len(self.conditions) > 1 else table[columns]

    def analysis(self, least: Analysis) -> Analysis:
        rng = self.rng
        axis = rng.choice((VOLTS, VOLTS, Axis(x_scale="linear"), Axis(x_scale="dB", unit="dB")))
        reasons = rng.sample([*REASONS], rng.choice((0, 1, 3, 8)))
        excluded = pd.DataFrame(
            [("S0", reason, rng.randrange(1, 40)) for reason in reasons],
            columns=["participant", "reason", "trials"],
        )
        out = int(excluded["trials"].sum())
        trials = least.trials.iloc[: rng.choice((0, 2, 2))].assign(
            reason=rng.choice(("", "practice"))
        )
        any_felt = rng.choice((None, least.detected_any))
        if any_felt is None:
            trials["none_offered"] = [rng.choice((False, True)), False][: len(trials)]
        counts = replace(
            least.counts, trials=400 + out, left_out=out, conditions=len(self.conditions),
            participants=self.people, simulated=rng.choice((0, 0, 400 + out, 7)),
            unread=rng.choice((0, 1, 5)),
        )  # fmt: skip
        levels = pd.DataFrame(
            [(name, level) for name in self.conditions for level in LEVELS],
            columns=["condition", "level_vpp"],
        )
        return replace(
            least, groups=self.groups(), thresholds=self.thresholds(), axis=axis, levels=levels,
            differences=self.differences(axis), blank=self.blank(), excluded=excluded,
            counts=counts, trials=trials, lost=rng.choice(({}, {"s": ("gone",)})),
            warnings=rng.choice(((), ("one", "two"))),
            detected_any=any_felt,
            task=rng.choice(("", "forced choice")), d_prime_differences=self.by_level(),
        )  # fmt: skip

    def by_level(self) -> pd.DataFrame:
        """Return differences of d' of all, at the levels; of its own generator."""
        rng = random.Random(self.people)
        rows = [
            {"condition_a": a, "condition_b": b, "participant": "all", "level_vpp": level,
             "felt_a": rng.choice((1, 19)), "presented_a": 20, "felt_b": 9, "presented_b": 20,
             "d_prime_a": 1.0, "d_prime_b": 1.0 + at, "d_prime_difference": at,
             "d_prime_difference_low": at - 0.5, "d_prime_difference_high": at + 0.5}
            for a, b in itertools.combinations(self.conditions, 2) for level in LEVELS
            for at in (rng.choice((0.0, 1.0, -1.0)),)
        ]  # fmt: skip
        return pd.DataFrame(rows, columns=[*BY_LEVEL_COLUMNS])

    def doubted(self, analysis: Analysis) -> Analysis:
        """Return it with people whose answers are in doubt."""
        rng = self.rng
        names = rng.sample(
            [f"S{n}" for n in range(self.people)], min(self.people, rng.randrange(6))
        )
        swapped = [Doubt(kind="swapped", words="", participant=name) for name in names[::2]]
        guessing = [
            Doubt(kind="guessing", words="", participant=name, condition=condition)
            for name in names[1::2]
            for condition in self.conditions
        ]
        left = self.people - len(swapped)
        groups = self.groups().assign(participants=left) if swapped and left else None
        return replace(analysis, doubts=(*swapped, *guessing), unswapped=groups)


@pytest.mark.slow
def test_every_sentence_is_true_of_the_tables(least: Analysis) -> None:
    for seed in range(14):
        made = Made(seed)
        analysis = made.doubted(made.analysis(least))
        checked(answer(analysis), analysis)


@pytest.mark.slow
def test_every_kind_of_sentence_occurs_and_is_true(least: Analysis, tmp_path: Path) -> None:
    used = set()
    for seed in range(14, 200):
        made = Made(seed)
        analysis = made.doubted(made.analysis(least))
        used |= checked(answer(analysis), analysis)
    nothing = replace(least, groups=least.groups[:0], thresholds=least.thresholds[:0])
    used |= checked(answer(nothing), nothing)
    mute = analyse(loaded(tmp_path, SILENT))
    used |= checked(answer(mute), mute)
    (tmp_path / "lost").mkdir()
    lost = analyse(loaded(tmp_path / "lost", LOST_BLANKS))
    used |= checked(answer(lost), lost)
    first = analyse(loaded(tmp_path, study({"a": 60.0, "b": 95.0}, 3, kind="none")))
    used |= checked(answer(first), first)
    for alarms in ([(1, 3), (2, 2)], [(2, 2), (0, 0)]):
        some = with_alarms(least, alarms, [(20, 20)] * 2, high_b=0.7)
        used |= checked(answer(some), some)
    assert [one for one in SENTENCES if one not in used] == []


@pytest.mark.slow
def test_the_table_of_the_answer_has_the_numbers_of_the_tables(least: Analysis) -> None:
    for seed in range(20):
        analysis = Made(seed).analysis(least)
        rows = [[plain(cell) for cell in row] for row in answer(analysis).rows]
        values = {value for _, value, _ in rows}
        for _, group in analysis.groups.iterrows():
            if group["participants"] > 1:
                assert str(group["printed"]).partition("; between")[0] in values
                told = "2.0 dB (0.5 to 4.5)" in values or not analysis.axis.is_logarithmic
                assert told or math.isnan(group["spread_db"])
        ok = analysis.differences["status"].eq("ok") & analysis.differences["participant"].eq("all")
        for _, row in analysis.differences[ok].iterrows():
            low, high = (round(row[name], 1) + 0.0 for name in ("low_db", "high_db"))
            shown = f"{row['difference_db']:+.1f} dB ({low:+.1f} to {high:+.1f})"
            ratio = f", {times(row['difference_db'], row['low_db'], row['high_db'])}"
            assert f"{shown}{ratio * (not analysis.axis.signed)}" in values
        for what, _, of in rows:
            if what.startswith("False alarms") and " against " not in what:
                assert ("interval to quote, wider the more people differ" in of) == (
                    Made(seed).people > 1
                )
        varied = [row for row in rows if row[0].startswith("The same if answers vary 2.8 times")]
        alone = analysis.groups["participants"].eq(1).any()
        assert [row[1] for row in varied] == ["50 to 150 V"] * (len(analysis.groups) * alone)
        by_map = ["Left out by the map"] * bool(analysis.counts.unread)
        assert [row[0] for row in rows[-1 - len(by_map) :]] == ["Trials left out", *by_map]


def study(conditions: dict[str, float], people: int, *, kind: str = "none") -> str:
    """Write trials of people whose thresholds lie 2 dB apart, in yes/no or forced choice."""
    rng = np.random.default_rng(3)
    told = ["participant,trial,condition,kind,side,level_vpp,response,simulated"]
    for n in range(people):
        number = 0
        for condition, at in conditions.items():
            for level in (40.0, 60.0, 80.0, 100.0, 140.0):
                z = (math.log10(level) - math.log10(at) - 0.05 * (n % 3 - 1)) / 0.1
                for _ in range(16):
                    felt = rng.random() < 0.5 * (1 + math.erf(z / math.sqrt(2)))
                    guess = rng.choice(["left", "right"]) if kind == "forced" else "none"
                    number += 1
                    told.append(
                        f"S{n},{number},{condition},single,left,{level:g},"
                        f"{'left' if felt else guess},{str(kind == 'simulated').lower()}"
                    )
            for trial in range(20 if kind != "forced" else 0):
                number += 1
                answered = "left" if trial < 1 else "none"
                told.append(f"S{n},{number},{condition},blank,none,0,{answered},"
                            f"{str(kind == 'simulated').lower()}")  # fmt: skip
        told.append(f"S{n},{number + 1},{condition},practice,left,60,left,"
                    f"{str(kind == 'simulated').lower()}")  # fmt: skip
    return "\n".join(told) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("conditions", "people", "kind", "words"),
    [
        ({"a": 60.0, "b": 95.0}, 3, "none", "higher than in a"),
        ({"a": 70.0, "b": 70.0}, 2, "none", "cannot be told apart"),
        ({"main": 70.0}, 1, "forced", "in this session"),
        ({"main": 20.0}, 2, "simulated", "2 simulated participants is at most"),
    ],
)
def test_page_terminal_and_summary_begin_with_the_same_true_answer(
    tmp_path: Path, conditions: dict[str, float], people: int, kind: str, words: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("tests.test_analysis.test_answer.LEVELS", [40.0, 60.0, 80.0, 100.0, 140.0])
    path = put(tmp_path / "t.csv", study(conditions, people, kind=kind))
    analysis = write_analysis([path], tmp_path / "out", columns=ColumnMap(), figures=False)
    found = answer(analysis)
    checked(found, analysis)
    statements = [plain(one) for one in found.statements]
    assert words in " ".join(statements)
    made = files(tmp_path / "out")
    assert json.loads(made["summary.json"])["answer"] == statements
    page = made["report.html"].decode()
    assert "Trials by kind of device" not in page  # nothing is known of them
    for _, row in analysis.differences[analysis.differences["status"].eq("ok")].iterrows():
        apart = round(row["low_db"], 1) > 0 or round(row["high_db"], 1) < 0
        assert row["printed"].startswith(("higher by", "lower by") if apart else "not told apart: ")
        assert harmless(row["printed"]) == row["printed"]
    first = page[page.index("<h1>") : page.index("<h2>")]
    told = re.findall("<p>(.*?)</p>", first.replace("<bdi>", "").replace("</bdi>", ""))
    assert [html.unescape(one) for one in told[:3]] == statements
    printed = io.StringIO()
    print_analysis(analysis, printed)
    mark = "Simulated participants. " if kind == "simulated" else ""
    assert " ".join(printed.getvalue().split()).startswith(mark + " ".join(statements))


@pytest.mark.slow
def test_of_a_table_of_counts_nobody_knows_what_was_left_out(tmp_path: Path) -> None:
    counts = zip((60, 80, 110, 150, 200), (15, 18, 24, 29, 30), strict=True)
    text = "participant,level_vpp,k,n\n" + "".join(f"1,{v},{k},30\n" for v, k in counts)
    columns = ColumnMap(table={"detected": "k", "presented": "n"}, task="forced choice")
    analysis = analyse(loaded(tmp_path, text, columns))
    first, second, third = map(plain, answer(analysis).statements)
    assert first.startswith("The threshold of participant 1 is 101.")
    assert '"none" was not an answer: forced choice, as the map says' in second
    assert third == "Counts were read, which do not tell what was left out of them."


@pytest.mark.slow
def test_none_in_one_condition_only_is_told_as_that(tmp_path: Path) -> None:
    rows = "1,left,60,none,a\n1,left,95,left,a\n1,none,0,none,a\n2,left,60,right,b\n"
    analysis = analyse(loaded(tmp_path, LEAST.replace("\n", ",condition\n") + rows))
    printed = io.StringIO()
    print_analysis(analysis, printed)
    said = " ".join(printed.getvalue().split())
    assert '"none" is not known to be an answer in all trials.' in said
    assert 'The answer "none" is not known to have been offered in all trials.' in said
    assert "was not offered" not in said


@pytest.mark.slow
def test_one_swapped_person_is_named_beside_the_number_they_have_moved(tmp_path: Path) -> None:
    text = study({"main": 60.0}, 6, kind="forced")
    other = {"left": "right", "right": "left"}
    lines = text.splitlines()
    for i, line in enumerate(lines):
        cells = line.split(",")
        if cells[0] == "S2" and cells[3] == "single":
            cells[6] = other[cells[6]]
            # Both sides: only so are guesses known from a preference of one.
        if cells[3] == "single" and int(cells[1]) % 2:
            cells[4], cells[6] = other[cells[4]], other[cells[6]]
        lines[i] = ",".join(cells)
    analysis = analyse(loaded(tmp_path, "\n".join(lines) + "\n"))
    assert [(one.kind, one.participant) for one in analysis.doubts] == [("swapped", "S2")]
    found = answer(analysis)
    first = plain(found.statements[0])
    assert "Participant S2 counts, though their sides look swapped (see the warnings)." in first
    assert analysis.unswapped is not None
    alone = analysis.unswapped["threshold_vpp"].iloc[0]
    assert f"Without participant S2 the threshold of the group is {alone:.1f} V" in first
    assert analysis.groups["threshold_vpp"].iloc[0] > 1.05 * alone
    assert ("The same without swapped sides", "5 participants") in {
        (name, of) for name, _, of in found.rows
    }


def test_people_of_another_condition_are_another_group(least: Analysis) -> None:
    made = Made(0)
    made.conditions, made.people = ["a", "b"], 5
    analysis = made.analysis(least)
    people = analysis.thresholds
    analysis = replace(
        analysis,
        thresholds=people.assign(participant=people["condition"] + people["participant"]),
    )
    first = plain(answer(analysis).statements[0])
    assert "n condition a the threshold of the group of 5" in first
    assert "n condition b the threshold of another group of 5" in first
    made.conditions = ["a", "b", "c"]
    analysis = made.analysis(least)
    people = analysis.thresholds
    turned = people["participant"].where(people["condition"].ne("b"), "B" + people["participant"])
    analysis = replace(analysis, thresholds=people.assign(participant=turned))
    first = plain(answer(analysis).statements[0])
    assert "n condition c the threshold of the group of 5" in first


def test_a_choice_of_three_starts_at_a_third(least: Analysis) -> None:
    thresholds = Made(0).thresholds().assign(guess_basis="forced choice", guess_rate=1 / 3)
    told = forced_choice(replace(least, thresholds=thresholds, task="forced choice"), "k/n")
    assert "not offered, as the map says" in told
    assert told.endswith("k/n starts near 1/3, not at 0.")
    mixed = thresholds.assign(guess_rate=[1 / 2, *[1 / 3] * (len(thresholds) - 1)])
    assert "near the guess rate" in forced_choice(replace(least, thresholds=mixed), "k/n")


@pytest.mark.parametrize(("rates", "often"), [((0.1, 0.5), 1), ((0.1, 0.2), 0), ((0.1, 0.1), 0)])
def test_criterion_is_spoken_of_only_where_false_alarms_differ(
    least: Analysis, rates: tuple[float, float], often: int
) -> None:
    apart = {"status": "ok", "difference_db": 3.0, "low_db": 1.0, "high_db": 5.0}
    row = {"condition_a": "a", "condition_b": "b", "participant": "all", "first": "interleaved 8"}
    blank = pd.DataFrame(
        {"condition": ["a", "a", "b", "b"], "participant": ["S1", "all", "S2", "all"],
         "presented": 60, "p": [rates[0]] * 2 + [rates[1]] * 2, "low": 0.05, "high": 0.3,
         "group_low": math.nan, "group_high": math.nan}
    )  # fmt: skip
    analysis = replace(
        least, counts=replace(least.counts, conditions=2), blank=blank,
        detected_any=least.levels,
        differences=pd.DataFrame([row | apart], columns=[*DIFFERENCE_COLUMNS, *BESIDE_COLUMNS]),
    )  # fmt: skip
    found = answer(analysis)
    said = plain(found.statements[1]).lower()
    assert (
        said.count(
            "false alarms were not equally frequent (p < 0.001, fisher's exact test of the "
            "totals): they were more frequent in b, where the threshold is higher, and a laxer "
        )
        == often
    )
    assert said.count("false alarms are not told apart (p = ") == 1 - often
    assert said.count(" % (5.0 to 30.0 %)") == 2
    assert not any("interleaved" in of for _, _, of in found.rows)
    alarms = round(60 * rates[0]) + round(60 * rates[1])
    felt = [round(60 * rate) for rate in rates]
    low, high = (100 * end for end in group_interval(felt, [60, 60], false_alarms=True))
    quoted = f"{alarms / 1.2:.1f} % ({low:.1f} to {high:.1f} %)"
    assert f"is to be quoted, {quoted}, {alarms} of 120 blank trials" in said
    told = [row for row in found.rows if row[0] == "False alarms, all"]
    assert [row[1] for row in told] == [quoted]
    assert "; to quote, if nothing told which condition was coming" in told[0][2]


@pytest.mark.parametrize(("number", "basis"), [(6, "interval"), (4, "test")])
def test_false_alarms_of_several_people_rest_on_their_interval(
    least: Analysis, number: int, basis: str
) -> None:
    """One of them alone differs: that is an exact test's difference, and not one of people."""
    alarms, blanks = [(0, 10), *[(1, 1)] * (number - 1)], [(20, 20)] * number
    assert same_rates_p(alarms, blanks) < 0.05
    said = alarms_said(least, alarms, blanks)
    rarer = (
        "hey were rarer in a, where the threshold is higher, and a stricter criterion there may "
    )
    if basis == "interval":
        assert (
            "not told apart (+8.3 points in b against a, 95 % interval -13.1 to +29.8 by "
            "Student's t)" in said
        )
        assert f"If anything t{rarer}bring the difference about in part." in said
    else:
        within = "exact Cochran-Mantel-Haenszel test within these participants"
        assert f"were not equally frequent (p = 0.012, {within}): t{rarer}bring" in said
        assert "bring the difference about in whole or in part" in said


@pytest.mark.slow
def test_results_without_misfits_stand_beside_those_of_all(tmp_path: Path) -> None:
    """As if the map had left these people out."""
    text = study({"a": 60.0, "b": 80.0}, 5)
    odd = "".join(
        f"odd,{1000 * at + level + n},{condition},single,left,{level},"
        f"{'left' if n < k else 'none'},false\n"
        for at, condition in enumerate("ab")
        for level, k in ((40, 0), (60, 14), (80, 3), (100, 15), (140, 16)) for n in range(16)
    )  # fmt: skip
    (tmp_path / "without").mkdir()
    analysis = analyse(loaded(tmp_path, text + odd))
    without = analyse(loaded(tmp_path / "without", text))
    assert analysis.fitting is not None
    assert analysis.fitting.names == ("odd",)
    rows = {plain(what): (plain(value), of) for what, value, of in answer(analysis).rows}
    for condition in "ab":
        [(_, group)] = without.groups[without.groups["condition"].eq(condition)].iterrows()
        value, of = rows[f"The same without participant odd, condition {condition}"]
        assert value == group["printed"].partition("; between")[0]
        assert of == "5 participants without misfits and drifts in any condition"
    value, of = rows["The same without participant odd, b against a"]
    assert value.startswith(f"{without.differences.iloc[-1]['difference_db']:+.1f} dB (")
    assert of == "5 participants in both, without misfits and drifts in any condition"
    (warning,) = (one for one in analysis.warnings if "do not fit" in one)
    assert "below the panels of the figure of participants" in warning
    assert without.fitting is None


@pytest.mark.slow
def test_results_without_drifts_stand_beside_those_of_all(tmp_path: Path) -> None:
    text = study({"a": 60.0, "b": 80.0}, 4)
    tired = "".join(
        f"tired,{10000 * at + 200 * n + level},{condition},single,left,{level},"
        f"{'left' if level > 100 or (level > 40 and n < 8) else 'none'},false\n"
        for at, condition in enumerate("ab")
        for level in (40, 60, 80, 100, 140) for n in range(16)
    )  # fmt: skip
    (tmp_path / "without").mkdir()
    analysis = analyse(loaded(tmp_path, text + tired))
    without = analyse(loaded(tmp_path / "without", text))
    assert analysis.fitting is not None
    assert "tired" in analysis.fitting.names
    rows = {plain(what): plain(value) for what, value, _ in answer(analysis).rows}
    found = without.differences.iloc[-1]["difference_db"]
    assert rows["The same without participant tired, b against a"].startswith(f"{found:+.1f} dB (")
    (warning,) = (one for one in analysis.warnings if one.startswith("participant tired, session"))
    assert warning.endswith("results without misfits and drifts stand in the answer's table")


def test_an_answer_more_or_less_points_nowhere(least: Analysis) -> None:
    blanks = [(20, 20)] * 6
    said = alarms_said(least, [(1, 0), (0, 1), *[(1, 1)] * 4], blanks)
    assert (
        "not told apart (0.0 points in b against a, 95 % interval -3.3 to +3.3 by Student's t)"
        in said
    )
    assert "If anything" not in said
    fewer = [(20, 19), *blanks[1:]]  # equally many false alarms, of other numbers of blanks
    assert "If anything" not in alarms_said(least, [(1, 1), (0, 1), (1, 0), *[(1, 1)] * 3], fewer)
    assert "If anything" not in alarms_said(least, [(1, 2), *[(1, 1)] * 5], blanks)
    assert "If anything" in alarms_said(least, [(1, 3), *[(1, 1)] * 5], blanks)


def test_intervals_of_equal_counts_are_said_to_differ_with_people(least: Analysis) -> None:
    alarms, blanks = [(1, 0), (1, 0), (0, 2)], [(20, 20)] * 3
    wider = "Equal counts have unequal intervals where participants differ more in one condition."
    assert wider in alarms_said(least, alarms, blanks, high_b=0.7)
    assert wider not in alarms_said(least, alarms, blanks)
    assert wider not in alarms_said(least, [(1, 0), (1, 0), (0, 3)], blanks, high_b=0.7)
    assert wider not in alarms_said(least, alarms, [(20, 19)] * 3, high_b=0.7)


Pairs = list[tuple[int, int]]


def alarms_said(least: Analysis, alarms: Pairs, blanks: Pairs, high_b: float = 0.6) -> str:
    """Return what is said of these false alarms."""
    return plain(answer(with_alarms(least, alarms, blanks, high_b)).statements[1])


def with_alarms(
    least: Analysis,
    alarms: Pairs,
    blanks: Pairs,
    high_b: float = 0.6,
) -> Analysis:
    """Return an analysis of conditions a, with the higher threshold, and b with false alarms."""
    names = [f"{i}" for i in range(len(alarms))]
    counts = [[[one[of] for one in table] for table in (alarms, blanks)] for of in (0, 1)]
    blank = pd.concat(
        pd.DataFrame({"condition": condition, "participant": [*names, "all"],
                      "presented": [*of, sum(of)],
                      "p": [*np.divide(k, of), sum(k) / sum(of)]}).assign(group_high=high)
        for condition, (k, of), high in zip("ab", counts, (0.6, high_b), strict=True)
    ).assign(low=0.01, high=0.6, group_low=0.01)  # fmt: skip
    told = dict(zip(BESIDE_COLUMNS[5:8], rates_apart(alarms, blanks), strict=True))
    row = {"condition_a": "a", "condition_b": "b", "participant": "all", "status": "ok",
           "printed": "lower by 3.0 dB (1.0 to 5.0), 0.71 times (0.56 to 0.89)",
           "difference_db": -3.0, "low_db": -5.0, "high_db": -1.0, **told}  # fmt: skip
    return replace(
        least, counts=replace(least.counts, conditions=2), blank=blank, detected_any=least.levels,
        differences=pd.DataFrame(
            [*(row | {"participant": name} for name in names), row],
            columns=[*DIFFERENCE_COLUMNS, *BESIDE_COLUMNS],
        ),
    )  # fmt: skip


def test_a_share_is_rounded_alike_wherever_it_is_told(least: Analysis) -> None:
    """9 of 240 lies half-way between two roundings."""
    blank = pd.DataFrame([{"participant": "all", "left": 5, "right": 4, "both": 0, "presented": 240,
                           "p": 9 / 240, "low": 0.02, "high": 0.07, "group_low": 0.0215,
                           "group_high": 0.0935}])  # fmt: skip
    analysis = replace(least, blank=blank, detected_any=least.levels)
    assert "alse alarms: 3.8 % (2.2 to 9.4 %)" in answer(analysis).statements[1]
    assert blank_cells(blank.iloc[0], PAGE)[-3:] == ["0.038", "0.020 to 0.070", "0.022 to 0.094"]


def test_false_alarms_are_compared_within_people() -> None:
    """Of two people who each prefer another rate, the one pair of conditions is compared."""
    assert same_rates_p([(21, 22)], [(240, 240)]) == pytest.approx(
        fisher_exact(np.array([[21, 22], [219, 218]])).pvalue
    )
    alarms, blanks = [(1, 6), (0, 5), (14, 19)], [(20, 20), (30, 30), (20, 20)]
    rng = np.random.default_rng(1)
    drawn = sum(
        rng.hypergeometric(a + b, of[0] + of[1] - a - b, of[0], 100_000)
        for (a, b), of in zip(alarms, blanks, strict=True)
    )
    number, times = np.unique(drawn, return_counts=True)
    rare = times[times <= times[number == 15]].sum() / 100_000
    assert same_rates_p(alarms, blanks) == pytest.approx(rare, abs=0.001)
    assert same_rates_p([(5000, 5200)], [(90_000, 90_000)]) == pytest.approx(
        fisher_exact(np.array([[5000, 5200], [85_000, 84_800]])).pvalue, rel=0.02
    )
