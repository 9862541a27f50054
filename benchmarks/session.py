"""What a session costs beside the participant's time: trial, way to the wire, waiting, view."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.link import COMMAND, STUDY, emulator
from benchmarks.timing import duration
from experiment.session.simulate import simulate_study
from experiment.study.files import paper_study
from experiment.study.physics import study_gains
from experiment.trial.draw import draw_plan
from experiment.trial.engine import next_event, step
from experiment.trial.events import Attempt, Event, Input, Phase, Response, SessionState

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from experiment.perception.gains import ConditionGains
    from experiment.trial.plan import Plan

ROOT = Path(__file__).parent.parent
SILENT = '[masking]\nnoise = "none"\n'
PATIENT_DESIGN = "response_window_s = 60\n"
WAIT_S = 10.0
PATIENCE_S = 30.0
REPEATS = 20


def _engine_s(plan: Plan) -> float:
    """Return the time per trial of the engine alone, from the cue to the answer."""
    answers: dict[Phase, Input] = {
        Phase.WELCOME: Event.CONTINUED,
        Phase.INTRODUCTION: Event.CONTINUED,
        Phase.FOREPERIOD: Event.ELAPSED,
        Phase.ARMING: Event.ARMED,
        Phase.FIRING: Event.FIRED,
        Phase.ANSWER: Response("left", 0.5),
        Phase.BREAK: Event.CONTINUED,
    }
    state = SessionState(
        pending=tuple(Attempt(trial, 1) for trial in plan.trials),
        accept_premature=False,
        max_premature=3,
        response_window_s=plan.response_window_s,
    )
    start = time.perf_counter()
    while state.phase is not Phase.FINISHED:
        event = next_event(state) if state.phase is Phase.READY else answers[state.phase]
        state, _ = step(state, event)
    return (time.perf_counter() - start) / len(plan.trials)


def _session_s(trials: int, gains: tuple[ConditionGains, ...]) -> float:
    """Return the time per trial of a simulated session with journal and mock device, no fsync."""
    with tempfile.TemporaryDirectory() as name:
        start = time.perf_counter()
        for _ in simulate_study(paper_study(), Path(name), participants=1, seed=1, gains=gains):
            pass
        return (time.perf_counter() - start) / trials


def _study(folder: Path, more_design: str = "") -> Path:
    """Write a short study without noise."""
    path = folder / "study.toml"
    text = STUDY.replace("[design]\n", "[design]\n" + more_design)
    path.write_text(SILENT + text, encoding="utf-8")
    return path


def _path_facts() -> dict[str, Any]:
    """Return what `session_path` finds in a session over an emulator behind a pty."""
    with tempfile.TemporaryDirectory() as name, emulator("--pty") as port:
        folder = Path(name)
        result = folder / "result.json"
        options = ["--participant", "01", "--responder", "simulated", "--seed", "7"]
        link = ["--out", str(folder / "out"), "--driver", "serial", "--port", port]
        module = [sys.executable, "-m", "benchmarks.session_path", str(result)]
        subprocess.run(
            [*module, str(_study(folder)), *options, *link],
            check=True,
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
        )
        found: dict[str, Any] = json.loads(result.read_text("utf-8"))
        return found


@contextlib.contextmanager
def _terminal() -> Iterator[tuple[int, int]]:
    """Give the two ends of a terminal: the person's, the program's."""
    far, near = pty.openpty()
    try:
        yield far, near
    finally:
        os.close(far)
        os.close(near)


def _read_all(far: int, over: threading.Event) -> None:
    while not over.is_set():
        if select.select([far], [], [], 0.1)[0]:
            os.read(far, 65536)


def _view_facts() -> dict[str, Any]:
    """Return what `session_view` finds on a terminal of its own."""
    over = threading.Event()
    with tempfile.TemporaryDirectory() as name, _terminal() as (far, near):
        result = Path(name) / "result.json"
        reader = threading.Thread(target=_read_all, args=(far, over))
        reader.start()
        try:
            subprocess.run(
                [sys.executable, "-m", "benchmarks.session_view", str(result)],
                check=True,
                cwd=ROOT,
                stdin=near,
                stdout=near,
                env=os.environ | {"TERM": "xterm"},
            )
        finally:
            over.set()
            reader.join()
        found: dict[str, Any] = json.loads(result.read_text("utf-8"))
        return found


def _until_asked(far: int) -> None:
    """Leaf through the pages at a terminal until the session awaits an answer there."""
    seen, pages, until_s = b"", 0, time.monotonic() + PATIENCE_S
    while b" ?" not in seen:
        if not select.select([far], [], [], max(0.0, until_s - time.monotonic()))[0]:
            raise TimeoutError(f"no answer was asked for; got {seen!r}")
        seen += os.read(far, 4096)
        if seen.count(b"Enter goes on") > pages:
            pages += 1
            os.write(far, b"\n")


def _processor_s(pid: int) -> float:
    """Return the processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _waiting() -> str:
    """Return the share of a processor that a session takes while it awaits an answer."""
    if not Path("/proc/self/stat").exists():
        return "not measured"
    with (
        tempfile.TemporaryDirectory() as name,
        emulator("--pty") as port,
        _terminal() as (far, near),
    ):
        study, out = _study(Path(name), PATIENT_DESIGN), str(Path(name) / "out")
        link = ["--responder", "terminal", "--driver", "serial", "--port", port, "--out", out]
        person = ["--participant", "01", "--practice-without-device"]
        command = [*COMMAND, "run", str(study), *person, *link]
        with subprocess.Popen(
            command, cwd=ROOT, stdin=near, stdout=near, stderr=near, start_new_session=True
        ) as process:
            try:
                _until_asked(far)
                before_s = _processor_s(process.pid)
                time.sleep(WAIT_S)
                share = (_processor_s(process.pid) - before_s) / WAIT_S
            finally:
                process.send_signal(signal.SIGTERM)
    return f"{share:.1%}"


def _spread(times_s: Sequence[float]) -> str:
    """Return median, 99th percentile and greatest of some times, as cells of a table."""
    figures = np.percentile(times_s, [50, 99, 100])
    return " | ".join(duration(float(figure)) for figure in figures)


def _storage_words(path: dict[str, Any]) -> str:
    calls = (
        f"From the first byte of FIRE to the answer, over {path['awaited']} trials: "
        f"{path['opened']} files opened, {path['written_awaited']} calls of write or fsync to a "
        f"file ({path['written_all']} in the whole session)"
    )
    if path["bytes_all"] is None:
        return f"{calls}."
    others = path["bytes_all"] - path["bytes_awaited"]
    return (
        f"{calls}, {path['bytes_awaited']} bytes to or from storage by any thread "
        f"({others} in the rest of these trials)."
    )


def _session_lines() -> list[str]:
    path, view, waiting = _path_facts(), _view_facts(), _waiting()
    return [
        "## Session",
        "",
        ("`run` over a pty with the emulator in its own process."),
        "",
        "| what | median | 99 % | greatest |",
        "|---|---|---|---|",
        f"| decision to fire, to first byte on the line | {_spread(path['fire_to_byte_s'])} |",
        (
            "| end of the foreperiod, to the same byte: journal with fsync, level, arm | "
            f"{_spread(path['arm_to_byte_s'])} |"
        ),
        f"| `OperatorView.show` | {_spread(view['show_s'])} |",
        f"| a sleep of 1 ms is late by, without a view | {_spread(view['late_bare_s'])} |",
        f"| ... with a view drawn all the time | {_spread(view['late_beside_s'])} |",
        f"| ... with a view while an answer is awaited | {_spread(view['late_answer_s'])} |",
        "",
        _storage_words(path),
        "",
        (
            f"A session that awaits an answer at the terminal takes {waiting} of one processor, "
            f"the operator's view {view['idle']:.1%} more."
        ),
        "",
    ]


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    plan = draw_plan(paper_study(), participant="01", session="01", seed=1)
    trials = len(plan.trials)
    engine_s = median(_engine_s(plan) for _ in range(REPEATS))
    gains = study_gains(paper_study())
    session_s = median(_session_s(trials, gains) for _ in range(REPEATS))
    return "\n".join(
        [
            "## Trial",
            "",
            (
                f"Of {REPEATS} sessions of the paper's {trials} trials without fsync, the median "
                f"per trial: {engine_s * 1e6:.0f} us for the trial engine alone, "
                f"{session_s * 1e6:.0f} us for the whole simulated session (plan, engine, mock "
                "device, observer, journal, trials.csv)."
            ),
            "",
            *_session_lines(),
        ]
    )
