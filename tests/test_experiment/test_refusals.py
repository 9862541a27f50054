"""Study files that are refused: in one line that has the key's path, the bound and the value.

That every number is refused just outside its range is shown in test_sections.py. What a refusal
says would be right is right: every value that it names is accepted when it is applied.
"""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from experiment import Study, StudyError, paper_study, read_study, study_from_text
from tests.plates import PAPER_PLATE, on_paper_plate, toml
from tests.test_experiment.studies import cases, discs, measured

if TYPE_CHECKING:
    from tests.conftest import Refused


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def faults_of(text: str) -> StudyError:
    with pytest.raises(StudyError) as caught:
        study_from_text(on_paper_plate(text), "s.toml")
    return caught.value


HUGE = [
    (PAPER_PLATE + "[burst]\nfrequency_hz = 1" + "0" * 400, "burst.frequency_hz"),
    (PAPER_PLATE + "[burst]\nfrequency_hz = 0x1" + "0" * 6000, "burst.frequency_hz"),
    ("x = " + "[" * 9999, ""),
]


@pytest.mark.parametrize(("text", "expected"), [*cases("studies"), *HUGE])
def test_every_fault_is_a_line_with_key_rule_and_value(text: str, expected: str) -> None:
    error = faults_of(text)
    lines = str(error).splitlines()
    assert lines == [f"s.toml: {fault}" for fault in error.faults]
    assert max(map(len, lines)) < 400
    for line, fault, part in zip(lines, error.faults, expected.split(" | "), strict=True):
        key, _, rest = part.partition(" (got ")
        hint = rest.partition("; did you mean ")[2] or key.partition("; did you mean ")[2]
        assert fault.key == key.partition("; ")[0]
        assert rest in line
        assert hint in line


def test_every_fault_is_reported_at_once() -> None:
    error = faults_of("[design]\na = 1\nb = 2\norder = 3\n[study]\nname = 4\n")
    assert [fault.key for fault in error.faults] == [
        "study.name",
        "design.order",
        "design.a",
        "design.b",
    ]


def test_a_study_needs_a_plate_and_an_actuator_for_each_finger() -> None:
    for text, keys in (
        ("", ["strip", "actuator"]),
        (
            "strip = {width_mm = 30}\nactuator = []",
            ["strip.length_mm", "strip.thickness_mm", "strip.edge"],
        ),
    ):
        with pytest.raises(StudyError) as caught:
            study_from_text(text, "s.toml")
        assert [fault.key for fault in caught.value.faults] == keys


WIDE = (
    '[strip]\nwidth_mm = 60\nlength_mm = 200\nthickness_mm = 0.5\nmaterial = "steel"\n'
    f'edge = "clamped"\n{discs()}[burst]\nfrequency_hz = 200\ncycles = 3\nwindow = "hann"\n'
)
FILES = {
    "study.toml": on_paper_plate(""),
    "old.toml": "# mine",
    "old.png": "mine",
    "old.svg": "mine",
    "old.csv": "mine",
    "endless.toml": on_paper_plate('[strip]\nlength_mm = "endless"\n'),
    "steel.toml": WIDE,
    "auto.toml": WIDE.replace('"hann"', '"auto"\nmax_crosstalk_db = -20'),
    "gpib.toml": on_paper_plate("device.driver = 'gpib'"),
    "misspelt.toml": on_paper_plate("design.trails_per_side = 3"),
    "unclosed.toml": "[design",
    "slow.toml": on_paper_plate("device.sample_rate_hz = 1500"),
    "blocks.toml": on_paper_plate("design = {order = 'balanced', break_every = 2}"),
    "high.toml": on_paper_plate(discs(measured(2, 9000))),
    "click.toml": on_paper_plate("burst.file = 'click.csv'"),
    "click.csv": "0\n1\n1\n0\n",
}  # names and contents
PLATE: dict[str, str] = {
    "--width-mm": "30",
    "--thickness-mm": "0.5",
    "--length-mm": "150",
    "--material": "steel",
    "--edge": "clamped",
    "--actuator": "disc:12.8@35",
    "--ceiling-vpp": "200",
}  # options and values


@pytest.mark.parametrize(("command", "parts"), cases("commands"))
def test_a_command_is_refused_in_one_line_and_changes_nothing(
    command: str, parts: str, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)  # no ffmpeg
    for name, content in FILES.items():
        Path(name).write_text(content, encoding="utf-8")
    word, *options = command.split()
    if word == "plate":
        changed = PLATE | dict(option.split("=", 1) for option in options)
        options = [
            "new.toml",
            "--preset",
            "plate",
            *(part for pair in changed.items() for part in pair),
        ]
    message = refused("init" if word == "plate" else word, *options)
    assert [part for part in parts.split(" | ") if part not in message] == []
    assert message.count("error: ") == 1
    assert word == "init" or message.count("\n") == 1


def test_what_is_at_a_bound_or_means_something_there_is_accepted() -> None:
    card = "device = {driver = 'audio', port = 'x', volts_full_scale = 56.6}\n"
    design = "design = {trials_per_side = 2, levels_vpp = [20.0, 113.2]}"
    study_from_text(on_paper_plate(card + design), "s.toml")
    texts = "{hands_off_after = '{none}', hands_off_before = '{none}', prompt_hands_off = '{none}'}"
    study_from_text(on_paper_plate(f"texts = {texts}"), "s.toml")


def test_a_file_that_cannot_be_read_is_one_clear_line(tmp_path: Path) -> None:
    path, in_latin = tmp_path / "s.toml", "[study]\n# \xe9\n".encode("latin-1")
    wide = "[study]".encode("utf-16")
    for content, part in ((None, "No such"), (in_latin, "line 2: "), (wide, "UTF-8")):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(StudyError) as caught:
            read_study(path)
        assert part in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_study_file_with_a_byte_order_mark_is_the_study_without_it(tmp_path: Path) -> None:
    plain, marked = tmp_path / "plain.toml", tmp_path / "marked.toml"
    plain.write_text(on_paper_plate(""), encoding="utf-8")
    marked.write_text(on_paper_plate(""), encoding="utf-8-sig")
    assert read_study(marked) == read_study(plain)


TORN = [
    ("[strip]\nmeasured_on = 04.05.2026", "at line 2"),
    ("[strip]\nwidth_mm = 30,5 # mm", "at line 2"),
    ("[strip]\nwidth_mm = ", "at end of document"),
    ("[strip]\nthickness_mm = .5", "at line 2"),
    ("[strip]\nthickness_mm = 1.", "at line 2"),
    ("[strip]\nthickness_mm = 05", "at line 2"),
    ("[strip]\nloss_factor = 1 %", "at line 2"),
    ("[strip]\nwidth_mm = 30 mm", "at line 2"),
    ("[strip]\nwidth_mm = wide", "at line 2"),
    ("[strip]\nwidth_mm = 1\nwidth_mm = 2", "at end of document"),
    ("[actuator]\nx_mm = 1\n[[actuator]]\nx_mm = 2", "at line 3"),
    ("[screen]\nfull_screen = True", "at line 2"),
    ("[strip]\nedge = clamped", "at line 2"),
    ("[design]\nlevels_vpp = [60,\n\nx", "at line 4"),
    ("[design]\nlevels_vpp = [60,\n", "at end of document"),
    ("[a]\n[a]\n", "at line 2"),
]


@pytest.mark.parametrize(("text", "place"), TORN)
def test_a_file_that_is_no_toml_is_refused_with_its_line(text: str, place: str) -> None:
    with pytest.raises(StudyError, match=f"must be valid TOML: .*{place}"):
        study_from_text(text, "s.toml")


# A value that a refusal names is accepted.

NUMBER = r"(-?[\d.]+(?:e[-+]?\d+)?)"


def study(tables: dict[str, Any]) -> Study:
    return Study.from_tables(tomllib.loads(on_paper_plate(toml(tables))))


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(
    width_mm=st.floats(2, 300),
    thickness_mm=st.floats(0.02, 10),
    material=st.sampled_from(["aluminium", "steel", "glass", "pmma", "titanium"]),
    cutoff_hz=st.floats(20, 100_000),
)
def test_a_cutoff_between_the_limits_that_a_refusal_names_is_accepted(
    width_mm: float, thickness_mm: float, material: str, cutoff_hz: float
) -> None:
    assume(thickness_mm <= width_mm / 2)
    tables: dict[str, Any] = {
        "width_mm": width_mm,
        "length_mm": 200.0,
        "thickness_mm": thickness_mm,
        "material": material,
        "edge": "measured-cutoff",
    }

    def faults(cutoff_hz: float) -> list[str]:
        strip = tables | {"measured_cutoff_hz": cutoff_hz}
        try:
            Study.from_tables({"strip": strip, "actuator": []})
        except StudyError as error:
            return [fault.rule for fault in error.faults if fault.key.startswith("strip")]
        return []

    for rule in faults(cutoff_hz):
        low_hz, high_hz = map(float, re.findall(rf"{NUMBER} Hz", rule))
        middle_hz = math.sqrt(low_hz * high_hz)
        if 20 <= middle_hz <= 200_000:
            assert faults(middle_hz) == []


@given(trials=st.integers(1, 10_000), fraction=st.floats(0.0, 0.9))
@example(trials=75, fraction=0.1)
@example(trials=2, fraction=0.1)
def test_a_fraction_is_rounded_to_whole_trials_by_at_most_a_tenth(
    trials: int, fraction: float
) -> None:
    single, exact = 2 * trials, 2 * trials * fraction / (1 - fraction)
    nearest = round(exact) / (single + round(exact))
    try:
        design = {"trials_per_side": trials, "both_fraction": fraction}
        both = paper_study().changed(design=design).design.both_trials
    except ValueError:
        assert exact > 10_000 or abs(nearest - fraction) > 0.1 * fraction
    else:
        assert both == round(exact)
        assert both / (single + both) == pytest.approx(fraction, rel=0.1)


@settings(deadline=None, max_examples=40)
@given(
    length_mm=st.floats(20, 5000),
    diameter_mm=st.floats(0.5, 60),
    x_mm=st.floats(0.001, 5000),
    y_mm=st.floats(0, 30),
)
def test_an_actuator_is_accepted_where_a_refusal_puts_it(
    length_mm: float, diameter_mm: float, x_mm: float, y_mm: float
) -> None:
    steel = {"width_mm": 30.0, "thickness_mm": 0.5, "material": "steel", "edge": "clamped"}

    def fault(**place: float) -> Any:
        disc = {"diameter_mm": diameter_mm} | place
        right = {"site": "right"} | disc
        left = {"site": "left"} | disc | {"x_mm": -place["x_mm"]}
        try:
            study({"strip": steel | {"length_mm": length_mm}, "actuator": [left, right]})
        except StudyError as error:
            return error.faults[0]
        return None

    place = {"x_mm": x_mm, "y_mm": y_mm}
    first = fault(**place)
    if first is None or not (limits := re.search(rf"from {NUMBER} to {NUMBER}", first.rule)):
        return
    key = first.key.rpartition(".")[2]
    low, high = map(float, limits.groups())
    for value in (0.999 * low + 0.001 * high, 0.001 * low + 0.999 * high):
        again = fault(**place | {key: value})
        assert again is None or again.key != first.key or again.rule != first.rule
