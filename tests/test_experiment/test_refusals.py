"""Study files that are refused: in one line that has the key's path, the bound and the value.

That every number is refused just outside its range is shown in test_sections.py. What a refusal
says would be right is right: every value that it names is accepted when it is applied.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, example, given, reject, settings
from hypothesis import strategies as st

from experiment import PlanError, Study, StudyError, draw_plan, read_study, study_from_text
from experiment.terms.checks import NAME_RULE, in_mind, inward

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


def cases(table: str) -> list[tuple[str, list[str]]]:
    """Split the rows of a table: a study file, and what its refusal has in it."""
    rows = [line.split(" ## ") for line in table.strip().splitlines()]
    return [(text.replace(r"\n", "\n"), parts.split(" | ")) for text, parts in rows]


KEYS = r"""
design.levels_vpp = [60, 60] ## design.levels_vpp[1] | > 60 | got 60
design.levels_vpp = 60 ## design.levels_vpp | got 60
design.levels_vpp = [] ## design.levels_vpp
design.levels_vpp = [60, 201] ## design.levels_vpp[1] | device.ceiling_vpp = 200; | got 201
design.both_level = 250 ## design.both_level | device.ceiling_vpp = 200; | got 250
design.both_level = 'no' ## design.both_level | >= 0.1 | got 'no'
design.trials_per_side = 7.0 ## design.trials_per_side | 1 to 10000 | got 7.0
design.order = 'shuffled' ## design.order | 'random' or 'balanced' | got 'shuffled'
design.responses = ['left', 'right', 'both', 'up'] ## design.responses[3] | 'up'
design.responses = ['left', 'right', 'both', 'both'] ## design.responses
design.foreperiod_s = [2, 1] ## design.foreperiod_s[1] | >= 2
design.foreperiod_s = [1, 2, 3] ## design.foreperiod_s | 2; | got [1, 2, 3]
design.foreperiod_s = [1] ## design.foreperiod_s[1]
design.audibility_trials = 5 ## design.audibility_trials | got 5
burst.window = 'hamming' ## burst.window | 'none', 'hann', 'tukey', 'gaussian' or 'auto'
burst.accept_unfit = ' ' ## burst.accept_unfit
study.name = 2024-01-01 ## study.name | got 2024-01-01
study.name = 'my study' ## study.name | 1 to 32
study.consent_version = '' ## study.consent_version | got ''
study.consent_version = 2 ## study.consent_version | got 2
strip = 5 ## strip | got 5
masking.max_level_dba = 80.5 ## masking.max_level_dba | >= 20 and <= 80 | got 80.5
masking.measured_level_dba = 76 ## masking.measured_level_dba | >= 20 and <= 75 | got 76
masking.sound_card = "a\tb" ## masking.sound_card
screen.full_screen = 1 ## screen.full_screen | got 1
screen.font = '' ## screen.font
keys.left = 'left' ## keys.left | got 'left'
keys.left = [] ## keys.left
keys.right = ['left'] ## keys.right | got left
keys.left = ['a', 'a'] ## keys.left | got a
keys.left = ['enter'] ## keys.left[0] | 'enter'
keys.left = ['A'] ## keys.left[0] | 'A'
keys.left = [','] ## keys.left[0] | ','
texts.welcome = ' ' ## texts.welcome
texts.welcome = "a\u0007" ## texts.welcome
texts.welcome = '{done}' ## texts.welcome | '{done}'
texts.rest = '{minutes}' ## texts.rest | {done}, {planned}, {seconds} | got {minutes}
texts.paused = '{seconds}' ## texts.paused | {done}, {planned}, | got {seconds}
texts.rest = '{done' ## texts.rest | {done}, {planned}, {seconds}
texts.rest = '{}' ## texts.rest | got {}
texts.rest = '{done!r}' ## texts.rest | got {done}
texts.rest = '{done:9}' ## texts.rest | got {done}
texts.main = "Press {none} if so." ## texts.main | {none}
participants.columns = [{name = 'a'}] ## participants.columns[0].description
participants = {columns = [{name = 'participant_id', description = 'b'}]} ## participants.columns
dataset.license = '' ## dataset.license
dataset.authors = 'A' ## dataset.authors
dataset.authors = ['A', ''] ## dataset.authors[1]
condition = [{name = 'a/b'}] ## condition[0].name | 1 to 32
condition = [{name = 'a', window = 'auto'}] ## condition[0].wanted_level_db
condition = [{name = 'a', auto_cycles = 2}] ## condition[0].auto_cycles
condition = [{name = 'a', file = 'a.wav', cycles = 2}] ## condition[0].cycles | file
condition = [{name = 'a', sample_rate_hz = 1e4}] ## condition[0].samples_base64
actuator = {side = 'left'} ## actuator | [[actuator]]
actuator = [{side = 'left'}] ## actuator[0].x_mm
contact.control = 'tight' ## contact.control | 'none', 'instructed', 'held' | got 'tight'
contact.force_n = 0.5 ## contact.control | force_n; | got 'not stated'
contact.how = 'by hand' ## contact.control | how;
contact = {control = 'none', force_n = 0.5} ## contact.control | force_n; | got 'none'
contact = {control = 'measured', force_n = 0.5} ## contact.how | measured
contact = {control = 'held'} ## contact.how | held
contact = {control = 'instructed', force_n = 0} ## contact.force_n | >= 0.01 and <= 20
contact = {control = 'none', how = ' '} ## contact.how
finger_load.mass_g = 0 ## finger_load.mass_g | >= 0.01 and <= 10 | got 0
finger_load.mass_g = '0,3' ## finger_load.mass_g
finger_load.damping_n_s_m = -1 ## finger_load.damping_n_s_m | >= 0 | got -1
simulation.wander_db = 1 ## simulation.wander_trials | wander_db
simulation.masking_falloff_mm = 9 ## simulation.masking_slope | masking_falloff_mm
simulation.reaction_time_s = 0.1 ## simulation.reaction_time_s | reaction_time_least_s, 0.15
"""
"""A key that is refused by its path."""

TEXTS = r"""
design.responses = ['left', 'right'] ## missing both
design.responses = ['left', 'both'] ## missing right
design.blank_trials = 10 ## missing none
design = {order = 'balanced', trials_per_side = 76} ## design.trials_per_side | write 75 | 80
design = {trials_per_side = 75, repeats_per_level = 15} ## repeats_per_level | got both
design = {both_trials = 5, both_fraction = 0.1} ## design.both_trials | both_fraction | got both
design.both_fraction = 0.01 ## 1.52; | 0.006623 (1 | 0.01316 (2
design = {trials_per_side = 1000, both_fraction = 0.9} ## both_fraction | at most 0.8333
design.repeats_per_level = 2001 ## repeats_per_level | at most 2000 | got 2001
strip = {edge = 'clamped', edge_stiffness_n = 9} ## edge_stiffness_n | edge = clamped
strip.measured_cutoff_hz = 5000 ## above 1926.04 | below 4366.09 | got 5000: | 0.573 mm | 23.3 mm
strip.measured_cutoff_hz = 1000 ## got 1000: | 0.259 mm | 34.7 mm | 0.5 mm and 25 mm
strip = {width_mm = 30, thickness_mm = 0.3, edge = 'clamped'} ## material | youngs_modulus_gpa
strip = {width_mm = 30, thickness_mm = 0.3} ## length_mm | [[actuator]] | side = left | side = right
strip = {width_mm = 30, material = 'steel', edge = 'clamped'} ## length_mm | [[actuator]]
strip.width_mm = 30 ## material | measured_cutoff_hz | length_mm
strip.youngs_modulus_gpa = 70 ## poisson_ratio, density_kg_m3, measured_cutoff_hz
strip.material = 'steel' ## measured_cutoff_hz | length_mm
strip.material = 'steal' ## strip.material | aluminium, steel, stainless,
strip.material = 'Aluminum' ## strip.material | 'Aluminum' | aluminium?
strip = {edge = 'clamped', edge_loss = 'plate'} ## strip.edge_loss | elastic or measured-cutoff
strip = {edge = 'clamped', measured_by = 'me'} ## measured_cutoff_hz | measured_by
strip.measured_by = ' ' ## strip.measured_by | got ' '
strip.edge = 'elastic' ## strip.edge_stiffness_n
strip.measured_on = 'in May' ## strip.measured_on | 2026-05-04 | 'in May'
strip.measured_on = 2999-01-01 ## strip.measured_on | got '2999-01-01'
[strip]\nmeasured_on = 04.05.2026 ## measured_on | 2026-05-04
simulation = {threshold_um = 1, threshold_vpp = 58} ## threshold_um | threshold_vpp
burst.cycles = 2000 ## design.response_window_s = 3; | got 4 s
burst = {file = 'a.wav', cycles = 2} ## burst.cycles | file
burst.file = 'a.wav' ## a.wav: | No such
burst.file = 'a.mp3' ## a.mp3: | .wav or .csv
burst.window = 'auto' ## burst.wanted_level_db | auto
burst.wanted_level_db = -30 ## burst.wanted_level_db | auto only
burst.file = 'a'\ncondition = [{name = 'a', cycles = 2}] ## [burst]
condition = [{name = 'a'}, {name = 'a'}] ## condition
condition = [] ## condition
strip.thickness_mm = 0.0005 ## got 0.0005 | thickness_mm = 0.5
actuator = [{side = 'left', measured_displacement_um = 2e-6}] ## 2e-06 | displacement_um = 2
strip.width_mm = 0.025 ## got 0.025 | width_mm = 25
strip.youngs_modulus_gpa = 67e9 ## pascals | youngs_modulus_gpa = 67
strip.youngs_modulus_gpa = 67000 ## megapascals | youngs_modulus_gpa = 67
strip.density_kg_m3 = 2.7 ## got 2.7 | density_kg_m3 = 2700
simulation.threshold_um = 1.2e-6 ## threshold_um = 1.2
strip.width_mm = '25' ## got '25' | write 25
strip.length_mm = 0.2 ## 'endless' | got 0.2 | length_mm = 200
strip.thickness_mm = 500 ## micrometres | thickness_mm = 0.5
strip.measured_cutoff_hz = 2.9 ## measured_cutoff_hz = 2900
strip.poisson_ratio = 34.6 ## poisson_ratio = 0.346
strip.loss_factor = 1 ## < 0.5 | got 1 | loss_factor = 0.01
strip.loss_factor = 1e-9 ## loss_factor | >= 0.0001 and < 0.5 | or 0
strip.viscous_time_us = 8e-7 ## viscous_time_us = 0.8
burst.frequency_hz = 0.5 ## frequency_hz = 500
burst.max_energy_above_cutoff = 1 ## max_energy_above_cutoff = 0.01
burst.masking_limit_db = -20 ## masking_limit_db = 20
masking.level_dbfs = 30 ## level_dbfs = -30
design.levels_vpp = [0.06, 0.2] ## got 0.06 | write 60
device.ceiling_vpp = 0.2 ## got 60 | ceiling_vpp = 200
design.foreperiod_s = [800, 2000] ## got 800 | write 0.8
design.both_fraction = 10 ## both_fraction = 0.1
device.sample_rate_hz = 48 ## sample_rate_hz = 48000
strip.width_mm = '30,5' ## '30,5' | write 30.5
[strip]\nwidth_mm = 30,5 # mm ## s.toml:2: | write width_mm = 30.5
[strip]\nwidth_mm =  ## s.toml:2: | width_mm
[strip]\nthickness_mm = .5 ## s.toml:2: | thickness_mm = 0.5
[strip]\nthickness_mm = 1. ## s.toml:2: | thickness_mm = 1.0
[strip]\nthickness_mm = 05 ## s.toml:2: | thickness_mm = 5
[strip]\nloss_factor = 1 % ## s.toml:2: | loss_factor = 1e-2
strip.width_mm = 2026-05-04 ## strip.width_mm | got 2026-05-04
[strip]\nwidth_mm = 30 mm ## s.toml:2: | width_mm = 30
[strip]\nwidth_mm = wide ## s.toml:2: | width_mm | "wide"
[strip]\nwidth_mm = 1\nwidth_mm = 2 ## s.toml:3: | width_mm
[actuator]\nx_mm = 1\n[[actuator]]\nx_mm = 2 ## [[actuator]]
design.foreperiod_s = [0,8, 2,0] ## [0.8, 2.0]
[screen]\nfull_screen = True ## full_screen = true
[strip]\nedge = clamped ## s.toml:2: | edge = "clamped"
[design]\nlevels_vpp = [60,\n\nx ## s.toml:4:
[design]\nlevels_vpp = [60,\n ## s.toml:3:
[a]\n[a]\n ## s.toml:2:
design.trails_per_side = 60 ## unknown key design.trails_per_side; | trials_per_side?
[desing] ## unknown key desing; | design?
study.qqq = 1 ## unknown key study.qqq
self = 1 ## unknown key self
design.__dataclass_self__ = 1 ## unknown key design.__dataclass_self__
condition = [{name = 'a', cycle = 1}] ## unknown key condition[0].cycle; | cycles?
screen.width = 1 ## unknown key screen.width; | width_px?
texts.welcom = 'a' ## unknown key texts.welcom; | welcome?
participants.columns = [{nme = 'a', description = 'b'}] ## participants.columns[0].nme; | name?
init = 3 ## init
[init]\ntold = 3 ## init
[init]\nbold = [] ## init
[init]\ntold = ["strip.bogus"] ## unknown key strip.bogus
[init]\ntold = ["strip.width_m"] ## unknown key strip.width_m; | strip.width_mm?
[init]\nleft_out = ["strip.bogus"] ## unknown key strip.bogus
[init.chosen]\n'strip.bogus' = 3 ## unknown key strip.bogus
strip = {measured_cutoff_hz = 2900, thickness_mm = 0.6} ## strip
"""
"""A file that contradicts itself, in another unit, or that is no TOML."""


def disc_pair(left: str = "", more: str = "") -> str:
    """Two discs, of which the left one may have more keys, and what else lies on the strip."""
    disc = "{{side = '{}', x_mm = {}, diameter_mm = 12.8{}}}"
    return f"actuator = [{disc.format('left', -35, left)}, {disc.format('right', 35, '')}{more}]"


def other(name: str, x_mm: float) -> str:
    return f", {{side = 'other', name = '{name}', x_mm = {x_mm}, diameter_mm = 10}}"


def sides(*names: str) -> str:
    disc = "{{side = '{}', x_mm = {}, diameter_mm = 5}}"
    return f"actuator = [{', '.join(disc.format(name, 20 * i) for i, name in enumerate(names))}]"


def cut(keys: str, key: str) -> str:
    """Leave out a key and those after it."""
    return keys.partition(f", {key} ")[0]


def without_diameter(left: str) -> str:
    return disc_pair(left).replace(", diameter_mm = 12.8", "", 1)


PIEZO = (
    ", piezo_thickness_mm = 0.25, piezo_youngs_modulus_gpa = 62, piezo_poisson_ratio = 0.34"
    ", piezo_d31_pm_v = -180"
)
MEASURED = ", measured_displacement_um = 2.6, measured_at_vpp = 100, measured_at_hz = 300"
CARRIER = (
    ", carrier_thickness_mm = 1, carrier_youngs_modulus_gpa = 105, carrier_poisson_ratio = 0.35"
)
COUNTS = f", patch_counts = true{cut(PIEZO, 'piezo_d31_pm_v')}, piezo_density_kg_m3 = 7800"
RECTANGLE = ", shape = 'rectangle', length_x_mm = 6, length_y_mm = 18"
MOTOR = ", shape = 'motor', length_x_mm = 8, length_y_mm = 6"
FINGERTIP = (
    "finger_load = {{mass_g = {}, stiffness_n_m = {}, damping_n_s_m = 1, holds_up_to_hz = 2000, "
    "source = 'a'}}\n"
)
LONG = "strip.length_mm = 9000\n"
ENDLESS = "strip.length_mm = 'endless'\n"
CARD = "device = {driver = 'audio', port = 'x', volts_full_scale = 56.6}\n"
TWO = "design.trials_per_side = 2\n"
COLUMN = "{name = 'age', description = 'in years'}"
REPEATED = "{name = 'hand', description = 'preferred', levels = ['left', 'left']}"
BUILT = [
    (f"participants.columns = [{COLUMN}, {COLUMN}]", ["participants.columns"]),
    (f"participants.columns = [{REPEATED}]", ["participants.columns[0].levels"]),
    (FINGERTIP.format(0.3, 600).replace(", source = 'a'", ""), ["finger_load.source", "mass_g"]),
    ("burst.frequency_hz = 1" + "0" * 400, ["burst.frequency_hz"]),
    ("burst.frequency_hz = 0x1" + "0" * 6000, ["burst.frequency_hz"]),
    ("x = " + "[" * 9999, ["s.toml:"]),
    ("device.driver = 'my card'", ["device.driver", NAME_RULE, "got 'my card'"]),
    (
        f"{CARD}{TWO}design.levels_vpp = [20.0, 113.3]",
        ["levels_vpp[1]", "2 x device.volts_full_scale = 113.2;", "got 113.3"],
    ),
    (
        "strip = {material = 'steel', density_kg_m3 = 7850, edge = 'clamped'}\n" + disc_pair(),
        ["strip.material", "density_kg_m3"],
    ),
    (disc_pair(", measured_on = 2026-05-04"), ["[0].measured_displacement_um", "measured_on"]),
    # where the actuators lie
    (disc_pair(", y_mm = 5"), ["0 mm to 25 mm", "-1.4 mm to 11.4 mm"]),
    (disc_pair().replace("-35", "-99"), ["-100 mm to 100 mm", "-105.4 mm to"]),
    (disc_pair().replace("-35", "30"), ["28.6 mm", "36.4 mm"]),
    (disc_pair().replace("-35", "60"), ["28.6 mm", "66.4 mm"]),
    (disc_pair().replace("-35", "35"), ["left and right", "x_mm = 35 and y_mm = 12.5"]),
    (disc_pair(more=other("a", -35)), ["left and a", "x_mm = -35"]),
    (disc_pair(more=other("a", 30)), ["right and a", "overlap"]),
    (disc_pair(more=other("a", 0) + other("b", 5)), ["a and b", "overlap"]),
    (disc_pair(more=other("a", 99)), ["the a", "100 mm"]),
    (LONG + disc_pair().replace("35", "4000"), ["1000 mm", "8000 mm"]),
    # which they are
    (sides("left"), ["left and right"]),
    (sides("left", "left"), ["left and right"]),
    (sides("left", "right", "right"), ["left and right"]),
    (disc_pair(more=other("a", 0) + other("a", 60)), ["got a, a"]),
    (disc_pair(more=other("left", 0)), ["actuator[2].name"]),
    (disc_pair(more=other("a b", 0)), ["actuator[2].name", "1 to 32"]),
    (disc_pair(more=other("a", 0)).replace(" name = 'a',", ""), ["actuator[2].name"]),
    (disc_pair(", name = 'a'"), ["actuator[0].name"]),
    # their shape, and what they do
    (disc_pair(RECTANGLE), ["actuator[0].diameter_mm", "shape = disc"]),
    (without_diameter(cut(RECTANGLE, "length_y_mm")), ["actuator[0].length_y_mm"]),
    (without_diameter(MOTOR + PIEZO), ["piezo_thickness_mm", "patches only"]),
    (without_diameter(MOTOR + COUNTS), ["patch_counts", "shape = motor"]),
    (disc_pair(cut(MEASURED, "measured_at_hz")), ["actuator[0].measured_at_hz"]),
    (disc_pair(", measured_at_hz = 9"), ["measured_displacement_um", "measured_at_hz"]),
    (disc_pair(", measured_as = 'peak'"), ["measured_displacement_um", "measured_as"]),
    (disc_pair(cut(PIEZO, "piezo_d31_pm_v")), ["actuator[0].piezo_d31_pm_v"]),
    (disc_pair(PIEZO.replace("-180", "0")), ["actuator[0].piezo_d31_pm_v", "not be 0"]),
    (disc_pair(PIEZO + MEASURED), ["displacement_um", "piezo_thickness_mm"]),
    (disc_pair(CARRIER), ["actuator[0].piezo_thickness_mm", "carrier_thickness_mm"]),
    (disc_pair(PIEZO + ", carrier_thickness_mm = 1"), ["carrier_youngs_modulus_gpa"]),
    (ENDLESS + disc_pair(MEASURED + COUNTS), ["strip.length_mm"]),
    (disc_pair(MEASURED + ", patch_counts = true"), ["piezo_thickness_mm", "patch_counts"]),
    (disc_pair(MEASURED + cut(COUNTS, "piezo_density_kg_m3")), ["piezo_density_kg_m3"]),
    (disc_pair(MEASURED + COUNTS + CARRIER), ["carrier_density_kg_m3"]),
    (disc_pair(PIEZO + ", piezo_density_kg_m3 = 7800"), ["patch_counts = true"]),
    (disc_pair(MEASURED + COUNTS + ", piezo_d31_pm_v = 9"), ["displacement_um", "piezo_d31_pm_v"]),
    # fingers, and what they feel
    (ENDLESS + FINGERTIP.format(0.3, 600), ["strip.length_mm", "[finger_load]"]),
    (
        FINGERTIP.format(0.3, 600) + disc_pair(", y_mm = 4").replace("12.8", "5"),
        ["finger_diameter_mm", "at most 8"],
    ),
    (f"simulation.threshold_um = 1\n{disc_pair(PIEZO)}", ["threshold_um", "displacement"]),
    (
        "simulation.threshold_at_hz = 250\ncondition = [{name = 'a', file = 'a.wav'}]",
        ["simulation.threshold_at_hz"],
    ),
    # units and signs that are written by mistake
    (disc_pair().replace("12.8", "0.0128"), ["diameter_mm = 12.8"]),
    (disc_pair().replace("35", "0.035"), ["x_mm = -35", "x_mm = 35"]),
    (disc_pair(", y_mm = 0.0125"), ["y_mm = 12.5"]),
    (disc_pair(PIEZO.replace("-180", "-180e-12")), ["piezo_d31_pm_v = -180"]),
    (FINGERTIP.format(2e-4, 1000), ["got 0.0002", "mass_g = 0.2"]),
    (FINGERTIP.format(200, 1000), ["got 200", "mass_g = 0.2"]),
    (FINGERTIP.format(0.2, 1), ["<= 100000", "or 0", "got 1;", "stiffness_n_m = 1000"]),
    (disc_pair(MEASURED + COUNTS.replace("7800", "7.8")), ["piezo_density_kg_m3 = 7800"]),
    (
        disc_pair(MEASURED.replace("2.6", "0.0026")),
        ["millimetres", "displacement_um = 2.6"],
    ),
    (disc_pair(MEASURED.replace("100", "0.1")), ["measured_at_vpp = 100"]),
    (disc_pair(MEASURED.replace("2.6", "2600")), ["nanometres", "displacement_um = 2.6"]),
    (disc_pair(MEASURED.replace("2.6", "300")), ["<= 250", "100 Vpp", "got 300"]),
]


@pytest.mark.parametrize(("text", "parts"), cases(KEYS))
def test_a_key_is_refused_by_its_path(text: str, parts: list[str]) -> None:
    path, *others = parts
    message = refusal(text).removeprefix("s.toml: ")
    assert message.startswith(path)
    assert [part for part in others if part not in message] == []


@pytest.mark.parametrize(("text", "parts"), [*cases(TEXTS), *BUILT])
def test_a_study_that_contradicts_itself_is_refused_in_one_line(
    text: str, parts: list[str]
) -> None:
    message = refusal(text)
    assert [part for part in parts if part not in message] == []


@pytest.mark.parametrize(
    "text",
    [
        f"{CARD}{TWO}design.levels_vpp = [20.0, 113.2]",
        "texts = {control = '{none}', audibility = '{none}', prompt_hands_off = '{none}'}",
    ],
)
def test_what_is_at_a_bound_or_means_something_there_is_accepted(text: str) -> None:
    study_from_text(text, "s.toml")


def test_another_unit_is_named_only_if_it_is_not_refused_in_turn() -> None:
    message = refusal(disc_pair(MEASURED.replace("2.6", "3000")))
    assert message.endswith("measured_displacement_um = 3")


def test_several_faults_stand_in_one_line() -> None:
    message = refusal("[design]\na = 1\nb = 2\norder = 3\n[study]\nname = 4\n")
    assert message.count(";") >= 3
    assert message.endswith("1 more")


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"\xef\xbb\xbf[study]\n", ""),
        ("[study]\n# \xe9\n".encode("latin-1"), "s.toml:2: "),
        ("[study]".encode("utf-16"), "UTF-8"),
        (None, "No such"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_clear_line(
    tmp_path: Path, content: bytes | None, line: str
) -> None:
    if content is not None:
        (tmp_path / "s.toml").write_bytes(content)
    with pytest.raises(StudyError) as caught:
        read_study(tmp_path / "s.toml")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


# --- every value that a refusal names is accepted ------------------------------------------------


MAX_TRIALS = 10_000
METALS = st.sampled_from(["aluminium", "steel", "glass", "pmma", "titanium"])
NUMBER = r"(-?[\d.]+(?:e[-+]?\d+)?)"


def refused(make: Any, **keys: Any) -> str:
    """Return what is refused of some keys; of what is taken nothing is to be shown."""
    try:
        make(**keys)
    except ValueError as error:
        return str(error)
    return reject()


def study(**tables: Any) -> Study:
    return Study(**tables)


def plate(**keys: Any) -> Study:
    tiny = {"diameter_mm": 1.0}
    return study(strip=keys, actuator=actuators({"x_mm": -35.0} | tiny, {"x_mm": 35.0} | tiny))


def design(**keys: Any) -> Any:
    return study(design=keys).design


def sig(value: float, digits: int) -> float:
    """Return a number as a person types it."""
    return float(f"{value:.{digits}g}")


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(
    width_mm=st.floats(2, 300).map(lambda mm: sig(mm, 3)),
    thickness_mm=st.floats(0.02, 10).map(lambda mm: sig(mm, 3)),
    material=METALS,
    cutoff_hz=st.floats(20, 100_000).map(lambda hz: sig(hz, 5)),
)
@example(width_mm=43.0, thickness_mm=1.54, material="steel", cutoff_hz=8566.0)
def test_the_plate_that_a_cutoff_fits_has_it(
    width_mm: float, thickness_mm: float, material: str, cutoff_hz: float
) -> None:
    assume(thickness_mm <= width_mm / 2)
    keys: dict[str, Any] = {
        "width_mm": width_mm,
        "length_mm": 200.0,
        "thickness_mm": thickness_mm,
        "material": material,
        "measured_cutoff_hz": cutoff_hz,
    }
    message = refused(plate, **keys)
    fits = message.partition(" fits ")[2].partition(";")[0]
    sizes = dict(re.findall(rf"{NUMBER} mm of (thickness|width)", fits))
    assert fits, message
    for number, size in re.findall(rf"{NUMBER} mm of (thickness|width)", fits):
        plate(**keys | {f"{size}_mm": float(number)})
    limits = re.findall(rf"{NUMBER} Hz", message.partition(";")[0])
    assert len(sizes) == len(re.findall("mm of", fits))
    for limit, factor in zip(map(float, limits), (1 + 1e-9, 1 - 1e-9), strict=True):
        if 20 <= limit <= 200_000:
            plate(**keys | {"measured_cutoff_hz": limit * factor})


@given(trials=st.integers(1, MAX_TRIALS), fraction=st.floats(0.0, 0.9))
@example(trials=75, fraction=0.1)
@example(trials=2, fraction=0.1)
def test_a_fraction_is_rounded_to_whole_trials_or_the_two_nearest_are_named(
    trials: int, fraction: float
) -> None:
    def both_trials(value: float) -> Any:
        return design(trials_per_side=trials, both_fraction=value).both_trials

    try:
        found = both_trials(fraction)
    except ValueError as error:
        named = [float(text) for text in re.findall(rf"{NUMBER} \(\d+", str(error))]
        counts = [int(text) for text in re.findall(r" \((\d+)", str(error))]
        if "at most" in str(error):
            (most,) = re.findall(rf"at most {NUMBER},", str(error))
            assert both_trials(float(most)) <= MAX_TRIALS
            return
        assert [both_trials(value) for value in named] == counts
        assert counts[1] == counts[0] + 1
        assert named[0] < fraction < named[1]
    else:
        assert abs(found - 2 * trials * fraction / (1 - fraction)) <= 0.5 + 1e-6
        assert found / (2 * trials + found) == pytest.approx(fraction, rel=0.1)


@settings(deadline=None, max_examples=40)
@given(
    levels=st.integers(1, 6),
    repeats=st.integers(1, 10),
    both=st.integers(60, 120),
    blanks=st.integers(60, 120),
    break_every=st.integers(1, 14),
)
def test_the_shortest_blocks_that_are_named_can_be_had(
    levels: int, repeats: int, both: int, blanks: int, break_every: int
) -> None:
    def draw(break_every: int) -> None:
        blocks = {
            "levels_vpp": [10.0 + level for level in range(levels)],
            "trials_per_side": levels * repeats,
            "both_trials": both,
            "blank_trials": blanks,
            "responses": ["left", "right", "both", "none"],
            "order": "balanced",
            "break_every": break_every,
        }
        draw_plan(study(design=blocks), participant="01", session="01", seed=1)

    try:
        draw(break_every)
    except PlanError as error:
        (shortest,) = re.findall(r"at least (\d+)", str(error))
        draw(int(shortest))
    else:
        reject()


@settings(max_examples=40)
@given(levels=st.integers(2, 9), trials=st.integers(1, MAX_TRIALS))
def test_the_nearest_multiples_of_the_levels_are_named(levels: int, trials: int) -> None:
    keys: dict[str, Any] = {
        "levels_vpp": [10.0 + level for level in range(levels)],
        "order": "balanced",
    }
    message = refused(design, trials_per_side=trials, **keys)
    named = re.findall(r"(\d+)", message.partition("; write ")[2])
    assert named
    for text in named:
        assert abs(int(text) - trials) < levels
        design(trials_per_side=int(text), **keys)


@settings(max_examples=40)
@given(levels=st.integers(1, 9), repeats=st.integers(MAX_TRIALS // 2, MAX_TRIALS))
def test_as_many_repeats_as_are_named_are_taken(levels: int, repeats: int) -> None:
    keys: dict[str, Any] = {"levels_vpp": [10.0 + level for level in range(levels)]}
    message = refused(design, repeats_per_level=repeats, **keys)
    (most,) = re.findall(r"at most (\d+) ", message)
    assert design(repeats_per_level=int(most), **keys).trials_per_side <= MAX_TRIALS


def actuators(left: dict[str, Any], right: dict[str, Any]) -> list[dict[str, Any]]:
    disc = {"shape": "disc", "diameter_mm": 12.0}
    return [{"side": "left"} | disc | left, {"side": "right"} | disc | right]


STEEL = {"width_mm": 30.0, "thickness_mm": 0.5, "material": "steel", "edge": "clamped"}


@settings(deadline=None, max_examples=40)
@given(
    length_mm=st.floats(20, 5000),
    diameter_mm=st.floats(0.5, 60),
    x_mm=st.floats(0.001, 5000),
    y_mm=st.floats(0, 30),
    in_metres=st.booleans(),
)
def test_an_actuator_is_taken_where_a_refusal_puts_it(
    length_mm: float, diameter_mm: float, x_mm: float, y_mm: float, *, in_metres: bool
) -> None:
    sizes = {"diameter_mm": diameter_mm}
    places = {"x_mm": x_mm / (1e3 if in_metres else 1), "y_mm": y_mm}

    def put(**places: float) -> Study:
        left = sizes | places | {"x_mm": -places["x_mm"]}
        tables = actuators(left, sizes | places)
        return study(strip=STEEL | {"length_mm": length_mm}, actuator=tables)

    message = refused(put, **places)
    written = re.findall(rf"write ([xy]_mm) = {NUMBER}(?: and x_mm = {NUMBER})?", message)
    ranges = re.findall(rf"([xy]_mm) from {NUMBER} to {NUMBER}", message)
    for key, *values in written:
        value = abs(float(values[1] or values[0]))
        again = refusal_of(put, **places | {key: value})
        assert not again.startswith(re.split(r"-?\d", message)[0]), (message, again)
    for key, least, most in ranges:
        for value in (float(least), float(most)):
            if key == "x_mm" and value < sizes["diameter_mm"]:
                continue  # its twin on the other side would be in the way
            again = refusal_of(put, **places | {key: value})
            assert key not in again, (message, again)


def refusal_of(make: Any, **keys: Any) -> str:
    try:
        make(**keys)
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    x_mm=st.floats(3, 75),
    y_mm=st.floats(0.5, 29.5),
    finger_mm=st.floats(1, 50),
)
def test_a_finger_as_large_as_is_named_rests_on_the_plate(
    x_mm: float, y_mm: float, finger_mm: float
) -> None:
    def put(finger_mm: float) -> Study:
        place = {"diameter_mm": 1.0, "y_mm": y_mm, "finger_diameter_mm": finger_mm}
        load = {"mass_g": 0.3, "stiffness_n_m": 600.0, "damping_n_s_m": 1.0}
        return study(
            strip=STEEL | {"length_mm": 160.0},
            actuator=actuators(place | {"x_mm": -x_mm}, place | {"x_mm": x_mm}),
            finger_load=load | {"holds_up_to_hz": 800.0, "source": "a"},
        )

    message = refused(put, finger_mm=finger_mm)
    assert "finger_diameter_mm" in message
    for most in re.findall(rf"at most {NUMBER} ", message):
        put(float(most))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(ceiling_vpp=st.floats(0.1, 1000), level_vpp=st.floats(0.1, 1e4))
def test_a_level_at_the_ceiling_that_is_named_is_taken(
    ceiling_vpp: float, level_vpp: float
) -> None:
    def put(level_vpp: float) -> Study:
        return study(device={"ceiling_vpp": ceiling_vpp}, design={"levels_vpp": [level_vpp]})

    message = refused(put, level_vpp=level_vpp)
    (most,) = re.findall(rf"ceiling_vpp = {NUMBER};", message)
    put(float(most))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(um=st.floats(1e-4, 5000), at_vpp=st.floats(1e-3, 1000), vpp=st.floats(0.1, 200))
def test_a_displacement_in_the_range_that_is_named_is_taken(
    um: float, at_vpp: float, vpp: float
) -> None:
    def put(um: float) -> Study:
        measured = {"measured_displacement_um": um, "measured_at_vpp": at_vpp}
        left, right = actuators({"x_mm": -35.0}, {"x_mm": 35.0})
        return study(
            strip=STEEL | {"length_mm": 200.0},
            actuator=[left | measured | {"measured_at_hz": 300.0}, right],
            design={"levels_vpp": [vpp]},
            simulation={"threshold_vpp": 50.0},
        )

    message = refused(put, um=um)
    limits = re.findall(rf"[<>]= {NUMBER}", message)
    assert limits, message
    meant = re.findall(rf"write measured_displacement_um = {NUMBER}", message)
    for value in map(float, (*limits, *meant)):
        if 1e-4 <= value <= 5000:
            put(value)


@pytest.mark.slow
@given(
    value=st.floats(-1e6, 1e6).filter(bool),
    least=st.floats(-1e3, 1e3),
    most=st.floats(-1e3, 1e3),
    key=st.sampled_from(["width_mm", "youngs_modulus_gpa", "loss_factor", "level_dbfs", "a_s"]),
)
def test_a_number_in_another_unit_is_named_only_in_the_range(
    value: float, least: float, most: float, key: str
) -> None:
    def holds(number: float) -> bool:
        return min(least, most) <= number <= max(least, most)

    assume(not holds(value))
    hint = in_mind(key, value, holds)
    if hint:
        assert holds(float(hint.rpartition(" ")[2])), hint


@given(limit=st.floats(-1e12, 1e12), digits=st.integers(1, 15), upward=st.booleans())
def test_a_limit_is_rounded_to_the_side_of_what_it_allows(
    limit: float, digits: int, *, upward: bool
) -> None:
    message = inward(limit, least=upward, digits=digits)
    assert float(message) >= limit if upward else float(message) <= limit
    assert float(message) == pytest.approx(limit, rel=10.0 ** (1 - digits))
