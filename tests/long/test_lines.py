"""Sessions over lines that lose and damage bytes: the record is what the emulator did."""

from __future__ import annotations

import subprocess
from collections import Counter
from typing import TYPE_CHECKING

from tests.long.test_fuzz import rounds
from tests.system.test_links import LINES, SHORT, finish, over, require_true
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from pathlib import Path

FAULTS = ("drop=0.01", "corrupt=0.01", "drop=0.01,corrupt=0.01")


def test_the_record_of_sessions_over_a_bad_line_is_what_the_emulator_did(tmp_path: Path) -> None:
    attempts, n_failures = Counter[str](), 0
    for number in range(rounds(60)):
        sessions, truth = Sessions(tmp_path / f"{number}", SHORT), tmp_path / f"{number}.jsonl"
        line, faults = list(LINES.values())[number % 2], FAULTS[number % 3]
        command = [*COMMAND, "emulate", *line, "--fault", faults, "--seed", str(number)]
        with subprocess.Popen(
            [*command, "--truth", str(truth)], stdout=subprocess.PIPE, text=True
        ) as emulator:
            try:
                assert emulator.stdout is not None
                port = emulator.stdout.readline().strip()
                n_failures += finish(sessions, *over("serial", port))
            finally:
                emulator.kill()
        attempts += require_true(sessions, truth)
    print(f"{rounds(60)} sessions, {n_failures} resumed, attempts: {dict(attempts)}")
