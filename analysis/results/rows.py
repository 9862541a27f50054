"""What the rows of a reported table tell, once for terminal, page and summary."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.answers.counting import AFTER, BEFORE, HANDS_OFF_COLUMNS
from analysis.axis import Axis, alone, half_up, rounded, shortest, with_limits
from analysis.definitions import TOTAL
from analysis.reading.foreign.columns import FORCED
from analysis.reading.text import named
from analysis.thresholds.people import FORCED_CHOICE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import pandas as pd

    from analysis.answers.choice import Choices
    from analysis.answers.sensitivity import Sensitivity, Share
    from analysis.answers.serial import SerialEffect
    from analysis.groups.population import PopulationThreshold
    from analysis.results.tables import Analysis


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How a place that is read writes counts of counts and limits; whether it has room for words.

    >>> TERMINAL.share(3, 4), PAGE.limits(0.25, 0.75), PAGE.limits(math.nan, math.nan)
    ('3/4', '0.250 to 0.750', 'n/a')
    """

    of: str
    to: str
    roomy: bool

    def share(self, count: int, of: int) -> str:
        """Return how many of how many."""
        return f"{count}{self.of}{of}"

    def limits(self, low: float, high: float) -> str:
        """Return an interval, of which there may be none."""
        return "n/a" if math.isnan(low) else f"{p_text(low)}{self.to}{p_text(high)}"


TERMINAL: Final = Style(of="/", to="-", roomy=False)
PAGE: Final = Style(of=" / ", to=" to ", roomy=True)


def p_text(value: float | None) -> str:
    """Return a value to three decimals, or n/a.

    >>> p_text(0.25), p_text(math.nan), p_text(None)
    ('0.250', 'n/a', 'n/a')
    """
    return "n/a" if value is None or math.isnan(value) else half_up(value, 3)


def count_text(number: float) -> str:
    """Return a number without decimals, or n/a."""
    return "n/a" if math.isnan(number) else f"{number:.0f}"


def level_text(value: float, unit: str) -> str:
    """Return a level without limits, or n/a."""
    return "n/a" if math.isnan(value) else alone(value, unit)


def width_text(sigma: float, axis: Axis) -> str:
    """Return a width: of a logarithm to three decimals, of levels to three digits.

    >>> width_text(0.1234, Axis()), width_text(0.000123, Axis(x_scale="linear", unit="mm"))
    ('0.123', '0.000123')
    """
    return p_text(sigma) if not axis.signed or math.isnan(sigma) else rounded(sigma, sigma / 10)


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReportColumn:
    """A column of the table of levels: its heads on terminal and page, and its cell in a row."""

    short: str
    long: str
    cell: Callable[[pd.Series[Any], Style], str]


def _named(name: str, write: Callable[[float], str]) -> Callable[[pd.Series[Any], Style], str]:
    return lambda row, _: write(row[name])


# The level itself stands in front of these, because its head and cell have the axis's unit.
_LEVELS = (
    _ReportColumn(
        short="k/n",
        long="Detected / presented",
        cell=lambda row, style: style.share(row["detected"], row["presented"]),
    ),
    _ReportColumn(short="P", long="Participants", cell=_named("people", str)),
    _ReportColumn(short="min", long="Least", cell=_named("p_min", p_text)),
    _ReportColumn(short="mean", long="Mean", cell=_named("p_mean", p_text)),
    _ReportColumn(short="max", long="Largest", cell=_named("p_max", p_text)),
    _ReportColumn(
        short="group 95 %",
        long="Group, 95 %",
        cell=lambda row, style: style.limits(row["group_low"], row["group_high"]),
    ),
    _ReportColumn(short="both", long="Both", cell=_named("over_report", count_text)),
    _ReportColumn(short="other", long="Other side", cell=_named("mislocalised", count_text)),
    _ReportColumn(short="late", long="Time-outs", cell=_named("timeouts", count_text)),
    _ReportColumn(short="p_ans", long="Of answered", cell=_named("p_answered", p_text)),
)
_FELT = _ReportColumn(short="any", long="Felt at all", cell=_named("detected_any", str))
"""Only where "none" could be answered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelRows:
    """The table of levels as text: its header, and the rows of each condition."""

    header: list[str]
    of_condition: dict[str, list[list[str]]]


def levels_told(analysis: Analysis) -> pd.DataFrame:
    """Return the levels with ``detected_any``, NaN where "none" could not be answered."""
    felt = analysis.detected_any
    return analysis.levels.assign(detected_any=math.nan if felt is None else felt["detected_any"])


def level_rows(analysis: Analysis, style: Style) -> LevelRows:
    """Write the table of levels for one place that is read."""
    people = analysis.participants.groupby(["condition", "level_vpp"]).size()
    table = levels_told(analysis).assign(people=people.to_numpy())
    columns = [*_LEVELS] if analysis.detected_any is None else [*_LEVELS, _FELT]
    if analysis.one_side:
        columns = [one for one in _LEVELS if one.short not in ("both", "other")]
    unit = f" {analysis.axis.unit}" if style.roomy else ""
    return LevelRows(
        header=[
            level_head(analysis, style),
            *(c.long if style.roomy else c.short for c in columns),
        ],
        of_condition={
            str(condition): [
                [f"{shortest(row['level_vpp'])}{unit}", *(c.cell(row, style) for c in columns)]
                for _, row in levels.iterrows()
            ]
            for condition, levels in table.groupby("condition")
        },
    )


def none_in_part(analysis: Analysis) -> bool:
    """Tell whether "none" could be answered in some trials that count, but not in all."""
    if analysis.detected_any is not None or analysis.trials.empty:
        return False
    offered = analysis.trials.loc[analysis.trials["reason"].eq(""), "none_offered"]
    return bool(offered.fillna(value=False).any())


def forced_choice(analysis: Analysis, what: str) -> str:
    """Return what a reader of levels has to know where "none" could not be answered."""
    table = analysis.thresholds
    rates = {*table.loc[table["guess_basis"].eq(FORCED_CHOICE), "guess_rate"]}
    start = f"1/{1 / rates.pop():.0f}" if len(rates) == 1 else "the guess rate"
    if none_in_part(analysis):
        return (
            'The answer "none" is not known to have been offered in all trials. Where it was not, '
            f"who felt nothing guessed, so {what} starts near {start} there, not at 0."
        )
    how = "as the map says" if analysis.task == FORCED else "as far as the files tell"
    return (
        f'The answer "none" was not offered, {how}: who felt nothing guessed, so {what} starts '
        f"near {start}, not at 0."
    )


def level_head(analysis: Analysis, style: Style) -> str:
    """Return the head of a column of levels."""
    volts = analysis.axis.is_vpp
    if style.roomy:
        return "Level (p-p)" if volts else "Level"
    return "V p-p" if volts else analysis.axis.unit


def both_cells(row: pd.Series[Any], style: Style) -> list[str]:
    """Return noticed of presented, share, its intervals, left only and right only."""
    return [
        style.share(row["noticed"], row["presented"]),
        p_text(row["p"]),
        *(style.limits(row[f"{of}low"], row[f"{of}high"]) for of in ("", "group_")),
        str(row["left_only"]),
        str(row["right_only"]),
    ]


def blank_cells(row: pd.Series[Any], style: Style, side: str = "") -> list[str]:
    """Return presented, left, right, both, or one side, the share of false alarms, intervals."""
    names = ("presented", *([side] if side else ("left", "right", "both")))
    ends = (style.limits(row[f"{of}low"], row[f"{of}high"]) for of in ("", "group_"))
    return [*(count_text(row[name]) for name in names), p_text(row["p"]), *ends]


def difference_rows(
    analysis: Analysis, style: Style
) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Yield caption, header and rows of every two conditions, with what has to stand beside."""
    for (a, b), rows in analysis.differences.groupby(["condition_a", "condition_b"], sort=False):
        header = ["Participant", "Difference (95 %)", "First"]
        if len(analysis.sensitivity):
            header += [f"{what}, {name}" for what in ("False alarms", "d'") for name in (a, b)]
            header.append("Difference of d' (95 %)")
        cells = [
            [
                "Group" if row["participant"] == TOTAL else str(row["participant"]),
                str(row["printed"]),
                *_beside(row, style),
            ][: len(header)]
            for _, row in rows.iterrows()
        ]
        if {row[2] for row in cells} == {"n/a"}:
            header, *cells = ([*row[:2], *row[3:]] for row in (header, *cells))
        yield f"Threshold in condition {b} against {a}", header, cells


def _beside(row: pd.Series[Any], style: Style) -> list[str]:
    """Return which condition came first, the false alarms of both, and d' of both."""
    shares = [
        "n/a"
        if math.isnan(row[f"blanks_{one}"])
        else style.share(int(row[f"false_alarms_{one}"]), int(row[f"blanks_{one}"]))
        for one in "ab"
    ]
    first = row["first"] if isinstance(row["first"], str) else "n/a"
    told = [*(_two(row[f"d_prime_{one}"]) for one in "ab"), _ends(row, "d_prime_difference", style)]
    return [first, *shares, *told]


D_PRIME_HEAD: Final = (
    "Level",
    "Participant",
    "Felt",
    "False alarms",
    "d' (95 %)",
    "d' of answered",
)


def d_prime_rows(analysis: Analysis, style: Style) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield the rows of d' by level, of each condition."""
    for condition, rows in analysis.sensitivity.groupby("condition"):
        yield str(condition), [_d_prime(row, analysis, style) for _, row in rows.iterrows()]


def _d_prime(row: pd.Series[Any], analysis: Analysis, style: Style) -> list[str]:
    level = row["level_vpp"]
    return [
        "all levels" if math.isnan(level) else f"{shortest(level)} {analysis.axis.unit}",
        str(row["participant"]),
        style.share(int(row["felt"]), int(row["presented"])),
        style.share(int(row["false_alarms"]), int(row["blanks"])),
        _ends(row, "d_prime", style),
        _two(row["d_prime_answered"]),
    ]


def _ends(row: pd.Series[Any], name: str, style: Style) -> str:
    at, low, high = (_two(row[f"{name}{end}"]) for end in ("", "_low", "_high"))
    return at if low == "n/a" else f"{at} ({low}{style.to}{high})"


def _two(value: float) -> str:
    return "n/a" if math.isnan(value) else f"{value:.2f}"


_COUNTS: Final = {
    "single": ("single", "Single stimuli, counted"),
    "both": ("both", "Both-finger trials, counted"),
    "blank": ("blank", "Blank trials, counted"),
    "left_out": ("left out", "Left out"),
    "trials": ("", "All that were read"),
    "timeouts": ("", "Time-outs among the counted"),
    "invalid": ("", "Invalid keys among the counted"),
    "simulated": ("", "Trials of simulated participants"),
    "without_device": ("", "Trials of people without a device"),
    "unread": ("", "Rows that the map leaves out"),
    "unread_files": ("", "Files that the map leaves out"),
}
"""What counts are called on terminal and page; the terminal tells those that have a short name."""


def count_rows(analysis: Analysis, style: Style) -> list[list[str]]:
    """Return what was counted and how often; the last on the terminal is what was left out."""
    counts, head = asdict(analysis.counts), int(style.roomy)
    seldom = {"simulated", "without_device", "unread_files", "both" if analysis.one_place else ""}
    told = [name for name in _COUNTS if counts[name] or name not in seldom]
    return [[_COUNTS[name][head], str(counts[name])] for name in told if _COUNTS[name][head]]


def not_compared_words(names: Sequence[str]) -> str:
    """Say which tables could be edited without being found out.

    >>> not_compared_words(["a.csv"])
    'Not compared with a journal, for none lies beside it: a.csv'
    """
    return f"Not compared with a journal, for none lies beside it: {named(names)}"


HANDS_OFF_HEAD: Final = [
    *("Participant", "Part", "Driven side"),
    *(name.capitalize() for name in HANDS_OFF_COLUMNS[3:]),
]


def hands_off_cells(row: pd.Series[Any]) -> list[str]:
    """Return part, driven side, how often each answer was given, and trials presented."""
    return [str(row[name]) for name in HANDS_OFF_COLUMNS[1:]]


_PARTS = {BEFORE: "hands off, before", AFTER: "hands off, after"}


def hands_off_totals(
    table: pd.DataFrame, style: Style
) -> Iterator[tuple[pd.Series[Any], list[str]]]:
    """Yield a row of each part, both sides together, and its name, driven side told, any told."""
    key = [name for name in ("condition", "part") if name in table.columns]
    for _, rows in table[table["participant"].eq(TOTAL)].groupby(key, sort=False):
        presented = int(rows["presented"].sum())
        own = sum(int(counts[counts["side"]]) for _, counts in rows.iterrows())
        told = int(rows[["left", "right", "both"]].to_numpy().sum())
        shares = (style.share(count, presented) for count in (own, told))
        yield rows.iloc[0], [_PARTS[rows.iloc[0]["part"]], *shares]


def population_text(one: PopulationThreshold, axis: Axis) -> str:
    """Return the threshold of a population and its limits; empty text where there is none."""
    if one.reason:
        return ""
    low, high = one.threshold_limits_vpp
    return with_limits(one.threshold_vpp, low, high, axis.unit, levels=(low, high))


def population_spread(one: PopulationThreshold, axis: Axis) -> str:
    """Return the standard deviation of people's thresholds, in dB on a logarithmic axis."""
    if math.isnan(one.between_sd):
        return "n/a"
    if axis.is_logarithmic:
        return f"{20 * one.between_sd:.1f} dB"
    return f"{rounded(one.between_sd, one.between_sd)} {axis.unit}"


def population_cells(one: PopulationThreshold, axis: Axis) -> list[str]:
    """Return condition, participants, threshold, spread between people, and remark."""
    told = population_text(one, axis) or "n/a"
    return [one.condition, str(one.participants), told, population_spread(one, axis), one.reason]


_SERIAL = {
    "correct": "Correct again after a correct answer",
    "felt": "Felt again after a stimulus was felt",
    "side": "The same side answered again",
}


def choice_rows(choices: Choices, *, sides: bool = True) -> Iterator[list[str]]:
    """Yield what the answers of a participant, or of all, tell: quantity, value, p, remark."""
    if sides:
        yield ["Over-report: both to a single stimulus", _share(choices.over_report), "", ""]
        yield ["Mislocalised: the other side", _share(choices.mislocalised), "", ""]
    told = choices.information
    corrected = f"corrected for chance, still too large: {p_text(told.miller_madow_bits)} bits"
    yield [
        "Information of an answer",
        f"{p_text(told.plugin_bits)} bits",
        p_text(told.p),
        told.reason or f"{corrected}, of {p_text(told.stimulus_bits)} at most",
    ]
    yield from _sensitivity("Detection", choices.detection)
    if sides:
        yield from _sensitivity("Left against right", choices.spatial)
        for words, one in (
            ("Side of wrong answers", choices.wrong_side),
            ("Side answered to blank trials", choices.blank_side),
            ("Side felt alone of both fingers", choices.extinction),
        ):
            yield [words, f"left {one.left}, right {one.right}", p_text(one.p), one.reason]
    told_of = [name for name in _SERIAL if sides or name != "side"]
    yield from (_serial(_SERIAL[name], getattr(choices.serial, name)) for name in told_of)


def _sensitivity(name: str, one: Sensitivity) -> Iterator[list[str]]:
    remark = one.reason
    if one.participants > 1:
        remark = f"mean of {one.participants} participants"
    yield [f"{name}: d'", p_text(one.d_prime), "", remark]
    yield [f"{name}: criterion", p_text(one.criterion), "", remark]


def _serial(name: str, one: SerialEffect) -> list[str]:
    told = f"the stimuli alone give {p_text(one.expected)}"
    if one.otherwise is not None:
        told = f"otherwise {_share(one.otherwise)}; {told} and {p_text(one.expected_otherwise)}"
    told = one.reason or f"{told}; difference beyond them {one.difference:+.3f}"
    return [name, _share(one.again), p_text(one.p), told]


def _share(share: Share) -> str:
    told = f"{share.count} of {share.of}"
    return told if share.p is None else f"{p_text(share.p)} ({told})"
