"""What the tests of the analysis share."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import pytest

from experiment.session.simulate import simulate_study
from experiment.terms.gains import ConditionGains

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study

    Simulate: TypeAlias = Callable[..., Path]

GAINS = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("measured", "measured"),
    per_vpp=((0.027, 0.001), (0.001, 0.027)),
)


@pytest.fixture(scope="session")
def simulate(make_study: Callable[[str], Study], short_study_text: str) -> Simulate:
    """Sessions of simulated participants in a new folder; their plate's gains are given.

    The text goes on with the short study's [design], or takes its place.
    """

    def run(
        folder: Path, text: str = "", *, participants: int = 1, seed: int = 7, study: str = ""
    ) -> Path:
        made = make_study((study or short_study_text) + text)
        sessions = simulate_study(
            made, folder, participants=participants, seed=seed, gains=(GAINS,)
        )
        assert len(list(sessions)) == participants
        return folder

    return run


@pytest.fixture(scope="session")
def two_sessions(tmp_path_factory: pytest.TempPathFactory, simulate: Simulate) -> Path:
    """A study's folder with a short session each of two simulated participants: not to change."""
    return simulate(tmp_path_factory.mktemp("simulated") / "results", participants=2)
