"""How two conditions compare, in words: what a row of the differences has, and never more.

Of an interval with 0 in it is said that the data cannot tell the conditions apart, not that these
are the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.axis import half_up, shortest
from analysis.codes import Statement, StatementCode
from analysis.definitions import TOTAL
from analysis.groups.criterion import ALTERNATED, MIXED
from analysis.groups.sensitivity import NEARLY_ALL, SEVERAL, levels_apart
from analysis.results.methods.words import SPELLED, and_words, isolated, number_of, plain

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    import pandas as pd

    from analysis.groups.sensitivity import LevelsApart
    from analysis.groups.tables import Without
    from analysis.results.tables import Analysis


ALPHA: Final = 0.05
"""False alarms of few people differ where the test of the same rates has a smaller p."""
FITTING: Final = "without misfits and drifts"
_ROUNDED: Final = 0.05
_EACH: Final = "95 % interval of each level, not corrected for several"
_OTHERS: Final = "different participants in each"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two conditions, what is known of their difference, and of whom."""

    a: str
    b: str
    row: pd.Series[Any]
    of: str

    @property
    def ends_db(self) -> tuple[float, float]:
        """The limits to the decimal that is printed, open ones infinite."""
        low, high = (round(float(self.row[name]), 1) + 0.0 for name in ("low_db", "high_db"))
        return -math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high

    @property
    def apart(self) -> bool:
        """Whether the interval, as it is printed, leaves out 0."""
        return self.ends_db[0] > 0 or self.ends_db[1] < 0

    @property
    def ratio(self) -> str:
        """The ratio of both thresholds, as it is printed; empty text of levels in dB."""
        return str(self.row["printed"]).partition(", ")[2] if self.row["status"] == "ok" else ""

    @property
    def t_test(self) -> str:
        """By which t the means of participants are compared."""
        return "Welch's t" if self.of == _OTHERS else "Student's t"

    @property
    def turns(self) -> str:
        """How trials, or else blocks, of both conditions took turns in everybody; or nothing."""
        first = self.row["first"]
        told = first.partition(" ")[0] if isinstance(first, str) and "," not in first else ""
        return told if told in (MIXED, ALTERNATED) else ""

    @property
    def took_turns(self) -> bool:
        """Whether trials of both conditions took turns in everybody."""
        return self.turns == MIXED

    @property
    def always_first(self) -> tuple[str, int]:
        """The condition that all of several people had first, and their number; or none."""
        told = self.row["first"]
        name, _, number = (told if isinstance(told, str) else "").rpartition(" ")
        alone = name in (self.a, self.b) and number.isdecimal() and int(number) > 1
        return (name, int(number)) if alone else ("", 0)


def pairs_of(differences: pd.DataFrame) -> Iterator[Pair]:
    """Yield every two conditions; of one participant in both it is that one's difference."""
    for (a, b), rows in differences.groupby(["condition_a", "condition_b"], sort=False):
        people, row = rows[rows["participant"].ne(TOTAL)], rows.iloc[-1]
        of = f"{number_of(len(people), 'participant')} in both"
        if row["status"] == "one_participant" and len(people) == 1:
            row = people.iloc[0]
            of = f"participant {isolated(row['participant'])} only, in these sessions"
        elif people.empty:
            of = _OTHERS
        yield Pair(a=str(a), b=str(b), row=row, of=of)


def difference_words(one: Pair) -> str:
    """Say a difference.

    >>> import pandas as pd
    >>> def told(status, at, low, high):
    ...     row = {"status": status, "difference_db": at, "low_db": low, "high_db": high,
    ...         "printed": "higher by 2.1 dB (0.4 to 3.9), 1.28 times (1.05 to 1.57)"}
    ...     return plain(difference_words(Pair(a="A", b="B", row=pd.Series(row), of="8 in both")))
    >>> print(told("ok", 2.14, 0.42, 3.91))
    the threshold in condition B is 2.1 dB higher than in A, 1.28 times (1.05 to 1.57) as high
    (posterior median, 95 % interval +0.4 to +3.9 dB; 8 in both)
    >>> print(told("ok", 0.6, -0.5, 1.7))
    conditions A and B cannot be told apart with these data: between -0.5 and +1.7 dB (95 % interval
    of the threshold in B against A; 8 in both)
    >>> print(told("at_most", float("nan"), float("nan"), -1.2))
    the threshold in condition B is lower than in A by at least 1.2 dB (end of the 95 % interval,
    the other is open; 8 in both)
    """
    low, high = one.ends_db
    a, b = isolated(one.a), isolated(one.b)
    status = one.row["status"]
    if status == "one_participant":
        return f"one participant alone cannot tell how groups differ in conditions {a} and {b}"
    if status == "unknown":
        return f"these levels bound no difference of conditions {a} and {b} ({one.of})"
    if status == "ok" and not one.apart:
        return (
            f"conditions {a} and {b} cannot be told apart with these data: between {low:+.1f} and "
            f"{high:+.1f} dB (95 % interval of the threshold in {b} against {a}; {one.of})"
        )
    if not one.apart:
        bound = f"at least {low:+.1f}" if status == "at_least" else f"at most {high:+.1f}"
        return (
            f"conditions {a} and {b} cannot be told apart with these data: {bound} dB (end of the "
            f"95 % interval of the threshold in {b} against {a}, the other is open; {one.of})"
        )
    more = "higher" if low > 0 else "lower"
    if status == "ok":
        at = float(one.row["difference_db"])
        ratio = f", {one.ratio} as high " if one.ratio else " "
        return (
            f"the threshold in condition {b} is {abs(at):.1f} dB {more} than in {a}"
            f"{ratio}(posterior median, 95 % interval {low:+.1f} to {high:+.1f} dB; {one.of})"
        )
    return (
        f"the threshold in condition {b} is {more} than in {a} by at least "
        f"{min(abs(low), abs(high)):.1f} dB (end of the 95 % interval, the other is open; {one.of})"
    )


def difference_cell(one: Pair) -> str:
    """Return a difference with its limits for a table."""
    if one.row["status"] != "ok":
        return str(one.row["printed"])
    low, high = one.ends_db
    found = float(one.row["difference_db"])
    at = round(found, 1) + 0.0  # no minus before 0
    ratio = f", {one.ratio}" if one.ratio else ""
    return f"{at:+.1f} dB ({low:+.1f} to {high:+.1f}){ratio}"


def own_model_words(analysis: Analysis) -> str:
    """Say why thresholds need not have the ratio that a difference has; empty text without one.

    Of two conditions, the ratio of the groups' thresholds stands beside where it is another; of
    levels in dB it is their difference.
    """
    told = [one for one in pairs_of(analysis.differences) if one.row["status"] == "ok"]
    if not told:
        return ""
    each = any(one.of.endswith("in both") for one in told)
    noun = "difference" if analysis.axis.signed else "ratio"
    how = f"estimated {'within participants ' if each else ''}by"
    if len(told) > 1:
        return (
            f"differences are {how} models of their own and are to be quoted; {noun}s of the "
            "thresholds need not equal them"
        )
    ratio = _ratio_of_groups(analysis, told[0])
    beside = f", here {ratio}, " if ratio and not _tells(told[0], ratio) else " "
    return (
        f"the difference is {how} a model of its own and is to be quoted; the {noun} of the two "
        f"thresholds{beside}need not equal it"
    )


def _ratio_of_groups(analysis: Analysis, one: Pair) -> str:
    """Return how the thresholds of two groups compare, as it is printed; empty without both."""
    at = analysis.groups.set_index("condition")["threshold_vpp"].astype(float).dropna()
    if one.row["participant"] != TOTAL or not {one.a, one.b} <= {*at.index}:
        return ""
    if analysis.axis.signed:
        return f"{at[one.b] - at[one.a]:+.1f} dB"
    return f"{at[one.b] / at[one.a]:.2f}"


def _tells(one: Pair, told: str) -> bool:
    """Tell whether a difference is printed as that."""
    cells = (difference_cell(one), one.ratio)
    return one.apart and any(cell.startswith(f"{told} ") for cell in cells)


def compared(analysis: Analysis) -> Iterator[Statement]:
    """Say how every two conditions compare."""
    pairs = [*pairs_of(analysis.differences)]
    apart = sum(one.apart for one in pairs)
    if len(pairs) > SPELLED:
        text = (
            f"of {len(pairs)} pairs of conditions {apart} differ in threshold, and "
            f"{len(pairs) - apart} cannot be told apart with these data (95 % intervals, in the "
            "table)"
        )
        yield Statement(StatementCode.DIFFERENCES_IN_TABLE, text)
    else:
        yield from (Statement(_difference_code(one), difference_words(one)) for one in pairs)
        told = [one for one in pairs if one.apart and one.row["status"] == "ok"]
        alike = len(pairs) == 1 and told and _tells(told[0], _ratio_of_groups(analysis, told[0]))
        if told and not alike:
            yield Statement(StatementCode.DIFFERENCE_HAS_OWN_MODEL, own_model_words(analysis))
        yield from _always_first(pairs)
    if len(pairs) > 1:
        text = f"these intervals are not corrected for {len(pairs)} comparisons"
        yield Statement(StatementCode.SEVERAL_COMPARISONS, text)
    if not pairs and len(analysis.groups) > 1:
        text = (
            "conditions are not compared, for a difference in dB needs levels above 0, or in dB "
            '([axis] x_scale = "log10" or "dB")'
        )
        yield Statement(StatementCode.CONDITIONS_NOT_COMPARED, text)


def _difference_code(one: Pair) -> StatementCode:
    if one.row["status"] in ("one_participant", "unknown"):
        return StatementCode.DIFFERENCE_UNKNOWN
    return StatementCode.DIFFERENCE if one.apart else StatementCode.DIFFERENCE_NOT_SHOWN


def _always_first(pairs: Sequence[Pair]) -> Iterator[Statement]:
    """Say where order and condition cannot be told apart."""
    for one in pairs:
        name, number = one.always_first
        if name:
            of = f" of {isolated(one.a)} and {isolated(one.b)}" if len(pairs) > 1 else ""
            text = (
                f"all {number} participants had condition {isolated(name)} first: practice, "
                f"fatigue and what else changed in between are part of the difference{of}"
            )
            yield Statement(StatementCode.CONDITION_ALWAYS_FIRST, text)


def level_words(told: LevelsApart, one: Pair) -> str:
    """Say at how many levels d' differs, and what follows for thresholds that do."""
    a, b = isolated(one.a), isolated(one.b)
    most = f"{100 * NEARLY_ALL:.0f} %"
    if not told.number:
        return f"d' tells little here, for over {most} were felt at every level"
    with_it, against_it = told.lower, told.higher
    if one.ends_db[1] < 0:
        with_it, against_it = against_it, with_it
    so = ""
    if len(with_it) >= SEVERAL and not against_it:
        so = ", which a difference of criterion alone would hardly bring about"
    elif len(with_it) == 1 and not against_it:
        so = ", and one level alone decides nothing"
    where = f" at which at most {most} were felt in both" if told.nearly_all else ""
    counts = [len(at) or "none" for at in (told.lower, told.higher)]
    return (
        f"of {number_of(told.number, 'level')}{where}, d' is lower in {b} than in {a} at "
        f"{counts[0]} of them and higher at {counts[1]} (95 % intervals, each by itself){so}"
    )


def by_level(analysis: Analysis, one: Pair) -> LevelsApart | None:
    """Return at which levels d' of two conditions differs; none without any."""
    return levels_apart(_levels_of(analysis, one))


def _levels_of(analysis: Analysis, one: Pair) -> pd.DataFrame:
    """Return the rows of d' by level of all, or of the one participant in both conditions."""
    table = analysis.d_prime_differences
    rows = table[table["condition_a"].eq(one.a) & table["condition_b"].eq(one.b)]
    return rows[rows["participant"].eq(one.row["participant"])]


def alarms_apart(row: pd.Series[Any]) -> str:
    """Return by how many points false alarms differ, with limits; empty text without limits."""
    at, low, high = (
        100 * float(row[f"false_alarm_difference{end}"]) for end in ("", "_low", "_high")
    )
    told = "0.0" if abs(at) < _ROUNDED else f"{at:+.1f}"
    return "" if math.isnan(low) else f"{told} points ({low:+.1f} to {high:+.1f})"


def difference_rows(
    analysis: Analysis, *, settled: Collection[tuple[str, str]] = (), either_side: bool = False
) -> Iterator[tuple[str, str, str]]:
    """Yield the rows of differences in the answer's table; whether d' is of either side.

    Pairs of conditions that are `settled` have none of d'.
    """
    sides = "felt at either side; " if either_side else ""
    for one in pairs_of(analysis.differences):
        name = f"Threshold in {isolated(one.b)} against {isolated(one.a)}"
        first = one.row["first"]
        order = f"; first: {first}" if isinstance(first, str) and not one.turns else ""
        if one.turns == ALTERNATED:
            order = "; blocks alternated"
        if one.always_first[0]:
            order = f"; {isolated(one.always_first[0])} first in all of them"
        yield name, difference_cell(one), one.of + order
        yield from _fitting_row(analysis, one)
        if not math.isnan(one.row["spread_db"]):
            at, low, high = (one.row[f"spread_{end}db"] for end in ("", "low_", "high_"))
            name = f"Spread of that difference (SD), {isolated(one.b)} against {isolated(one.a)}"
            yield name, f"{at:.1f} dB ({low:.1f} to {high:.1f})", one.of
        levels = None if (one.a, one.b) in settled else by_level(analysis, one)
        if levels is not None:
            of = "mean of participants; " if one.row["participant"] == TOTAL else ""
            name = f"d' at single levels, {isolated(one.b)} against {isolated(one.a)}"
            yield name, _level_cell(levels, analysis.axis.unit), f"{of}{sides}{_EACH}"
        if points := alarms_apart(one.row):
            name = f"False alarms in {isolated(one.b)} against {isolated(one.a)}"
            what = "mean of participants" if one.of != _OTHERS else "difference of two means"
            yield name, points, f"{what}, by {one.t_test}"


def _fitting_row(analysis: Analysis, one: Pair) -> Iterator[tuple[str, str, str]]:
    """Yield a difference without misfits and drifts, if any of these people took part in it."""
    if analysis.fitting is None:
        return
    table = analysis.thresholds
    here = {*table.loc[table["condition"].isin([one.a, one.b]), "participant"]}
    for other in pairs_of(analysis.fitting.differences):
        told = other.row["participant"] == TOTAL and other.row["status"] != "one_participant"
        if (other.a, other.b) == (one.a, one.b) and told and here & {*analysis.fitting.names}:
            name = f"The same {without_words(analysis.fitting)}, {isolated(one.b)}"
            yield (
                f"{name} against {isolated(one.a)}",
                difference_cell(other),
                other.of.replace(" in both", f" in both, {fitting_words(analysis)}"),
            )


def fitting_words(analysis: Analysis) -> str:
    """Say who is left without those whose functions do not fit, or whose thresholds drift."""
    return f"{FITTING} in any condition" if len(analysis.groups) > 1 else FITTING


def without_words(some: Without) -> str:
    """Say who is left out: names, where they are few."""
    names = some.names
    if len(names) > SPELLED:
        return f"without {len(names)} misfits and drifts"
    return f"without participant{'s' * (len(names) > 1)} {and_words(names)}"


def _level_cell(told: LevelsApart, unit: str) -> str:
    which = {"lower": told.lower, "higher": told.higher, "not told apart": told.not_apart}
    each = [
        f"{words} at {', '.join(map(shortest, at))} {unit}" for words, at in which.items() if at
    ]
    if told.nearly_all:
        most = f"tells little where over {100 * NEARLY_ALL:.0f} % were felt in either"
        shares = zip(told.nearly_all, told.most_felt, strict=True)
        at = ", ".join(
            f"{shortest(level)} {unit} ({half_up(round(100 * p, 9), 1)} %)" for level, p in shares
        )
        each.append(f"{most}: {at}")
    return "; ".join(each)


def d_prime_level_rows(analysis: Analysis) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Yield caption, header and rows of d' by level of every two conditions."""
    for one in pairs_of(analysis.differences):
        rows = _levels_of(analysis, one)
        header = [
            "Level",
            *(f"{what}, {name}" for what in ("Felt", "d'") for name in (one.a, one.b)),
        ]
        cells = [
            [
                f"{shortest(row['level_vpp'])} {analysis.axis.unit}",
                *(f"{row[f'felt_{which}']} / {row[f'presented_{which}']}" for which in "ab"),
                *(f"{row[f'd_prime_{which}']:.2f}" for which in "ab"),
                _d_prime_apart(row),
            ]
            for _, row in rows.iterrows()
        ]
        if cells:
            caption = f"d' by level in condition {one.b} against {one.a} ({one.of})"
            yield plain(caption), [*header, "Difference of d' (95 %)"], cells


def _d_prime_apart(row: pd.Series[Any]) -> str:
    at, low, high = (float(row[f"d_prime_difference{end}"]) for end in ("", "_low", "_high"))
    return f"{at:+.2f}" if math.isnan(low) else f"{at:+.2f} ({low:+.2f} to {high:+.2f})"


def totals(analysis: Analysis) -> Iterator[pd.Series[Any]]:
    """Yield the totals of blank trials, of each condition where there are several."""
    table = analysis.blank
    yield from (row for _, row in table[table["participant"].eq(TOTAL)].iterrows())
