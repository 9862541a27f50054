"""The report of an analysis: one HTML page that needs nothing else, for people."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from analysis.axis import shortest
from analysis.definitions import (
    BLANK_INTERVALS,
    BOTH_INTERVALS,
    CENSORED,
    COUNTING,
    COUNTING_ONE_PLACE,
    CRITERION,
    D_PRIME,
    D_PRIME_APART,
    FITTED_GUESSES,
    FITTED_RATES,
    GROUP_COVERS,
    LAPSES,
    OFF_THE_PLATE,
    POPULATION,
    TOTAL,
    VARY,
)
from analysis.results.answer import ANSWER_HEAD, answer
from analysis.results.compared import d_prime_level_rows, own_model_words
from analysis.results.figures.confusion import stimulus
from analysis.results.methods.left_out import REASONS
from analysis.results.methods.looked import EACH, each_participant, looked_words
from analysis.results.methods.misfit import misfit_p_text
from analysis.results.methods.paragraphs import counts_told, methods_of
from analysis.results.methods.task import is_yes_no, one_side_words
from analysis.results.protocol import (
    Section,
    Table,
    folded_tables,
    planned,
    protocol_section,
)
from analysis.results.rows import (
    D_PRIME_HEAD,
    HANDS_OFF_HEAD,
    PAGE,
    blank_cells,
    both_cells,
    choice_rows,
    count_rows,
    count_text,
    d_prime_rows,
    difference_rows,
    forced_choice,
    hands_off_cells,
    level_head,
    level_rows,
    level_text,
    not_compared_words,
    p_text,
    population_cells,
    width_text,
)
from analysis.results.summary import definitions_of, devices
from experiment.rows import NOT_AVAILABLE, RESPONSES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pandas as pd

    from analysis.axis import Axis
    from analysis.results.figures.figures import Picture
    from analysis.results.tables import Analysis


_TITLE: Final = "Detection of vibrotactile stimuli"
_MOST_ROWS: Final = 16
"""A longer table is folded."""
_LONGEST: Final = 30
"""Letters of a cell that are not wrapped."""


def report_html(analysis: Analysis, pictures: Iterable[Picture]) -> str:
    """Write the report.

    A page without script, link or request; the same for the same data.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    pages = Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["base64"] = _base64
    style = _text("report.css")
    digest = _base64(hashlib.sha256(style.encode()).digest())
    found, plans, kinds = answer(analysis), planned(analysis), devices(analysis.trials)
    drawn = list(pictures)
    # Pages of many people come after what is told of all of them.
    several = [one for one in drawn if one.figure == "participants"]
    of_people = several if len(several) > 1 else []
    unit = "V: volts peak-to-peak; " if analysis.axis.is_vpp else ""
    return pages.get_template("report.html.jinja").render(
        analysis=analysis,
        title=_TITLE,
        style=style,
        policy=f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; "
        "base-uri 'none'; form-action 'none'",
        answer=found,
        answer_table=Table(
            caption=f"The answer ({unit}threshold: half-way between {_chance(analysis)} and 1 - "
            "lapse rate)",
            header=ANSWER_HEAD,
            rows=found.rows,
            texts=ANSWER_HEAD[1:],
        ),
        counts_told=counts_told(analysis),
        kinds=[f"{kind} {number}" for kind, number in kinds.items()]
        if {*kinds} - {NOT_AVAILABLE}
        else [],
        conditions=sorted({*analysis.trials["condition"].unique(), *analysis.levels["condition"]}),
        not_compared=not_compared_words(analysis.not_compared) if analysis.not_compared else "",
        pictures=[one for one in drawn if one not in of_people],
        of_people=of_people,
        sections=[
            *_thresholds(analysis),
            _detection(analysis),
            _counted(analysis),
            protocol_section(analysis, plans),
        ],
        more_sections=[
            *_sensitivity(analysis),
            *_answers(analysis),
            *_reaction_times(analysis),
            *_both_and_blank(analysis),
        ],
        looked=" ".join(filter(None, (looked_words(analysis), _EACH * len(analysis.trials[:1])))),
        methods=methods_of(analysis, plans, drawn=bool(drawn)),
        definitions=definitions_of(analysis),
        folded=[*folded_tables(analysis, plans)],
        most_rows=_MOST_ROWS,
        longest=_LONGEST,
    )


_EACH: Final = f'The table "{EACH}" shows them, but for the last.'


def _text(name: str) -> str:
    return files("analysis.results").joinpath(name).read_text(encoding="utf-8")


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _counted(analysis: Analysis) -> Section:
    rows = count_rows(analysis, PAGE)
    tables = [Table(caption="Trials", header=["What", "Trials"], rows=rows)]
    excluded = analysis.excluded
    if len(excluded):
        counts = excluded.pivot_table(
            index="participant", columns="reason", values="trials", aggfunc="sum", fill_value=0
        )
        reasons = sorted(counts.columns, key=[*REASONS, *counts.columns].index)
        each = [
            [str(name), *(str(row[reason]) for reason in reasons), str(row.sum())]
            for name, row in counts.iterrows()
        ]
        total = [TOTAL, *(str(counts[reason].sum()) for reason in reasons)]
        rows = [*each, [*total, str(counts.to_numpy().sum())]]
        header = ["Participant", *(REASONS.get(one, one) for one in reasons), "Together"]
        tables.append(Table(caption="Trials left out, and why", header=header, rows=rows))
    title = "What was counted and what was left out"
    told = COUNTING_ONE_PLACE if analysis.one_place else COUNTING
    return Section(title=title, texts=[told], tables=tables)


def _detection(analysis: Analysis) -> Section:
    title = "Detection by level"
    if analysis.levels.empty:
        return Section(title=title, texts=["No trial with a single stimulus counts."])
    forced = analysis.detected_any is None
    levels = level_rows(analysis, PAGE)
    texts = [forced_choice(analysis, "the detection probability")] if forced else []
    several = bool(analysis.levels["group_low"].notna().any())
    return Section(
        title=title,
        texts=[*texts, GROUP_COVERS] if several else texts,
        tables=[
            Table(caption=f"{title}{_where(analysis, name)}", header=levels.header, rows=rows)
            for name, rows in levels.of_condition.items()
        ],
    )


def _thresholds(analysis: Analysis) -> Iterator[Section]:
    if analysis.thresholds.empty:
        return
    chance = _chance(analysis).capitalize()
    words = [
        "Threshold",
        "Threshold (95 %)",
        "Status",
        f"{chance} from",
        "Difference (95 %)",
        "Remark",
    ]
    tables = []
    if analysis.groups["participants"].gt(1).any():
        header = ["Condition", "Participants", "Threshold", "Below the levels", "Above the levels"]
        cells = [
            [str(row[name]) for name in ("condition", "participants", "printed")]
            + [count_text(row[name]) for name in ("below", "above")]
            for _, row in analysis.groups.iterrows()
        ]
        caption = "Thresholds of the group"
        tables.append(Table(caption=caption, header=header, rows=cells, texts=words))
    tables += [
        Table(caption=caption, header=header, rows=cells, texts=[*words, "First"])
        for caption, header, cells in difference_rows(analysis, PAGE)
    ]
    if own := own_model_words(analysis):
        tables[-1] = replace(tables[-1], note=f"{own[0].upper()}{own[1:]}.")
    if analysis.population:
        caption = "The participants as one population: logistic, a random intercept each"
        header = ["Condition", "Participants", "Threshold (95 %)", "Between people (SD)", "Remark"]
        cells = [population_cells(one, analysis.axis) for one in analysis.population]
        tables.append(Table(caption=caption, header=header, rows=cells, texts=words))
    width = analysis.axis.width_unit
    # What another rate would give is of no use where blank trials tell the rate.
    zero = "" if analysis.thresholds["guess_basis"].eq("blanks").all() else f"If {chance.lower()} 0"
    third = "" if is_yes_no(analysis) or not zero else f"If {chance.lower()} 1/3"
    header = [
        "Participant",
        "Threshold (95 %)",
        "Status",
        f"Width ({width})",
        "Lapse rate",
        "Misfit p",
        chance,
        f"{chance} from",
        zero,
        third,
        "If answers vary 2.8 times",
        "Levels",
        "Trials",
    ]
    for condition, rows in analysis.thresholds.groupby("condition"):
        caption = f"Thresholds of participants{_where(analysis, condition)}"
        cells = [_threshold(row, analysis.axis) for _, row in rows.iterrows()]
        # A column in which nobody has a value says nothing.
        told = [i for i, head in enumerate(header) if head and {row[i] for row in cells} != {"n/a"}]
        cells = [[row[i] for i in told] for row in cells]
        heads = [header[i] for i in told]
        tables.append(Table(caption=caption, header=heads, rows=cells, texts=words))
    tables[-1] = replace(tables[-1], note=" ".join(_rates(analysis)))
    varied = [VARY] if analysis.thresholds["varied_printed"].notna().any() else []
    second = [POPULATION] if analysis.population else []
    compared = [CRITERION] if len(analysis.differences) and len(analysis.sensitivity) else []
    yield Section(
        title="Thresholds",
        texts=[CENSORED, *varied, *compared, *second],
        tables=tables,
    )


def _chance(analysis: Analysis) -> str:
    return "false-alarm rate" if is_yes_no(analysis) else "guess rate"


def _rates(analysis: Analysis) -> Iterator[str]:
    if analysis.thresholds["guess_basis"].isin(["blanks", "few blanks"]).any():
        yield FITTED_RATES if is_yes_no(analysis) or analysis.one_side else FITTED_GUESSES
    if analysis.thresholds["status"].eq("lapse_at_bound").any():
        yield LAPSES


def _sensitivity(analysis: Analysis) -> Iterator[Section]:
    tables = [
        Table(
            caption=f"Sensitivity d' by level{_where(analysis, condition)}",
            header=D_PRIME_HEAD,
            rows=rows,
            texts=[D_PRIME_HEAD[1], D_PRIME_HEAD[4]],
        )
        for condition, rows in d_prime_rows(analysis, PAGE)
    ]
    apart = [
        Table(caption=caption, header=header, rows=rows, texts=[header[-1]])
        for caption, header, rows in d_prime_level_rows(analysis)
    ]
    if tables:
        texts = [D_PRIME, *([D_PRIME_APART] if apart else [])]
        yield Section(title="Sensitivity", texts=texts, tables=[*apart, *tables])


def _threshold(row: pd.Series[Any], axis: Axis) -> list[str]:
    return [
        str(row["participant"]),
        row["printed"],
        row["status"].replace("_", " "),
        width_text(row["sigma"], axis),
        p_text(row["lapse_rate"]),
        misfit_p_text(row["deviance_p"]),
        p_text(row["guess_rate"]),
        row["guess_basis"],
        *(level_text(row[f"threshold_guess_{name}_vpp"], axis.unit) for name in ("0", "third")),
        row["varied_printed"] if isinstance(row["varied_printed"], str) else "n/a",
        str(row["levels"]),
        str(row["trials"]),
    ]


def _answers(analysis: Analysis) -> Iterator[Section]:
    if analysis.confusion.empty:
        return
    tables, side = [], analysis.one_side
    unused = {"left", "right", "both"} - {side} if side else set()
    named = [name for name in RESPONSES if name not in unused]
    place, heads = analysis.one_place, named
    if place:
        heads = [{place: "felt", "none": "not felt"}.get(name, name) for name in named]
    header = ["Stimulus", *heads, "Presented"]
    for condition, rows in analysis.confusion.groupby("condition"):
        cells = [
            [
                "stimulus" if place == row["side"] else stimulus(row["kind"], row["side"]),
                *(str(row[name]) for name in named),
                str(row["presented"]),
            ]
            for _, row in rows.iterrows()
        ]
        caption = f"Answers to each stimulus{_where(analysis, condition)}"
        tables.append(Table(caption=caption, header=header, rows=cells))
    header = ["Quantity", "Value", "p", "Remark"]
    for one in analysis.choice:
        if one.participant == TOTAL:
            caption = f"What the answers tell{_where(analysis, one.condition)}"
            cells = [*choice_rows(one, sides=not side)]
            words = ["Value", "Remark"]
            tables.append(Table(caption=caption, header=header, rows=cells, texts=words))
    told = [
        "What the answers of each tell stands in summary.json under choice.",
        "Where something comes again, p is two-sided, by exchanging answers among equal stimuli.",
        "No p here is corrected for the number of them.",
    ]
    if side and not place:
        told.append(f"{one_side_words(side)}, also the figure of answers to each stimulus.")
    header, cells = each_participant(analysis)
    tables.append(Table(caption=EACH, header=header, rows=cells))
    yield Section(title="Answers", texts=told, tables=tables)


def _reaction_times(analysis: Analysis) -> Iterator[Section]:
    if not analysis.reaction_times["n"].gt(0).any():
        return
    head, named = level_head(analysis, PAGE), "{} {}"
    if not analysis.one_place:
        head, named = f"{head}, side", "{} {}, {}"
    header = [head, "Answers", "Median (s)", "10 % (s)", "90 % (s)"]
    tables = [
        Table(
            caption=f"Reaction times{_where(analysis, condition)}",
            header=header,
            rows=[
                [
                    named.format(shortest(row["level_vpp"]), analysis.axis.unit, row["side"]),
                    str(row["n"]),
                    *(p_text(row[name]) for name in ("median", "p10", "p90")),
                ]
                for _, row in rows.iterrows()
            ],
        )
        for condition, rows in analysis.reaction_times.groupby("condition")
    ]
    told = "Of correct answers to single stimuli; time-outs have none."
    yield Section(title="Reaction times", texts=[told], tables=tables)


_TOTALS: Final = "{}; the {} interval of a row 'all' ignores that participants differ"


def _both_and_blank(analysis: Analysis) -> Iterator[Section]:
    of_ci, side = f"95 % {analysis.ci.title()}", analysis.one_side
    sides = ["Felt"] if side else ["Left", "Right", "Both"]
    for title, table, cells, header in (
        (
            "Both-finger trials",
            analysis.both,
            lambda row: both_cells(row, PAGE),
            ["Answered both / presented", "Share", of_ci, "Group, 95 %", "Left only", "Right only"],
        ),
        (
            "Blank trials",
            analysis.blank,
            lambda row: blank_cells(row, PAGE, side),
            ["Presented", *sides, "False alarms", of_ci, "Group, 95 %"],
        ),
        ("Fingers off the plate", analysis.hands_off, hands_off_cells, HANDS_OFF_HEAD[1:]),
    ):
        if len(table):
            is_hands_off = table is analysis.hands_off
            caption = title if is_hands_off else _TOTALS.format(title, analysis.ci.title())
            rows = [[_who(row), *cells(row)] for _, row in table.iterrows()]
            told = not is_hands_off and table["group_low"].notna().any()
            words = BOTH_INTERVALS if table is analysis.both else BLANK_INTERVALS
            note = words.format(analysis.ci.title()) if told else ""
            made = Table(caption=caption, header=["Participant", *header], rows=rows, note=note)
            texts = [OFF_THE_PLATE] if is_hands_off else []
            yield Section(title=title, texts=texts, tables=[made])


def _who(row: pd.Series[Any]) -> str:
    """Name a participant, and the condition where there are several."""
    return f"{row['participant']}{', ' + row['condition'] if 'condition' in row.index else ''}"


def _where(analysis: Analysis, condition: object) -> str:
    return f", condition {condition}" if analysis.counts.conditions > 1 else ""
