"""Which column is that of the levels, and what they are in."""

from __future__ import annotations

import re
from functools import partial
from typing import Final

from analysis.reading.cells import SILENT
from analysis.reading.drafted.names import CALLED, LEVELS, OF_VOLTS
from analysis.reading.drafted.sample import FILL, NUMBER, Sample, float_of, plain

_PART: Final = re.compile("[A-Z]?[a-z]+|[A-Z]+")
_MOST_LEVELS: Final = 20
CODE: Final = re.compile(r"-99|-?9{3,}")
"""Numbers that others write where there is none."""
_VOLTS: Final = re.compile("volt|spannung|tension")
_UNIT: Final = re.compile(
    r"(?:[_ .(\[]|(?<=[a-z])(?=(?-i:V|mV)$))((?-i:V|mV|g)|um|µm|nm|mm|pct|percent|%)[)\]]?$",
    re.IGNORECASE,
)
_UNITS: Final = {"pct": "%", "percent": "%"}
_IN_UNIT: Final = re.compile(r"[_ .(\[]((?-i:V|mV)|um|µm|nm|pct|percent|%)[)\]]?$", re.IGNORECASE)
_WEAK: Final = {"volume", "gain", "strength", "contrast", "soa"}
"""Names that give way to a column with a unit."""
_OF_DRIVES: Final = {"drive", "magnitude"}
_BESIDE: Final = re.compile(
    "mask|pedestal|noise|background|standard|reference|adapt", re.IGNORECASE
)
"""Of stimuli beside that whose level it is."""
_IN_DB: Final = re.compile(r"(?:^|[^A-Za-z])d[Bb](?=$|[^A-Za-z]|[A-Z])|[a-z]dB$")


def level_of(table: Sample) -> str | None:
    """Return the column of the level: by its name or, if it has a few numbers, by a part of it.

    That is a word such as "volts", or else "drive" or, of a single column, a unit of levels.
    """
    named = [*table.named(CALLED["level_vpp"])]
    in_units = [*filter(_has_unit, dict.fromkeys(table.header))]
    for name in filter(partial(_varies, table), named):
        weak = plain(name) in _WEAK
        known = (one for one in in_units if one != name and _has_few_numbers(table, one))
        return next((one for one in known if weak or _is_step_of(table, name, one)), name)
    for words in ({*LEVELS, *OF_VOLTS}, _OF_DRIVES):
        for name in table.header:
            of_levels = {part.lower() for part in _PART.findall(name)} & words
            if of_levels and _has_few_numbers(table, name) and not _BESIDE.search(name):
                return name
    in_unit = [name for name in in_units if _has_few_numbers(table, name)]
    in_unit = [name for name in in_unit if not _BESIDE.search(name)] or in_unit
    return in_unit[0] if len(in_unit) == 1 else next(iter(named), None)


def _has_unit(name: str) -> bool:
    return in_db(name) or bool(_IN_UNIT.search(name))


def _varies(table: Sample, name: str) -> bool:
    """Tell whether a column has two numbers or more: a constant is no level, nor are mere words."""
    return len({*map(float_of, filter(NUMBER.fullmatch, table.words(name)))}) > 1


def _is_step_of(table: Sample, name: str, other: str) -> bool:
    """Tell whether a column counts the steps that another one has in a unit.

    >>> rows = [["1", "0.5"], ["2", "4"], ["0", "0"]]
    >>> _is_step_of(Sample(header=["level", "amp_um"], rows=rows), "level", "amp_um")
    True
    """
    steps, sizes = table.numbers(name), table.numbers(other)
    if not steps or not sizes or len(steps) != len(sizes):
        return False
    pairs = sorted({*zip(steps, sizes, strict=True)})
    counted, rising = [step for step, _ in pairs], [size for _, size in pairs]
    by_ones = counted == [counted[0] + place for place in range(len(counted))]
    return by_ones and rising == sorted({*rising}) and rising != counted


def _has_few_numbers(table: Sample, name: str) -> bool:
    return 1 < len({*(table.numbers(name) or ())}) <= _MOST_LEVELS


def in_db(name: str) -> bool:
    """Tell whether a column is named after dB.

    >>> [in_db(name) for name in ("level_dB", "dB SL", "leveldB", "gain.db", "feedback", "dbl")]
    [True, True, True, True, False, False]
    """
    return bool(_IN_DB.search(name))


def is_signed(table: Sample, level: str) -> bool:
    """Tell whether 0 is a level: in dB by the name, or where others are below; codes are none.

    >>> is_signed(Sample(header=["amp"], rows=[["-6"], ["0"]]), "amp")
    True
    """
    numbers = table.numbers(level) or []
    return in_db(level) or any(one < 0 and not CODE.fullmatch(f"{one:g}") for one in numbers)


def silent_words(table: Sample, level: str) -> set[str]:
    """Return the words of a column of levels that are no stimulus: 0, or -inf where 0 is a level.

    >>> silent_words(Sample(header=["amp"], rows=[["0"], ["0,0"], ["2"]]), "amp") == {"0", "0,0"}
    True
    """
    if is_signed(table, level):
        return {word for word in table.words(level) if word.lower() in SILENT}
    return {word for word in filter(NUMBER.fullmatch, table.words(level)) if not float_of(word)}


def unit_of(level: str) -> str:
    """Return what levels are in by the name of their column; Vpp is V from peak to peak.

    >>> [unit_of(name) for name in ("amp_um", "drive_pct", "Spannung", "level_vpp", "amp dB", "x")]
    ['um', '%', 'V', 'Vpp', 'dB', '']
    >>> unit_of("amplitude_V"), unit_of("amp (mV)"), unit_of("x_v"), unit_of("voltage_pp")
    ('V', 'mV', '', 'Vpp')
    """
    if in_db(level):
        return "dB"
    if named := _UNIT.search(level):
        return _UNITS.get(named[1].lower(), named[1])
    volts = bool(_VOLTS.search(plain(level)))
    return "Vpp" if plain(level).endswith("vpp" if not volts else "pp") else "V" * volts


def unit_words(unit: str) -> str:
    """Say how sure a unit is that was found by a column's name, and what becomes of it.

    >>> unit_words("um").partition(";")[0], unit_words("").partition(";")[0]
    ('guess, by the name', 'FILL IN: the unit of the levels, or what they are (gain)')
    """
    printed = (
        'printed behind numbers, in brackets on axes ("µm", "% of full drive"), never converted'
    )
    return {
        "V": f"guess; say peak or peak-to-peak if you know; {printed}",
        "dB": 'guess, by the name; may be "dB SL" or "dB re 1 um": it is only printed',
        "": f"{FILL}the unit of the levels, or what they are (gain); {printed}",
    }.get(unit, f"guess, by the name; {printed}")
