"""Devices and responders of a lab's own: by name, from Python, and what is wrong with them."""

from __future__ import annotations

import csv
import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any
from unittest.mock import MagicMock, call

import numpy as np
import pytest

from device import (
    DriverSettings,
    LimitExceeded,
    Limits,
    LinkError,
    Outcome,
    VirtualClock,
    converter_device,
    make_device,
)
from experiment import Press, ResponderError, run_session, study_from_text
from experiment.apparatus.slots import require_suitable, told_limits

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.conftest import Run

DOCS = Path(__file__).parents[2] / "docs"
OWN = DOCS / "examples" / "own_device"
STUDY = """
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 0
foreperiod_s = [0.01, 0.02]
minimum_break_s = 0
[burst]
window = "hann"
[masking]
noise = "none"
[device]
volts_full_scale = 100
"""
LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.02)
SINE = np.append(np.sin(2 * np.pi * np.arange(96) / 96), 0.0)


def offer(folder: Path, entries: str, modules: dict[str, str], name: str = "lab_device") -> None:
    """Lay a distribution where Python finds it, as pip does."""
    info = folder / f"{name}-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(entries)
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text, encoding="utf-8")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a study, and the example's distribution where Python finds it."""
    offer(
        tmp_path / "site",
        "[tactstrip.drivers]\nprinter = lab_device:printer\n"
        "[tactstrip.responders]\nimpatient = lab_device:Impatient\n",
        {"lab_device": (OWN / "lab_device.py").read_text(encoding="utf-8")},
    )
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for module in ("lab_device", "broken"):
        sys.modules.pop(module, None)


RUN = ("run", "study.toml", "--participant", "01", "--seed", "1", "--confirm-hardware")


def test_a_session_is_run_by_name(lab: Path, run: Run) -> None:
    done = run(*RUN, "--driver", "printer", "--responder", "impatient")
    assert done.exit_code == 0, done.stderr
    session = lab / "results" / "sub-01" / "ses-01"
    header = json.loads((session / "header.json").read_text(encoding="utf-8"))
    assert header["driver_distribution"] == header["responder_distribution"] == "lab_device 0.1"
    assert (header["responder"], header["device"]) == ("impatient", "printer")
    with (session / "trials.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert [(row["response"], row["status"]) for row in rows] == [("left", "ok")] * 4
    assert {float(row["rt_s"]) // 0.01 for row in rows} <= {33.0, 34.0, 35.0, 36.0}


@pytest.mark.parametrize(
    ("entries", "module", "part"),
    [
        ("other = nowhere:printer", "", "from nowhere"),
        ("other = broken:printer", "1 / 0", "ZeroDivisionError"),
        ("other = broken:printer", "printer = 3", "factory"),
        ("printer = other:printer", "", "other_lab 0.1"),
    ],
)
def test_a_driver_that_cannot_be_loaded_is_refused_in_one_line(
    lab: Path, entries: str, module: str, part: str, run: Run
) -> None:
    offer(lab / "site", f"[tactstrip.drivers]\n{entries}\n", {"broken": module}, name="other_lab")
    name = entries.partition(" ")[0]
    done = run(*RUN, "--driver", name, "--responder", "simulated")
    assert done.exit_code == 2
    assert name in done.stderr
    assert part in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (lab / "results").exists()


@pytest.mark.parametrize(("driver", "notes"), [("mock", 1), ("printer", 0)])
def test_a_built_in_name_is_that_of_the_built_in_one_and_noted(
    lab: Path, driver: str, notes: int, run: Run
) -> None:
    offer(lab / "site", "[tactstrip.drivers]\nmock = nowhere:mock\n", {}, name="other_lab")
    done = run(*RUN, "--driver", driver, "--responder", "simulated")
    assert done.exit_code == 0, done.stderr
    assert done.stderr.count("other_lab 0.1") == notes


@pytest.mark.parametrize(
    ("made", "part"),
    [
        ("Printer.emulated = None", "Printer.emulated"),
        ("del Printer.emulated", "Printer"),
        ("Printer.play = lambda self: None", "(left_v, right_v); got ()"),
        ("Printer.bits = 99", "bits"),
        ("del Impatient.simulated", "Impatient"),
        ("del Impatient.cue", "cue(progress)"),
        ("Impatient.pause = lambda self, progress: True", "(progress, *, paused, minimum_s)"),
    ],
)
def test_what_is_lacking_is_one_line_with_its_distribution(
    lab: Path, made: str, part: str, run: Run
) -> None:
    module = lab / "site" / "lab_device.py"
    module.write_text(f"{module.read_text('utf-8')}\n{made}\n", encoding="utf-8")
    done = run(*RUN, "--driver", "printer", "--responder", "impatient")
    assert done.exit_code == 2, done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert part in line
    assert "lab_device 0.1" in line
    assert not (lab / "results").exists()


def test_a_responder_that_fails_as_it_is_left_is_noted_after_the_session(
    lab: Path, run: Run
) -> None:
    module = lab / "site" / "lab_device.py"
    leaving = "def leave(*_):\n    raise OSError('gone')\n"
    leaving += "Impatient.__enter__ = lambda self: self\nImpatient.__exit__ = leave\n"
    module.write_text(f"{module.read_text('utf-8')}\n{leaving}", encoding="utf-8")
    done = run(*RUN, "--driver", "printer", "--responder", "impatient")
    assert done.exit_code == 0, done.stderr
    assert "--responder impatient" in done.stderr
    assert "OSError: gone" in done.stderr


@pytest.fixture
def lab_device(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(OWN))
    yield importlib.import_module("lab_device")
    sys.modules.pop("lab_device")


@pytest.mark.parametrize(
    ("changed", "bound"),
    [
        ({"slots": 3}, "4 slots"),
        ({"memory_samples": 387}, "388 .* 387"),
        ({"least_interval_us": 60_000}, r"device\.least_interval_s .* 0\.06 "),
        ({"max_duty_ppm": 10_000}, r"device\.least_interval_s .* 0\.202125 "),
        ({"longest_time_to_live_us": 999_999}, " 1 s"),
        ({"dc_tolerance_ppm": 1}, "DC"),
    ],
)
def test_what_a_device_would_refuse_in_a_session_is_refused_before(
    changed: dict[str, Any], bound: str
) -> None:
    study = study_from_text("[burst]\nfrequency_hz = 499.3\n", "study.toml")
    if "dc_tolerance_ppm" not in changed:
        study = study_from_text("", "study.toml")
    device = make_device("mock", DriverSettings(limits=Limits(ceiling_vpp=200.0)), VirtualClock())
    identity, limits = device.open(), told_limits(device)
    assert limits is not None
    require_suitable(study, identity, limits)
    with pytest.raises(ValueError, match=bound):
        require_suitable(study, identity, replace(limits, **changed))


def test_a_session_is_run_from_python(lab_device: Any, tmp_path: Path) -> None:
    clock = VirtualClock()
    settings = DriverSettings(limits=LIMITS)
    study = study_from_text(STUDY, "study.toml")
    someone = lab_device.Impatient(None, clock)
    ending = run_session(
        study, "01", lab_device.printer(settings, clock), someone, out=tmp_path, clock=clock, seed=1
    )
    assert ending.finished
    assert ending.trials_path.read_text(encoding="utf-8").count(",left,0.33,") == 4
    again = lab_device.printer(settings, clock)
    with pytest.raises(ValueError, match="exists"):
        run_session(study, "01", again, someone, out=tmp_path, clock=clock)
    ended = run_session(study, "01", again, someone, out=tmp_path, clock=clock, resuming=True)
    assert ended.finished


def test_levels_markers_and_a_late_resume_are_had_from_python_too(
    lab_device: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, study = VirtualClock(), study_from_text(STUDY, "study.toml")
    sent: list[str] = []

    class Markers:
        words = "kept here"

        def __init__(self, clock: Any, *, participant: str, session: str) -> None: ...

        def heard(self) -> bool:
            return True

        def send(self, marker: str, time_s: float) -> None:
            sent.append(marker)

    monkeypatch.setattr("experiment.session.run.LslMarkers", Markers)

    def run(**more: Any) -> Any:
        someone = lab_device.Impatient(None, clock)
        device = lab_device.printer(DriverSettings(limits=LIMITS), clock)
        return run_session(study, "01", device, someone, out=tmp_path, clock=clock, **more)

    monkeypatch.setattr(lab_device.Impatient, "pause", lambda *_, **__: False, raising=False)
    monkeypatch.setattr(lab_device.Impatient, "introduce", lambda *_: False)
    assert not run(levels_vpp=(33.0,), seed=1).finished
    monkeypatch.undo()
    monkeypatch.setattr("experiment.session.run.LslMarkers", Markers)
    monkeypatch.setattr("experiment.session.conduct.interruption_s", lambda _: 3600.0)
    with pytest.raises(ValueError, match="60 minutes"):
        run(resuming=True)
    ending = run(resume_anyway=True, lsl=True)
    assert ending.finished
    assert ending.trials_path.read_text(encoding="utf-8").count(",33,left,") == 4
    assert [marker.split("/")[0] for marker in sent].count("stimulus") == 4


def test_a_person_on_an_emulated_device_of_ones_own_is_practice(
    lab_device: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, study = VirtualClock(), study_from_text(STUDY, "study.toml")
    someone = lab_device.Impatient(None, clock)
    device = lab_device.printer(DriverSettings(limits=LIMITS), clock)
    monkeypatch.setattr(type(someone), "simulated", False)
    with pytest.raises(ValueError, match="--practice-without-device"):
        run_session(study, "01", device, someone, out=tmp_path, clock=clock)
    assert not (tmp_path / "sub-01").exists()
    ending = run_session(
        study, "01", device, someone, out=tmp_path, clock=clock, practice_without_device=True
    )
    assert ending.trials_path.read_text(encoding="utf-8").count(",false,emulated,") == 4


class Faulty:
    """A converter that fails in one way or another."""

    name, serial_number, bits, emulated = "faulty", "1", 16, True
    cannot: tuple[str, ...] = ()
    sample_rate_hz, full_scale_v = 48_000.0, 60.0

    def __init__(self, outcome: Any) -> None:
        self.outcome = outcome
        self.played: list[tuple[float, float]] = []

    def connect(self) -> None: ...

    def play(self, left_v: Any, right_v: Any) -> Outcome:
        self.played.append((abs(left_v).max(), abs(right_v).max()))
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome  # type: ignore[no-any-return] # of no type, on purpose

    def zero(self) -> None: ...

    def disconnect(self) -> None: ...


@pytest.mark.parametrize(
    ("outcome", "kept"),
    [
        (Outcome.NOT_FIRED, Outcome.NOT_FIRED),
        (RuntimeError("the cable is out"), Outcome.INDETERMINATE),
        ("no outcome", Outcome.INDETERMINATE),
    ],
)
def test_what_a_converter_says_or_fails_with_is_kept_and_nothing_is_played_twice(
    outcome: Any, kept: Outcome
) -> None:
    converter = Faulty(outcome)
    device = converter_device(converter, limits=LIMITS, clock=VirtualClock())
    device.open()
    device.load(0, SINE, SINE)
    device.enable()
    device.set_levels(100.0, 50.0)
    device.arm(1, 0, time_to_live_s=1.0)
    for _ in range(3):
        assert device.fire(1).outcome is device.query(1).outcome is kept
    assert converter.played == [pytest.approx((50.0, 25.0), rel=1e-4)]
    if kept is Outcome.INDETERMINATE:
        with pytest.raises(LinkError, match=r"^faulty: "):
            device.enable()


def test_no_burst_is_above_what_the_converter_reaches() -> None:
    device = converter_device(Faulty(Outcome.FIRED), limits=LIMITS, clock=VirtualClock())
    assert device.open().ceiling_vpp == 120.0
    device.load(0, SINE, SINE)
    with pytest.raises(LimitExceeded):
        device.set_levels(121.0, 0.0)


# --- the larger examples, against stand-ins ------------------------------------------------------


def example(name: str) -> Any:
    path = DOCS / "examples" / f"{name}.py"
    module = ModuleType(name)
    exec(compile(path.read_text(encoding="utf-8"), path, "exec"), vars(module))
    return module


def burst_on(device: Any, level_vpp: float = 100.0) -> Any:
    device.open()
    device.load(0, SINE, 0 * SINE)
    device.enable()
    device.set_levels(level_vpp, level_vpp)
    device.arm(1, 0, time_to_live_s=1.0)
    return device.fire(1)


@pytest.fixture
def nidaqmx(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """A stand-in for nidaqmx that notes its calls."""
    module = MagicMock()
    module.errors.Error = RuntimeError
    module.constants.AcquisitionType.FINITE = "finite"
    for part in ("", ".constants", ".errors"):
        stands_in = getattr(module, part[1:]) if part else module
        monkeypatch.setitem(sys.modules, f"nidaqmx{part}", stands_in)
    return module


def test_the_daq_plays_a_burst_once_from_its_buffer_and_rests_at_zero(nidaqmx: MagicMock) -> None:
    settings = DriverSettings(limits=LIMITS, port="Dev1", amplifier_gain=20.0, channels=(1, 3))
    device = example("ni_daq").ni_daq(settings, VirtualClock())
    assert burst_on(device).outcome is Outcome.FIRED
    task = nidaqmx.Task.return_value.__enter__.return_value
    channels = task.ao_channels.add_ao_voltage_chan.call_args_list
    assert [call.args[0] for call in channels] == ["Dev1/ao0", "Dev1/ao2"] * 2
    assert {(call.kwargs["min_val"], call.kwargs["max_val"]) for call in channels} == {(-10, 10)}
    (clock,) = task.timing.cfg_samp_clk_timing.call_args_list
    assert clock == call(48_000.0, sample_mode="finite", samps_per_chan=97)
    names = [name.rpartition(".")[2] for name, *_ in task.mock_calls]
    assert names[-5:] == ["cfg_samp_clk_timing", "write", "start", "wait_until_done", "stop"]
    zeros, burst = task.write.call_args_list
    assert (zeros.args[0], zeros.kwargs) == ([0.0, 0.0], {"auto_start": True})
    volts = np.array(burst.args[0])
    assert volts.dtype == np.float64
    assert burst.kwargs == {"auto_start": False}
    assert abs(volts).max(axis=1) == pytest.approx([50.0 / 20.0, 0.0], abs=1e-3)
    assert volts[:, [0, -1]].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert device.fire(1).outcome is Outcome.FIRED
    assert task.write.call_count == 2, "played twice"
    device.close()
    assert task.write.call_args.args[0] == [0.0, 0.0]
    nidaqmx.Task.side_effect = RuntimeError("Device identifier is invalid.\nStatus Code: -200220")
    with pytest.raises(LinkError, match=r"^Dev1: .*invalid\.$"):
        example("ni_daq").ni_daq(settings, VirtualClock()).open()


@pytest.fixture
def sounddevice(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    played: list[Any] = []

    def play(data: Any, **how: Any) -> None:
        played.append((data, how))

    def query_devices(device: str, kind: str) -> dict[str, Any]:
        assert kind == "output"
        if device != "card":
            raise ValueError(f"No output device matching {device!r}")
        return {"name": "card", "max_output_channels": 4}

    card = SimpleNamespace(status=None, played=played)
    module = ModuleType("sounddevice")
    vars(module).update(
        play=play, query_devices=query_devices, PortAudioError=OSError,
        stop=lambda: None, get_status=lambda: card.status,
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "sounddevice", module)
    return card


def card(**settings: Any) -> Any:
    chosen: dict[str, Any] = {
        "port": "card",
        "volts_full_scale": 100.0,
        "channels": (3, 4),
    } | settings
    module = example("sound_card_channels")
    return module.sound_card_channels(DriverSettings(limits=LIMITS, **chosen), VirtualClock())


def test_the_sound_card_plays_on_the_chosen_outputs(sounddevice: SimpleNamespace) -> None:
    assert burst_on(card()).outcome is Outcome.FIRED
    ((frames, how),) = sounddevice.played
    assert frames.shape == (97, 2)
    assert abs(frames).max(axis=0) == pytest.approx([0.5, 0.0], abs=1e-4)
    expected = {"samplerate": 48_000.0, "device": "card", "mapping": [3, 4], "blocking": True}
    assert how == expected
    sounddevice.status = "output underflow"  # a gap: whether the burst came out is open
    assert burst_on(card()).outcome is Outcome.INDETERMINATE


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"channels": (3, 5)}, r"channels .* 4 on card, got \[3, 5\]"),
        ({"port": "none"}, "card none: "),
    ],
)
def test_a_card_without_these_outputs_is_refused(
    sounddevice: SimpleNamespace, settings: dict[str, Any], said: str
) -> None:
    with pytest.raises(LinkError, match=said):
        card(**settings).open()


def test_settings_that_an_example_needs_are_asked_for(nidaqmx: MagicMock) -> None:
    for name, factory in (("ni_daq", "ni_daq"), ("sound_card_channels", "sound_card_channels")):
        with pytest.raises(ValueError, match="given"):
            getattr(example(name), factory)(DriverSettings(limits=LIMITS), VirtualClock())


# --- responders and converters that misbehave ----------------------------------------------------


def sat(lab_device: Any, tmp_path: Path, **methods: Any) -> Any:
    """Run a session with a responder whose methods are others."""
    clock = VirtualClock()
    someone = lab_device.Impatient(None, clock)
    for name, method in methods.items():
        setattr(someone, name, method)
    device = lab_device.printer(DriverSettings(limits=LIMITS), clock)
    study = study_from_text(STUDY, "study.toml")
    return run_session(study, "01", device, someone, out=tmp_path, clock=clock, seed=1)


@pytest.mark.parametrize("word", ["Left", "banana"])
def test_a_word_that_is_never_offered_ends_in_time_outs(
    lab_device: Any, tmp_path: Path, word: str
) -> None:
    ending = sat(lab_device, tmp_path, ask=lambda question: Press(word, question.onset_s + 0.3))
    assert ending.finished
    assert ending.trials_path.read_text(encoding="utf-8").count(",timeout,") == 4


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda _: Press("left", float("nan")), "Impatient"),
        (lambda _: ("left", 1.0), r"or None; got \('left', 1.0\)"),
        (
            lambda question: Press("left", question.onset_s + 0.3),
            r"Impatient .* 0\.3 s .*time_s",
        ),
        (lambda _: Press("left", 1.7e9), "Impatient .* 1.7e.09 s"),
        (
            lambda _: Press("left", -100.0),
            "Impatient .*time_s",
        ),
        (lambda _: 1 / 0, "Impatient failed: ZeroDivisionError"),
        (lambda _: sys.exit(0), "Impatient failed: SystemExit: 0"),
    ],
)
def test_a_responder_that_fails_ends_the_session_in_one_line(
    lab_device: Any, tmp_path: Path, made: Any, said: str
) -> None:
    with pytest.raises(ResponderError, match=said):
        sat(lab_device, tmp_path, ask=made)


@pytest.mark.slow
def test_a_foreperiod_is_kept_by_whoever_does_not_wait(lab_device: Any, tmp_path: Path) -> None:
    ending = sat(lab_device, tmp_path, wait=lambda _: None)
    with ending.trials_path.open(encoding="utf-8") as table:
        onsets_s = [float(row["onset_s"]) for row in csv.DictReader(table)]
    assert min(np.diff(onsets_s)) >= 0.33 + 0.01


@pytest.mark.parametrize("step", ["connect", "zero", "disconnect"])
def test_a_step_of_a_converter_that_fails_is_a_failure_of_the_device(step: str) -> None:
    def failing() -> None:
        raise OSError("gone")

    converter = Faulty(Outcome.FIRED)
    device = converter_device(converter, limits=LIMITS, clock=VirtualClock())
    if step != "connect":
        device.open()
    failing.__name__ = step
    setattr(converter, step, failing)
    with pytest.raises(LinkError, match=rf"^faulty: {step} .*OSError: gone$"):
        device.open() if step == "connect" else device.close()


@pytest.mark.slow
def test_a_balanced_study_is_run_from_python(lab_device: Any, tmp_path: Path) -> None:
    clock = VirtualClock()
    text = STUDY.replace("[design]", '[design]\ncondition_order = "balanced"')
    study = study_from_text(
        text + '[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n', "study.toml"
    )
    first = set()
    for participant in ("01", "02"):
        device = lab_device.printer(DriverSettings(limits=LIMITS), clock)
        someone = lab_device.Impatient(None, clock)
        ending = run_session(study, participant, device, someone, out=tmp_path, clock=clock)
        with ending.trials_path.open(encoding="utf-8") as table:
            first.add(next(csv.DictReader(table))["condition"])
    assert first == {"a", "b"}


# --- what lacks a part of its protocol -----------------------------------------------------------

CONVERTER = ("name", "serial_number", "sample_rate_hz", "bits", "full_scale_v", "emulated",
             "cannot", "connect", "play", "zero", "disconnect")  # fmt: skip
DEVICE = ("cannot", "open", "load", "enable", "set_levels", "arm", "fire", "disarm", "query",
          "stop", "close")  # fmt: skip
ANSWERER = ("simulated", "begin", "introduce", "cue", "wait", "ask", "feedback", "pause", "end")


class Lacking:
    """Another object but for one part, which it has not, has as something else, or fails with."""

    def __init__(self, whole: object, part: str, how: str) -> None:
        self._whole, self._part, self._how = whole, part, how

    def __getattr__(self, name: str) -> Any:
        if name == self._part:
            if self._how == "raises":
                raise OSError("gone")
            if self._how == "wrong":
                return object()
            raise AttributeError(name)
        return getattr(self._whole, name)


@pytest.mark.parametrize("how", ["lacks", "wrong", "raises"])
@pytest.mark.parametrize("part", CONVERTER)
def test_a_converter_without_a_part_is_refused_with_what_to_add(part: str, how: str) -> None:
    lacking: Any = Lacking(Faulty(Outcome.FIRED), part, how)
    with pytest.raises(ValueError, match=rf"^Lacking\b.*\b{part}\b") as refusal:
        converter_device(lacking, limits=LIMITS, clock=VirtualClock())
    assert "(see device.Converter)" in str(refusal.value) or "gone" in str(refusal.value)


@pytest.mark.parametrize("how", ["lacks", "wrong", "raises"])
@pytest.mark.parametrize("part", [*DEVICE, *ANSWERER])
def test_a_device_or_responder_without_a_part_begins_no_session(
    lab_device: Any, tmp_path: Path, part: str, how: str
) -> None:
    clock, study = VirtualClock(), study_from_text(STUDY, "study.toml")
    device: Any = lab_device.printer(DriverSettings(limits=LIMITS), clock)
    someone: Any = lab_device.Impatient(None, clock)
    if part in DEVICE:
        device = Lacking(device, part, how)
    else:
        someone = Lacking(someone, part, how)
    with pytest.raises((ValueError, ResponderError), match=rf"^Lacking\b.*\b{part}\b") as refusal:
        run_session(study, "01", device, someone, out=tmp_path, clock=clock, seed=1)
    assert "\n" not in str(refusal.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("step", [part for part in DEVICE if part != "cannot"])
def test_a_device_of_ones_own_that_raises_is_a_failure_of_the_device(
    lab_device: Any, tmp_path: Path, step: str
) -> None:
    clock, study = VirtualClock(), study_from_text(STUDY, "study.toml")
    inner = lab_device.printer(DriverSettings(limits=LIMITS), clock)

    class Own:
        cannot = ()

    def failing(*_: Any, **__: Any) -> None:
        raise OSError("gone")

    device: Any = Own()
    for name in DEVICE[1:]:
        setattr(device, name, failing if name == step else getattr(inner, name))
    someone = lab_device.Impatient(None, clock)
    if step in {"disarm", "query"}:
        assert run_session(study, "01", device, someone, out=tmp_path, clock=clock).finished
        return
    try:
        failure = run_session(study, "01", device, someone, out=tmp_path, clock=clock).failure
    except LinkError as error:
        failure = error
    assert str(failure).startswith(f"Own.{step} ")
    assert str(failure).endswith("OSError: gone")
