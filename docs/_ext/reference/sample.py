"""Small studies of several kinds, checked, simulated, planned: what the reference is read from."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from reference.marked import alter, practise

PLATE = (
    *("--preset", "plate", "--width-mm", "30", "--thickness-mm", "0.5", "--length-mm", "150"),
    *("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35"),
    *("--ceiling-vpp", "113"),
)
"""A plate of one's own, as the README has it."""
_EXAMPLES = Path(__file__).parents[2] / "examples"
_ELSEWHERE = {
    "jspsych": (_EXAMPLES / "jspsych-trials.csv", _EXAMPLES / "jspsych-columns.toml"),
    "synthetic": (_EXAMPLES / "synthetic-trials.csv", _EXAMPLES / "synthetic-columns.toml"),
    "one-place": ("one-place-trials.csv", "one-place-columns.toml"),
    "no-blanks": ("one-place-trials.csv", "no-blanks-columns.toml"),
    "counts": ("counts-trials.csv", "counts-columns.toml"),
}
"""Tables made elsewhere, with their maps: in per cent, in volts, of one place in micrometres with
and without blanks, and of counts."""
STUDIES = Path(__file__).parent / "studies"
"""Studies that have what those of `tactstrip init` have not."""
_CONDITIONS = """
[[condition]]
name = "one-cycle"
cycles = 1
[[condition]]
name = "two-cycles"
cycles = 2
"""
_BURSTS = ("--frequency-hz", "250,500", "--cycles", "1,2")
_FIELDS = {"map": (), "band": ("--band", "100", "1000")}
_OF_THREE = ("--participants", "3", "3", "--people", "literature", "--seed", "7")
_GOALS = ("false-alarms=10%", "detection=45%@100V")
"""One that three people do not reach and one that they do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What the commands wrote and printed.

    `results` is the folder of the plate of one's own, which the example is of; `printed` its
    commands, each with what it prints. `elsewhere` has the analyses of tables made elsewhere,
    `marked` one of sessions of several sorts; `fields` are CSVs in micrometres, and per unit load,
    by what they are of; `shapes`, by the name of a file or command, the JSON of all studies.
    """

    results: Path
    printed: tuple[tuple[str, str], ...]
    field: Path
    elsewhere: Path
    marked: Path
    fields: dict[str, tuple[Path, Path]]
    shapes: dict[str, list[Any]]

    @property
    def analysis(self) -> Path:
        """The folder of the analysis."""
        return self.results / "analysis"


def tactstrip(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, as somebody would."""
    return subprocess.run(
        [sys.executable, "-m", "tactstrip", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def make_sample(folder: Path) -> Sample:
    """Make a study of a plate of one's own, draw its field, simulate five people, analyse them.

    Other studies are run beside it, for what that one does not have.
    """
    shutil.copytree(STUDIES, folder, dirs_exist_ok=True)
    printed = [_done(folder, "init", "plate.toml", *PLATE)]
    path = folder / "plate.toml"
    text = path.read_text(encoding="utf-8")
    for key in ("audibility_trials", "control_trials"):
        text = text.replace(f"\n{key} = 0", f"\n{key} = 10")
    head, init, rest = text.partition("[init]")
    path.write_text(f"{head}{init}{rest}{_CONDITIONS}", encoding="utf-8")
    _done(folder, "init", "paper.toml")
    with ThreadPoolExecutor() as beside:
        told = beside.submit(_told, folder)
        printed.append(_done(folder, "check", "plate.toml"))
        printed.append(_done(folder, "field", "plate.toml", "--out", "field.png"))
        printed.append(_simulated(folder, "plate", people=5, out="results"))
        alone = ("--allow-simulated", "--no-figures", "--out", "alone")
        _done(folder, "analyze", "results/sub-01", *alone)
        shapes = told.result()
    return Sample(
        results=folder / "results",
        printed=tuple(printed),
        field=folder / "field.png",
        elsewhere=folder / "elsewhere",
        marked=folder / "marked-analysis",
        fields={
            what: (folder / f"paper-{what}.csv", folder / f"plate-{what}.csv") for what in _FIELDS
        },
        shapes={
            **shapes,
            "tactstrip check --json": [
                *shapes["tactstrip check --json"],
                *_measured_by_a_monitor(folder / "special.toml"),
            ],
            "summary.json": _written(folder, "summary.json"),
            "plan.json": [*_written(folder, "plan.json"), _plan_of_placed(folder / "special.toml")],
            "header.json": [
                *_written(folder, "header.json"),
                _header_of_a_person(folder / "special.toml"),
            ],
            "journal.jsonl": [
                json.loads(line)
                for path in sorted(folder.rglob("journal.jsonl"))
                for line in path.read_text(encoding="utf-8").splitlines()
            ],
        },
    )


def _told(folder: Path) -> dict[str, list[Any]]:
    """Let the commands print JSON, and simulate what the example does not have."""
    _simulated(folder, "layered", people=3, out="layered")
    _simulated(folder, "paper", people=2, out="paper")
    _done(folder, "analyze", "layered", "--allow-simulated", "--population", "--out", "population")
    for name, (table, columns) in _ELSEWHERE.items():
        out = ("--out", f"elsewhere/{name}", "--population", "--no-figures")
        _done(folder, "analyze", str(table), "--columns", str(columns), *out)
    for what, options in _FIELDS.items():
        for name in ("paper", "plate"):
            _done(folder, "field", f"{name}.toml", *options, "--out", f"{name}-{what}.csv")
    _marked(folder)
    commands: dict[str, list[tuple[str, ...]]] = {
        "check": [
            *((f"{name}.toml",) for name in ("plate", "paper", "special")),
            ("layered.toml", "--device", "--driver", "mock"),
        ],
        "bursts": [(f"{name}.toml", *_BURSTS) for name in ("plate", "paper", "layered")],
        "power": [("layered.toml", "--goal", goal, *_OF_THREE) for goal in _GOALS],
        "audit": [(str(_EXAMPLES / "paper-table1.csv"),)],
    }
    return {
        f"tactstrip {name} --json": [
            json.loads(tactstrip(folder, name, *one, "--json").stdout) for one in each
        ]
        for name, each in commands.items()
    }


def _simulated(folder: Path, name: str, *, people: int, out: str) -> tuple[str, str]:
    drawn = ("--participants", str(people), "--seed", "7", "--out", out)
    return _done(folder, "dry-run", f"{name}.toml", *drawn)


def _marked(folder: Path) -> None:
    """Analyse sessions of simulated people, one of them altered, and of somebody who practised."""
    _simulated(folder, "marked", people=2, out="marked")
    practise(folder / "marked.toml", folder / "marked", "03")
    alter(folder / "marked" / "sub-02" / "ses-01" / "trials.csv")
    accepted = ("--allow-simulated", "--accept-altered", "--no-figures")
    _done(folder, "analyze", "marked", *accepted, "--out", "marked-analysis")


def _written(folder: Path, name: str) -> list[Any]:
    """Read all files of a name, somewhere below a folder."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob(name))]


def _plan_of_placed(path: Path) -> dict[str, Any]:
    """Return a plan whose levels were placed for a person, of each condition its own."""
    from experiment import draw_plan, read_study

    study = read_study(path)
    levels_vpp = {one.name: (60.0, 95.0) for one in study.conditions}
    plan = draw_plan(study, participant="01", session="01", seed=7, levels_vpp=levels_vpp)
    told: dict[str, Any] = json.loads(plan.to_json())
    return told


def _measured_by_a_monitor(path: Path) -> list[dict[str, Any]]:
    """Return what a check tells of bursts as planned, too weak, and not measured."""
    import numpy as np

    from device.monitor.measured import Fault, Measured, Planned, Tap
    from experiment.check.monitor import MonitorCalibration
    from experiment.study.files import read_study

    shape = np.sin(np.linspace(0, 2 * np.pi, 97))
    planned = Planned(shape=shape, sample_rate_hz=48e3, left=50.0, right=0.0, burst=(50.0, 50.0))
    seen = Measured(
        token=1,
        tap=Tap.AMPLIFIER,
        source="interface",
        peak_left=49.0,
        late_s=1e-4,
        correlation_left=0.99,
        noise_left=0.1,
    )
    none = Measured(token=1, tap=Tap.AMPLIFIER, source="interface", unmeasured="no input")
    channels = [
        MonitorCalibration(
            side="left", planned=planned, measured=one, settings=read_study(path).monitor
        ).findings.facts
        for one in (seen, replace(seen, faults=(Fault.WEAK,)), none)
    ]
    return [{"device_check": {"channels": [{"monitor": one} for one in channels]}}]


def _header_of_a_person(path: Path) -> dict[str, Any]:
    """Return what a session of a person keeps whose bursts are measured, on a real device."""
    from device.monitor.measured import Tap
    from experiment.apparatus.noise import NoiseFacts
    from experiment.apparatus.rig import assemble, confirmed_now
    from experiment.session.setting import Setting, Sitting, header
    from experiment.study.files import read_study
    from experiment.trial.draw import draw_plan

    study = read_study(path)
    rig = assemble(study, driver="mock", port=None, simulated=True)
    tap = Tap.AMPLIFIER
    noise = NoiseFacts(
        noise="pink",
        played=True,
        sha256="",
        sample_rate_hz=48e3,
        loop_s=30.0,
        level_dbfs=-30.0,
        max_level_dba=75.0,
        measured_level_dba=70.0,
        sound_card="headphones",
    )
    stand_in: Any = SimpleNamespace  # of what is only asked for what a header keeps of it
    setting = Setting(
        device=rig.device,
        responder=stand_in(simulated=False),
        noise=stand_in(facts=noise),
        clock=rig.clock,
        stop=stand_in(),
        confirmation=confirmed_now("asked"),
        sitting=Sitting(
            responder="screen", operator="EF", responder_from="lab 1.0", driver_from="lab 1.0"
        ),
        markers=stand_in(words="LSL"),
        monitor=stand_in(source="", tap=tap, unseen=tap.unseen),
    )
    identity = replace(rig.device.open(), emulated=False)
    plan = draw_plan(study, participant="01", session="01", seed=7)
    kept = header(study, plan, setting, identity)
    told: dict[str, Any] = json.loads(json.dumps(kept))  # with lists for tuples
    return told


def _done(folder: Path, *arguments: str) -> tuple[str, str]:
    """Run a command that has to succeed; return it with what it prints."""
    words = textwrap.wrap(" ".join(("tactstrip", *arguments)), 74, break_on_hyphens=False)
    command, done = " \\\n    ".join(words), tactstrip(folder, *arguments)
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stderr}")
    return command, done.stdout
