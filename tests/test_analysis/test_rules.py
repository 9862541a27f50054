"""Rules of levels compared in simulated sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.planning.rules import RULES, compare_rules, format_rules
from experiment import first_study

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Run

LEVELS = tuple(np.geomspace(40.0, 200.0, 10).round().tolist())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["left-right-both", "yes-no", "2ifc"])
def test_errors_shrink_with_trials_and_are_least_under_the_bayesian_rule(
    kind: str, tmp_path: Path
) -> None:
    blanks = {} if kind == "2ifc" else {"blank_trials": 8}
    study = first_study().changed(
        task={"kind": kind},
        design={"levels_vpp": LEVELS, "trials_per_side": 40} | blanks,
        simulation={"threshold_vpp": 90.0, "threshold_sd_db": 2.0},
    )
    table = compare_rules(study, tmp_path, participants=12, seed=2, gains=())
    assert [*table["rule"].unique()] == [*RULES]
    assert set(table["trials"]) == {8, 12, 16, 24, 32, 40}
    keys = zip(table["rule"].tolist(), table["trials"].tolist(), strict=True)
    errors_db = dict(zip(keys, table["rms_db"].tolist(), strict=True))
    assert all(errors_db[rule, 32] < errors_db[rule, 12] for rule in RULES)
    assert errors_db["bayesian", 16] < errors_db["constant", 16]
    assert np.all(np.abs(table.loc[table["trials"].eq(32), "bias_db"].to_numpy()) < 1.0)
    assert [line.split()[0] for line in format_rules(table)] == ["trials", *RULES]


def test_a_study_whose_levels_no_rule_can_choose_is_refused(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("init", "--preset", "recommended").exit_code == 0
    told = run("dry-run", "study.toml", "--compare", "--out", "tried")
    assert (told.exit_code, told.stderr.count("\n")) == (2, 1)
    assert "design.order" in told.stderr
