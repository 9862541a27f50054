"""The templates of `analysis/results/templates/`: every sentence that an analysis prints.

Templates compute nothing. They get numbers as text from the filters below, or as data from
`analysis.results.findings`; a name that they use but do not get is an error.
"""

from __future__ import annotations

import base64
import math
import re
import tomllib
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from analysis.codes import AnalysisWarning
from analysis.numbers import decimals, p_value, percent, shortest, signed
from experiment.check.report import burst_text
from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from jinja2 import Environment, Template

    from analysis.codes import WarningCode


_ISOLATE, _END = "\u2068", "\u2069"
MAX_NAMES: Final = 5


def isolate(name: object) -> str:
    """Return a name between signs that keep letters which run right to left within it."""
    return f"{_ISOLATE}{name}{_END}"


def plain(text: str) -> str:
    """Return a text without the signs that isolate names.

    >>> plain(f"in condition {isolate('main')}")
    'in condition main'
    """
    return text.replace(_ISOLATE, "").replace(_END, "")


def short(name: str, max_letters: int = 14) -> str:
    """Cut the middle out of a name that is too long for a label: names often differ at their ends.

    >>> short("S01"), short("S" * 64), short("S1<U+200F>S2<U+200F>")
    ('S01', 'SSSSSSS…SSSSSS', 'S1…S2…')
    """
    if len(name) > max_letters:
        name = re.sub(r"<U\+[0-9A-F]+>", "…", name)  # an escape is not cut into halves
    end = (max_letters - 1) // 2
    return name if len(name) <= max_letters else f"{name[: max_letters - end - 1]}…{name[-end:]}"


def list_names(names: Sequence[object]) -> str:
    """List names; after the fifth say how many follow.

    >>> list_names("ab"), list_names("abcdefg")
    ('a and b', 'a, b, c, d, e and 2 more')
    """
    shown = [str(name) for name in names[:MAX_NAMES]]
    if len(names) > MAX_NAMES:
        return f"{', '.join(shown)} and {len(names) - MAX_NAMES} more"
    return " and ".join(filter(None, (", ".join(shown[:-1]), *shown[-1:])))


def count_noun(number: int, noun: str) -> str:
    """Return a number and its noun.

    >>> count_noun(1, "trial"), count_noun(2, "trial")
    ('1 trial', '2 trials')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def whole(number: float) -> str:
    """Return a count, nothing of 0 and where there is none.

    >>> whole(3.0), whole(0.0), whole(math.nan)
    ('3', '', '')
    """
    return "" if math.isnan(number) or not number else f"{number:.0f}"


def with_unit(level: float, unit: str) -> str:
    """Return a level with its unit; where there is none, the row is of all levels."""
    return "all" if math.isnan(level) else f"{shortest(level)} {unit}"


def limits(values: Sequence[float]) -> str:
    """Return a value, with its limits where it has some.

    >>> limits([1.61, 0.77, 2.44]), limits([1.61, math.nan, math.nan])
    ('1.61 (0.77 to 2.44)', '1.61')
    """
    at, low, high = (decimals(value, 2) for value in values)
    return at if low == "n/a" else f"{at} ({low} to {high})"


def points(values: Sequence[float]) -> str:
    """Return a difference of shares in percentage points with its limits, nothing without them.

    >>> points([0.02, -0.01, 0.05]), points([0.02, math.nan, math.nan])
    ('+2.0 points (-1.0 to +5.0)', '')
    """
    if not all(map(math.isfinite, values)):
        return ""
    at, low, high = (signed(100 * value) for value in values)
    return f"{at} points ({low} to {high})"


def phrase(code: str, section: str) -> str:
    """Return the words of a code."""
    return str(phrases()[section][code])


@cache
def words_of(scoring: str = "") -> Mapping[str, Any]:
    """Return the words of words.toml for tasks that are scored so.

    >>> words_of()["threshold"], words_of("discrimination")["threshold"]
    ('threshold', 'PSE')
    """
    return MappingProxyType(
        {**read_toml("words.toml")["default"], **texts_of("words.toml", scoring)}
    )


def texts_of(file: str, scoring: str) -> dict[str, Any]:
    """Return the texts of a scoring, with those of the one that it is like where it has none."""
    texts = read_toml(file)
    texts = texts.get("scoring", texts)
    own = texts.get(scoring, {})
    return {**texts.get(own.get("like"), {}), **own}


_FILTERS: Final[Mapping[str, Callable[..., Any]]] = {
    "percent": percent,
    "p_value": p_value,
    "decimals": decimals,
    "signed": signed,
    "whole": whole,
    "with_unit": with_unit,
    "limits": limits,
    "points": points,
    "phrase": phrase,
    "isolate": isolate,
    "list_names": list_names,
    "count": count_noun,
    "base64": lambda content: base64.b64encode(content).decode("ascii"),
    "burst": burst_text,
    "mm": lambda length_m: f"{length_m * 1e3:g}",
}


def read_text(name: str) -> str:
    """Return the text of a file of the templates."""
    return files("analysis.results").joinpath("templates", name).read_text(encoding="utf-8")


@cache
def read_toml(name: str) -> Mapping[str, Any]:
    """Return the tables of a TOML file of the templates."""
    return MappingProxyType(tomllib.loads(read_text(name)))


def phrases() -> Mapping[str, Any]:
    """Return phrases.toml: the words for codes, such as statuses and reasons."""
    return read_toml("phrases.toml")


@cache
def _environment(*, autoescape: bool = False) -> Environment:
    environment = open_templates("analysis.results", _FILTERS, autoescape=autoescape)
    environment.globals["phrases"] = phrases()
    return environment


def template(name: str) -> Template:
    """Return a template; values in a template of HTML are escaped."""
    return _environment(autoescape=name.endswith(".html.jinja")).get_template(name)


@cache
def compiled(expression: str) -> Callable[[Mapping[str, Any]], Any]:
    """Return an expression of the template language; it takes the values of its names."""
    return _environment().compile_expression(expression)


@cache
def names_in(expression: str) -> frozenset[str]:
    """Return the names of values that an expression needs."""
    from jinja2 import meta

    tree = _environment().parse(f"{{{{ {expression} }}}}")
    return frozenset(meta.find_undeclared_variables(tree))


@cache
def _module(file: str, scoring: str) -> Any:
    return template(file).make_module({"words": words_of(scoring)})


def sentence(file: str, macro: str, scoring: str = "", **data: object) -> str:
    """Return what a macro makes of data, on one line, in the words of a task's scoring."""
    return " ".join(str(getattr(_module(file, scoring), macro)(**data)).split())


def warning(code: WarningCode, scoring: str = "", **data: object) -> AnalysisWarning:
    """Return a warning in the words of warnings.jinja, where a macro has the name of its code."""
    message = sentence("warnings.jinja", code.value, scoring, **data)
    return AnalysisWarning(code, message, data)
