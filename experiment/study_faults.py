"""Tables of a study file -> checked tables, or one line that says what is wrong with them."""

from __future__ import annotations

import reprlib
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from experiment.checks import unknown_key
from experiment.study_tables import StudyTables, section_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pydantic_core import ErrorDetails

MOST_FAULTS = 3
"""How many faults a message names; it counts the others."""

_EXPECTED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "too_long": "a list of {max_length}",
    "greater_than": "a number > {gt:g}",
    "literal_error": "{expected}",
    "model_type": "a table",
}
_ARRAYS = ("actuator", "condition")
"""The sections that are written [[section]], once for each of several tables."""


def checked_tables(tables: Mapping[str, Any]) -> StudyTables:
    """Check the tables of a study file for types, words and unknown keys.

    Parameters
    ----------
    tables : mapping
        As parsed from TOML or JSON.

    Returns
    -------
    StudyTables
        With every default filled in.

    Raises
    ------
    ValueError
        If something is wrong; one line with the path of each key, what is allowed and what it got.

    Examples
    --------
    >>> checked_tables({"design": {"trails_per_side": 60}})
    Traceback (most recent call last):
    ValueError: unknown key design.trails_per_side; did you mean trials_per_side?
    """
    try:
        return StudyTables.model_validate(tables)
    except ValidationError as error:
        faults = _merged(error.errors(include_url=False), tables)
    more = len(faults) - MOST_FAULTS
    named = faults[:MOST_FAULTS] + ([f"and {more} more"] if more > 0 else [])
    raise ValueError("; ".join(named))


def _merged(errors: list[ErrorDetails], tables: Mapping[str, Any]) -> list[str]:
    """Word the faults; a key that may be of either of two types has one fault, not two."""
    words: dict[str, list[ErrorDetails]] = {}
    for error in errors:
        words.setdefault(_path(error["loc"], tables), []).append(error)
    return [_fault(path, found) for path, found in words.items()]


def _path(steps: tuple[int | str, ...], tables: Mapping[str, Any]) -> str:
    """Write the place of a value as the file's reader finds it: ``design.levels_vpp[2]``."""
    path = ""
    value: Any = tables
    for step in steps:
        try:
            value = value[step]
        except (KeyError, IndexError):
            value = None
        except TypeError:  # not a step into the file, but one type of several that a key may have
            break
        path += f"[{step}]" if isinstance(step, int) else f".{step}"
    return path.removeprefix(".")


def _fault(path: str, errors: list[ErrorDetails]) -> str:
    first = errors[0]
    if first["type"] == "extra_forbidden":
        return unknown_key(path, _known_keys(first["loc"][:-1]))
    if first["type"] == "missing":
        return f"{path} is missing"
    if first["type"] == "value_error":
        return f"{path}.{first['ctx']['error']}".removeprefix(".")
    allowed = " or ".join(_allowed(error) for error in errors)
    if path in _ARRAYS:
        allowed = f"given as [[{path}]]"
    return f"{path} must be {allowed}; got {_shown(first['input'])}"


def _allowed(error: ErrorDetails) -> str:
    text = _EXPECTED.get(error["type"])
    return error["msg"] if text is None else text.format(**error.get("ctx", {}))


def _known_keys(steps: tuple[int | str, ...]) -> list[str]:
    """List the keys of the table that the steps lead to."""
    sections = [step for step in steps if isinstance(step, str)]
    return list(section_table(*sections).model_fields)


def _shown(value: object) -> str:
    shown = reprlib.Repr()
    shown.maxstring = shown.maxother = shown.maxlong = 60
    try:
        return shown.repr(value)
    except ValueError:  # Python refuses to write a whole number of so many digits
        return "a number of thousands of digits"
