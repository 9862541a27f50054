"""Templates of texts, in the folder ``templates`` of the package that fills them in."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from jinja2 import Environment


def open_templates(
    package: str, filters: Mapping[str, Callable[..., Any]], *, autoescape: bool = False
) -> Environment:
    """Return the templates of a package; a name that they use but do not get is an error.

    Of plain text nothing is escaped; those of HTML need `autoescape`.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    folder = files(package).joinpath("templates")
    environment = Environment(
        loader=FunctionLoader(lambda name: folder.joinpath(name).read_text(encoding="utf-8")),
        autoescape=autoescape,  # noqa: S701 (of HTML)
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters
    return environment
