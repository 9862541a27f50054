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


@pytest.mark.parametrize(
    ("python", "display", "said"),
    [
        ((3, 11, 0), "", "DISPLAY"),
        ((3, 12, 0), ":0", r'pip install -e "\.\[screen\]"'),
        ((3, 13, 1), "", r"got Python 3\.13; --responder terminal"),
    ],
    ids=["no display", "no psychopy", "a Python too new for psychopy, told first"],
)
def test_a_machine_without_a_window_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, python: tuple[int, int, int], display: str, said: str
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "version_info", python)
    monkeypatch.delenv("DISPLAY", raising=False)
    if display:
        monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setitem(sys.modules, "psychtoolbox", None)
    with pytest.raises(NoScreenError, match=said):
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
