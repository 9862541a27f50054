"""What several test files need."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from experiment.study import study_from_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.study import Study

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("repeatable")
"""The same examples in every run; ``--hypothesis-profile=explore`` looks for new ones."""

QUICK_BURST = """
[burst]
window = "hann"
"""
"""What it does at the other finger is computed quickest: it ends without a jump."""
SHORT_DESIGN = """
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 1
break_every = 3
foreperiod_s = [0.01, 0.02]
"""


@pytest.fixture
def short_study_text() -> str:
    """A study file of five trials in two blocks."""
    return SHORT_DESIGN


@pytest.fixture
def quick_study_text(short_study_text: str) -> str:
    """The same with a burst whose displacements are computed in a moment."""
    return QUICK_BURST + short_study_text


@pytest.fixture
def make_study() -> Callable[[str], Study]:
    """A study from the text of a study file; what the text leaves out is the paper's protocol."""
    return lambda text: study_from_text(text, "study.toml")
