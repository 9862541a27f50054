"""`tactstrip bursts` compares bursts on a plate: the JSON that it prints, and the lines to copy."""

from __future__ import annotations

import json
import math
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.test_experiment.studies import discs, facts_of, measured

if TYPE_CHECKING:
    from tests.conftest import Run

SUPPORTED = 'edge = "simply-supported"'
PEOPLE = "[simulation]\nthreshold_um = 1.57\nthreshold_at_hz = 500\n"
MOVED = measured(3.1, 100, 200)


def study_text(edge: str = 'edge = "clamped"', *, moved: str = MOVED, more: str = "") -> str:
    """Return a plate of steel, 60 mm wide; simply supported its cut-off is 342 Hz."""
    return (
        f"[strip]\nwidth_mm = 60\nlength_mm = 200\nthickness_mm = 0.5\n{edge}\n"
        f'material = "steel"\n{discs(moved, x_mm=40)}'
        f'[burst]\nfrequency_hz = 200\ncycles = 1\nwindow = "hann"\n{more}'
    )


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def compared(
    run: Run, text: str, hz: str, cycles: str, *more: str, exit_code: int = 0
) -> dict[str, Any]:
    """Compare bursts of these frequencies and cycles on the plate of a study."""
    Path("study.toml").write_text(text, "utf-8")
    options = ("--json", "--frequency-hz", hz, "--cycles", cycles)
    result = run("bursts", "study.toml", *options, *more)
    assert (result.exit_code, result.stderr) == (exit_code, "")
    facts: dict[str, Any] = json.loads(result.stdout)
    return facts


@pytest.mark.slow
def test_a_row_is_what_the_check_says_of_a_study_with_these_lines(run: Run) -> None:
    text = study_text(more=PEOPLE)
    (row,) = compared(run, text, "250", "3")["bursts"]
    lines = text.replace("_hz = 200", "_hz = 250").replace("cycles = 1", "cycles = 3")
    for edge, like in zip(
        row["edges"], (lines, lines.replace("clamped", "simply-supported")), strict=True
    ):
        check = facts_of(like)
        (condition,) = check["conditions"]
        actuators = condition["displacements"]["actuators"]
        assert edge["edge"] == check["strip"]["edge"]
        assert edge["crosstalk_db"] == max(one["fingers"][0]["crosstalk_db"] for one in actuators)
        for key in ("energy_above_cutoff", "staircase_energy_above_cutoff", "verdict", "reasons"):
            assert edge[key] == condition[key]
    check = facts_of(lines)
    actuators = check["conditions"][0]["displacements"]["actuators"]
    assert row["peak_um"] == {one["name"]: one["peak_um"] for one in actuators}
    (threshold,) = check["simulated"]["thresholds"]
    assert row["threshold_vpp"] == threshold["threshold_vpp"]
    alternative = check["strip"]["alternative_edge"]
    assert row["edges"][1]["crosstalk_db"] == alternative["crosstalk_db"]
    assert (alternative["verdict"], row["within_limits"]) == ("violates a limit", False)


@pytest.mark.slow
def test_the_best_burst_is_the_shortest_and_the_table_is_sorted_by_threshold(run: Run) -> None:
    facts = compared(run, study_text(more=PEOPLE), "100,200,300", "1,3")
    fit = [row for row in facts["bursts"] if row["within_limits"]]
    assert {(row["frequency_hz"], row["cycles"]) for row in fit} >= {(100, 3), (200, 3)}
    assert facts["best"] == min(fit, key=itemgetter("duration_s"))
    thresholds = [row["threshold_vpp"] for row in facts["bursts"]]
    assert thresholds == sorted(thresholds)


@pytest.mark.slow
def test_the_lines_of_the_best_burst_make_it_the_study_s(run: Run) -> None:
    facts = compared(run, study_text(), "200,300", "1,3")
    best = facts["best"]
    assert (best["frequency_hz"], best["cycles"], best["within_limits"]) == (200.0, 3, True)
    assert [row for row in facts["bursts"] if row["within_limits"]] == [best]
    for row in facts["bursts"]:
        assert row["edges"][0]["verdict"] == "within limits"
    options = ("--frequency-hz", "200,300", "--cycles", "1,3")
    page = run("bursts", "study.toml", *options).stdout
    assert "\nfrequency_hz = 200\ncycles = 3\n" in page
    text = study_text().replace("cycles = 1", "cycles = 3")
    rows = compared(run, text, "200,300", "1,3")["bursts"]
    (own,) = (row for row in rows if row["conditions"])
    assert (own["frequency_hz"], own["cycles"], own["conditions"]) == (200.0, 3, ["main"])
    assert "\nfrequency_hz = 200" not in run("bursts", "study.toml", *options).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("edge", "hz", "cycles", "best", "edges", "exit_code"),
    [
        (SUPPORTED, "300", "1", None, ["simply-supported", "clamped"], 1),
        ('edge = "clamped"', "300", "2", False, ["clamped", "simply-supported"], 0),
        (
            'edge = "measured-cutoff"\nmeasured_cutoff_hz = 600',
            "200",
            "3",
            True,
            ["measured-cutoff"],
            0,
        ),
        ('edge = "clamped"\nmeasured_cutoff_hz = 600', "200", "3", True, ["clamped"], 0),
        ('edge = "elastic"\nedge_stiffness_n = 900', "200", "3", True, ["elastic"], 0),
    ],
)
def test_the_other_ideal_edge_counts_where_no_more_is_known(
    edge: str,
    hz: str,
    cycles: str,
    *,
    best: bool | None,
    edges: list[str],
    exit_code: int,
    run: Run,
) -> None:  # one line of parameters
    facts = compared(run, study_text(edge), hz, cycles, exit_code=exit_code)
    assert [one["edge"] for one in facts["edges"]] == edges
    assert (facts["best"] and facts["best"]["within_limits"]) == best


@pytest.mark.slow
def test_thresholds_are_compared_where_no_displacement_is_known_as_where_it_is(run: Run) -> None:
    of_own = "[simulation]\nthreshold_um = 1.13\nthreshold_at_hz = 200\nthreshold_at_s = 0.005\n"
    in_volts, in_db = (
        sorted(compared(run, text, "140,200", "1,3")["bursts"], key=itemgetter("duration_s"))
        for text in (study_text(more=of_own), study_text(moved=""))
    )
    (own_vpp,) = [row["threshold_vpp"] for row in in_volts if row["conditions"]]
    for volts, decibels in zip(in_volts, in_db, strict=True):
        assert (volts["threshold_db"], decibels["threshold_vpp"]) == (None, None)
        level_db = 20 * math.log10(volts["threshold_vpp"] / own_vpp)
        assert decibels["threshold_db"] == pytest.approx(level_db, abs=0.005)
    levels_db = [row["threshold_db"] for row in in_db]
    assert max(levels_db) - min(levels_db) > 3


@pytest.mark.slow
@pytest.mark.parametrize(
    "burst",
    [
        '[burst]\nfrequency_hz = 200\ncycles = 2\nwindow = "auto"\nmax_crosstalk_db = -1\n',
        '[burst]\nfile = "click.csv"\n',
        '[burst]\nfrequency_hz = 200\ncycles = 1\nwindow = "none"\n',
    ],
)
def test_a_window_that_is_named_is_compared_whatever_the_study_has(burst: str, run: Run) -> None:
    samples = (math.sin(2 * math.pi * number / 96) for number in range(97))
    Path("click.csv").write_text("\n".join(f"{sample:.6f}" for sample in samples), "utf-8")
    sine = '[burst]\nfrequency_hz = 200\ncycles = 1\nwindow = "hann"\n'
    more = "" if "file" in burst else PEOPLE + "threshold_at_s = 0.01\n"
    text = study_text(more=more)
    (plain,) = compared(run, text, "100", "1", "--window", "hann")["bursts"]
    facts = compared(run, text.replace(sine, burst), "100", "1", "--window", "hann")
    (row,) = facts["bursts"]
    same = {"threshold_db": row["threshold_db"], "conditions": row["conditions"]}
    assert row == plain | same
    assert facts["window"] == "hann"
