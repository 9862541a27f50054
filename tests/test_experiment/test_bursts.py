"""`tactstrip bursts` compares bursts on a plate, and `tactstrip init` chooses one of them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from experiment.preview.bursts.choice import CANDIDATES, chosen_burst
from experiment.preview.bursts.compared import compare_bursts, grid_of, with_burst
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.preview.edges import with_other_edge
from experiment.study.read import paper_study, study_from_text

if TYPE_CHECKING:
    from experiment.study.study import Study
    from tests.conftest import Refused, Run


def study_text(edge: str = 'edge = "clamped"', *, thickness_mm: float = 0.5, more: str = "") -> str:
    """Return a plate of steel, 60 mm wide; simply supported its cut-off is 342 Hz."""
    discs = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12.8\n{{0}}'
        for side, x_mm in (("left", -40), ("right", 40))
    ).replace("{0}", MEASURED)
    return (
        f"[strip]\nwidth_mm = 60\nlength_mm = 200\nthickness_mm = {thickness_mm}\n{edge}\n"
        f'material = "steel"\n{discs}[burst]\nfrequency_hz = 200\ncycles = 1\nwindow = "hann"\n'
        f"{more}"
    )


MEASURED = "measured_displacement_um = 3.1\nmeasured_at_vpp = 200\nmeasured_at_hz = 100\n"
PLAIN = "window = 'none'\ncycles = 1\naccept_unfit = 'control'"
SUPPORTED = 'edge = "simply-supported"'
PEOPLE = "[simulation]\nthreshold_um = 1.57\nthreshold_at_hz = 500\n"


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def told(run: Run, *words: str, text: str, exit_code: int = 0) -> Any:
    """Return what a command says of a study file to programs."""
    Path("study.toml").write_text(text, "utf-8")
    result = run(words[0], "study.toml", "--json", *words[1:])
    assert (result.exit_code, result.stderr) == (exit_code, "")
    return json.loads(result.stdout)


@pytest.mark.slow
def test_a_row_is_what_the_check_says_of_a_study_with_these_lines(run: Run) -> None:
    text = study_text(more=PEOPLE)
    bursts = told(run, "bursts", "--frequency-hz", "250", "--cycles", "3", text=text)
    (row,) = bursts["bursts"]
    lines = text.replace("_hz = 200", "_hz = 250").replace("cycles = 1", "cycles = 3")
    for edge, words in zip(row["edges"], (lines, lines.replace("clamped", "simply-supported")),
                           strict=True):  # fmt: skip
        check = told(run, "check", text=words, exit_code=int(edge["verdict"] == "unfit"))
        (condition,) = check["conditions"]
        moved = condition["displacements"]["actuators"]
        assert edge["edge"] == check["strip"]["edge"]
        assert edge["level_db"] == max(one["fingers"][0]["level_db"] for one in moved)
        for key in ("energy_above_cutoff", "staircase_energy_above_cutoff", "verdict", "reasons"):
            assert edge[key] == condition[key]
    check = told(run, "check", text=lines)
    moved = check["conditions"][0]["displacements"]["actuators"]
    assert row["own_um"] == {one["name"]: one["own_um"] for one in moved}
    assert row["threshold_vpp"] == check["simulated_threshold"]["threshold_vpp"]
    other = check["strip"]["other_edge"]
    assert row["edges"][1]["level_db"] == other["level_db"]
    assert (other["verdict"], row["fit"]) == ("unfit", False)


def test_the_lines_of_the_best_burst_make_it_the_study_s(run: Run) -> None:
    Path("study.toml").write_text(study_text(), "utf-8")
    options = ("--frequency-hz", "200,300", "--cycles", "1,3")
    result = run("bursts", "study.toml", *options)
    assert (result.exit_code, result.stderr) == (0, "")
    table, _, best = result.stdout.partition("\nshortest ")
    assert best.splitlines()[0].strip() == "3 cycles of 200 Hz: fit with both edges"
    assert "\nfrequency_hz = 200\ncycles = 3\n" in best
    assert [line.split()[-1] for line in table.strip().splitlines()[-4:]] == [
        *("clamped", "both", "clamped", "clamped")
    ]
    own = study_text().replace("cycles = 1", "cycles = 3")
    Path("study.toml").write_text(own, "utf-8")
    again = run("bursts", "study.toml", *options).stdout
    assert "the shortest (*) is that of study.toml\n" in again
    assert "# shortest" not in again
    assert "\n*200       3 " in again
    assert Path("study.toml").read_text("utf-8") == own


@pytest.mark.slow
def test_the_quietest_of_those_that_are_as_fit_is_named(run: Run) -> None:
    Path("study.toml").write_text(study_text(), "utf-8")
    found = told(run, "bursts", "--frequency-hz", "200", "--cycles", "2,3", text=study_text())
    levels_db = [max(end["level_db"] for end in row["edges"]) for row in found["bursts"]]
    rows = [row for row in found["bursts"] if row["fit"]]
    assert found["quietest"]["level_db"] == min(
        level_db for level_db, row in zip(levels_db, found["bursts"], strict=True) if row in rows
    )
    said = run("bursts", "study.toml", "--frequency-hz", "200", "--cycles", "2,3").stdout
    level_db = found["quietest"]["level_db"]
    words = f"3 cycles of 200 Hz: {level_db:.1f} dB at the other finger with the worse edges"
    assert f"\nquietest       {words}\n" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("inside_db", "near"), [(2.3, "that is 2.3 dB inside the limit; for more:"), (7, ""), (-1, "")]
)
def test_a_level_near_its_limit_with_the_other_edge_is_pointed_at(
    inside_db: float, near: str
) -> None:
    study = with_burst(study_from_text(study_text(), "study.toml"), 200, 3)
    level_db = check_findings(check_study(study), "s").facts["strip"]["other_edge"]["level_db"]
    limited = study.changed(burst=replace(study.burst, masking_limit_db=-level_db - inside_db))
    found = check_findings(check_study(limited), "study.toml")
    assert found.text.count(" dB inside the limit; ") == bool(near)
    assert near in found.text


def test_where_none_is_fit_lower_frequencies_are_named_and_the_exit_code_is_1(run: Run) -> None:
    Path("study.toml").write_text(study_text(SUPPORTED), "utf-8")
    result = run("bursts", "study.toml", "--frequency-hz", "300", "--cycles", "1")
    assert (result.exit_code, result.stderr) == (1, "")
    assert "none of these is fit: try --frequency-hz 43,85,110,170, more --cycles," in result.stdout


def test_without_an_edge_that_is_fit_with_both_the_stated_one_counts(run: Run) -> None:
    Path("study.toml").write_text(study_text(), "utf-8")
    said = run("bursts", "study.toml", "--frequency-hz", "300", "--cycles", "2").stdout
    assert "fit with clamped edges; none is fit with both\n" in said
    assert "measure the cut-off before it is used" in said


@pytest.mark.parametrize(
    ("edge", "why"),
    [
        ("measured_cutoff_hz = 600", "its cut-off was measured"),
        ('edge = "clamped"\nmeasured_cutoff_hz = 600', "its cut-off was measured"),
        ('edge = "elastic"\nedge_stiffness_n = 900', "its stiffness is stated"),
    ],
)
def test_edges_of_which_more_is_known_have_no_other_ones(edge: str, why: str, run: Run) -> None:
    Path("study.toml").write_text(study_text(edge), "utf-8")
    said = run("bursts", "study.toml", "--frequency-hz", "200", "--cycles", "3").stdout
    assert f"no other edge is tried: {why}" in said
    assert "\n*" not in said
    assert said.partition("\nshortest")[0].split()[-1] == "yes"


def test_thresholds_are_compared_where_no_displacement_is_known_as_where_it_is(run: Run) -> None:
    options = ("--frequency-hz", "140,200", "--cycles", "1,3")
    of_own = "[simulation]\nthreshold_um = 1.13\nthreshold_at_hz = 200\nthreshold_at_s = 0.005\n"
    in_volts = told(run, "bursts", *options, text=study_text(more=of_own))["bursts"]
    in_db = told(run, "bursts", *options, text=study_text().replace(MEASURED, ""))["bursts"]
    (own_vpp,) = [row["threshold_vpp"] for row in in_volts if row["is_of_study"]]
    for volts, decibels in zip(in_volts, in_db, strict=True):
        assert (volts["threshold_db"], decibels["threshold_vpp"]) == (None, None)
        level_db = 20 * math.log10(volts["threshold_vpp"] / own_vpp)
        assert decibels["threshold_db"] == pytest.approx(level_db, abs=0.005)
    levels_db = [row["threshold_db"] for row in in_db]
    assert max(levels_db) - min(levels_db) > 3


def test_the_most_felt_is_named_re_the_study_s_where_no_displacement_is_known(run: Run) -> None:
    Path("study.toml").write_text(study_text().replace(MEASURED, ""), "utf-8")
    said = run("bursts", "study.toml", "--frequency-hz", "200", "--cycles", "1,3").stdout
    assert "\nfelt           threshold in volts, dB re 1 cycle of 200 Hz; the lower, " in said
    assert "estimated by published curves of sines, some beyond what was measured; docs/" in said
    assert re.search(r"\n\*200 .* 0\.0   clamped\n", said)
    assert re.search(
        r"\nmost felt      3 cycles of 200 Hz, at -2\.\d dB re 1 cycle of 200 Hz\n", said
    )


def test_the_bursts_of_all_conditions_are_compared_and_marked(run: Run) -> None:
    conditions = "".join(
        f'[[condition]]\nname = "{name}"\n{keys}\n'
        for name, keys in (("one", "cycles = 4"), ("two", "frequency_hz = 170"), ("none", PLAIN))
    )
    study = study_from_text(study_text(more=conditions), "study.toml")
    assert {(200.0, 4), (170.0, 1), (170.0, 3)} <= set(grid_of(study))
    Path("study.toml").write_text(study_text(more=conditions), "utf-8")
    said = run("bursts", "study.toml", "--frequency-hz", "170,200", "--cycles", "1,4").stdout
    assert "marked (*): conditions one, two\n" in said
    assert "not among these bursts: condition none\n" in said
    assert {line.split()[0] for line in said.splitlines() if line.startswith("*")} == {
        *("*170", "*200")
    }
    assert "the shortest (*) is that of condition one of study.toml\n" in said


def test_what_is_felt_most_easily_is_named_where_thresholds_are_known(run: Run) -> None:
    Path("study.toml").write_text(study_text(more=PEOPLE), "utf-8")
    said = run("bursts", "study.toml", "--frequency-hz", "100,200", "--cycles", "3").stdout
    assert "\nmost felt      3 cycles of 200 Hz, from " in said
    lines = said.partition("for another burst write its lines into [burst] of study.toml:\n")[2]
    named = {"shortest", "quietest", "most felt"}
    assert named == {name for line in lines.splitlines() if line.startswith("# ")
                     for name in line[2:].split(", ")}  # fmt: skip
    of_felt = lines.partition("most felt")[2].splitlines()[1:3]
    assert of_felt == ["frequency_hz = 200", "cycles = 3"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--frequency-hz", "3"), "error: --frequency-hz must be a finite number >= 5 and <= 1000"),
        (("--frequency-hz", "0.2"), "if these are kilohertz, write --frequency-hz 200"),
        (("--frequency-hz", "2;3"), "--frequency-hz must be numbers with commas between them; got"),
        (("--cycles", "0"), "error: --cycles must be a whole number from 1 to 1000000; got 0"),
        (("--cycles", "1.5"), "error: --cycles must be whole numbers with commas between them; g"),
        (("--cycles", "2000"), "error: the burst must last at most design.response_window_s = 3;"),
    ],
)
def test_what_cannot_be_compared_is_refused_by_its_option(
    options: tuple[str, str], said: str, refused: Refused
) -> None:
    Path("study.toml").write_text(study_text(), "utf-8")
    refusal = refused("bursts", "study.toml", *options)
    assert said in refusal
    assert refusal.count("\n") == 1


def test_a_window_that_is_chosen_is_not_compared(refused: Refused) -> None:
    auto = study_text().replace('"hann"', '"auto"\nwanted_level_db = -20').replace("= 1\n", "= 3\n")
    Path("study.toml").write_text(auto, "utf-8")
    told = (
        'of one window are compared, and [burst] has window = "auto"; name one, such as --window h'
    )
    assert told in refused("bursts", "study.toml")


SINE = '[burst]\nfrequency_hz = 200\ncycles = 1\nwindow = "hann"\n'
AUTO = SINE.replace('"hann"', '"auto"\nwanted_level_db = -1').replace("= 1\n", "= 2\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("burst", "people", "gone", "has"),
    [
        (AUTO, f"{PEOPLE}threshold_at_s = 0.01\n", "wanted_level_db", "auto"),
        ('[burst]\nfile = "click.csv"\n', "", "file", "a file"),
    ],
)
def test_a_window_that_is_named_is_compared_whatever_the_study_has(
    burst: str, people: str, gone: str, has: str, run: Run
) -> None:
    samples = (math.sin(2 * math.pi * number / 96) for number in range(97))
    Path("click.csv").write_text("\n".join(f"{one:.6f}" for one in samples), "utf-8")
    options = ("--window", "hann", "--frequency-hz", "100", "--cycles", "1")
    (plain,) = told(run, "bursts", *options, text=study_text(more=people))["bursts"]
    text = study_text(more=people).replace(SINE, burst)
    (row,) = told(run, "bursts", *options, text=text)["bursts"]
    assert row == plain | {"threshold_db": None}, "of no burst in [burst] are others in dB"
    said = run("bursts", "study.toml", *options).stdout
    assert f"\nwindow         hann, where [burst] has {has}\n" in said
    assert f"into [burst] of study.toml, without {gone}:\n" in said

    _, _, lines = said.partition("\n# ")
    Path("study.toml").write_text(text.replace(burst, f"[burst]\n# {lines}"), "utf-8")
    assert "the shortest (*) is that of study.toml" in run("bursts", "study.toml", *options).stdout


def test_what_a_study_accepts_as_unfit_is_not_fit() -> None:
    study = study_from_text(study_text().replace("cycles = 1", 'accept_unfit = "why"\n'), "s.toml")
    (row,) = compare_bursts(study, [(500.0, 1)], lambda done, total: None).rows
    assert not row.stated.is_fit
    assert row.stated.found is not None
    assert row.stated.found.verdict == "unfit"


def test_bursts_are_those_that_are_felt_well_with_the_study_s_own() -> None:
    grid = grid_of(paper_study())
    assert {hz for hz, _ in grid} == {200, 250, 300, 400, 500}
    assert {cycles for _, cycles in grid} == {1, 2, 3}
    assert (120.0, 7) in grid_of(with_burst(paper_study(), 120.0, 7))


def plate(edge: str, thickness_mm: float) -> dict[str, Any]:
    """Return the burst that a plate gets, with what it is fit with."""
    text = study_text(edge, thickness_mm=thickness_mm)
    study = study_from_text(text, "study.toml")

    def with_keys(burst: dict[str, Any]) -> Study:
        return study.changed(burst=burst, condition=[{"name": "main"}])

    chosen = chosen_burst(with_keys, lambda done, total: None)
    return {
        "burst": chosen.study.conditions[0].stated,
        "verdict": chosen.found.verdict,
        "other": chosen.is_fit_with_other,
        "words": chosen.words,
    }


@pytest.mark.slow
def test_a_new_plate_gets_the_shortest_burst_that_is_fit_with_both_edges() -> None:
    found = plate('edge = "clamped"', 0.5)
    assert (found["burst"].frequency_hz, found["burst"].cycles) == (200, 3)
    assert found["words"].endswith("is fit with clamped and with simply supported edges")
    study = study_from_text(study_text(), "study.toml")
    compared = compare_bursts(study, grid_of(study), lambda done, total: None)
    assert compared.best is not None
    assert compared.best.burst == found["burst"]


@pytest.mark.slow
def test_where_none_is_fit_with_both_edges_it_says_so() -> None:
    found = plate('edge = "clamped"', 0.4)
    assert (found["verdict"], found["other"]) == ("fit", False)
    assert "with simply supported ones all are unfit: measure the cut-off" in found["words"]
    measured = plate("measured_cutoff_hz = 600", 0.5)
    assert (measured["verdict"], measured["other"]) == ("fit", None)
    assert measured["words"] == "the shortest of those tried that is fit"


def test_candidates_are_tried_from_the_shortest_on() -> None:
    lengths_s = [round(burst.duration_s, 9) for burst in CANDIDATES]
    assert lengths_s == sorted(lengths_s)
    assert (CANDIDATES[0].frequency_hz, CANDIDATES[0].cycles) == (500, 1)


def test_a_study_of_ideal_edges_has_another_one() -> None:
    study = study_from_text(study_text(SUPPORTED), "study.toml")
    other = with_other_edge(study)
    assert other is not None
    assert other.plate.edge == "clamped"
    assert with_other_edge(other) == study


@pytest.mark.slow
def test_another_window_is_compared_and_its_line_is_printed(run: Run) -> None:
    Path("study.toml").write_text(study_text(more=PEOPLE), "utf-8")
    options = ("--frequency-hz", "100,200", "--cycles", "1", "--window")
    said = run("bursts", "study.toml", *options, "none").stdout
    assert "\nwindow         none, where [burst] has hann\n" in said
    assert "*200" not in said
    assert '\ncycles = 1\nwindow = "none"\n' in said
    text = study_text(more=PEOPLE)
    of_file = told(run, "bursts", *options[:-1], text=text.replace('"hann"', '"none"'))
    by_option = told(run, "bursts", *options, "none", text=text)
    assert of_file["window"] == by_option["window"] == "none"
    for mine, theirs in zip(by_option["bursts"], of_file["bursts"], strict=True):
        assert mine | {"is_of_study": None} == theirs | {"is_of_study": None}


@pytest.mark.parametrize("window", ["foo", "auto"])
def test_an_unknown_window_to_compare_is_refused(refused: Refused, window: str) -> None:
    Path("study.toml").write_text(study_text(), "utf-8")
    said = refused("bursts", "study.toml", "--window", window)
    assert f"--window must be one of none, hann, tukey, gaussian; got '{window}'" in said


def test_the_shortest_burst_with_room_for_levels_is_named(run: Run) -> None:
    study = f'{PEOPLE}threshold_at_s = 0.002\n[burst]\nwindow = "hann"\n'
    options = ("--frequency-hz", "200", "--cycles", "1,2,3")
    found = told(run, "bursts", *options, text=study)
    thresholds = {row["cycles"]: row["threshold_vpp"] for row in found["bursts"]}
    assert thresholds[1] > thresholds[2] > thresholds[3]
    ceiling_vpp = 2 * (thresholds[1] + thresholds[2])  # a quarter lies between the two
    of_two = f"{study}[device]\nceiling_vpp = {ceiling_vpp}\n"
    of_two += f"[design]\nlevels_vpp = [{0.3 * ceiling_vpp}, {0.9 * ceiling_vpp}]\n"
    assert told(run, "bursts", *options, text=of_two)["with_room"] == {
        "frequency_hz": 200,
        "cycles": 2,
    }
    said = run("bursts", "study.toml", *options).stdout
    assert (
        "\nwith room      2 cycles of 200 Hz: the shortest of these felt below a quarter of device."
        in said
    )
    assert "would be" not in said
    many = run("bursts", "study.toml", "--frequency-hz", "200", "--cycles", "1,9").stdout
    assert "\nwith room      9 cycles of 200 Hz: " in many
    assert "\n               about 2 cycles of 200 Hz would be, too: --cycles 2\n" in many
    few = run("bursts", "study.toml", "--frequency-hz", "200", "--cycles", "1").stdout
    assert "\nwith room      none of these is felt below a quarter of device.ceiling_vpp, " in few
    assert " V: about 2 cycles of 200 Hz would be, by --cycles\n" in few


def test_no_burst_is_said_to_leave_room_whose_like_is_unfit(run: Run) -> None:
    study = f'{PEOPLE}threshold_at_s = 0.002\n[burst]\nwindow = "hann"\n'
    options = ("--frequency-hz", "200", "--cycles", "1,2,9")
    found = told(run, "bursts", *options, text=study)
    energy = {
        row["cycles"]: max(
            one[f"{of}energy_above_cutoff"] for one in row["edges"] for of in ("", "staircase_")
        )
        for row in found["bursts"]
    }
    assert energy[2] > energy[9]
    thresholds = {row["cycles"]: row["threshold_vpp"] for row in found["bursts"]}
    ceiling_vpp = 2 * (thresholds[1] + thresholds[2])  # a quarter lies between the two
    study += f"max_energy_above_cutoff = {{}}\n[device]\nceiling_vpp = {ceiling_vpp}\n"
    study += f"[design]\nlevels_vpp = [{0.3 * ceiling_vpp}, {0.9 * ceiling_vpp}]\n"
    said = []
    for limit in (0.01, (energy[2] + energy[9]) / 2):
        Path("study.toml").write_text(study.format(f"{limit:.6g}"), "utf-8")
        said.append(run("bursts", "study.toml", *options[:3], "1,2,9").stdout)
    assert "with room      2 cycles of 200 Hz: " in said[0]
    assert "with room      9 cycles of 200 Hz: " in said[1]
    (shorter,) = re.findall(r"about (\d) cycles of 200 Hz would be, too: --cycles", said[1])
    assert 2 < int(shorter) < 9
