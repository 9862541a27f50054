"""Reports of facts: a dict or dataclass as one JSON object, or as text by a template."""

from __future__ import annotations

import json
import math
import shutil
import textwrap
from dataclasses import asdict
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Callable

    from jinja2 import Environment

    from experiment.study.stimulus import Condition

CREATOR: Final = "tactstrip field"
"""What a picture says of the program that drew it."""
_MAX_WIDTH: Final = 100
_MAX_ERROR_DB: Final = 2.0
"""A level with a greater error is not known; only what it is at most is printed."""
_COLUMN: Final = 15
"""Where the text begins behind a label."""


def report_json(report: Any) -> str:
    """Return a report as one JSON object on one line."""
    return json.dumps(report, default=asdict, allow_nan=False)


def report_text(template: str, report: Any, **more: Any) -> str:
    """Return a report as text, by a template of ``templates/``, wrapped at the terminal's width."""
    text = _templates().get_template(f"{template}.txt.jinja").render(report=report, **more)
    width = min(_MAX_WIDTH, shutil.get_terminal_size((_MAX_WIDTH, 24)).columns)
    return "\n".join(_wrap(line, width) for line in text.splitlines())


def burst_text(condition: Condition) -> str:
    """Return what the burst of a condition is.

    >>> from experiment.study.files import paper_study
    >>> burst_text(paper_study().conditions[0])
    '1 cycle of 500 Hz, no window, 2 ms'
    """
    from experiment.study.stimulus import stimulus_values

    module: Any = _templates().get_template("burst.txt.jinja").module
    return str(module.burst(stimulus_values(condition), condition.drive.duration_s))


@cache
def _templates() -> Environment:
    return open_templates(str(__package__), _FILTERS)


def _wrap(line: str, width: int) -> str:
    """Break a line that is too long at words, and indent its other lines to the text.

    Rows of tables are kept: they begin with less space than a line of text.
    """
    is_row = line.startswith(" ") and line[:_COLUMN].strip()
    if len(line) <= width or is_row:
        return line
    lines = textwrap.wrap(
        line, width, subsequent_indent=" " * _COLUMN, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines)


def _scaled(factor: float) -> Callable[..., str]:
    """Return the format of a number in another unit, with so many significant digits."""

    def format_number(value: float, digits: int = 6) -> str:
        return f"{value * factor:.{digits}g}"

    return format_number


def _fixed(value: float, digits: int = 1) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before 0.0


def format_level(level_db: float, error_db: float | None) -> str:
    """Return a level with its error, or what it is at most where the error is large.

    >>> format_level(-23.71, 0.016), format_level(-48.2, 0.31), format_level(-81.0, 20.0)
    ('-23.7 +- 0.1 dB', '-48.2 +- 0.4 dB', 'at most -61.0 dB')
    """
    if error_db is None:
        return f"{_fixed(level_db)} dB"
    if error_db > _MAX_ERROR_DB:
        return f"at most {_fixed(level_db + error_db)} dB"
    return f"{_fixed(level_db)} +- {math.ceil(10 * error_db) / 10:.1f} dB"


def format_bound(level_db: float, error_db: float | None) -> str:
    """Return a level for a table, or below what it lies where the error is large.

    >>> format_bound(-23.71, 0.016), format_bound(-81.0, 20.0)
    ('-23.7', '<-61.0')
    """
    if error_db is not None and error_db > _MAX_ERROR_DB:
        return f"<{_fixed(level_db + error_db)}"
    return _fixed(level_db)


_FILTERS: Final[dict[str, Callable[..., str]]] = {
    "g": _scaled(1.0),
    "fixed": _fixed,
    "level": format_level,
    "bound": format_bound,
    "mm": _scaled(1e3),
    "ms": _scaled(1e3),
    "us": _scaled(1e6),
    "giga": _scaled(1e-9),
    "um": lambda value: "n/a" if value is None else f"{value:.3g}",
    "power": "{:.1e}".format,
    "scientific": "{:.2e}".format,
    "percent": "{:.1%}".format,
    "percent_above": lambda value: f"{math.ceil(1e3 * value) / 10:g}%",
    "label": f"{{:{_COLUMN}}}".format,
    "minutes": lambda value: f"{math.ceil(value / 60)}",
    "edge": lambda text: text.replace("-", " ").replace("cutoff", "cut-off"),
}
"""How numbers and names are printed, and in which unit."""
