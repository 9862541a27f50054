"""The templates of `analysis/results/templates/`: every sentence that an analysis prints.

Templates compute nothing. They get numbers as text from the filters below, or as data from
`analysis.results.findings`; a name that they use but do not get is an error.
"""

from __future__ import annotations

import base64
import tomllib
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from analysis.codes import AnalysisWarning
from analysis.numbers import decimals, p_value, percent, shortest, signed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


_FILTERS: Final = {
    "percent": percent,
    "p_value": p_value,
    "decimals": decimals,
    "signed": signed,
    "level": shortest,
    "isolate": isolate,
    "list_names": list_names,
    "count": count_noun,
    "base64": _base64,
}


def read_text(name: str) -> str:
    """Return the text of a file of the templates."""
    return files("analysis.results").joinpath("templates", name).read_text(encoding="utf-8")


@cache
def phrases() -> Mapping[str, Mapping[str, str]]:
    """Return phrases.toml: the words for codes, such as statuses and reasons."""
    return MappingProxyType(tomllib.loads(read_text("phrases.toml")))


@cache
def _environment(*, autoescape: bool) -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        loader=FunctionLoader(read_text),
        autoescape=autoescape,  # noqa: S701 (of HTML; other templates make plain text)
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(_FILTERS)
    environment.globals["phrases"] = phrases()
    return environment


def template(name: str) -> Template:
    """Return a template; values in a template of HTML are escaped."""
    return _environment(autoescape=name.endswith(".html.jinja")).get_template(name)


@cache
def _macros(name: str) -> Any:
    return template(name).module


def sentence(file: str, macro: str, **data: object) -> str:
    """Return what a macro makes of data, on one line."""
    return " ".join(str(getattr(_macros(file), macro)(**data)).split())


def warning(code: WarningCode, **data: object) -> AnalysisWarning:
    """Return a warning in the words of warnings.jinja, where a macro has the name of its code."""
    return AnalysisWarning(code, sentence("warnings.jinja", code.value, **data), data)
