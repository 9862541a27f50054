"""`tactstrip init --preset plate`: a lab's own plate, from options or from questions."""

from __future__ import annotations

import os
import re
import select
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Self

import pytest

from experiment.study.read import read_study
from experiment.study.sources import study_sources
from stimuli import MATERIALS
from tests.test_experiment.sessions import COMMAND

if TYPE_CHECKING:
    from tests.conftest import Refused, Run

STEEL = {
    "--width-mm": "30", "--thickness-mm": "0.5", "--length-mm": "150", "--material": "steel",
    "--edge": "clamped", "--actuator": "disc:12.8@35",
}  # fmt: skip
GLASS = {
    "--width-mm": "40", "--thickness-mm": "1", "--length-mm": "200", "--material": "glass",
    "--edge": "simply-supported", "--actuator": "rectangle:6x18@40",
}  # fmt: skip
ALUMINIUM = {
    "--width-mm": "25", "--thickness-mm": "0.5", "--length-mm": "200", "--material": "aluminium",
    "--cutoff-hz": "2500", "--actuator": "disc:12.8@35",
}  # fmt: skip
LOW = STEEL | {"--edge": "simply-supported", "--thickness-mm": "0.3"}
HOPELESS = LOW | {"--width-mm": "60"}
PATIENCE_S = 60
END_OF_INPUT = b"\x04"


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def words(plate: dict[str, str], *more: str) -> list[str]:
    """Return the command line for a plate."""
    return ["init", "--preset", "plate", *(word for pair in plate.items() for word in pair), *more]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plate", "edge", "cutoff_hz"),
    [
        (STEEL, "clamped", None),
        (GLASS, "simply-supported", None),
        (ALUMINIUM, "measured-cutoff", 2500.0),
        (LOW, "simply-supported", None),
        (STEEL | {"--length-mm": "endless", "--cutoff-hz": "3000"}, "clamped", 3000.0),
    ],
)
def test_the_study_of_a_plate_says_what_was_typed_and_passes_its_check(
    plate: dict[str, str], edge: str, cutoff_hz: float | None, run: Run
) -> None:
    result = run(*words(plate))
    assert (result.exit_code, result.stderr) == (0, "")
    assert re.search(
        r"\nburst   .* hann window: fit\n        the shortest .*\n.*\nblocks  5 of ", result.stdout
    )
    told = read_study("study.toml")
    length_mm = plate["--length-mm"]
    assert told.plate.length_mm == ("endless" if length_mm == "endless" else float(length_mm))
    assert told.plate.width_mm == float(plate["--width-mm"])
    assert (told.plate.material, told.plate.edge) == (plate["--material"], edge)
    assert told.plate.measured_cutoff_hz == cutoff_hz
    assert [one.basis for one in told.actuators] == [None, None]
    left, right = told.actuators
    assert right.x_mm == -left.x_mm == float(plate["--actuator"].partition("@")[2])
    checked = run("check", "study.toml")
    assert (checked.exit_code, checked.stderr) == (0, "")
    assert " um" not in checked.stdout.partition("\ndisplacement")[2].partition("\n\n")[0]


@pytest.mark.slow
def test_a_plate_without_a_fit_burst_is_written_and_said_to_be_unfit(run: Run) -> None:
    result = run(*words(HOPELESS))
    assert result.exit_code == 0
    assert "hann window: unfit; the ideal burst has 0.9" in result.stdout
    assert "so are all others tried, of 200 to 500 Hz and 1 to 3 cycles" in result.stdout
    checked = run("check", "study.toml")
    assert (checked.exit_code, "UNFIT" in checked.stdout) == (1, True)


def test_a_hopeless_plate_is_told_without_its_field(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_field(*_: object, **__: object) -> None:
        raise AssertionError("a field was computed of a burst unfit by its energy")

    monkeypatch.setattr("experiment.study.physics.study_gains", no_field)
    long = HOPELESS | {"--length-mm": "10000", "--material": "pmma"}
    assert "so are all others tried" in run(*words(long)).stdout


def test_a_measured_cutoff_beside_an_edge_is_compared(run: Run) -> None:
    told = run(*words(STEEL | {"--cutoff-hz": "4500"})).stdout
    assert "\ncut-off 4500 Hz, measured (by: not stated; on: not stated): 45.3% above the" in told
    assert "\n        clamped, 4500 Hz fits 0.727 mm of thickness or 24.9 mm of width; you" in told


def test_two_actuators_lie_where_each_was_put(run: Run) -> None:
    assert run(*words(STEEL | {"--actuator": "disc:10@40"}, "--actuator", "motor:8x6@-30")
               ).exit_code == 0  # fmt: skip
    left, right = read_study("study.toml").actuators
    assert (left.side, left.shape, left.x_mm) == ("left", "motor", -30.0)
    assert (left.length_x_mm, left.length_y_mm) == (8.0, 6.0)
    assert (right.shape, right.x_mm, right.diameter_mm) == ("disc", 40.0, 10.0)
    assert 'as-left"  ' not in Path("study.toml").read_text("utf-8")


def test_of_two_like_discs_the_right_one_is_offered_what_was_measured_of_the_left(
    run: Run,
) -> None:
    assert run(*words(HOPELESS | {"--length-mm": "10000", "--material": "pmma"})).exit_code == 0
    text = Path("study.toml").read_text("utf-8")
    right = text.rpartition("[[actuator]]")[2]
    assert '\n# measured_as = "as-left"  ' in right
    keys = re.findall(r"^(?:# )?([a-z]\w+) =", right.partition("\n[burst]")[0], re.MULTILINE)
    assert {"measured_displacement_um", "measured_by", "piezo_d31_pm_v"} <= set(keys)
    assert len(keys) == len(set(keys))
    for key, value in (("displacement_um", 2.9), ("at_vpp", 100), ("at_hz", 200)):
        text = text.replace(f"# measured_{key} = ", f"measured_{key} = {value} ")
    Path("study.toml").write_text(text.replace('# measured_as = "', 'measured_as = "'), "utf-8")
    assert read_study("study.toml").actuators[1].measured_displacement_um == 2.9


def test_the_help_lists_every_material_that_a_plate_may_have(run: Run) -> None:
    told = " ".join(run("init", "--help").stdout.split())
    assert f"Material: {', '.join(MATERIALS)} (" in told


def test_off_a_terminal_what_is_missing_is_named(refused: Refused) -> None:
    assert refused("init", "--preset", "plate", "--width-mm", "30") == (
        "error: --preset plate needs --thickness-mm, --length-mm, --material, --edge, --actuator; "
        "on a terminal they are asked for\n"
    )
    without = {key: value for key, value in ALUMINIUM.items() if key != "--cutoff-hz"}
    assert "needs --cutoff-hz;" in refused(*words(without | {"--edge": "measured-cutoff"}))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"--width-mm": "-3"}, "--width-mm must be a finite number >= 2 and <= 1000; got -3.0"),
        ({"--width-mm": "0.03"}, "; if these are metres, write --width-mm 30"),
        ({"--width-mm": "30,5"}, "--width-mm must be a number; got '30,5'; write 30.5, with a"),
        ({"--thickness-mm": "nan"}, "--thickness-mm must be a finite number >= 0.02 and <= 50;"),
        ({"--length-mm": "long"}, "--length-mm must be a number or endless; got 'long'"),
        ({"--width-mm": "25 mm"}, "got '25 mm'; write the number alone, in mm"),
        ({"--thickness-mm": "20"}, "at most half of --width-mm = 30, or it is no plate; got 20:"),
        ({"--material": "steal"}, "--material must be one of aluminium, steel, "),
        ({"--edge": "elastic"}, "--edge must be one of simply-supported, clamped, measured-cutoff"),
        (
            {"--edge": "measured-cutoff", "--cutoff-hz": "900"},
            "--cutoff-hz must lie above 1365.88 Hz (simply supported) and below 3096.28 Hz (clamp",
        ),
        ({"--cutoff-hz": "2.5"}, "; got 2.5; if these are kilohertz, write --cutoff-hz 2500"),
        (
            {"--ceiling-vpp": "0.01"},
            "--ceiling-vpp must be a finite number >= 0.1 and <= 1000",
        ),
        (
            {"--ceiling-vpp": "30V"},
            "got '30V'; write the number alone, in V",
        ),
        ({"--ceiling-vpp": "nan"}, "--ceiling-vpp must be a finite number"),
        ({"--actuator": "disc:0.012@35"}, "; if these are metres, write diameter_mm = 12"),
        ({"--actuator": "disc:12@0.035"}, "5.965 mm; if X is in metres, write @35\n"),
        ({"--actuator": "bla"}, "--actuator must be disc:DIAMETER@X, rectangle:ALONGxACROSS@X or"),
        ({"--actuator": "rectangle:6@35"}, "--actuator must be disc:DIAMETER@X, rectangle:ALON"),
        ({"--actuator": "disc:6x7@35"}, "--actuator must be disc:DIAMETER@X, rectangle:ALONGxA"),
        ({"--actuator": "disc:12,8@35"}, "--actuator must be a number; got '12,8'; write 12.8, wi"),
        ({"--actuator": "disc:12@-3"}, "X must be above 0; got -3; give it twice"),
        ({"--actuator": "disc:12@95"}, "must lie on the strip, which goes from x = -75 mm to 75"),
        ({"--actuator": "disc:12@3"}, "--actuator: the left actuator must end, along the strip,"),
        ({"--actuator": "disc:40@35"}, "must lie on the strip, which goes from y = 0 mm to 30 mm"),
        (
            {"--actuator": "disc:-4@35"},
            "error: --actuator: diameter_mm must be a finite number >=",
        ),
    ],
)
def test_a_value_out_of_range_is_refused_by_its_option(
    options: dict[str, str], said: str, refused: Refused
) -> None:
    told = refused(*words(STEEL | options))
    assert said in told
    assert told.count("\n") == told.count("error: ") == 1
    assert "strip." not in told


def test_the_ceiling_is_yours_and_the_levels_go_up_to_it(run: Run) -> None:
    assert run(*words(STEEL | {"--ceiling-vpp": "26"})).exit_code == 0
    study = read_study("study.toml")
    assert study.device.ceiling_vpp == 26.0
    assert study.design.levels_vpp == (5.2, 10.4, 15.6, 20.8, 26.0)
    whose = {one.key: one.origin for one in study_sources(study)}
    assert (whose["device.ceiling_vpp"], whose["design.levels_vpp"]) == ("yours", "assumed")


def test_without_a_ceiling_it_is_assumed(run: Run) -> None:
    assert run(*words(STEEL)).exit_code == 0
    study = read_study("study.toml")
    assert study.design.levels_vpp == (40.0, 80.0, 120.0, 160.0, 200.0)
    whose = {one.key: one.origin for one in study_sources(study)}
    assert whose["device.ceiling_vpp"] == "assumed"


def test_options_of_a_plate_are_for_its_preset_only(refused: Refused) -> None:
    assert refused("init", "--ceiling-vpp", "30") == "error: --ceiling-vpp needs --preset plate\n"
    assert refused("init", "--width-mm", "30") == "error: --width-mm needs --preset plate\n"


def test_a_third_actuator_is_for_the_file(refused: Refused) -> None:
    more = ("--actuator", "disc:4@0", "--actuator", "disc:4@10")
    assert "must be given once or twice; got 3; " in refused(*words(STEEL, *more))


class Terminal:
    """`tactstrip init --preset plate` in a process of its own, in front of a pseudo-terminal."""

    def __init__(self, *options: str) -> None:
        pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")
        self._keyboard, inner = pty.openpty()
        self._process = subprocess.Popen(
            [*COMMAND, "init", "--preset", "plate", *options],
            stdin=inner, stdout=inner, stderr=inner, start_new_session=True,
        )  # fmt: skip
        os.close(inner)
        self.shown = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._keyboard)

    def _read(self, until_s: float) -> bool:
        ready, _, _ = select.select([self._keyboard], [], [], max(0.0, until_s - time.monotonic()))
        try:
            new = os.read(self._keyboard, 4096) if ready else b""
        except OSError:  # Linux ends a pseudo-terminal so
            return False
        self.shown += new
        return bool(new)

    def answer(self, question: bytes, answer: bytes) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while question not in self.shown.replace(b"\r\n", b""):
            assert self._read(until_s), (question, self.shown)
        assert not Path("study.toml").exists()
        self.shown = b""
        os.write(self._keyboard, answer)

    def ended(self) -> int:
        until_s = time.monotonic() + PATIENCE_S
        while self._read(until_s):
            pass
        return self._process.wait(PATIENCE_S)


@pytest.mark.process
def test_on_a_terminal_what_is_missing_is_asked_for_until_it_is_right() -> None:
    dialogue = [
        (b"Width between the held edges, in mm: ", b"0.025"),
        (b"Error: width must be a finite number >= 2 and <= 1000; got 0.025; if", b"25"),
        (b"Thickness, in mm: ", b"0,5"),
        (b"write 0.5, with a point", b"0.5"),
        (b"Length, in mm, or endless: ", b"200"),
        (b"polycarbonate: ", b"aluminum"),
        (b"did you mean aluminium?", b"aluminium"),
        (b"Edges: simply-supported, clamped, measured-cutoff: ", b"measured-cutoff"),
        (b"First cut-off as measured, in Hz: ", b"9000"),
        (b"fits 1.03 mm of thickness or 17.4 mm of width; you have 0.5 mm and 25 mm", b"2500"),
        (b"one at -X and one at X: ", b"disc:12.8@99"),
        (b"must lie on the strip", b"disc:12.8@35"),
    ]
    with Terminal() as terminal:
        for question, answer in dialogue:
            terminal.answer(question, answer + b"\n")
        assert terminal.ended() == 0, terminal.shown
        assert b"hann window: fit" in terminal.shown
    assert read_study("study.toml").plate.measured_cutoff_hz == 2500.0


@pytest.mark.process
def test_what_the_command_line_has_is_not_asked_for_but_refused_before_the_questions() -> None:
    given = ["--length-mm", "150", "--edge", "clamped", "--actuator", "disc:12.8@35"]
    with Terminal(*given, "--material", "steel") as terminal:
        terminal.answer(b"Width between the held edges, in mm: ", b"30\n")
        terminal.answer(b"Thickness, in mm: ", b"0.5\n")
        assert terminal.ended() == 0, terminal.shown
    Path("study.toml").unlink()
    with Terminal(*given, "--material", "steal") as terminal:
        assert terminal.ended() == 2, terminal.shown
        assert b"Width" not in terminal.shown
    with Terminal(*given) as terminal:
        terminal.answer(b"Width", END_OF_INPUT)
        assert terminal.ended() == 2, terminal.shown
        assert b"error: not all was answered; nothing was written" in terminal.shown
    assert not Path("study.toml").exists()
