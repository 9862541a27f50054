"""Checks of single values that this package shares, and what a refused one may have meant."""

from __future__ import annotations

import math
import re
import unicodedata
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from itertools import pairwise
from numbers import Integral
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence


def require_word(name: str, value: str, words: Iterable[str]) -> None:
    """Refuse a value that is none of the words.

    Parameters
    ----------
    name : str
        What the message calls the value.
    value : str
        The value.
    words : iterable of str
        What it may be.

    Raises
    ------
    ValueError
        If it is none of them; the message lists the words.

    Examples
    --------
    >>> require_word("side", "left", ("left", "right"))
    >>> require_word("side", "up", ("left", "right"))
    Traceback (most recent call last):
    ValueError: side must be one of left, right; got 'up'
    """
    listed = tuple(words)
    if value not in listed:
        raise ValueError(f"{name} must be one of {', '.join(listed)}; got {value!r}")


def require_known(name: str, value: str, words: Iterable[str]) -> None:
    """Refuse a value that is none of the words, and say which is nearest to it.

    >>> require_known("material", "steal", ("steel", "glass"))
    Traceback (most recent call last):
    ValueError: material must be one of steel, glass; got 'steal', did you mean steel?
    """
    import difflib

    listed = tuple(words)
    if value not in listed:
        near = difflib.get_close_matches(value.lower(), listed, n=1)
        told = f", did you mean {near[0]}?" if near else ""
        raise ValueError(f"{name} must be one of {', '.join(listed)}; got {value!r}{told}")


def inward(limit: float, *, least: bool, digits: int = 6) -> str:
    """Say a limit in a few digits, rounded to the side of what it allows: what is told is taken.

    >>> inward(8560.416, least=False), inward(2.8365, least=True, digits=3), inward(0.3, least=True)
    ('8560.41', '2.84', '0.3')
    """
    if not math.isfinite(limit) or not limit:
        return f"{limit:g}"
    exact = Decimal(repr(float(limit)))
    place = Decimal((0, (1,), exact.adjusted() - digits + 1))
    rounding = ROUND_CEILING if least else ROUND_FLOOR
    return f"{float(exact.quantize(place, rounding, _DECIMALS)):.{digits}g}"


_DECIMALS: Final = Context(prec=40)


def is_line(text: object) -> bool:
    r"""Tell whether a value is one line of text with something to read, in any script.

    Examples
    --------
    >>> is_line("שלום"), is_line(" "), is_line("two\nlines"), is_line(3)
    (True, False, False, False)
    """
    if not isinstance(text, str):
        return False
    return all(c.isprintable() or unicodedata.category(c) in _INVISIBLE for c in text) and any(
        c.isprintable() and not c.isspace() for c in text
    )


_INVISIBLE = ("Cf", "Zs")
"""Signs without a form: marks of the direction, joiners, wide spaces."""


def unknown_key(path: str, known: Iterable[str]) -> str:
    """Say that a key is unknown, and which known one is nearest to it.

    Parameters
    ----------
    path : str
        The key with the tables it stands in, joined by dots.
    known : iterable of str
        The keys of that table.

    Examples
    --------
    >>> unknown_key("design.trails_per_side", ["levels_vpp", "trials_per_side"])
    'unknown key design.trails_per_side; did you mean trials_per_side?'
    """
    import difflib

    near = difflib.get_close_matches(path.rsplit(".", maxsplit=1)[-1], list(known), n=1)
    return f"unknown key {path}" + (f"; did you mean {near[0]}?" if near else "")


_RESERVED = r"(?i:CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])"
"""Pattern of the names that Windows keeps for devices: a file or folder of one cannot be read."""
_TOTALS: Final = "all"
"""What the analysis calls its rows of totals: nobody's name."""
_IDENTIFIER: Final = re.compile(rf"(?!(?:{_RESERVED}|{_TOTALS})\Z)[A-Za-z0-9]{{1,32}}")


def require_identifier(name: str, value: object) -> None:
    """Refuse what cannot be a participant's or session's identifier, a part of a folder's name.

    ValueError unless it consists of 1 to 32 letters a-z, A-Z and digits, and is neither ``all``
    nor a name that Windows reserves.

    >>> require_identifier("participant", "01")
    """
    if not isinstance(value, str) or not _IDENTIFIER.fullmatch(value):
        raise ValueError(
            f"{name} must be 1 to 32 letters (a-z, A-Z) or digits, and not {_TOTALS!r} or a name "
            f"that Windows reserves, such as CON or COM1; got {value!r}"
        )


def require_whole(name: str, value: object, least: int) -> None:
    """Refuse what is no whole number of at least so many.

    >>> require_whole("participants", 0, 1)
    Traceback (most recent call last):
    ValueError: participants must be a whole number >= 1; got 0
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
        raise ValueError(f"{name} must be a whole number >= {least}; got {value!r}")


NAME = re.compile(rf"(?!{_RESERVED}\Z)[A-Za-z0-9_-]{{1,32}}")
NAME_RULE = "1 to 32 of the characters A-Z a-z 0-9 _ -, and none that Windows reserves, as CON"


# By how a key ends, the longest ending that fits first: the unit that its writer may have had in
# mind, and times what that makes the key's. What it is turned into has to lie in the key's range,
# so ranges are kept narrower than a factor of 1000 from what is sensible: then the slip shows.
_UNITS: Final[dict[str, tuple[tuple[str, float], ...]]] = {
    "density_kg_m3": (("g/cm3", 1e3),),
    "_n_s_m": (("N s/mm", 1e3),),
    "_n_m": (("N/mm", 1e3),),
    "_pm_v": (("m/V", 1e12), ("nm/V", 1e3)),
    "_mm": (("metres", 1e3), ("micrometres", 1e-3)),
    "_um": (("metres", 1e6), ("millimetres", 1e3), ("nanometres", 1e-3)),
    "_us": (("seconds", 1e6), ("milliseconds", 1e3), ("nanoseconds", 1e-3)),
    "_gpa": (("pascals", 1e-9), ("megapascals", 1e-3)),
    "_hz": (("kilohertz", 1e3),),
    "_vpp": (("kilovolts", 1e3), ("millivolts", 1e-3)),
    "_g": (("kilograms", 1e3), ("milligrams", 1e-3)),
    "_n": (("kilonewtons", 1e3), ("millinewtons", 1e-3)),
    "_s": (("milliseconds", 1e-3),),
}
_PER_CENT: Final = (("per cent", 1e-2),)
_FRACTIONS: Final = frozenset(
    (
        "loss_factor",
        "poisson_ratio",
        "piezo_poisson_ratio",
        "carrier_poisson_ratio",
        "max_energy_above_cutoff",
        "both_fraction",
        "lapse_rate",
        "false_alarm_rate",
        "side_bias",
        "guess_both",
    )
)
_DECIBELS: Final = ("_db", "_dba", "_dbfs")
NUMBERS: Final = (*_UNITS, *_FRACTIONS, *_DECIBELS)
"""How the keys of numbers end."""

_NO_STIMULUS: Final = {"levels_vpp": "blank_trials"}
"""Of keys that cannot be 0, those that count what is meant by it."""

_MOST: Final = 1e18
"""What is greater is in no unit."""
_NUMBER: Final = re.compile(r"[-+]?\d+(?:_\d+)*([.,]\d+)?(?:[eE][-+]?\d+)?")


def in_mind(path: str, value: object, fits: Callable[[float], bool]) -> str:
    """Say what a refused number would be in the unit or the form that its writer had in mind.

    Parameters
    ----------
    path : str
        The key with the tables it stands in.
    value : object
        What was refused.
    fits : callable
        Whether a number lies in the key's range.

    Examples
    --------
    >>> in_mind("strip.width_mm", 0.025, lambda mm: 1 <= mm <= 1000)
    '; if these are metres, write width_mm = 25'
    >>> in_mind("burst.masking_limit_db", -20, lambda db: 0 <= db <= 100)
    '; its sign is meant the other way: write masking_limit_db = 20'
    >>> in_mind("strip.width_mm", "30,5", lambda mm: True)
    '; write 30.5, with a point and without quotes'
    >>> in_mind("design.levels_vpp[1]", 0, lambda vpp: vpp > 0)
    '; trials without a stimulus are counted by blank_trials'
    """
    key, item = path.rsplit(".", maxsplit=1)[-1].partition("[")[::2]
    write = "write " if item else f"write {key} = "
    if isinstance(value, str):
        return _without_quotes(value.strip())
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > _MOST:
        return ""
    if value == 0 and key in _NO_STIMULUS:
        return f"; trials without a stimulus are counted by {_NO_STIMULUS[key]}"
    if key.endswith(_DECIBELS):
        meant = "; its sign is meant the other way: "
        return f"{meant}{write}{-value:.6g}" if fits(float(f"{-value:.6g}")) else ""
    ending = next((ending for ending in _UNITS if key.endswith(ending)), "")
    units = _PER_CENT if key in _FRACTIONS else _UNITS.get(ending, ())
    for unit, factor in units:
        told = f"{value * factor:.6g}"
        if fits(float(told)):
            these = "this is" if units is _PER_CENT else "these are"
            return f"; if {these} {unit}, {write}{told}"
    return ""


def in_metres(
    key: str, given_m: Sequence[tuple[float, float]], limits_m: tuple[float, float]
) -> str:
    """Say what places in millimetres would be that were written in metres, if all are on the strip.

    Given is each place with the half of what lies there, from left to right.

    >>> in_metres("x_mm", [(-35e-6, 0.006), (35e-6, 0.006)], (-0.1, 0.1))
    '; if x_mm is in metres, write x_mm = -35 and x_mm = 35'
    """
    told = [f"{1e6 * place_m:.6g}" for place_m, _ in given_m]
    places_m = [float(mm) / 1e3 for mm in told]
    spans_m = [(at - half, at + half) for at, (_, half) in zip(places_m, given_m, strict=True)]
    fit = all(limits_m[0] <= start and end <= limits_m[1] for start, end in spans_m)
    apart = all(one[1] <= two[0] for one, two in pairwise(spans_m))
    if not (fit and apart and all(0 < abs(place_m) < _MILLIMETRE_M for place_m, _ in given_m)):
        return ""
    return f"; if {key} is in metres, write {' and '.join(f'{key} = {mm}' for mm in told)}"


_MILLIMETRE_M: Final = 1e-3
"""A smaller number of millimetres may be one of metres."""


def _without_quotes(text: str) -> str:
    found = _NUMBER.fullmatch(text)
    if found is None:
        return ""
    point = "with a point and " if "," in (found[1] or "") else ""
    return f"; write {text.replace(',', '.')}, {point}without quotes"
