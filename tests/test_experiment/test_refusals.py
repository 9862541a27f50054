"""Study files that are refused: in one line that has the key's path, the bound and the value.

That every number is refused just outside its range is shown in test_sections.py. What a refusal
says would be right is right: every value that it names is accepted when it is applied.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, example, given, reject, settings
from hypothesis import strategies as st

from experiment import Study, StudyError, read_study, study_from_text
from experiment.names import NAME_RULE, inward
from tests.test_experiment.studies import cases, discs, measured

if TYPE_CHECKING:
    from tests.conftest import Refused


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


HUGE = [
    ("burst.frequency_hz = 1" + "0" * 400, "burst.frequency_hz"),
    ("burst.frequency_hz = 0x1" + "0" * 6000, "burst.frequency_hz"),
    ("x = " + "[" * 9999, "s.toml:"),
    ("device.driver = 'my card'", f"device.driver | {NAME_RULE} | got 'my card'"),
]


@pytest.mark.parametrize(("text", "parts"), [*cases("studies"), *HUGE])
def test_a_study_that_cannot_be_is_refused_by_path_bound_and_value(text: str, parts: str) -> None:
    message = refusal(text)
    assert [part for part in parts.split(" | ") if part not in message] == []


WIDE = (
    '[strip]\nwidth_mm = 60\nlength_mm = 200\nthickness_mm = 0.5\nmaterial = "steel"\n'
    f'edge = "clamped"\n{discs()}[burst]\nfrequency_hz = 200\ncycles = 3\nwindow = "hann"\n'
)
FILES = {
    "study.toml": "",
    "old.toml": "# mine",
    "old.png": "mine",
    "old.svg": "mine",
    "old.csv": "mine",
    "endless.toml": '[strip]\nlength_mm = "endless"\n',
    "steel.toml": WIDE,
    "auto.toml": WIDE.replace('"hann"', '"auto"\nwanted_level_db = -20'),
    "gpib.toml": "device.driver = 'gpib'",
    "misspelt.toml": "design.trails_per_side = 3",
    "unclosed.toml": "[design",
    "slow.toml": "device.sample_rate_hz = 1500",
    "blocks.toml": "design = {order = 'balanced', break_every = 2}",
    "high.toml": discs(measured(2, 9000)),
    "click.toml": "burst.file = 'click.csv'",
    "click.csv": "0\n1\n1\n0\n",
}  # names and contents
PLATE: dict[str, str] = {
    "--width-mm": "30",
    "--thickness-mm": "0.5",
    "--length-mm": "150",
    "--material": "steel",
    "--edge": "clamped",
    "--actuator": "disc:12.8@35",
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
    study_from_text(card + "design = {trials_per_side = 2, levels_vpp = [20.0, 113.2]}", "s.toml")
    texts = "{control = '{none}', audibility = '{none}', prompt_hands_off = '{none}'}"
    study_from_text(f"texts = {texts}", "s.toml")


def test_several_faults_stand_in_one_line() -> None:
    message = refusal("[design]\na = 1\nb = 2\norder = 3\n[study]\nname = 4\n")
    assert message.count(";") >= 3
    assert message.endswith("1 more")


def test_a_file_that_cannot_be_read_is_one_clear_line(tmp_path: Path) -> None:
    path, in_latin = tmp_path / "s.toml", "[study]\n# \xe9\n".encode("latin-1")
    marked, wide = b"\xef\xbb\xbf[study]\n", "[study]".encode("utf-16")
    for content, part in ((None, "No such"), (in_latin, ":2: "), (marked, ""), (wide, "UTF-8")):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(StudyError) as caught:
            read_study(path)
        assert part in str(caught.value)
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


@given(limit=st.floats(-1e12, 1e12), digits=st.integers(1, 15), upward=st.booleans())
def test_a_limit_is_rounded_to_the_side_of_what_it_allows(
    limit: float, digits: int, *, upward: bool
) -> None:
    message = inward(limit, least=upward, digits=digits)
    assert float(message) >= limit if upward else float(message) <= limit
    assert float(message) == pytest.approx(limit, rel=10.0 ** (1 - digits))
