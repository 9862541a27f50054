"""Study files that are refused: in one line, by the key's path, with what is allowed and what came.

That every number is refused just outside its range is shown in test_sections.py.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from experiment.study.read import read_study, study_from_text
from experiment.study.study import StudyError
from experiment.terms.checks import NAME_RULE

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refusal(text: str) -> str:
    with pytest.raises(StudyError) as caught:
        study_from_text(text, "s.toml")
    message = str(caught.value)
    assert message.startswith("s.toml:")
    assert "\n" not in message
    return message


COLUMN = "{name = 'age', description = 'in years'}"
IDENTIFIER = "{name = 'participant_id', description = 'who'}"
MISSPELT = "{nme = 'age', name = 'age', description = 'in years'}"
REPEATED = "{name = 'hand', description = 'preferred', levels = ['left', 'left']}"


def test_no_level_exceeds_what_a_sound_card_reaches() -> None:
    card = '[device]\ndriver = "audio"\nport = "x"\nvolts_full_scale = 56.6\n'
    told = refusal(f"{card}[design]\nlevels_vpp = [20.0, 113.3]\ntrials_per_side = 2\n")
    assert "levels_vpp[1] must be at most 2 x device.volts_full_scale = 113.2; got 113.3" in told
    study_from_text(f"{card}[design]\nlevels_vpp = [20.0, 113.2]\ntrials_per_side = 2\n", "s.toml")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("design.levels_vpp", "[60, 60]", "[1] must be a finite number > 60, got 60"),
        ("design.levels_vpp", "60", " must be a list; got 60"),
        ("design.levels_vpp", "[]", " must hold at least one level"),
        ("design.levels_vpp", "[60, 201]", "[1] must be at most device.ceiling_vpp = 200; got 201"),
        ("design.both_level", "250", " must be at most device.ceiling_vpp = 200; got 250"),
        ("design.both_level", "'no'", " must be a finite number >= 0.1 or 'random'; got 'no'"),
        ("design.trials_per_side", "7.0", " must be a whole number from 1 to 10000; got 7.0"),
        ("design.order", "'shuffled'", " must be 'random' or 'balanced'; got 'shuffled'"),
        ("design.responses", "['left', 'right', 'both', 'up']", "[3] must be one of"),
        ("design.responses", "['left', 'right', 'both', 'both']", " must be distinct"),
        ("design.foreperiod_s", "[2, 1]", "[1] must be a finite number >= 2"),
        ("design.foreperiod_s", "[1, 2, 3]", " must be a list of 2; got [1, 2, 3]"),
        ("design.foreperiod_s", "[1]", "[1] is missing"),
        ("design.audibility_trials", "5", " must be even"),
        ("burst.frequency_hz", "1" + "0" * 400, " must be a finite number >="),
        ("burst.window", "'hamming'", " must be 'none', 'hann', 'tukey', 'gaussian' or 'auto'"),
        ("burst.accept_unfit", "' '", " must be a reason"),
        ("device.driver", "'my card'", f" must be {NAME_RULE}; got 'my card'"),
        ("study.name", "2024-01-01", " must be text; got 2024-01-01"),
        ("study.name", "'my study'", " must be 1 to 32"),
        ("study.consent_version", "''", " must be a name in one line"),
        ("study.consent_version", "2", " must be text; got 2"),
        ("strip", "5", " must be a table; got 5"),
        ("masking.max_level_dba", "80.5", " must be a finite number >= 20 and <= 80; got 80.5"),
        ("masking.measured_level_dba", "76", " must be a finite number >= 20 and <= 75, got 76"),
        ("masking.sound_card", '"a\\tb"', " must be a name in one line"),
        ("screen.full_screen", "1", " must be true or false; got 1"),
        ("screen.font", "''", " must be a name"),
        ("keys.left", "'left'", " must be a list; got 'left'"),
        ("keys.left", "[]", " must have at least one key"),
        ("keys.right", "['left']", " must have keys without another meaning; got left, which"),
        ("keys.left", "['a', 'a']", " must have keys without another meaning; got a, which"),
        ("keys.left", "['enter']", "[0] must be a key's name"),
        ("keys.left", "['A']", "[0] must be a key's name"),
        ("keys.left", "[',']", "[0] must be a key's name"),
        ("texts.welcome", "' '", " must hold something to read"),
        ("texts.welcome", '"a\\u0007"', " must have no control characters"),
        ("texts.welcome", "'{done}'", " must have no braces"),
        ("texts.rest", "'{minutes}'", " may hold {done}, {planned}, {seconds}"),
        ("texts.paused", "'{seconds}'", " may hold {done}, {planned}, and other"),
        ("texts.rest", "'{done'", " may hold"),
        ("texts.rest", "'{}'", " may hold"),
        ("texts.rest", "'{done!r}'", " may hold"),
        ("texts.rest", "'{done:9}'", " may hold"),
        ("participants.columns", "[{name = 'a'}]", "[0].description is missing"),
        ("participants.columns", f"[{IDENTIFIER}]", "[0].name must be 1 to 64 of a-z 0-9 _"),
        ("participants.columns", f"[{COLUMN}, {COLUMN}]", " must have distinct names"),
        ("participants.columns", f"[{REPEATED}]", "[0].levels must be distinct"),
        ("dataset.license", "''", " must be one line of text"),
        ("dataset.authors", "'A'", " must be a list"),
        ("dataset.authors", "['A', '']", "[1] must be one line of text"),
        ("condition", "[{name = 'a/b'}]", "[0].name must be 1 to 32"),
        ("condition", "[{name = 'a', window = 'auto'}]", "[0].wanted_level_db is missing; window"),
        ("condition", "[{name = 'a', auto_cycles = 2}]", "[0].auto_cycles and auto_window are for"),
        ("condition", "[{name = 'a', file = 'a.wav', cycles = 2}]", "[0].cycles and file exclude"),
        ("condition", "[{name = 'a', sample_rate_hz = 1e4}]", "[0].samples_base64 is missing"),
        ("actuator", "{side = 'left'}", " must be given as [[actuator]]"),
        ("actuator", "[{side = 'left'}]", "[0].x_mm is missing"),
    ],
)
def test_a_key_is_refused_by_its_path(key: str, value: str, said: str) -> None:
    assert refusal(f"{key} = {value}").startswith(f"s.toml: {key}{said}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("design.trails_per_side = 60", "design.trails_per_side; did you mean trials_per_side?"),
        ("[desing]", "desing; did you mean design?"),
        ("study.qqq = 1", "study.qqq"),
        ("self = 1", "self"),
        ("design.__dataclass_self__ = 1", "design.__dataclass_self__"),
        ("condition = [{name = 'a', cycle = 1}]", "condition[0].cycle; did you mean cycles?"),
        ("screen.width = 1", "screen.width; did you mean width_px?"),
        ("texts.welcom = 'a'", "texts.welcom; did you mean welcome?"),
        (f"participants.columns = [{MISSPELT}]", "participants.columns[0].nme; did you mean name?"),
    ],
)
def test_an_unknown_key_is_refused_by_name_with_the_nearest_one(text: str, said: str) -> None:
    assert refusal(text) == f"s.toml: unknown key {said}"


def array(left: str = "", more: str = "") -> str:
    """Two discs, of which the left one may have more keys, and what else lies on the strip."""
    disc = "{{side = '{}', x_mm = {}, diameter_mm = 12.8{}}}"
    return f"actuator = [{disc.format('left', -35, left)}, {disc.format('right', 35, '')}{more}]"


def other(name: str, x_mm: float) -> str:
    return f", {{side = 'other', name = '{name}', x_mm = {x_mm}, diameter_mm = 10}}"


def side(*names: str) -> str:
    discs = (
        f"{{side = '{name}', x_mm = {20 * i}, diameter_mm = 5}}" for i, name in enumerate(names)
    )
    return f"actuator = [{', '.join(discs)}]"


PIEZO = (
    ", piezo_thickness_mm = 0.25, piezo_youngs_modulus_gpa = 62, piezo_poisson_ratio = 0.34"
    ", piezo_d31_pm_v = -180"
)
MEASURED = ", measured_displacement_um = 2.6, measured_at_vpp = 100, measured_at_hz = 300"
CARRIER = (
    ", carrier_thickness_mm = 1, carrier_youngs_modulus_gpa = 105, carrier_poisson_ratio = 0.35"
)
RECTANGLE = ", shape = 'rectangle', length_x_mm = 6, length_y_mm = 18"
MOTOR = ", shape = 'motor', length_x_mm = 8, length_y_mm = 6"


CUTOFF = "strip.measured_cutoff_hz = {}"
THIN = "strip = {width_mm = 30, thickness_mm = 0.3, edge = 'clamped'}"
METAL = "strip = {{material = '{}', density_kg_m3 = 7850, edge = 'clamped'}}\n"


FINGERTIP = (
    "finger_load = {{mass_g = {}, stiffness_n_m = {}, damping_n_s_m = 1, holds_up_to_hz = 2000, "
    "source = 'a'}}"
)


def cut(keys: str, key: str) -> str:
    """Leave out a key and those after it."""
    return keys.partition(f", {key} ")[0]


def without_diameter(left: str) -> str:
    return array(left).replace(", diameter_mm = 12.8", "", 1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        # the design
        ("design.responses = ['left', 'right']", "missing both"),
        ("design.responses = ['left', 'both']", "missing right"),
        ("design.blank_trials = 10", "missing none"),
        ("design = {order = 'balanced', trials_per_side = 76}", "multiple of the number of level"),
        (
            "design = {trials_per_side = 75, repeats_per_level = 15}",
            ": design.trials_per_side and repeats_per_level exclude each other; got both",
        ),
        (
            "design = {both_trials = 5, both_fraction = 0.1}",
            ": design.both_trials and both_fraction exclude each other; got both",
        ),
        (
            "design.both_fraction = 0.01",
            "which gives 1.52; the nearest are 0.006623 (1 trial) and 0.01316 (2 trials)",
        ),
        (
            "design = {trials_per_side = 1000, both_fraction = 0.9}",
            "both_fraction must be at most 0.8333, 10000 trials beside",
        ),
        (
            "design.repeats_per_level = 2001",
            "repeats_per_level must be at most 2000 with 5 levels, 10000 trials a side; got 2001",
        ),
        # the strip
        ("strip = {edge = 'clamped', edge_stiffness_n = 9}", "only; got edge = clamped"),
        (
            CUTOFF.format(5000),
            "above 1926.04 Hz (simply supported) and below 4366.09 Hz (clamped);",
        ),
        (
            CUTOFF.format(5000),
            "got 5000: clamped, 5000 Hz fits 0.573 mm of thickness or 23.3 mm of",
        ),
        (
            CUTOFF.format(1000),
            "got 1000: simply supported, 1000 Hz fits 0.259 mm of thickness or",
        ),
        (CUTOFF.format(1000), "or 34.7 mm of width; you have 0.5 mm and 25 mm"),
        # what is known of another plate than the paper's
        (THIN, "strip needs material (or youngs_modulus_gpa, poisson_ratio and density_kg_m3), l"),
        (
            THIN,
            ', length_mm (or "endless"), as it is not the paper\'s plate; [[actuator]] is missi',
        ),
        (
            "strip = {width_mm = 30, material = 'steel', edge = 'clamped'}",
            "strip needs length_mm (or",
        ),
        (THIN, "; [[actuator]] is missing, one with side = left and one with side = right"),
        ("strip.width_mm = 30", ", measured_cutoff_hz (or another edge), length_mm"),
        ("strip.youngs_modulus_gpa = 70", "needs poisson_ratio, density_kg_m3, measured_cutoff_hz"),
        ("strip.material = 'steel'", "strip needs measured_cutoff_hz (or another edge), le"),
        (METAL.format("steel") + array(), "strip.material and density_kg_m3 exclude each other"),
        ("strip.material = 'steal'", "strip.material must be one of aluminium, steel, stainless,"),
        ("strip.material = 'Aluminum'", "; got 'Aluminum', did you mean aluminium?"),
        (
            "strip = {edge = 'clamped', edge_loss = 'plate'}",
            "strip.edge_loss is for edge = elastic or measured-cutoff only, whose springs can have",
        ),
        ("strip = {edge = 'clamped', measured_by = 'me'}", "measured_cutoff_hz is missing; measu"),
        (array(", measured_on = 2026-05-04"), "measured_displacement_um is missing; measured_on"),
        ("strip.measured_by = ' '", "strip.measured_by"),
        ("strip.edge = 'elastic'", "strip.edge_stiffness_n is missing"),
        # where the actuators lie
        (array(", y_mm = 5"), "from y = 0 mm to 25 mm; got a disc from -1.4 mm to 11.4 mm"),
        (array().replace("-35", "-99"), "from x = -100 mm to 100 mm; got a disc from -105.4 mm to"),
        (array().replace("-35", "30"), "right one begins at 28.6 mm; got an end at 36.4 mm"),
        (array().replace("-35", "60"), "right one begins at 28.6 mm; got an end at 66.4 mm"),
        (
            array().replace("-35", "35"),
            "left and right are in one place, x_mm = 35 and y_mm = 12.5;",
        ),
        (array(more=other("a", -35)), "the actuators left and a are in one place, x_mm = -35 and"),
        (array(more=other("a", 30)), "the actuators right and a must not overlap"),
        (array(more=other("a", 0) + other("b", 5)), "the actuators a and b must not overlap"),
        (array(more=other("a", 99)), "the a actuator must lie on the strip"),
        (
            "strip.length_mm = 9000\n" + array().replace("35", "4000"),
            "at most 1000 mm apart along the strip, within one person's reach; got 8000 mm",
        ),
        # which they are
        (side("left"), "left and right, each once"),
        (side("left", "left"), "left and right, each once"),
        (side("left", "right", "right"), "left and right, each once"),
        (array(more=other("a", 0) + other("a", 60)), "names must be distinct; got a, a"),
        (array(more=other("left", 0)), "actuator[2].name must be 1 to 32"),
        (array(more=other("a b", 0)), "actuator[2].name must be 1 to 32"),
        (array(more=other("a", 0)).replace(" name = 'a',", ""), "name must be given where side is"),
        (array(", name = 'a'"), "[0].name must be given where side is other, and only there"),
        # their shape, and what they do
        (array(RECTANGLE), "for shape = disc only"),
        (without_diameter(cut(RECTANGLE, "length_y_mm")), "[0].length_y_mm is missing"),
        (without_diameter(MOTOR + PIEZO), "piezo_thickness_mm is for patches only"),
        (array(cut(MEASURED, "measured_at_hz")), "[0].measured_at_hz is missing; measured_displ"),
        (array(", measured_at_hz = 9"), "measured_displacement_um is missing; measured_at_hz ne"),
        (array(cut(PIEZO, "piezo_d31_pm_v")), "actuator[0].piezo_d31_pm_v is missing"),
        (array(PIEZO.replace("-180", "0")), "actuator[0].piezo_d31_pm_v must not be 0"),
        (array(PIEZO + MEASURED), "displacement_um and piezo_thickness_mm exclude each other; got"),
        (array(CARRIER), "[0].piezo_thickness_mm is missing; carrier_thickness_mm needs it"),
        (array(PIEZO + ", carrier_thickness_mm = 1"), "carrier_youngs_modulus_gpa is missing"),
        # what is felt
        ("simulation = {threshold_um = 1, threshold_vpp = 58}", "threshold_vpp exclude each other"),
        (f"simulation.threshold_um = 1\n{array(PIEZO)}", "threshold_um needs the displacement or"),
        # the stimuli
        ("burst.cycles = 2000", "must last at most design.response_window_s = 3; got 4 s"),
        ("burst = {file = 'a.wav', cycles = 2}", "burst.cycles and file exclude each other"),
        ("burst.file = 'a.wav'", "a.wav: No such file"),
        ("burst.file = 'a.mp3'", "a.mp3: must be a .wav or .csv file"),
        ("burst.window = 'auto'", "burst.wanted_level_db is missing; window = auto needs it"),
        ("burst.wanted_level_db = -30", "burst.wanted_level_db is for window = auto only"),
        (
            "burst.file = 'a'\ncondition = [{name = 'a', cycles = 2}]",
            "; [burst] has a file instead",
        ),
        ("condition = [{name = 'a'}, {name = 'a'}]", "condition names must be distinct"),
        ("condition = []", "condition names must be distinct, at least one"),
        # units and signs that are written by mistake
        (
            "strip.thickness_mm = 0.0005",
            "got 0.0005; if these are metres, write thickness_mm = 0.5",
        ),
        (
            "actuator = [{side = 'left', x_mm = -35, measured_displacement_um = 2e-6}]",
            "got 2e-06; if these are metres, write measured_displacement_um = 2",
        ),
        ("strip.width_mm = 0.025", "got 0.025; if these are metres, write width_mm = 25"),
        ("strip.youngs_modulus_gpa = 67e9", "if these are pascals, write youngs_modulus_gpa = 67"),
        ("strip.youngs_modulus_gpa = 67000", "megapascals, write youngs_modulus_gpa = 67"),
        ("strip.density_kg_m3 = 2.7", "got 2.7; if these are g/cm3, write density_kg_m3 = 2700"),
        ("simulation.threshold_um = 1.2e-6", "these are metres, write threshold_um = 1.2"),
        ("strip.width_mm = '25'", "got '25'; write 25, without quotes"),
        ("strip.length_mm = 0.2", "or 'endless'; got 0.2; if these are metres, write length_mm ="),
        ("strip.thickness_mm = 500", "; if these are micrometres, write thickness_mm = 0.5"),
        ("strip.measured_cutoff_hz = 2.9", "if these are kilohertz, write measured_cutoff_hz = 2"),
        ("strip.poisson_ratio = 34.6", "; if this is per cent, write poisson_ratio = 0.346"),
        (
            "strip.loss_factor = 1",
            "and < 0.5; got 1; if this is per cent, write loss_factor = 0.01",
        ),
        (
            "strip.loss_factor = 1e-9",
            "loss_factor must be a finite number >= 0.0001 and < 0.5, or 0 where it is not known; ",
        ),
        ("strip.viscous_time_us = 8e-7", "; if these are seconds, write viscous_time_us = 0.8"),
        (array().replace("12.8", "0.0128"), "these are metres, write diameter_mm = 12.8"),
        (array().replace("35", "0.035"), "; if x_mm is in metres, write x_mm = -35 and x_mm = 35"),
        (array(", y_mm = 0.0125"), "; if y_mm is in metres, write y_mm = 12.5"),
        (array(PIEZO.replace("-180", "-180e-12")), "these are m/V, write piezo_d31_pm_v = -180"),
        (FINGERTIP.format(2e-4, 1000), "got 0.0002; if these are kilograms, write mass_g = 0.2"),
        (FINGERTIP.format(200, 1000), "got 200; if these are milligrams, write mass_g = 0.2"),
        (
            FINGERTIP.format(0.2, 1),
            "and <= 100000, or 0 for none; got 1; if these are N/mm, write stiffness_n_m = 1000",
        ),
        ("burst.frequency_hz = 0.5", "; if these are kilohertz, write frequency_hz = 500"),
        ("burst.max_energy_above_cutoff = 1", "write max_energy_above_cutoff = 0.01"),
        ("burst.masking_limit_db = -20", "the other way: write masking_limit_db = 20"),
        ("masking.level_dbfs = 30", "its sign is meant the other way: write level_dbfs = -30"),
        ("design.levels_vpp = [0.06, 0.2]", "got 0.06; if these are kilovolts, write 60"),
        ("device.ceiling_vpp = 0.2", "got 60; if these are kilovolts, write ceiling_vpp = 200"),
        ("design.foreperiod_s = [800, 2000]", "got 800; if these are milliseconds, write 0.8"),
        ("design.both_fraction = 10", "if this is per cent, write both_fraction = 0.1"),
        ("device.sample_rate_hz = 48", "these are kilohertz, write sample_rate_hz = 48000"),
        ("strip.width_mm = '30,5'", "got '30,5'; write 30.5, with a point and without quotes"),
        ("[strip]\nwidth_mm = 30,5 # mm", "s.toml:2: width_mm has a decimal comma; write width_mm"),
        ("[strip]\nwidth_mm = ", "s.toml:2: width_mm has no value; write one behind the =, or #"),
        ("[strip]\nthickness_mm = .5", "a digit before its point; write thickness_mm = 0.5"),
        ("[strip]\nthickness_mm = 1.", "a digit after its point; write thickness_mm = 1.0"),
        ("[strip]\nthickness_mm = 05", "thickness_mm begins with a 0; write thickness_mm = 5"),
        ("[strip]\nloss_factor = 1 %", "loss_factor is in per cent; write loss_factor = 1e-2"),
        ("strip.width_mm = 2026-05-04", "; got 2026-05-04"),
        ("[strip]\nwidth_mm = 30 mm", "s.toml:2: width_mm has its unit in its name; write width_m"),
        (
            "[strip]\nwidth_mm = wide",
            's.toml:2: width_mm must be a number, or a word in quotes, "w',
        ),
        ("[strip]\nwidth_mm = 1\nwidth_mm = 2", "s.toml:3: width_mm is given twice; keep one"),
        ("[actuator]\nx_mm = 1\n[[actuator]]\nx_mm = 2", "are written [[actuator]] and [[condi"),
        ("design.foreperiod_s = [0,8, 2,0]", "; with points, not commas: [0.8, 2.0]"),
        (array(MEASURED.replace("2.6", "0.0026")), "if these are millimetres, write measured_dis"),
        (array(MEASURED.replace("100", "0.1")), "if these are kilovolts, write measured_at_vpp ="),
        ("strip.measured_by = ' '", "strip.measured_by must be text in one line; got ' '"),
        ("strip.measured_on = 'in May'", "strip.measured_on must be a day as year-month-day, such"),
        ("strip.measured_on = 2999-01-01", "such as 2026-05-04, and none to come; got '2999-01-01"),
        (
            "[strip]\nmeasured_on = 04.05.2026",
            "must be a day as year-month-day, such as 2026-05-04",
        ),
        (
            "[screen]\nfull_screen = True",
            "full_screen must be true or false; write full_screen = true",
        ),
        (array(MEASURED.replace("2.6", "2600")), "if these are nanometres, write measured_displ"),
        (
            array(MEASURED.replace("2.6", "300")),
            "and <= 250 at 100 Vpp, so that it is felt at some level and within the plate's thick",
        ),
        ("[strip]\nedge = clamped", 's.toml:2: edge has a text without quotes; write edge = "clam'),
        # the text itself
        ("burst.frequency_hz = 0x1" + "0" * 6000, "got a number of thousands of digits"),
        ("[design]\nlevels_vpp = [60,\n\nx", "s.toml:4: "),
        ("[design]\nlevels_vpp = [60,\n", "s.toml:3: "),
        ("[a]\n[a]\n", "s.toml:2: "),
        ("x = " + "[" * 9999, "s.toml: nested too deeply"),
    ],
)
def test_a_study_that_contradicts_itself_is_refused_in_one_line(text: str, said: str) -> None:
    assert said in refusal(text)


def test_another_unit_is_told_only_if_it_is_not_refused_in_turn() -> None:
    told = refusal(array(MEASURED.replace("2.6", "3000")))
    assert told.endswith("; got 3000; if these are nanometres, write measured_displacement_um = 3")


def test_several_faults_stand_in_one_line() -> None:
    message = refusal("[design]\na = 1\nb = 2\norder = 3\n[study]\nname = 4\n")
    assert message.count(";") >= 3
    assert message.endswith("and 1 more")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\xef\xbb\xbf[study]\n", "byte order mark"),
        ("[study]\n# \xe9\n".encode("latin-1"), "s.toml:2: must be UTF-8"),
        ("[study]".encode("utf-16"), "must be UTF-8"),
    ],
)
def test_a_file_in_another_encoding_is_one_clear_line(
    tmp_path: Path, data: bytes, said: str
) -> None:
    (tmp_path / "s.toml").write_bytes(data)
    with pytest.raises(StudyError, match=said):
        read_study(tmp_path / "s.toml")


def test_a_file_that_is_none_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="No such file"):
        read_study(tmp_path / "missing.toml")
    with pytest.raises(StudyError, match="directory"):
        read_study(tmp_path)
