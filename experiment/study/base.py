"""What every section of study.toml is: one frozen class, strict, and refused by the user's keys.

A section states each key once: its type, unit, range, default and meaning. Its values stand as in
the file, its SI values are properties; a refusal is worded here from the key's own field.
"""

from __future__ import annotations

import reprlib
from dataclasses import dataclass as plain_dataclass
from dataclasses import replace
from datetime import date
from functools import wraps
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

from pydantic import ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs, core_schema

from experiment.names import in_mind, inward, unknown_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pydantic.fields import FieldInfo
    from pydantic_core import ErrorDetails

_Section = TypeVar("_Section")

_CONFIG: Final = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


# Without slots, though values have them elsewhere: what a section works out of its keys (a strip
# with a measured cut-off, a click's samples) is worked out once, as a cached property. Its errors
# are put in words here, where a section is made, so that nobody else has to know pydantic's.
@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(Field,))
def section(cls: type[_Section]) -> type[_Section]:
    """Make a class a section: frozen, strict, refused by a ValueError of one line."""
    made: Any = dataclass(cls, frozen=True, kw_only=True, config=_CONFIG)

    @wraps(made.__init__)
    def make(self: Any, /, **keys: Any) -> None:
        try:
            _fill(self, keys)
        except ValidationError as error:
            raise ValueError(_in_words(error, type(self))) from error

    made.__init__ = make
    checked: type[_Section] = made
    return checked


def _fill(instance: Any, keys: dict[str, Any]) -> Any:
    """Check keys and put them into a new instance; keys may have any name that a file has."""
    validator = type(instance).__pydantic_validator__
    made = validator.validate_python(ArgsKwargs((), keys), self_instance=instance)
    return with_stated(made, _origin_of(keys))


@plain_dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What of a section its writer stated, told by the file and never by the values."""

    keys: Mapping[str, Any] | None  # with their values; none where nobody recorded it
    chosen: frozenset[str] = frozenset()  # what `tactstrip init` chose and nobody changed


class Table(dict[str, Any]):
    """A table in which keys were filled in, and what of it was stated."""

    def __init__(self, keys: Mapping[str, Any], stated: Stated | None = None) -> None:
        super().__init__(keys)
        self.stated = Stated(keys={}) if stated is None else stated


def filled(table: dict[str, Any], **keys: Any) -> Table:
    """Return a table with more keys, which nobody stated."""
    return Table(table | keys, _origin_of(table))


def stated_of(section: object) -> Stated:
    """Return what of a section was stated."""
    stated: Stated = vars(section)[_STATED]
    return stated


def is_left_as_it_was(section: object, key: str) -> bool:
    """Tell whether a key is known to be a default, be it one that `tactstrip init` wrote down."""
    told = stated_of(section)
    return told.keys is not None and key not in told.keys and key not in told.chosen


def _origin_of(table: dict[str, Any]) -> Stated:
    if isinstance(table, Table):
        return table.stated
    return Stated(keys={key: value for key, value in table.items() if value is not None})


# beside the fields, so that it is no part of what makes two studies the same
_STATED: Final = "_stated"


def with_stated(section: _Section, stated: Stated) -> _Section:
    """Tell what of a section was stated, and return it."""
    object.__setattr__(section, _STATED, stated)
    return section


class _AsTable:
    """Reads a section from a table; strict pydantic takes nothing but an instance for a class."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        def read(value: Any) -> Any:
            # not by its __init__: the places in pydantic's error belong below the section's own
            return _fill(object.__new__(source), value) if isinstance(value, dict) else value

        return core_schema.no_info_before_validator_function(read, handler(source))


FromTable = Annotated[_Section, _AsTable()]
"""A section, or the table of its keys."""


def file_keys(cls: type) -> dict[str, FieldInfo]:
    """Return the fields of a section by the keys that a file has for them."""
    fields: dict[str, FieldInfo] = getattr(cls, "__pydantic_fields__", {})
    return {field.alias or name: field for name, field in fields.items()}


@plain_dataclass(frozen=True, slots=True, kw_only=True)
class KeyRange:
    """Between which numbers a key's value must lie; none where there is no limit."""

    gt: float | None = None
    ge: float | None = None
    le: float | None = None
    lt: float | None = None

    def hold(self, value: float) -> bool:
        """Tell whether a number is one of these."""
        above = self.gt is None or value > self.gt
        below = self.lt is None or value < self.lt
        least = self.ge is None or value >= self.ge
        return above and below and least and (self.le is None or value <= self.le)

    def words(self, *, whole: bool) -> str:
        """Say which numbers these are.

        Examples
        --------
        >>> KeyRange(gt=0, le=60).words(whole=False), KeyRange(ge=1, le=9).words(whole=True)
        ('a finite number > 0 and <= 60', 'a whole number from 1 to 9')
        """
        if whole:
            return f"a whole number from {self.ge} to {self.le}"
        signs = ((">", self.gt), (">=", self.ge), ("<=", self.le), ("<", self.lt))
        told = [
            f"{sign} {inward(limit, least=sign[0] == '>', digits=12)}"
            for sign, limit in signs
            if limit is not None
        ]
        return " ".join(filter(None, ("a finite number", " and ".join(told))))


def range_of(kind: Any, metadata: tuple[Any, ...] = ()) -> KeyRange | None:
    """Return the limits that a key's type and field state, if any."""
    found = {
        name: limit
        for part in _stated(kind, metadata)
        for name in ("gt", "ge", "le", "lt")
        if (limit := getattr(part, name, None)) is not None
    }
    return KeyRange(**found) if found else None


def limits_of(cls: type, key: str) -> KeyRange:
    """Return between which numbers a key of a section must lie."""
    field = file_keys(cls)[key]
    return range_of(field.annotation, tuple(field.metadata)) or KeyRange()


def _stated(kind: Any, metadata: tuple[Any, ...]) -> Iterator[Any]:
    """List what stands beside a type, those of a union's members included."""
    for part in metadata:
        yield from getattr(part, "metadata", [part])
    if get_origin(kind) is Annotated:
        inner, *beside = get_args(kind)
        yield from _stated(inner, tuple(beside))
    elif get_origin(kind) in {Union, UnionType}:
        for member in get_args(kind):
            yield from _stated(member, ())


@plain_dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """Where a value stands: its path in the file, and what is stated of it."""

    path: str = ""
    kind: Any = None
    metadata: tuple[Any, ...] = ()

    def step(self, step: int | str) -> _Place | None:
        """Go on to a key or an item; none where the step is but one type of several."""
        kind = get_args(self.kind)[0] if get_origin(self.kind) is Annotated else self.kind
        if isinstance(step, int):
            if NoneType in get_args(kind):
                kind = next(one for one in get_args(kind) if one is not NoneType)
            items = [item for item in get_args(kind) if item is not Ellipsis]
            return _Place(path=f"{self.path}[{step}]", kind=items[min(step, len(items) - 1)])
        keys = file_keys(kind)
        if not keys:
            return None
        path = f"{self.path}.{step}".removeprefix(".")
        if step not in keys:
            return _Place(path=path)
        return _Place(path=path, kind=keys[step].annotation, metadata=tuple(keys[step].metadata))

    def keys(self) -> list[str]:
        """List the keys that the table at this place may have."""
        kind = get_args(self.kind)[0] if get_origin(self.kind) is Annotated else self.kind
        return list(file_keys(kind))


def _place(root: type, steps: tuple[int | str, ...]) -> _Place:
    place = _Place(kind=root)
    for step in steps:
        following = place.step(step)
        if following is None:
            break
        place = following
    return place


ASKED_FOR: Final = "asked_for"
"""Kind of a fault whose message names its keys itself."""

MOST_FAULTS = 3
"""How many faults a message names; it counts the others."""

_RANGES: Final = frozenset(
    (
        "float_type",
        "finite_number",
        "int_type",
        "greater_than",
        "greater_than_equal",
        "less_than",
        "less_than_equal",
    )
)
_EXPECTED: Final = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "too_long": "a list of {max_length}",
    "literal_error": "{expected}",
    "dataclass_type": "a table",
    "dataclass_exact_type": "a table",
}
_ARRAYS: Final = ("actuator", "condition")
"""The sections that are written [[section]], once for each of several tables."""


def _in_words(error: ValidationError, root: type) -> str:
    """Say what is wrong in one line: the path of each key, what is allowed and what it got.

    A key that may be of either of two types has one fault, not two; and what a plate lacks is asked
    for once what it has is right.
    """
    found: dict[str, list[ErrorDetails]] = {}
    every = error.errors(include_url=False)
    slips = any(one["loc"][:1] == ("strip",) and one["type"] != ASKED_FOR for one in every)
    for detail in every:
        if slips and detail["type"] == ASKED_FOR:
            continue
        found.setdefault(_place(root, detail["loc"]).path, []).append(detail)
    faults = [_fault(path, details, root) for path, details in found.items()]
    more = len(faults) - MOST_FAULTS
    return "; ".join(faults[:MOST_FAULTS] + ([f"and {more} more"] if more > 0 else []))


def _fault(path: str, errors: list[ErrorDetails], root: type) -> str:
    first = errors[0]
    if first["type"] == "unexpected_keyword_argument":
        return unknown_key(path, _place(root, first["loc"][:-1]).keys())
    if first["type"] == "missing":
        return f"{path} is missing"
    if first["type"] == ASKED_FOR:
        return str(first["msg"])
    if first["type"] == "value_error":
        refusal = str(first["ctx"]["error"])
        joint = " " if refusal.startswith("must ") else "."
        return f"{path}{joint}{refusal}".removeprefix(".")
    place = _place(root, first["loc"])
    allowed = " or ".join(_allowed(error, place) for error in errors)
    if path in _ARRAYS:
        allowed = f"given as [[{path}]]"
    slip = _comma(first) or _slip(place, first["input"])
    return f"{path} must be {allowed}; got {_shown(first['input'])}{slip}"


def _comma(error: ErrorDetails) -> str:
    """Say how a list is written whose numbers have decimal commas."""
    given, wanted = error["input"], error.get("ctx", {}).get("max_length", 0)
    if error["type"] != "too_long" or not isinstance(given, list) or len(given) != 2 * wanted:
        return ""
    points = [f"{whole}.{part}" for whole, part in zip(given[::2], given[1::2], strict=True)]
    return f"; with points, not commas: [{', '.join(points)}]"


def _slip(place: _Place, value: object) -> str:
    """Say what a refused value would be in the unit that its writer may have had in mind."""
    limits = range_of(place.kind, place.metadata)
    return "" if limits is None else in_mind(place.path, value, limits.hold)


def _allowed(error: ErrorDetails, place: _Place) -> str:
    limits = range_of(place.kind, place.metadata)
    if error["type"] in _RANGES and limits is not None:
        return limits.words(whole=_is_whole(place.kind))
    text = _EXPECTED.get(error["type"])
    return error["msg"] if text is None else text.format(**error.get("ctx", {}))


def _is_whole(kind: Any) -> bool:
    return kind is int or int in get_args(kind)


def _shown(value: object) -> str:
    if isinstance(value, date):
        return value.isoformat()
    shown = reprlib.Repr()
    shown.maxstring = shown.maxother = shown.maxlong = 60
    try:
        return shown.repr(value)
    except ValueError:  # Python refuses to write a whole number of so many digits
        return "a number of thousands of digits"


def refuse_incomplete(values: object, *groups: tuple[str, ...]) -> str | None:
    """Return the first key of the one group that is given, if any; refuse a part of one, or two."""
    given = [[key for key in keys if getattr(values, key) is not None] for keys in groups]
    for keys, found in zip(groups, given, strict=True):
        if found and len(found) < len(keys):
            missing = next(key for key in keys if key not in found)
            raise ValueError(f"{missing} is missing; {found[0]} needs it")
    chosen = [found[0] for found in given if found]
    if len(chosen) > 1:
        raise ValueError(f"{chosen[0]} and {chosen[1]} exclude each other; got both")
    return chosen[0] if chosen else None


def refuse_below(values: object, key: str, least: float, otherwise: str) -> None:
    """Refuse a number whose size is not 0 but less than what can be meant; say what else may be."""
    stated: float | None = getattr(values, key)
    if stated is None or not 0 < abs(stated) < least:
        return
    limits = limits_of(type(values), key)
    hint = in_mind(key, stated, lambda meant: abs(meant) >= least and limits.hold(meant))
    words = replace(limits, ge=least).words(whole=False)
    raise ValueError(f"{key} must be {words}, {otherwise}; got {stated:g}{hint}")
