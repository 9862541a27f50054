"""Sessions with a monitor: what was not verified is presented again, told, and never counted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ResultFileError
from analysis.reading.trials import read_inputs
from experiment import StudyError, examine
from tests.test_experiment.monitored import BY_ITSELF, STUDY, ByItself, Wired

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment import Study
    from tests.conftest import Run

pytestmark = pytest.mark.usefixtures("anybody_may")


def counted(rows: list[dict[str, str]], tap: str = "line") -> bool:
    """Return whether all bursts were verified; in a blank there is nothing to verify."""
    return all(row["burst_verified"] == ("n/a" if row["side"] == "none" else tap) for row in rows)


@pytest.mark.slow
def test_a_session_of_verified_bursts_says_so_in_every_row(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    assert wired.begin().finished
    rows, measured = wired.table(), wired.table("measured.csv")
    assert counted(rows)
    for row, burst in zip(rows, measured, strict=True):
        assert (row["trial"], row["attempt"]) == (burst["trial"], burst["attempt"])
        for side in ("left", "right"):
            target_v = float(row["level_vpp"]) / 2 if row["side"] in {side, "both"} else 0.0
            assert float(burst[f"planned_{side}"]) == pytest.approx(target_v, rel=1e-3)
            assert float(burst[f"peak_{side}"]) == pytest.approx(target_v, rel=0.02, abs=2.0)
        if row["side"] != "none":
            assert abs(float(burst["late_s"])) < 1 / 48e3
            assert float(burst["onset_s"]) - float(row["onset_s"]) == pytest.approx(0, abs=0.03)
    assert (wired.header["monitor"]["tap"], wired.header["monitor"]["unit"]) == ("line", "V")
    assert examine(wired.folder.path).differences == ()
    (progress,) = read_inputs([tmp_path]).progress
    assert len(progress.measured) == len(rows)


@pytest.mark.slow
def test_a_loop_cut_in_the_middle_pauses_calls_and_counts_nothing_until_it_is_mended(
    tmp_path: Path,
) -> None:
    wired = Wired(tmp_path, trials=8)
    wired.requests.attended = True
    asked: list[int] = []

    def ask(trial: int) -> None:
        asked.append(trial)
        if len(asked) == 9:
            wired.cut()

    def mend() -> None:
        assert wired.requests.paused
        if wired.pauses == 2:  # the operator goes on once before anything was mended
            wired.repair()

    wired.at_ask, wired.at_pause = ask, mend
    assert wired.begin().finished
    rows = wired.table()
    assert wired.pauses == 2
    wrong = [row for row in rows if row["burst_verified"] == "false"]
    assert [row["status"] for row in wrong] == ["indeterminate"] * len(wrong)
    assert len(wrong) in {2, 3}  # a blank trial is silent as planned
    ok = [row for row in rows if row["status"] == "ok"]
    assert sorted(int(row["trial"]) for row in ok) == [t.number for t in wired.plan.trials]
    assert counted(ok)
    assert {burst["faults"] for burst in wired.table("measured.csv")} == {"n/a", "silent"}


@pytest.mark.slow
@pytest.mark.parametrize("killed", [False, True])
def test_where_nobody_attends_it_stops_and_can_be_resumed(tmp_path: Path, *, killed: bool) -> None:
    wired = Wired(tmp_path)
    wired.at_ask = lambda trial: wired.cut()
    assert not wired.begin().finished
    if killed:  # before the end of the trial whose burst was not verified
        lines = wired.folder.journal_path.read_bytes().splitlines(keepends=True)
        last = max(i for i, line in enumerate(lines) if b'"trial_end"' in line)
        wired.folder.journal_path.write_bytes(b"".join(lines[:last]))
        for path in (
            wired.folder.path.parent / "sessions.tsv",
            wired.folder.trials_path,
            wired.folder.measured_path,
        ):
            path.unlink()
    wired.repair()
    wired.at_ask = lambda trial: None
    assert wired.resume().finished
    assert counted([row for row in wired.table() if row["status"] == "ok"])


def test_a_device_s_own_converter_verifies(tmp_path: Path) -> None:
    rig = ByItself(tmp_path)
    assert rig.begin().finished
    assert {row["burst_verified"] for row in rig.table()} == {"amplifier"}
    assert rig.header["monitor"]["never_sees"]
    for row in rig.table("measured.csv"):
        assert float(row["peak_left"]) == pytest.approx(float(row["planned_left"]), rel=0.02)
    weak = ByItself(tmp_path / "weak", per_volt=1.3)
    assert not weak.begin().finished
    assert weak.table()[0]["burst_verified"] == "false"


@pytest.mark.parametrize("tap", ["line", "amplifier"])
def test_an_amplifier_that_goes_off_while_it_drives_is_seen_beside_any_tap(
    tmp_path: Path, tap: str
) -> None:
    rig = ByItself(tmp_path, tap=tap)
    on = rig.health(switch_closed=True)

    def open_switch(trial: int) -> None:
        if len(rig.mock.emitted) == 5:
            rig.mock.sense(replace(on, switch_closed=False))

    rig.mock.sense(on)
    rig.at_ask = open_switch
    assert not rig.begin().finished
    rows = rig.table()
    assert [row["burst_verified"] for row in rows] == [tap] * 4 + ["false"]
    assert rows[-1]["status"] == "indeterminate"


MONITOR = STUDY.format(trials=4, tap="line", disagreement="repeat")
DEVICE = BY_ITSELF.format(tap="line", gain=1)


@pytest.mark.parametrize(
    ("text", "key", "instead", "named"),
    [
        (MONITOR, 'source = "duplex"\n', "", r"monitor\.source"),
        (MONITOR, "[125, 125]", "[1e-15, 125]", "per_unit.*1e-12"),
        (MONITOR, '"duplex"', '"duplex"\nsound_card = "x"', "sound_card"),
        (MONITOR, '"repeat"', '"repeat"\nonset_tolerance_ms = 200', "onset_tolerance_ms"),
        (MONITOR, '"repeat"', '"repeat"\nsample_rate_hz = 96000', "sample_rate_hz"),
        (MONITOR, "[1, 1]", "[0, 1]", r"per_volt\[0\].*1e-09.*got 0"),
        (MONITOR, "[0.3, 0.4]", "[0.1, 0.4]", r"onset_tolerance_ms.*foreperiod_s\[0\], 50 "),
        (MONITOR, "hann", 'hann"\ncycles = 20 #', r"foreperiod_s\[0\].*0\.32.*got 0\.3"),
        (MONITOR, "hann", 'hann"\ncycles = 64 #', r"source.*0\.125 s.*0\.128 s"),
        (MONITOR, "hann", 'hann"\nfrequency_hz = 15000 #', r"device.sample_rate_hz.*got 48000"),
        (MONITOR, '"duplex"', '"device"', "source.*audio.*input.*device"),
        (MONITOR, '"audio"', '"serial"', "source.*serial.*input.*duplex"),
        (MONITOR, "2026-05-04", '"soon"', 'measured_on.*"soon"'),
        (MONITOR, "2026-05-04", "2999-01-01", 'measured_on.*"2999-01-01"'),
        (MONITOR, "2026-05-04", '"20260504"', "measured_on"),
        (DEVICE, 'source = "device"', 'source = "device"\nper_unit = [-1, 1]', "per_unit.* 0 "),
        (
            MONITOR.replace("duplex", "input").replace("hann", 'hann"\nfrequency_hz = 2000 #'),
            '"repeat"',
            '"repeat"\nsample_rate_hz = 8000',
            r"monitor\.sample_rate_hz.*got 8000",
        ),
    ],
)
def test_a_key_of_the_monitor_that_could_mislead_is_refused(
    text: str, key: str, instead: str, named: str, make_study: Callable[[str], Study]
) -> None:
    if "foreperiod_s" in named and "50" in named:
        text = text.replace("delay_ms", "onset_tolerance_ms = 60\ndelay_ms")
    assert key in text
    make_study(text)
    with pytest.raises(StudyError, match=named):
        make_study(text.replace(key, instead))


def test_a_check_of_a_device_measures_gain_and_delay_of_its_monitor(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    wired.card.line.delays = [252.0, 264.0]
    wired.card.line.path = lambda past: 0.95 * past
    check, wrong = wired.check()
    assert wrong == ""
    for channel, delay in zip(check.channels, (252, 264), strict=True):
        assert channel.monitor is not None
        assert channel.good
        assert channel.monitor.per_unit == pytest.approx(125 / 0.95, rel=0.02)
        assert channel.monitor.delay_ms == pytest.approx(delay / 48, abs=0.02)
    wired.cut()
    check, wrong = wired.check()
    assert not any(channel.good for channel in check.channels)
    assert "silent" in wrong


@pytest.mark.parametrize(
    ("adc", "keys", "named"),
    [
        ({"gain": 0.5}, "", "weak; per_unit = 2 "),
        ({"gain": 1.2}, "", "strong; per_unit = 0.833"),
        ({"delay_us": 5e4}, "", " and delay_ms = 50 "),
        ({"delay_us": 1e4}, "delay_ms = [30, 10]", " and delay_ms = 10 "),
        ({"noise": 200.0}, "min_correlation = 0.9999", "distorted"),
        ({"loss": 1.0}, "", "silent"),
        (
            {"delay_us": 1e4, "gain": 0.5},
            'disagreement = "flag"',
            "late; per_unit = 2 and delay_ms = 10",
        ),
        ({"gain": 0.95, "delay_us": 900.0}, "", ""),
        ({"delay_us": 1e4}, "delay_ms = [9.5, 10.5]", ""),
    ],
)
def test_a_check_ends_with_1_where_a_session_would_count_no_burst(
    tmp_path: Path, adc: dict[str, Any], keys: str, named: str
) -> None:
    _, wrong = ByItself(tmp_path, keys=keys, **adc).check()
    assert (named in wrong, wrong[:3]) == (True, "1: " if named else "")


@pytest.fixture
def measured(tmp_path: Path) -> ByItself:
    """A session that was measured and has ended."""
    rig = ByItself(tmp_path / "results")
    assert rig.begin().finished
    return rig


def edited(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b"amplifier", b"line", 1))


def of_another(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b",01,", b",02,"))


@pytest.mark.parametrize(
    ("change", "line"),
    [(edited, 2), (of_another, 2), (Path.unlink, None), (lambda path: path.write_bytes(b""), 1)],
)
def test_an_analysis_names_another_measured_csv_and_export_builds_it(
    measured: ByItself, run: Run, change: Callable[[Path], object], line: int | None
) -> None:
    path = measured.folder.measured_path
    written = path.read_bytes()
    change(path)
    differences = examine(measured.folder.path).differences
    assert {(found.path, found.remedy) for found in differences} == {(path, "export")}
    place = re.escape(str(path) if line is None else f"{path}:{line}")
    with pytest.raises(ResultFileError, match=f"^{place}: "):
        read_inputs([measured.folder.root])
    done = run("export", measured.folder.root)
    assert (done.exit_code, path.read_bytes()) == (0, written)
    assert done.stdout.splitlines() == [str(measured.folder.trials_path), str(path)]
    assert done.stderr.startswith(str(path))
    assert not read_inputs([measured.folder.root]).altered
