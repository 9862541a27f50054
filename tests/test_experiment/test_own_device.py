"""Devices and responders of a lab's own: by name, from Python, and what is wrong with them."""

from __future__ import annotations

import csv
import importlib
import json
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device import (
    BurstDevice,
    Converter,
    DriverSettings,
    LimitExceeded,
    Limits,
    LinkError,
    Outcome,
    Played,
    VirtualClock,
    converter_device,
    make_device,
)
from experiment import (
    Press,
    Responder,
    ResponderError,
    StudyError,
    run_session,
    simulate_study,
)
from experiment.hardware.setup import read_limits
from experiment.hardware.suitability import require_suitable
from experiment.record.bids import export_bids
from experiment.tasks import make_task
from tests.plates import on_paper_plate, study_from_text
from tests.test_experiment.lab import Crash, Lab, Scripted

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
min_break_s = 0
[burst]
window = "hann"
[masking]
noise = "none"
[device]
volts_full_scale = 100
"""
LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.02)
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
    (tmp_path / "study.toml").write_text(on_paper_plate(STUDY), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for module in ("lab_device", "broken"):
        sys.modules.pop(module, None)


RUN = ("run", "study.toml", "--participant", "01", "--seed", "1", "--confirm-hardware")


@pytest.mark.slow
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
    ("driver", "entries", "module", "parts"),
    [
        ("other", "other = nowhere:printer", "", ["other", "nowhere"]),
        ("other", "other = broken:printer", "1 / 0", ["other", "ZeroDivisionError"]),
        ("other", "other = broken:printer", "printer = 3", ["other", "factory"]),
        ("printer", "printer = other:printer", "", ["lab_device 0.1", "other_lab 0.1"]),
        ("mock", "mock = nowhere:mock", "", None),  # the built-in one, with a note
        ("printer", "mock = nowhere:mock", "", None),
    ],
)
def test_a_driver_that_cannot_be_loaded_is_refused_in_one_line(
    driver: str, entries: str, module: str, parts: list[str] | None, lab: Path, run: Run
) -> None:
    offer(lab / "site", f"[tactstrip.drivers]\n{entries}\n", {"broken": module}, name="other_lab")
    done = run(*RUN, "--driver", driver, "--responder", "simulated")
    if parts is None:
        assert (done.exit_code, done.stderr.count("other_lab 0.1")) == (0, int(driver == "mock"))
        return
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert [part for part in parts if part not in done.stderr] == []
    assert not (lab / "results").exists()


LEFT = "def leave(*_):\n    raise OSError('gone')\nImpatient.__enter__ = lambda self: self\n"


@pytest.mark.parametrize(
    ("made", "part", "exit_code"),
    [
        ("del Printer.emulated", "Printer.emulated", 2),
        ("class Printer(Converter): pass", "Printer", 2),
        ("Printer.bits = 99", "bits", 2),
        ("class Impatient: pass", "Impatient", 2),
        ("class Impatient(Responder):\n    def __init__(self, *_): pass", "abstract method", 2),
        (f"{LEFT}Impatient.__exit__ = leave", "OSError: gone", 0),
    ],
)
def test_what_is_lacking_is_one_line_with_its_distribution(
    made: str, part: str, exit_code: int, lab: Path, run: Run
) -> None:
    module = lab / "site" / "lab_device.py"
    module.write_text(f"{module.read_text('utf-8')}\n{made}\n", encoding="utf-8")
    done = run(*RUN, "--driver", "printer", "--responder", "impatient")
    assert done.exit_code == exit_code, done.stderr
    (line,) = [line for line in done.stderr.splitlines() if part in line]
    assert exit_code == 0 or "lab_device 0.1" in line
    assert (lab / "results").exists() == (exit_code == 0)


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
        ({"least_interval_us": 60_000}, r"device\.min_interval_s: .* 0\.06 "),
        ({"max_duty_ppm": 10_000}, r"device\.min_interval_s: .* 0\.202125 "),
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
    identity, limits = device.open(), read_limits(device)
    assert limits is not None
    require_suitable(study, identity, limits)
    with pytest.raises(ValueError, match=bound):
        require_suitable(study, identity, replace(limits, **changed))
    with pytest.raises(ValueError, match=r"design\.levels_vpp: .* 199 Vpp \(got 200\)"):
        require_suitable(study, replace(identity, ceiling_vpp=199.0))
    for channels in (1, 3):
        with pytest.raises(ValueError, match=f"one channel .* 2 sites; it drives {channels}"):
            require_suitable(study, replace(identity, channels=channels))


class Faulty(Converter):
    """A converter that fails in one way or another."""

    name, serial_number, bits, emulated = "faulty", "1", 16, True
    sample_rate_hz, full_scale_v = 48_000.0, 60.0

    def __init__(self, outcome: Any) -> None:
        self.outcome = outcome
        self.played: list[tuple[float, float]] = []

    def connect(self) -> None: ...

    def play(self, volts: Any) -> Played:
        self.played.append(tuple(abs(volts).max(axis=1)))
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return Played(outcome=self.outcome)

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
    device.load(0, np.stack([SINE, SINE]))
    device.enable()
    device.set_levels([100.0, 50.0])
    device.arm(1, 0, time_to_live_s=1.0)
    for _ in range(3):
        assert device.fire(1).outcome is device.query(1).outcome is kept
    assert converter.played == [pytest.approx((50.0, 25.0), rel=1e-4)]
    if kept is Outcome.INDETERMINATE:
        with pytest.raises(LinkError, match=r"^faulty: "):
            device.enable()


ATTRIBUTES = ("name", "serial_number", "sample_rate_hz", "bits", "full_scale_v", "emulated")
STEPS = ("open", "load", "enable", "set_levels", "arm", "fire", "disarm", "query", "stop", "close")


@pytest.mark.parametrize("step", ["connect", "zero", "disconnect"])
def test_a_step_of_a_converter_that_fails_is_a_failure_of_the_device(step: str) -> None:
    def failing() -> None:
        raise OSError("gone")

    converter = Faulty(Outcome.FIRED)
    device = converter_device(converter, limits=LIMITS, clock=VirtualClock())
    if step != "connect":
        assert device.open().ceiling_vpp == 120.0  # what the converter reaches
        device.load(0, np.stack([SINE, SINE]))
        with pytest.raises(LimitExceeded):
            device.set_levels([121.0, 0.0])
    failing.__name__ = step
    setattr(converter, step, failing)
    with pytest.raises(LinkError, match=rf"^faulty: {step} .*OSError: gone$"):
        device.open() if step == "connect" else device.close()


class Session:
    """Sessions of participant 01 run from Python, on the example's device and responder."""

    def __init__(self, lab_device: Any, out: Path) -> None:
        self._lab_device, self._out, self.clock = lab_device, out, VirtualClock()
        self.study = study_from_text(STUDY, "study.toml")
        self.someone = lab_device.Impatient(None, self.clock)

    @property
    def device(self) -> Any:
        return self._lab_device.printer(DriverSettings(limits=LIMITS), self.clock)

    def run(self, *, device: Any = None, someone: Any = None, **more: Any) -> Any:
        return run_session(
            self.study,
            "01",
            device or self.device,
            someone or self.someone,
            out=self._out,
            clock=self.clock,
            **more,
        )  # arguments of one call


@pytest.fixture
def session(lab_device: Any, tmp_path: Path) -> Session:
    return Session(lab_device, tmp_path / "results")


def test_a_session_is_run_and_resumed_from_python(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session.someone, "introduce", lambda *_: False)
    monkeypatch.setattr(session.someone, "pause", lambda *_, **__: False, raising=False)
    assert not session.run(levels_vpp=(33.0,), seed=1).finished
    monkeypatch.undo()
    with pytest.raises(ValueError, match="exists"):
        session.run()
    with monkeypatch.context() as patch:
        patch.setattr("experiment.session.run.interruption_s", lambda _: 3600.0)
        with pytest.raises(ValueError, match="60 minutes"):
            session.run(resuming=True)
        ending = session.run(resume_anyway=True)
    assert ending.finished
    text = ending.trials_path.read_text(encoding="utf-8")
    assert (text.count(",left,0.33,"), text.count(",33,left,")) == (4, 4)
    assert session.run(resuming=True).finished


@pytest.mark.parametrize(
    ("method", "made", "part"),
    [
        ("ask", lambda _: Press("left", float("nan")), ""),
        ("ask", lambda _: ("left", 1.0), r"\('left', 1.0\)"),
        ("ask", lambda question: Press("left", question.onset_s + 0.3), r" 0\.3 s .*time_s"),
        ("ask", lambda _: Press("left", 1.7e9), " 1.7e.09 s"),
        ("ask", lambda _: Press("left", -100.0), "time_s"),
        ("ask", lambda _: 1 / 0, "ZeroDivisionError"),
        ("ask", lambda _: sys.exit(0), "SystemExit: 0"),
        ("cue", lambda _: 1 / 0, "ZeroDivisionError"),
    ],
)
def test_a_responder_that_fails_ends_the_session_in_one_line(
    session: Session, method: str, made: Any, part: str
) -> None:
    setattr(session.someone, method, made)
    with pytest.raises(ResponderError, match=f"Impatient .*{part}") as caught:
        session.run()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("word", ["Left", "banana"])
def test_a_word_that_is_never_offered_ends_in_time_outs_after_its_foreperiod(
    session: Session, word: str
) -> None:
    session.someone.wait = lambda _: None  # who does not wait
    session.someone.ask = lambda question: Press(word, question.onset_s + 0.3)
    ending = session.run(seed=1)
    with ending.trials_path.open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert [row["response"] for row in rows] == ["timeout"] * 4
    assert min(np.diff([float(row["onset_s"]) for row in rows])) >= 0.33 + 0.01


@pytest.mark.parametrize("base", [Converter, BurstDevice, Responder])
def test_a_class_that_lacks_a_method_is_refused_by_its_name(base: Any) -> None:
    for name in base.__abstractmethods__:
        methods = {other: lambda *_: None for other in base.__abstractmethods__ - {name}}
        with pytest.raises(TypeError, match=rf"abstract method '?{name}'?"):
            type("Lacking", (base,), methods)()


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_a_converter_without_an_attribute_is_refused_by_its_name(name: str) -> None:
    class Lacking(Faulty):
        def __getattribute__(self, attribute: str) -> Any:
            if attribute == name:
                raise AttributeError(name)
            return super().__getattribute__(attribute)

    with pytest.raises(ValueError, match=rf"^Lacking\.{name} must be set"):
        converter_device(Lacking(Outcome.FIRED), limits=LIMITS, clock=VirtualClock())


@pytest.mark.parametrize("part", ["device", "someone"])
def test_what_is_no_device_or_responder_is_refused_before_a_session(
    session: Session, tmp_path: Path, part: str
) -> None:
    with pytest.raises((ValueError, ResponderError), match="subclass of") as caught:
        session.run(**{part: object()})
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "results").exists()


def forwarded(device: Any, step: str) -> Any:
    """Return a method that has another device do its step."""
    return lambda _, *args, **named: getattr(device, step)(*args, **named)


@pytest.mark.parametrize("step", STEPS)
def test_a_device_of_ones_own_that_raises_is_a_failure_of_the_device(
    session: Session, step: str
) -> None:
    def failing(*_: Any, **__: Any) -> None:
        raise OSError("gone")

    inner = session.device
    methods = {name: failing if name == step else forwarded(inner, name) for name in STEPS}
    device = type("Own", (BurstDevice,), methods)()
    if step in {"disarm", "query"}:
        assert session.run(device=device).finished
        return
    try:
        failure = session.run(device=device).failure
    except LinkError as error:
        failure = error
    assert str(failure).startswith(f"Own.{step} ")
    assert str(failure).endswith("OSError: gone")


SAME_DIFFERENT = """
[task]
kind = "same-different"
gap_s = 0.1
[design]
levels_vpp = [80, 160]
trials_per_side = 3
blank_trials = 4
foreperiod_s = [0.01, 0.02]
break_every = 5
min_break_s = 0
[masking]
noise = "none"
[simulation]
threshold_vpp = 100
"""


@pytest.fixture
def own_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The example of a task, where Python finds its distribution."""
    text = (DOCS / "examples" / "own_task" / "same_different.py").read_text(encoding="utf-8")
    entries = "[tactstrip.tasks]\nsame-different = same_different:same_different\n"
    offer(tmp_path / "site", entries, {"same_different": text}, name="same_different")
    monkeypatch.syspath_prepend(tmp_path / "site")
    make_task.cache_clear()
    yield
    make_task.cache_clear()
    sys.modules.pop("same_different", None)


@pytest.mark.usefixtures("own_task")
def test_a_task_of_a_labs_own_runs_and_resumes_and_is_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = study_from_text(SAME_DIFFERENT)
    monkeypatch.setattr(Scripted, "usual", ("different", 0.5))
    lab = Lab(study, tmp_path / "results", monkeypatch)
    with pytest.raises(Crash), lab.killed_after(lines=40):
        lab.begin()
    assert lab.resume().finished
    rows = [row for row in lab.rows if row.status == "ok"]
    assert Counter(row.side for row in rows) == {
        "left_left": 2,
        "right_right": 2,
        "left_right": 3,
        "right_left": 3,
    }
    assert {row.kind: row.level_vpp is None for row in rows} == {"single": False, "blank": False}
    assert lab.differences() == ()
    people = simulate_study(study, tmp_path / "people", participants=1, seed=1, gains=())
    folders = [*people]
    (history,) = (each.read_history(each.read_plan()) for each in folders)
    assert {row.response for row in history.rows} <= {"same", "different"}
    export_bids(folders, tmp_path / "bids")
    (sidecar,) = (tmp_path / "bids").rglob("*_events.json")
    levels = json.loads(sidecar.read_text(encoding="utf-8"))["side"]["Levels"]
    assert levels["left_right"] == "first at the left finger, then at the right finger"
    described = json.loads(sidecar.read_text(encoding="utf-8"))["Task"]
    assert described == {
        "Kind": "same-different",
        "Intervals": 2,
        "GapBetweenIntervals": 0.1,
        "LevelRule": "constant",
    }
    assert "task same-different" in (tmp_path / "bids" / "README").read_text(encoding="utf-8")


@pytest.mark.usefixtures("own_task")
@pytest.mark.parametrize(
    ("module", "part"),
    [
        ("same_different = 3", "factory"),
        ("def same_different(sites): return sites", "experiment.Task"),
        ("def same_different(sites): 1 / 0", "ZeroDivisionError"),
        (
            (
                "from dataclasses import replace\nfrom experiment import paper_study\n"
                "def same_different(sites):\n"
                "    return replace(paper_study().task, decide=lambda *_: {'left': 1.0})"
            ),
            "every answer",
        ),
    ],
)
def test_a_task_that_cannot_be_made_is_refused_by_its_distribution(
    module: str, part: str, tmp_path: Path
) -> None:
    (tmp_path / "site" / "same_different.py").write_text(module, encoding="utf-8")
    sys.modules.pop("same_different", None)
    importlib.invalidate_caches()
    with pytest.raises(StudyError, match=rf"task\.kind: .*{part}"):
        study_from_text(SAME_DIFFERENT)
