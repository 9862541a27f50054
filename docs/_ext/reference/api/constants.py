"""What a module or a class says below its constants, where Python itself does not keep it."""

from __future__ import annotations

import ast
import inspect
import itertools
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


def constants(module: str) -> dict[str, str]:
    """Return the text below each constant of a module.

    >>> constants("experiment.exits")["BAD_INPUT"]
    'Exit code: bad input or usage.'
    """
    return below(ast.parse(inspect.getsource(import_module(module))).body)


def below(body: Iterable[ast.stmt]) -> dict[str, str]:
    r"""Return the text below each name that is given a value in a module or a class.

    >>> below(ast.parse("A = 1\n'The first.'\nB = 2").body)
    {'A': 'The first.'}
    """
    found = {}
    for one, text in itertools.pairwise(body):
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            targets = one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", None)]
            for target in targets:
                if isinstance(target, ast.Name):
                    found[target.id] = inspect.cleandoc(str(text.value.value))
    return found
