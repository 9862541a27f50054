"""What a module says below its constants, where Python itself does not keep it."""

from __future__ import annotations

import ast
import inspect
import itertools
from importlib import import_module


def constants(module: str) -> dict[str, str]:
    """Return the text below each constant of a module.

    >>> constants("experiment.terms.exits")["BAD_INPUT"]
    'Exit code: bad input or usage.'
    """
    body = ast.parse(inspect.getsource(import_module(module))).body
    found = {}
    for one, text in itertools.pairwise(body):
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            targets = one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", None)]
            for target in targets:
                if isinstance(target, ast.Name):
                    found[target.id] = str(text.value.value)
    return found
