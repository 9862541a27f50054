"""The report of an analysis: one HTML page that needs nothing else, for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from analysis.axis import alone, shortest
from analysis.definitions import DEFINITIONS, TOTAL
from analysis.results.figures.confusion import stimulus
from analysis.results.markup import element, figure, foreign, page, table
from analysis.results.numbers import plates
from analysis.results.rows import (
    CONTROL_HEAD,
    PAGE,
    blank_cells,
    both_cells,
    choice_rows,
    control_cells,
    count_rows,
    forced_choice,
    left_out_rows,
    level_head,
    level_rows,
    not_compared_words,
    p_text,
    population_text,
)
from analysis.results.summary import devices, versions
from experiment.terms.record import RESPONSES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from xml.etree.ElementTree import Element

    import pandas as pd

    from analysis.groups.population import PopulationThreshold
    from analysis.results.figures.figures import Picture
    from analysis.results.markup import Content
    from analysis.results.tables import Analysis


_TITLE = "Detection of vibrotactile stimuli"
_CENSORED = (
    "A threshold outside the tested levels is told as below or above them, never as a number; so "
    "is a limit. Everybody takes part in the group's threshold, those below and above included. "
    "A participant's interval is for that session; what another day brings needs a second one."
)


def report_html(analysis: Analysis, pictures: Iterable[Picture]) -> str:
    """Write the report.

    A page without script, link or request; the same for the same data.
    """
    drawn = {one.name: figure(one.svg, one.alt) for one in pictures}
    body = [
        *_opening(analysis),
        *_warnings(analysis),
        *_counted(analysis),
        *_detection(analysis, drawn),
        *_thresholds(analysis, drawn),
        *_answers(analysis, drawn),
        *_reaction_times(analysis, drawn),
        *_both_and_blank(analysis),
        *_control(analysis),
        *plates(analysis),
        *_contact(analysis),
        *_definitions(analysis),
        *_sources(analysis),
    ]
    return page(_TITLE, body)


def _opening(analysis: Analysis) -> Iterator[Element]:
    counts = analysis.counts
    yield element("h1", _TITLE)
    if analysis.mark:
        yield element("p", f"{analysis.mark}.", class_="mark")
    kinds = ", ".join(f"{kind} {number}" for kind, number in devices(analysis.trials).items())
    if kinds:
        yield element("p", f"Trials by kind of device: {kinds}.")
    if analysis.not_compared:
        yield element("p", foreign(f"{not_compared_words(analysis.not_compared)}."))
    conditions = sorted({*analysis.trials["condition"], *analysis.levels["condition"]})
    named: list[Content] = []
    for name in conditions:
        named += [", " if named else " (", foreign(name)]
    yield element(
        "p",
        f"{counts.trials} trials of {_number(counts.participants, 'participant')} in "
        f"{_number(counts.sessions, 'session')}, {_number(counts.conditions, 'condition')}",
        *named,
        ").",
    )


def _number(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _warnings(analysis: Analysis) -> Iterator[Element]:
    yield element("h2", "Warnings")
    if analysis.warnings:
        yield element("ul", *(element("li", foreign(text)) for text in analysis.warnings))
    else:
        yield element("p", "None.")


def _counted(analysis: Analysis) -> Iterator[Element]:
    yield element("h2", "What was counted and what was left out")
    yield element(
        "p",
        "A trial counts where its status is ok, it was not anticipated, its masking noise was not "
        "known to be silent, and it is of one of the three kinds below. trials_clean.csv has every "
        "trial with the reason why it was left out.",
    )
    yield table("Trials", ["What", "Trials"], count_rows(analysis.counts, PAGE))
    if len(analysis.excluded):
        header = ["Reason", "Trials", "Participants"]
        yield table("Left out", header, _left_out(analysis.excluded), ["Participants"])


def _left_out(excluded: pd.DataFrame) -> Iterator[list[Content]]:
    for reason, trials, people in left_out_rows(excluded):
        each: list[Content] = []
        for name, number in people:
            each += [", " if each else "", foreign(name), f" {number}"]
        yield [reason, str(trials), element("span", *each)]


def _detection(analysis: Analysis, drawn: dict[str, Element]) -> Iterator[Element]:
    yield element("h2", "Detection by level")
    if analysis.levels.empty:
        yield element("p", "No trial with a single stimulus counts.")
        return
    if analysis.detected_any is None:
        yield element("p", forced_choice("the detection probability"))
    yield from _shown(drawn, "detection")
    levels = level_rows(analysis, PAGE)
    for condition, rows in levels.of_condition.items():
        yield table(f"Detection by level{_where(analysis, condition)}", levels.header, rows)


def _thresholds(analysis: Analysis, drawn: dict[str, Element]) -> Iterator[Element]:
    if analysis.thresholds.empty:
        return
    yield element("h2", "Thresholds")
    yield element("p", _CENSORED)
    groups: list[list[Content]] = [
        [
            foreign(str(row["condition"])),
            str(row["participants"]),
            foreign(str(row["printed"])),
            str(row["below"]),
            str(row["above"]),
        ]
        for _, row in analysis.groups.iterrows()
    ]
    header = ["Condition", "Participants", "Threshold", "Below the levels", "Above the levels"]
    yield table("Thresholds of the group", header, groups, ["Threshold"])
    yield from _differences(analysis)
    if analysis.population:
        header = ["Condition", "Participants", "Threshold (95 %)", "Between people", "Remark"]
        fitted = [_population(one, analysis.axis.unit) for one in analysis.population]
        caption = "The participants as one population: logistic, a random intercept each"
        yield table(caption, header, fitted, ["Remark"])
    yield from _shown(drawn, "thresholds")
    header = ["Participant", "Threshold (95 %)", "Status", "Width", "Lapses", "Misfit p",
              "Guess rate", "Guess rate from", "If guess rate 0", "If guess rate 1/3",
              "Levels", "Trials"]  # fmt: skip
    for condition, rows in analysis.thresholds.groupby("condition"):
        caption = f"Thresholds of participants{_where(analysis, condition)}"
        cells = [_threshold(row, analysis.axis.unit) for _, row in rows.iterrows()]
        yield table(caption, header, cells, ["Threshold (95 %)", "Status", "Guess rate from"])


def _differences(analysis: Analysis) -> Iterator[Element]:
    for (a, b), rows in analysis.differences.groupby(["condition_a", "condition_b"], sort=False):
        cells: list[list[Content]] = [
            ["Group" if row["participant"] == TOTAL else foreign(str(row["participant"])),
             str(row["printed"])]
            for _, row in rows.iterrows()
        ]  # fmt: skip
        caption = f"Threshold in condition {b} against {a}"
        yield table(caption, ["Participant", "Difference (95 %)"], cells, ["Difference (95 %)"])


def _population(one: PopulationThreshold, unit: str) -> list[Content]:
    return [
        foreign(one.condition),
        str(one.participants),
        population_text(one, unit) or "n/a",
        p_text(one.between_sd),
        one.reason,
    ]


def _threshold(row: pd.Series[Any], unit: str) -> list[Content]:
    return [
        foreign(row["participant"]),
        row["printed"],
        row["status"].replace("_", " "),
        *(p_text(row[name]) for name in ("sigma", "lapse_rate", "deviance_p", "guess_rate")),
        row["guess_basis"],
        *(_level_text(row[f"threshold_guess_{name}_vpp"], unit) for name in ("0", "third")),
        str(row["levels"]),
        str(row["trials"]),
    ]


def _answers(analysis: Analysis, drawn: dict[str, Element]) -> Iterator[Element]:
    if analysis.confusion.empty:
        return
    yield element("h2", "Answers")
    yield from _shown(drawn, "confusion")
    header = ["Stimulus", *RESPONSES, "Presented"]
    for condition, rows in analysis.confusion.groupby("condition"):
        cells = [
            [stimulus(row["kind"], row["side"]), *(str(row[name]) for name in RESPONSES),
             str(row["presented"])]
            for _, row in rows.iterrows()
        ]  # fmt: skip
        yield table(f"Answers to each stimulus{_where(analysis, condition)}", header, cells)
    header = ["Quantity", "Value", "p", "Remark"]
    for one in analysis.choice:
        if one.participant == TOTAL:
            caption = f"What the answers tell{_where(analysis, one.condition)}"
            yield table(caption, header, choice_rows(one), ["Value", "Remark"])
    yield element("p", "The same of every participant stands in summary.json under choice.")


def _reaction_times(analysis: Analysis, drawn: dict[str, Element]) -> Iterator[Element]:
    if not analysis.reaction_times["n"].gt(0).any():
        return
    yield element("h2", "Reaction times")
    yield element("p", "Of correct answers to single stimuli; time-outs have none.")
    yield from _shown(drawn, "reaction_times")
    header = [
        f"{level_head(analysis, PAGE)}, finger",
        "Answers",
        "Median (s)",
        "10 % (s)",
        "90 % (s)",
    ]
    for condition, rows in analysis.reaction_times.groupby("condition"):
        cells = [
            [f"{shortest(row['level_vpp'])} {analysis.axis.unit}, {row['side']}", str(row["n"]),
             *(p_text(row[name]) for name in ("median", "p10", "p90"))]
            for _, row in rows.iterrows()
        ]  # fmt: skip
        yield table(f"Reaction times{_where(analysis, condition)}", header, cells)


def _both_and_blank(analysis: Analysis) -> Iterator[Element]:
    of_ci = f"95 % {analysis.ci.title()}"
    if len(analysis.both):
        yield element("h2", "Both-finger trials")
        header = ["Participant", "Answered both / presented", "Share", of_ci, "Left only",
                  "Right only"]  # fmt: skip
        rows = [[*_who(row), *both_cells(row, PAGE)] for _, row in analysis.both.iterrows()]
        yield table(f"Both-finger trials; {_TOTALS}", header, rows)
    if len(analysis.blank):
        yield element("h2", "Blank trials")
        header = ["Participant", "Presented", "Left", "Right", "Both", "False alarms", of_ci]
        rows = [[*_who(row), *blank_cells(row, PAGE)] for _, row in analysis.blank.iterrows()]
        yield table(f"Blank trials; {_TOTALS}", header, rows)


def _control(analysis: Analysis) -> Iterator[Element]:
    if analysis.control.empty:
        return
    yield element("h2", "Fingers off the plate")
    yield element(
        "p",
        "Audibility and control trials, with the noise on and no finger on the plate; they are in "
        "no other number here. More answers with the driven side than with the other say that "
        "the plate is heard or seen.",
    )
    rows = [[*_who(row), *control_cells(row)] for _, row in analysis.control.iterrows()]
    yield table("Answers with the fingers off the plate", CONTROL_HEAD, rows)


_TOTALS = "the interval of a row 'all' ignores that participants differ"


def _who(row: pd.Series[Any]) -> list[Content]:
    """Name a participant, and the condition where there are several."""
    name = foreign(row["participant"])
    if "condition" not in row.index:
        return [name]
    return [element("span", name, ", ", foreign(row["condition"]))]


def _contact(analysis: Analysis) -> Iterator[Element]:
    """Tell what the studies state of the fingers on the plate; where it differs, whose it is."""
    yield element("h2", "Force and contact of the fingers")
    if len(analysis.contacts) > 1:
        told = (f"{words}: {', '.join(which)}" for words, which in analysis.contacts.items())
        yield element("ul", *(element("li", foreign(one)) for one in told))
    else:
        yield element("p", foreign(next(iter(analysis.contacts), "not stated")), ".")


def _definitions(analysis: Analysis) -> Iterator[Element]:
    yield element("h2", "Definitions")
    yield element(
        "p",
        f"Intervals of one cell: {analysis.ci}. What is drawn at random has the seed "
        f"{analysis.seed}. Formulas and sources: docs/statistics.md of tactstrip.",
    )
    terms = [
        one
        for words, meaning in DEFINITIONS.items()
        for one in (element("dt", words), element("dd", meaning))
    ]
    yield element("dl", *terms)


def _sources(analysis: Analysis) -> Iterator[Element]:
    yield element("h2", "Inputs and versions")
    rows = [[foreign(one.name), element("code", one.sha256)] for one in analysis.inputs]
    yield table("Files that were read", ["File", "sha256"], rows, ["sha256"])
    told = [[name, number] for name, number in versions().items()]
    yield table("Versions", ["Package", "Version"], told, ["Version"])


def _shown(drawn: dict[str, Element], name: str) -> Iterator[Element]:
    if name in drawn:
        yield drawn[name]


def _where(analysis: Analysis, condition: object) -> str:
    return f", condition {condition}" if analysis.counts.conditions > 1 else ""


def _level_text(value: float, unit: str) -> str:
    return "n/a" if math.isnan(value) else alone(value, unit)
