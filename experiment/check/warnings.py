"""The warnings of a check: a code for programs, and its message by `warnings.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable


Rule = tuple[bool, str, dict[str, Any]]
"""Whether a warning applies, its code, and its data."""


@cache
def messages() -> dict[str, str]:
    """Return the message of each code, the most important first."""
    return tomllib.loads(files(__package__).joinpath("warnings.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckWarning:
    """A warning: its code, its message, and the data in the message.

    >>> make_warning("plastic_loss", material="pmma").message
    'pmma has more damping than is assumed: set strip.loss_factor.'
    """

    code: str
    message: str
    data: dict[str, Any]


def make_warning(code: str, **data: Any) -> CheckWarning:
    """Return a warning with the message of its code."""
    return CheckWarning(code=code, message=messages()[code].format(**data), data=data)


def apply_rules(rules: Iterable[Rule]) -> tuple[CheckWarning, ...]:
    """Return the warnings of the rules that apply."""
    return tuple(make_warning(code, **data) for applies, code, data in rules if applies)


def sort_warnings(warnings: Iterable[CheckWarning]) -> tuple[CheckWarning, ...]:
    """Return the warnings by importance, each once."""
    order = list(messages())
    unique = {warning.message: warning for warning in warnings}
    return tuple(sorted(unique.values(), key=lambda warning: order.index(warning.code)))
