"""The page of columns tells what every table has, that of a session and of an analysis."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from experiment.session.simulate import simulate_study
from experiment.study.read import read_study
from experiment.terms.gains import ConditionGains
from experiment.terms.record import COLUMNS
from tactstrip import main

FOLDER = Path(__file__).parents[2] / "docs" / "_ext"


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("reference.tables")


def test_a_column_of_trials_means_in_an_analysis_what_it_means_in_a_session(tables: Any) -> None:
    told = tables.meanings("trials_clean.csv")
    for column in COLUMNS:
        assert told[column.name].startswith(column.description), column.name
        assert all(word in told[column.name] for word in column.choices), column.name


def test_a_column_in_a_lab_s_own_unit_is_not_told_in_volts(tables: Any) -> None:
    told = tables.meanings("trials_clean.csv")
    own = {column.name.removesuffix("_vpp") for column in COLUMNS if "_vpp" in column.name}
    assert own == {"level", "level_left", "level_right", "level_planned"}
    assert [name for name in own if "levels' unit" not in told[name] or "volt" in told[name]] == []


@pytest.mark.slow
def test_every_column_of_a_field_is_told(tables: Any, tmp_path: Path) -> None:
    for options in ((), ("--band", "100", "200")):
        out = tmp_path / "field.csv"
        study = FOLDER / "reference" / "studies" / "marked.toml"
        done = CliRunner().invoke(main, ["field", str(study), *options, "--out", str(out)])
        assert done.exit_code == 0, done.output
        heads = out.read_text(encoding="utf-8").partition("\n")[0].split(",")
        assert len({tables.of_field(name) for name in heads}) == len(heads)
        out.unlink()


@pytest.mark.slow
def test_a_practised_session_beside_simulated_ones_is_marked_in_every_table(
    tables: Any, tmp_path: Path
) -> None:
    text = "[design]\ntrials_per_side = 5\nboth_trials = 2\n[masking]\nnoise = 'none'\n"
    (study := tmp_path / "study.toml").write_text(text, encoding="utf-8")
    results, out = tmp_path / "results", tmp_path / "out"
    gains = ConditionGains(
        condition="main", actuators=("left", "right"), bases=("measured", "measured"),
        per_vpp=((0.03, 0.001), (0.001, 0.03)),
    )  # fmt: skip
    [*_] = simulate_study(read_study(study), results, participants=2, seed=7, gains=(gains,))
    marked = importlib.import_module("reference.marked")
    marked.practise(study, results, "03")
    marked.alter(results / "sub-02" / "ses-01" / "trials.csv")
    accepted = ["--allow-simulated", "--accept-altered", "--no-figures", "--out", str(out)]
    done = CliRunner().invoke(main, ["analyze", str(results), *accepted])
    assert done.exit_code == 0, done.output
    marks = [*tables.MARKS]
    for path in out.glob("*.csv"):
        heads = path.read_text(encoding="utf-8").partition("\n")[0].split(",")
        assert heads[-len(marks) :] == marks or path.name == "trials_clean.csv", path.name
    last = (out / "thresholds.csv").read_text(encoding="utf-8").splitlines()[-1]
    assert last.endswith(",mixed,mixed,mixed")
