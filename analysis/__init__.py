"""What came out: checked trials, detection probabilities, thresholds, figures."""

from importlib.util import find_spec
from pathlib import Path

import lazy_loader

# A lab's own experiment.py on the path would be run in place of ours and end in some other error
# far from here. Ours lies beside this folder: another file is named, and not run.
for _name in ("experiment",):
    _spec = find_spec(_name)
    _ours = Path(__file__).resolve().parents[1] / _name / "__init__.py"
    if _spec and _spec.origin and Path(_spec.origin).resolve() != _ours:
        raise ImportError(
            f"{_spec.origin} hides the package {_name} of tactstrip: rename it, or take "
            "its folder off Python's path"
        )

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
