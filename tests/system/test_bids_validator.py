"""What the validator of BIDS says of an export."""

from __future__ import annotations

import json
import os
import subprocess
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.plates import PAPER_PLATE
from tests.test_experiment.test_bids import exported

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.conftest import Simulate

    Issues = Callable[[Path], list[dict[str, Any]]]

PAPER = f'[study]\nname = "paper"\n{PAPER_PLATE}[burst]\nwindow = "hann"\n'
MISSED = {
    *("HEDVersion", "SourceDatasets", "CogAtlasID", "CogPOID", "InstitutionalDepartmentName"),
    *("Instructions", "InstitutionAddress", "InstitutionName", "TaskDescription", "License"),
    "TOO_FEW_AUTHORS",
}
"""Facts that BIDS recommends and this study lacks."""


@pytest.fixture(scope="session")
def issues() -> Issues:
    """Validate a data set without any right to the network, with an exit code of 0."""
    bundle = pytest.importorskip("bids_validator_deno", reason="an extra test")
    from deno import find_deno_bin

    rights = ["--allow-read", "--allow-env", "--allow-write", "--deny-net", "--no-prompt"]
    script = Path(bundle.__path__[0]) / "bids-validator.js"
    command = [os.fsdecode(find_deno_bin()), *rights, str(script)]

    def issues(bids: Path) -> list[dict[str, Any]]:
        done = subprocess.run(
            [*command, str(bids), "--format", "json", "--max-rows", "-1"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        listed: list[dict[str, Any]] = json.loads(done.stdout)["issues"]["issues"]
        assert {issue["severity"] for issue in listed} <= {"warning"}
        return listed

    return issues


def test_the_validator_misses_only_facts_that_the_study_lacks(
    issues: Issues, tmp_path: Path, simulate: Simulate
) -> None:
    bids = exported(simulate(tmp_path / "results", study=PAPER, participants=2))
    found = Counter(issue.get("subCode", issue["code"]) for issue in issues(bids))
    assert {*found} == MISSED
    assert {*found.values()} <= {1, 2}  # of the data set, or of each participant
