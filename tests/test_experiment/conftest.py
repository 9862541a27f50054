"""What several tests of sessions need: a scripted session."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import pytest

from tests.test_experiment.lab import FakeNoise, Lab

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from experiment import Study

    Run: TypeAlias = Callable[..., Result]
    Rows: TypeAlias = Callable[..., list[dict[str, str]]]
    Refused: TypeAlias = Callable[..., str]
    LabOf: TypeAlias = Callable[..., Lab]


@pytest.fixture
def lab_of(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
) -> LabOf:
    """Set up a study with more lines than the short one's."""

    def lab_of(more: str = "", place: str = "results") -> Lab:
        return Lab(make_study(short_study_text + more), tmp_path / place, monkeypatch)

    return lab_of


@pytest.fixture
def lab(lab_of: LabOf) -> Lab:
    return lab_of()


@pytest.fixture
def noisy(lab: Lab) -> Lab:
    """Set up a session with masking noise."""
    lab.noise = FakeNoise()
    return lab


@pytest.fixture
def anybody_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask nobody whether the hardware is safe."""
    monkeypatch.setattr("experiment.session.run.require_confirmed", lambda *_: None)
