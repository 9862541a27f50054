"""The answer as data: which statements there are, and which numbers of the tables they have."""

from __future__ import annotations

import html
import io
import itertools
import json
import math
import random
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact, ttest_1samp

from analysis import (
    Axis,
    ColumnMap,
    StatementCode,
    WarningCode,
    analyse,
    print_analysis,
    write_analysis,
)
from analysis.results.answer import answer
from tests.test_analysis.shared import LEAST, files, loaded, put
from tests.test_analysis.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from analysis import Analysis

C = StatementCode
NAN = math.nan
VALUES = [
    ("ok", 81.0, 74.0, 88.0, "81.0 V (74.0 to 88.0)"),
    ("ok", 71.0, NAN, 90.0, "71.0 V (< 60 to 90.0)"),
    ("lapse_at_bound", 150.0, 120.0, NAN, "150 V (120 to > 200)"),
    ("separated", 110.0, 95.0, 130.0, "110 V (95 to 130), slope unknown"),
    ("threshold_below_levels", NAN, NAN, 60.0, "< 60 V"),
    ("threshold_above_levels", NAN, 200.0, NAN, "> 200 V"),
    ("median_below_levels", NAN, NAN, 68.2, "at most 68.2 V (95 %)"),
    ("median_above_levels", NAN, 161.0, NAN, "at least 161 V (95 %)"),
    ("flat", NAN, NAN, NAN, "no threshold: does not rise"),
]
"""Status, threshold, limits and what is printed of them."""
LIMITS = ["status", "threshold_vpp", "threshold_low_vpp", "threshold_high_vpp", "printed"]


@pytest.fixture(scope="module")
def least(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """An analysis of next to nothing, whose tables are replaced."""
    folder = tmp_path_factory.mktemp("least")
    return analyse(loaded(folder, LEAST + "1,left,60,left\n1,left,95,none\n"))


def rows_of(table: pd.DataFrame, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows with the columns of a table; what a row lacks is missing."""
    return pd.DataFrame(rows, columns=[*dict.fromkeys([*table.columns, *(rows or [{}])[0]])])


def drawn(least: Analysis, seed: int) -> Analysis:
    """Return an analysis whose tables are drawn at random: any status, any number of people."""
    rng: Any = random.Random(seed)
    names = [f"c{n}" for n in range(rng.choice((1, 2, 2, 3, 4)))]
    people, basis = rng.choice((1, 2, 4, 5, 8)), rng.choice(("blanks", "assumed"))
    linear, shared, asked = rng.random() < 0.2, rng.random() < 0.5, rng.random() < 0.7

    def value() -> dict[str, Any]:
        return dict(zip(LIMITS, rng.choice(VALUES), strict=True))

    def difference() -> dict[str, Any]:
        status = rng.choice(("ok", "ok", "ok", "at_least", "at_most", "unknown"))
        low, high = sorted(rng.uniform(-6, 6) for _ in range(2))
        low = rng.choice((low, low, -0.04, 0.04, 0.06))
        low = low if status in ("ok", "at_least") else NAN
        high = low + 2 if low in (-0.04, 0.04, 0.06) else high
        high = high if status in ("ok", "at_most") else NAN
        return {"status": status, "difference_db": (low + high) / 2, "low_db": low, "high_db": high}

    groups: list[dict[str, Any]] = [
        {"condition": name, "participants": people} | value() for name in names
    ]
    for group in groups:
        if people == 1:
            group["status"] = "one_participant"
        elif math.isfinite(group["threshold_vpp"]):
            group |= {"spread_db": 2.04, "spread_low_db": 0.51, "spread_high_db": 4.49}
            group["printed"] += "; between people 2.0 dB (0.5 to 4.5)"
    each = [
        {"participant": f"S{n}", "condition": name, "trials": 80, "guess_basis": basis} | value()
        for name in names
        for n in range(people)
    ]
    differences = []
    for a, b in itertools.combinations(names, 2) if not linear else ():
        pair = {"condition_a": a, "condition_b": b, "printed": "x, 1.41 times (1.1 to 1.8)"}
        of = [f"S{n}" for n in range(people * shared)]
        differences += [pair | difference() | {"participant": one} for one in of]
        alone = {"status": "one_participant"} if people == 1 else difference()
        differences.append(pair | {"participant": "all"} | alone)
    alarms = [
        rng.randrange(12) + rng.choice((0, 0, 40 * (n == 1))) for n in range(len(names) * asked)
    ]
    blank = pd.DataFrame({"left": alarms, "p": [k / 60 for k in alarms], "presented": 60})
    blank = blank.assign(condition=names[: len(alarms)], participant="all", group_low=NAN)
    at = pd.DataFrame({"level_vpp": [60.0, 95.0, 130.0], "d_prime_difference": [1.0, -1.0, 0.0]})
    at = at.assign(d_prime_difference_low=at["d_prime_difference"] - 0.5, participant="all")
    at = at.assign(d_prime_difference_high=at["d_prime_difference"] + 0.5, felt_a=9, felt_b=9)
    at = at.assign(presented_a=20, presented_b=20)
    pairs = itertools.combinations(names, 2)
    levels = [at.assign(condition_a=a, condition_b=b) for a, b in pairs]
    out = rng.choice((0, 7))
    excluded = [{"participant": "S0", "reason": "practice", "trials": out}] if out else []
    counts = replace(least.counts, trials=400 + out, left_out=out, conditions=len(names))
    swapped = SimpleNamespace(kind="swapped", participant="S0", condition="")
    guess = SimpleNamespace(kind="guessing", participant="S1", condition="c0")
    return replace(
        least,
        groups=rows_of(least.groups, groups),
        thresholds=rows_of(least.thresholds, each),
        differences=rows_of(least.differences, differences),
        blank=blank.assign(low=blank["p"] / 2, high=blank["p"] + 0.1, group_high=NAN),
        excluded=rows_of(least.excluded, excluded),
        counts=replace(counts, participants=people, unread=rng.choice((0, 5))),
        trials=least.trials[: rng.choice((0, 2))].assign(reason=rng.choice(("", "practice"))),
        levels=pd.DataFrame({"condition": names * 2, "level_vpp": 60.0}),
        axis=Axis(x_scale="linear") if linear else Axis(),
        d_prime_differences=pd.concat([least.d_prime_differences, *levels]),
        lost=rng.choice(({}, {"s": ("gone",)})),
        warnings=rng.choice(((), ("a",))),
        detected_any=rng.choice((None, least.levels)),
        doubts=rng.choice(((), (swapped,), (guess,) if people > 1 else ())),
    )


def threshold_codes(analysis: Analysis) -> Iterator[StatementCode]:
    """Yield the codes that the tables of thresholds must have."""
    groups, people = analysis.groups, analysis.thresholds.drop_duplicates("condition")
    rows = groups if groups["participants"].iloc[0] > 1 else people
    told = groups[rows[LIMITS[1:4]].notna().any(axis=1).to_numpy()]
    yield from [C.THRESHOLD] * len(groups) if len(groups) <= 3 else [C.THRESHOLDS_IN_TABLE]
    for one in analysis.doubts:
        number = told["condition"].str.startswith(one.condition).sum()
        yield from [C.RESPONSES_REVERSED if one.kind == "swapped" else C.GUESSING] * number
    if len(told) and people["guess_basis"].iloc[0] == "assumed":
        yield C.GUESS_RATE_ASSUMED
    if told["participants"].eq(1).any():
        yield C.ONE_SESSION
    if (told["spread_db"].notna() & told["participants"].lt(5)).any():
        yield C.FEW_PARTICIPANTS


def difference_codes(analysis: Analysis) -> Iterator[StatementCode]:
    """Yield the codes that the tables of differences and false alarms must have."""
    pairs, apart = [], []
    for names, rows in analysis.differences.groupby(["condition_a", "condition_b"]):
        alone = len(rows) == 2 and rows["status"].iloc[-1] == "one_participant"
        row = rows.iloc[0 if alone else -1]
        pairs.append(row["status"])
        if row["low_db"].round(1) > 0 or row["high_db"].round(1) < 0:
            apart.append(names)
            pairs[-1] = "apart"
    if len(pairs) <= 3:
        known = {"apart": C.DIFFERENCE, "unknown": C.DIFFERENCE_UNKNOWN}
        known["one_participant"] = C.DIFFERENCE_UNKNOWN
        yield from (known.get(one, C.DIFFERENCE_NOT_SHOWN) for one in pairs)
    else:
        yield C.DIFFERENCES_IN_TABLE
    if len(pairs) > 1:
        yield C.SEVERAL_COMPARISONS
    if not pairs and len(analysis.groups) > 1:
        yield C.CONDITIONS_NOT_COMPARED
    counts = dict(zip(analysis.blank["condition"], analysis.blank["left"], strict=True))
    if analysis.detected_any is None:
        yield C.FALSE_ALARMS_NOT_ASKED
        return
    if apart and not counts:
        yield C.CRITERION_UNKNOWN
    elif apart:
        tables = [[[counts[name], 60 - counts[name]] for name in names] for names in apart]
        differ = min(fisher_exact(np.array(table)).pvalue for table in tables) < 0.05
        yield C.FALSE_ALARMS_DIFFER if differ else C.FALSE_ALARM_DIFFERENCE_NOT_SHOWN
        moved = abs(tables[0][0][0] - tables[0][1][0]) > 1
        of_all = analysis.counts.participants > 1
        after = [C.D_PRIME_BY_LEVEL] * of_all if differ else [C.FALSE_ALARM_TENDENCY] * moved
        yield from after if len(apart) == 1 else []
    table = C.FALSE_ALARMS if len(counts) <= 3 else C.FALSE_ALARMS_IN_TABLE
    yield table if counts else C.FALSE_ALARMS_UNKNOWN


def left_out_codes(analysis: Analysis) -> list[StatementCode]:
    """Return the codes that must follow the number of trials that are left out."""
    nobody = len(analysis.trials) and analysis.trials["reason"].ne("").all()
    said = {
        C.LEFT_OUT_BY_MAP: analysis.counts.unread,
        C.PARTICIPANTS_NOT_COUNTED: nobody,
        C.SESSIONS_LOST: analysis.lost,
        C.FUNCTIONS_STEEP: analysis.thresholds["status"].eq("separated").any(),
        C.LAPSES_AT_BOUND: analysis.thresholds["status"].eq("lapse_at_bound").any(),
        C.WARNINGS: analysis.warnings,
    }
    return [C.LEFT_OUT, *(code for code, is_said in said.items() if is_said)]


@pytest.mark.parametrize("seeds", [range(12), pytest.param(range(12, 250), marks=pytest.mark.slow)])
def test_the_codes_of_statements_are_those_of_the_tables(least: Analysis, seeds: range) -> None:
    seen = set()
    for seed in seeds:
        analysis = drawn(least, seed)
        first, second, third = answer(analysis).codes
        assert [*first] == [*threshold_codes(analysis)], seed
        own = C.DIFFERENCE_HAS_OWN_MODEL
        assert [one for one in second if one != own] == [*difference_codes(analysis)], seed
        assert [*third] == left_out_codes(analysis), seed
        seen |= {*first, *second, *third}
    assert len(seeds) < 100 or len(seen) >= 28


@pytest.mark.parametrize("seed", range(12))
def test_the_numbers_of_statements_are_those_of_the_tables(least: Analysis, seed: int) -> None:
    analysis = drawn(least, seed)
    found = answer(analysis)
    said = [(one.code, numbers(one.text)) for each in found.sentences for one in each]
    cells = [numbers(value) for _, value, _ in found.rows]
    of_one = analysis.thresholds.drop_duplicates("condition").set_index("condition")
    thresholds = iter(values for code, values in said if code == C.THRESHOLD)
    for _, group in analysis.groups.iterrows():
        row = of_one.loc[group["condition"]] if group["participants"] == 1 else group
        printed = numbers(str(row["printed"]).partition("; between")[0])
        assert printed in cells
        assert math.isnan(row.get("spread_db", NAN)) or [2.0, 0.5, 4.5] in cells
        if len(analysis.groups) <= 3:
            values = next(thresholds)
            assert {*printed} <= {*values}
            low, high = row["threshold_low_vpp"], row["threshold_high_vpp"]
            whole = math.isfinite(row["threshold_vpp"] + low + high)
            if whole and analysis.axis.is_logarithmic and group["participants"] > 1:
                assert values[-1] == pytest.approx(10 * math.log10(high / low), abs=0.051)
    for _, row in analysis.differences.query("status == 'ok' and participant == 'all'").iterrows():
        at = [round(row[name], 1) for name in ("difference_db", "low_db", "high_db")]
        assert [*at, 1.41, 1.1, 1.8] in cells
    shares = 100 * analysis.blank[["p", "low", "high"]].to_numpy().ravel()
    for code, values in said:
        if code == C.FALSE_ALARMS:
            assert values == pytest.approx(shares.tolist(), abs=0.051)
        if code == C.D_PRIME_BY_LEVEL:
            assert {3, 1} <= {*values}
        if code == C.LEFT_OUT and analysis.counts.left_out and len(analysis.trials):
            assert values[:3] == [7, 407, 1.7]


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
    ("conditions", "people", "kind", "codes"),
    [
        ({"a": 60.0, "b": 95.0}, 3, "none", {C.DIFFERENCE, C.CONDITION_ALWAYS_FIRST}),
        ({"a": 70.0, "b": 70.0}, 2, "none", {C.DIFFERENCE_NOT_SHOWN, C.FALSE_ALARMS}),
        ({"main": 70.0}, 1, "forced", {C.ONE_SESSION, C.FALSE_ALARMS_NOT_ASKED}),
        ({"main": 20.0}, 2, "simulated", {C.THRESHOLD}),
    ],
)
def test_page_terminal_and_summary_begin_with_the_same_answer(
    tmp_path: Path, conditions: dict[str, float], people: int, kind: str, codes: set[StatementCode]
) -> None:
    path = put(tmp_path / "t.csv", study(conditions, people, kind=kind))
    analysis = write_analysis([path], tmp_path / "out", columns=ColumnMap(), figures=False)
    made = files(tmp_path / "out")
    summary = json.loads(made["summary.json"])
    assert codes <= {*itertools.chain(*summary["answer_codes"])}
    assert summary["answer_codes"] == [[*each] for each in answer(analysis).codes]
    page = made["report.html"].decode()
    first = page[page.index("<h1>") : page.index("<h2>")]
    told = re.findall("<p>(.*?)</p>", first.replace("<bdi>", "").replace("</bdi>", ""))
    assert [html.unescape(one) for one in told[:3]] == summary["answer"]
    printed = io.StringIO()
    print_analysis(analysis, printed)
    mark = f"{analysis.mark}. " if kind == "simulated" else ""
    assert bool(analysis.mark) == (kind == "simulated")
    assert " ".join(printed.getvalue().split()).startswith(mark + " ".join(summary["answer"]))


SILENT = LEAST.replace("participant", "participant,condition") + "".join(
    f"{who},{where},left,{level},{said if where == 'felt' else 'timeout'}\n"
    f"{who},{where},none,0,{'none' if where == 'felt' else 'timeout'}\n"
    for who in "ab"
    for where in ("dead", "felt", "mute")
    for level, said in ((60, "none"), (95, "left"), (130, "none"), (200, "left"))
)
LOST_BLANKS = (
    LEAST
    + "2,left,60,timeout\n2,none,0,timeout\n"
    + "".join(f"1,left,{level},{word}\n" for level in (60, 200) for word in ("none", "left"))
)


@pytest.mark.parametrize(
    ("text", "codes", "shown"),
    [
        (SILENT, [C.THRESHOLD, C.CONDITION_NEVER_ANSWERED], ["dead", "mute"]),
        (LOST_BLANKS, [C.FALSE_ALARMS_UNKNOWN, C.PARTICIPANTS_NOT_COUNTED], ["2"]),
        (LEAST + "1,left,60,left\n1,left,95,none\n", [C.FALSE_ALARMS_UNKNOWN], []),
        (LEAST + "1,none,0,none\n", [C.THRESHOLD_MISSING, C.FALSE_ALARMS], []),
    ],
)
def test_what_lacks_has_a_code(
    tmp_path: Path, text: str, codes: list[StatementCode], shown: list[str]
) -> None:
    found = answer(analyse(loaded(tmp_path, text)))
    said = {one.code: one.text for each in found.sentences for one in each}
    assert {*codes} <= {*said}
    assert re.findall("\u2068(.+?)\u2069", said[codes[1 if shown else 0]])[: len(shown)] == shown


@pytest.mark.slow
def test_a_threshold_without_a_reversed_participant_stands_beside_the_groups(
    tmp_path: Path,
) -> None:
    other = {"left": "right", "right": "left"}
    lines = study({"main": 60.0}, 6, kind="forced").splitlines()
    for i, line in enumerate(lines):
        cells = line.split(",")
        if cells[0] == "S2" and cells[3] == "single":
            cells[6] = other[cells[6]]
        if cells[3] == "single" and int(cells[1]) % 2:  # a preference of a side is no guess
            cells[4], cells[6] = other[cells[4]], other[cells[6]]
        lines[i] = ",".join(cells)
    analysis = analyse(loaded(tmp_path, "\n".join(lines) + "\n"))
    found = answer(analysis)
    assert [(one.kind, one.participant) for one in analysis.doubts] == [("swapped", "S2")]
    assert [one.code for one in analysis.warnings] == [WarningCode.RESPONSES_REVERSED]
    assert analysis.unswapped is not None
    alone = analysis.unswapped["threshold_vpp"].iloc[0]
    said = {one.code: one.text for one in found.sentences[0]}
    assert C.RESPONSES_REVERSED in said
    assert numbers(said[C.THRESHOLD_WITHOUT_REVERSED])[0] == pytest.approx(alone, abs=0.06)
    assert analysis.groups["threshold_vpp"].iloc[0] > 1.05 * alone


@pytest.mark.slow
@pytest.mark.parametrize("how", ["misfit", "drift"])
def test_results_without_misfits_and_drifts_are_those_of_the_others(
    tmp_path: Path, how: str
) -> None:
    """As if the map had left these people out."""
    text = study({"a": 60.0, "b": 80.0}, 5)
    counts = ((40, 0), (60, 14), (80, 3), (100, 15), (140, 16))
    odd = "".join(
        f"odd,{10000 * at + (200 * n + level if how == 'drift' else 20 * level + n)},{condition},"
        f"single,left,{level},{'left' if felt else 'none'},false\n"
        for at, condition in enumerate("ab")
        for level, k in counts
        for n in range(16)
        for felt in [n < k if how == "misfit" else level > 100 or (level > 40 and n < 8)]
    )
    analysis, without = (analyse(loaded(tmp_path, one)) for one in (text + odd, text))
    code = {"misfit": WarningCode.FUNCTION_MISFIT, "drift": WarningCode.THRESHOLD_DRIFTS}[how]
    assert code in {one.code for one in analysis.warnings}
    assert analysis.fitting is not None
    assert analysis.fitting.names == ("odd",)
    assert without.fitting is None
    values = [value for name, value, _ in answer(analysis).rows if "odd" in name]
    groups = without.groups["printed"].str.partition("; between")[0]
    assert values[:2] == groups.tolist()
    assert numbers(values[2])[0] == round(without.differences.iloc[-1]["difference_db"], 1)


Pairs = list[tuple[int, int]]


DIFFERENCE = dict(
    zip(
        ("condition_a", "condition_b", "participant", "status"),
        ("a", "b", "all", "ok"),
        strict=True,
    )
)


def with_alarms(least: Analysis, alarms: Pairs, blanks: Pairs, high_b: float = 0.6) -> Analysis:
    """Return an analysis of conditions a, with the higher threshold, and b with false alarms."""
    names, tables = [f"{i}" for i in range(len(alarms))], []
    for at, high in enumerate((0.6, high_b)):
        k, n = ([one[at] for one in table] for table in (alarms, blanks))
        of_all = {"condition": "ab"[at], "participant": [*names, "all"], "presented": [*n, sum(n)]}
        shares = [*np.divide(k, n), sum(k) / sum(n)]
        tables.append(pd.DataFrame(of_all | {"p": shares, "group_high": high}))
    apart = np.diff(np.array(alarms) / np.array(blanks))[:, 0]
    limits = ttest_1samp(apart, 0).confidence_interval()
    ends = zip(("", "_low", "_high"), (apart.mean(), *limits), strict=True)
    row = DIFFERENCE | {"difference_db": -3.0, "low_db": -5.0, "high_db": -1.0, "printed": ""}
    row |= {f"false_alarm_difference{end}": value for end, value in ends}
    return replace(
        least,
        counts=replace(least.counts, conditions=2),
        blank=pd.concat(tables).assign(low=0.01, high=0.6, group_low=0.01),
        detected_any=least.levels,
        differences=rows_of(
            least.differences, [*(row | {"participant": one} for one in names), row]
        ),
    )


APART, TENDENCY = C.FALSE_ALARM_DIFFERENCE_NOT_SHOWN, C.FALSE_ALARM_TENDENCY
EQUAL = C.EQUAL_COUNTS_UNEQUAL_INTERVALS
ALIKE = [(1, 1)] * 5
THREE = [(1, 0), (1, 0), (0, 2)]


@pytest.mark.parametrize(
    ("alarms", "blanks", "high_b", "codes", "shown"),
    [
        # One participant alone differs: that is an exact test's difference, not one of people.
        ([(0, 10), *ALIKE], 20, 0.6, [APART, TENDENCY], [8.3, -13.1, 29.8]),
        ([(0, 10), *ALIKE[:3]], 20, 0.6, [C.FALSE_ALARMS_DIFFER], [0.012]),
        ([(1, 0), (0, 1), *ALIKE[:4]], 20, 0.6, [APART], [0.0, -3.3, 3.3]),
        # Equally many false alarms, of other numbers of blanks; one answer more; two more.
        ([(1, 1), (0, 1), (1, 0), *ALIKE[:3]], 19, 0.6, [APART], []),
        ([(1, 2), *ALIKE], 20, 0.6, [APART], []),
        ([(1, 3), *ALIKE], 20, 0.6, [APART, TENDENCY], []),
        (THREE, 20, 0.7, [EQUAL], []),
        (THREE, 20, 0.6, [], []),
        ([*THREE[:2], (0, 3)], 20, 0.7, [], []),
    ],
)
def test_whether_false_alarms_differ_rests_on_people_or_on_a_test(
    least: Analysis, alarms: Pairs, blanks: int, high_b: float, codes: list[str], shown: list[float]
) -> None:
    each = [(20, blanks), *[(20, 20)] * (len(alarms) - 1)]
    sentences = answer(with_alarms(least, alarms, each, high_b)).sentences[1]
    asked = {C.FALSE_ALARMS_DIFFER, APART, TENDENCY} if len(alarms) > 3 else {EQUAL}
    found = [one for one in sentences if one.code in asked]
    assert [one.code for one in found] == codes
    if shown:
        assert [one for one in numbers(found[0].text) if one != 95][: len(shown)] == shown
