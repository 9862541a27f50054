"""What every section of a study file is: a strict, frozen model whose faults name key and rule."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from difflib import get_close_matches
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Final, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, model_validator

from device.printing import escaped, shortened
from experiment.names import NAME, NAME_RULE, is_line

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
    from pathlib import Path

_MAX_SHOWN: Final = 80
"""The longest part of a value that a message repeats."""
_EARTH_AHEAD: Final = timedelta(hours=14)

Rule = tuple[bool, str, str] | tuple[bool, str, str, object]
"""Whether a key violates a rule, the key, the rule, and the value if it is not that of the key."""


class Section(BaseModel):
    """A section of a study file. `model_fields_set` has the fields that the file sets."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    def rules(self) -> Iterable[Rule]:
        """Return the rules that types do not state; of a key, the first that is violated counts.

        They are evaluated one by one, so that a rule can rely on those before it.
        """
        return ()

    @model_validator(mode="after")
    def _obey_rules(self) -> Self:
        obey(self.rules(), self)
        return self

    @property
    def keys_set(self) -> tuple[str, ...]:
        """The keys that the file sets, as it writes them."""
        aliases = {name: field.alias for name, field in type(self).model_fields.items()}
        return tuple(sorted(aliases.get(name) or name for name in self.model_fields_set))

    @classmethod
    def from_json(cls, text: str, source: object) -> Self:
        """Return the section of a JSON text; StudyError names its source."""
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            raise StudyError(str(source), *faults_of(error, cls)) from error

    def changed(self, **values: Any) -> Self:
        """Return the section with other values; StudyError if they are not valid."""
        keys = {name: field.alias or name for name, field in type(self).model_fields.items()}
        present = {key: getattr(self, name) for name, key in keys.items()}
        given = {keys.get(name, name): value for name, value in values.items()}
        try:
            changed = type(self).model_validate(present | (self.__pydantic_extra__ or {}) | given)
        except ValidationError as error:
            raise StudyError(type(self).__name__, *faults_of(error, type(self))) from error
        names_set = {name for name, key in keys.items() if key in given} | self.model_fields_set
        object.__setattr__(changed, "__pydantic_fields_set__", names_set)
        return changed

    def completed(self, **values: Any) -> Self:
        """Return a copy with values for keys that the file omits; they do not count as set."""
        copy = self.model_copy()
        # of the fields only: what was computed from them, such as a drive, is that of other values
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        copy.__dict__ = fields | values
        return copy


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong in a study file: the key, the rule that it violates, and its value.

    Examples
    --------
    >>> str(Fault("strip.width_mm", "must be a number from 2 to 1000", 0.025))
    'strip.width_mm: must be a number from 2 to 1000 (got 0.025)'
    """

    key: str
    rule: str
    got: object = None

    def __str__(self) -> str:
        key = f"{shortened(escaped(self.key))}: " if self.key else ""
        got = "" if self.got is None else f" (got {format_value(self.got)})"
        return f"{key}{self.rule}{got}"


class StudyError(ValueError):
    """A study file, or a file of levels, that cannot be used.

    Attributes
    ----------
    source : str
        The file, or the name of the study.
    faults : tuple of Fault
        What is wrong, one line of the message each.

    Examples
    --------
    >>> from experiment import read_study
    >>> read_study("nowhere.toml")
    Traceback (most recent call last):
    experiment.study.base.StudyError: nowhere.toml: No such file or directory
    """

    def __init__(self, source: Path | str, fault: Fault, *faults: Fault) -> None:
        self.source = str(source)
        self.faults = (fault, *faults)
        super().__init__("\n".join(f"{self.source}: {each}" for each in self.faults))

    def __reduce__(self) -> tuple[type[StudyError], tuple[str, *tuple[Fault, ...]]]:
        return type(self), (self.source, *self.faults)

    def renamed(self, names: Mapping[str, str]) -> StudyError:
        """Return the error with other names of keys, such as the options that set them.

        Parameters
        ----------
        names : mapping of str to str
            New names by key; a key that is not in it keeps its name.

        Returns
        -------
        StudyError
        """
        faults: dict[str, Fault] = {}  # one option may set several keys
        for fault in self.faults:
            name = names.get(fault.key, fault.key)
            faults.setdefault(name, replace(fault, key=name))
        return StudyError(self.source, *faults.values())


def refusal(key: str, rule: str, got: object = None) -> StudyError:
    """Return the error with which a validator refuses the value of a key of its section."""
    return StudyError("study", Fault(key, rule, got))


def rules_below(rules: Iterable[Rule], section: Section, path: str) -> Iterator[Rule]:
    """Yield the rules of a section with its path before their keys, and with the keys' values."""
    for is_violated, key, rule, *values in rules:
        value: Any = values[0] if values else section
        for step in [] if values or not is_violated else re.findall(r"\w+", key):
            value = value[int(step)] if step.isdigit() else getattr(value, step)
        yield is_violated, join_keys(path, key), rule, value


def obey(
    rules: Iterable[Rule], section: Section | None = None, path: str = "", source: str = "study"
) -> None:
    """Refuse the keys of a section that violate rules; the path is that of the section."""
    faults: dict[str, Fault] = {}
    try:
        for is_violated, key, rule, *values in (
            rules if section is None else rules_below(rules, section, path)
        ):
            if is_violated:
                faults.setdefault(key, Fault(key, rule, *values))
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        if not faults:  # else it is a rule that relies on one that is violated
            raise
    if faults:
        raise StudyError(source, *faults.values())


def all_or_none(section: Section, keys: Iterable[str]) -> Iterator[Rule]:
    """Yield the rule that keys which belong together are all given, or none."""
    given = [key for key in keys if getattr(section, key) is not None]
    for key in keys:
        yield bool(given) and key not in given, key, f"is required with {' '.join(given[:1])}"


def join_keys(section: str, key: str) -> str:
    """Return the path of a key of a section; an index follows without a point.

    >>> join_keys("actuator", "[0].x_mm"), join_keys("strip", "width_mm"), join_keys("", "strip")
    ('actuator[0].x_mm', 'strip.width_mm', 'strip')
    """
    return f"{section}{'.' if section and key and not key.startswith('[') else ''}{key}"


def format_value(value: object) -> str:
    """Write a value as in a study file; a long one is cut.

    >>> format_value([1.0, True, "a"]), len(format_value("x" * 1000))
    ('[1, true, "a"]', 83)
    """
    if isinstance(value, list | tuple):
        shown = f"[{', '.join(map(format_value, value[:_MAX_SHOWN]))}]"
    elif isinstance(value, float):
        shown = f"{value:.12g}"
    else:
        shown = json.dumps(value, ensure_ascii=False, default=str)
    return shown if len(shown) <= _MAX_SHOWN else f"{shown[:_MAX_SHOWN]}..."


def first_fault(error: ValidationError) -> str:
    """Return the first fault that pydantic found in a file that no person writes."""
    fault = error.errors()[0]
    return f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}"


def faults_of(error: ValidationError, model: type[Section]) -> tuple[Fault, ...]:
    """Return the faults that pydantic found in the tables of a model, one for each key."""
    faults: dict[str, Fault] = {}
    missing, similar = set(), set()
    for detail in error.errors(include_url=False):
        key, schema = _locate(model, detail["loc"])
        match detail["type"]:
            case "value_error":
                refused = detail["ctx"]["error"]
                inner = getattr(refused, "faults", [Fault("", str(refused))])
                joined = [replace(fault, key=join_keys(key, fault.key)) for fault in inner]
            case "missing":
                missing.add(key)
                joined = [Fault(key, "is required")]
            case "extra_forbidden":
                section, table = _locate(model, detail["loc"][:-1])
                name = str(detail["loc"][-1])
                names = get_close_matches(name, table.get("properties", {}), n=1)
                similar |= {join_keys(section, name) for name in names}
                hint = f"; did you mean {names[0]}?" if names else ""
                is_table = isinstance(detail["input"], dict | list)
                joined = [Fault(key, f"unknown key{hint}", None if is_table else detail["input"])]
            case _:
                joined = [Fault(key, f"must be {describe(schema)}", detail["input"])]
        for fault in joined:
            faults.setdefault(fault.key, fault)
    # a required key that is misspelt is one fault
    return tuple(fault for key, fault in faults.items() if key not in missing & similar)


@cache
def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of a model, by the keys of a study file."""
    schema: dict[str, Any] = model.model_json_schema(by_alias=True)
    return schema


def _locate(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[str, dict[str, Any]]:
    """Return the path of a location in pydantic's errors, and the schema of what is there."""
    root = schema_of(model)
    tables = {f"#/$defs/{name}": table for name, table in root.get("$defs", {}).items()}
    path, schema = "", root
    for step in location:
        choices = [tables.get(each.get("$ref", ""), each) for each in schema.get("anyOf", [schema])]
        table = next((choice for choice in choices if "properties" in choice), None)
        if isinstance(step, int):
            path += f"[{step}]"
            arrays = [choice for choice in choices if choice.get("type") == "array"]
            array: dict[str, Any] = arrays[0] if arrays else {}
            items = array.get("prefixItems", [])
            schema = items[step] if step < len(items) else array.get("items", {})
        elif table is not None:
            path = join_keys(path, step)
            schema = table["properties"].get(step, table.get("additionalProperties") or {})
        # Any other step is the branch of a union that did not fit.
        schema = tables.get(schema.get("$ref", ""), schema)
    return path, schema


def describe(schema: Mapping[str, Any]) -> str:
    """Say which values a JSON Schema allows.

    Examples
    --------
    >>> describe({"type": "integer", "minimum": 1, "maximum": 9})
    'a whole number from 1 to 9'
    >>> describe({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"const": "endless"}]})
    'a number above 0, or "endless"'
    """
    if "anyOf" in schema:
        choices = (choice for choice in schema["anyOf"] if choice.get("type") != "null")
        return ", or ".join(map(describe, choices))
    if "const" in schema or "enum" in schema:
        values = ", ".join(map(json.dumps, schema.get("enum", [schema.get("const")])))
        return f"one of {values}" if "enum" in schema else values
    kind = schema.get("type", "object")
    if kind == "array" and "prefixItems" in schema:
        return f"a list of {len(schema['prefixItems'])}, each {describe(schema['prefixItems'][0])}"
    if kind == "array" and "$ref" not in schema.get("items", {}):
        least = f" of at least {schema['minItems']}" if "minItems" in schema else ""
        return f"a list{least}, each {describe(schema.get('items', {}))}"
    return _KINDS[kind] + _range(schema)


_KINDS: Final = {
    "number": "a number",
    "integer": "a whole number",
    "string": "text in quotes",
    "boolean": "true or false",
    "array": "an array of tables, written [[...]]",
    "object": "a table",
}


def _range(schema: Mapping[str, Any]) -> str:
    if "minimum" in schema and "maximum" in schema:
        even = f", a multiple of {schema['multipleOf']}" if "multipleOf" in schema else ""
        return f" from {schema['minimum']:.12g} to {schema['maximum']:.12g}{even}"
    given = [f"{phrase} {schema[key]:.12g}" for key, phrase in _LIMITS.items() if key in schema]
    return " " + " and ".join(given) if given else ""


_LIMITS: Final = {
    "minimum": "of at least",
    "exclusiveMinimum": "above",
    "maximum": "of at most",
    "exclusiveMaximum": "below",
}


def obeying(is_valid: Callable[[Any], bool], rule: str) -> AfterValidator:
    """Return a validator that refuses values for which a function is false."""

    def check(value: Any) -> Any:
        obey([(not is_valid(value), "", rule, value)])
        return value

    return AfterValidator(check)


def zero_or_at_least(minimum: float) -> AfterValidator:
    """Return a validator that refuses values near 0, which are slips of the unit, but not 0."""
    rule = f"must be 0 or at least {minimum:g} in size"
    return obeying(lambda value: not 0 < abs(value) < minimum, rule)


def is_distinct(values: Collection[Hashable]) -> bool:
    """Return whether no value occurs twice."""
    return len(set(values)) == len(values)


# It is today as soon as it is today anywhere, so that a study is valid in all time zones at once.
def _is_past_day(text: str) -> bool:
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return False
    return day.isoformat() == text and day <= (datetime.now(UTC) + _EARTH_AHEAD).date()


Line = Annotated[str, obeying(is_line, "must be one line of text")]
"""One line of text that is not blank."""
Name = Annotated[str, obeying(lambda text: NAME.fullmatch(text) is not None, NAME_RULE)]
"""A name that can be part of a file's name."""
Day = Annotated[str, obeying(_is_past_day, "must be a day up to today, as year-month-day")]
"""A day, today or in the past, such as 2026-05-04."""
