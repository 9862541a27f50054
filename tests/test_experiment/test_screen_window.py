"""Where no window can be opened: one line that says what to do instead."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from experiment.participant.window import NoScreenError, open_window, require_python
from experiment.study.sections.presentation import Screen

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_PSYCHOPY = """
import sys
for name in ("psychopy", "psychtoolbox", "pyglet"):
    sys.modules[name] = None
from tactstrip import main
sys.exit(main(sys.argv[1:], standalone_mode=False))
"""


def test_a_linux_without_a_display_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "version_info", (3, 11, 0))
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(NoScreenError, match="DISPLAY is not set"):
        open_window(Screen())


def test_a_python_without_psychopy_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 12, 0))
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setitem(sys.modules, "psychtoolbox", None)
    with pytest.raises(NoScreenError, match=r'pip install "tactstrip\[screen\]"'):
        open_window(Screen())


def test_a_python_too_new_for_psychopy_is_refused_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 13, 1))
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(NoScreenError, match=r"got Python 3\.13; --responder terminal"):
        open_window(Screen())
    require_python((3, 12))


@pytest.mark.process
def test_dry_run_analyze_and_check_need_no_psychopy(tmp_path: Path, quick_study_text: str) -> None:
    study, results = tmp_path / "study.toml", tmp_path / "dry"
    study.write_text(quick_study_text, encoding="utf-8")
    for command in (
        ["check", str(study)],
        ["dry-run", str(study), "--participants", "1", "--seed", "1", "--out", str(results)],
        [
            "analyze",
            str(results),
            "--allow-simulated",
            "--no-figures",
            "--out",
            str(tmp_path / "a"),
        ],
    ):
        ended = subprocess.run(
            [sys.executable, "-c", WITHOUT_PSYCHOPY, *command],
            capture_output=True,
            text=True,
            check=False,
        )
        assert ended.returncode == 0, ended
