"""What other systems lack is missed only where it is used (docs/explanation/limits.md)."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
sys.modules['termios'] = sys.modules['tty'] = None
import experiment.participant.terminal, experiment.operator.view, experiment.commands.demo
"""


def test_modules_of_a_session_are_imported_without_termios() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
