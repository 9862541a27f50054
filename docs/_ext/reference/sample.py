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

PLATE = (
    *("--preset", "plate", "--width-mm", "30", "--thickness-mm", "0.5", "--length-mm", "150"),
    *("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35"),
    *("--ceiling-vpp", "113"),
)
"""A plate of one's own, as the README has it."""
_EXAMPLES = Path(__file__).parents[2] / "examples"
_ELSEWHERE = (_EXAMPLES / "jspsych", _EXAMPLES / "synthetic", Path("one-place"))
"""Tables made elsewhere: in per cent, in volts, and of one place in micrometres."""
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
_OF_THREE = ("--participants", "3", "3", "--people", "literature", "--seed", "7")
_GOALS = ("false-alarms=10%", "detection=45%@100V")
"""One that three people do not reach and one that they do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What the commands wrote and printed.

    `results` is the folder of the plate of one's own, which the example is of; `printed` its
    commands, each with what it prints. `elsewhere` has the analyses of tables made elsewhere;
    `shapes`, by the name of a file or command, the JSON of all studies.
    """

    results: Path
    printed: tuple[tuple[str, str], ...]
    field: Path
    elsewhere: Path
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
        shapes = told.result()
    return Sample(
        results=folder / "results",
        printed=tuple(printed),
        field=folder / "field.png",
        elsewhere=folder / "elsewhere",
        shapes={
            **shapes,
            **{name: _written(folder, name) for name in ("plan.json", "summary.json")},
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
    for table in _ELSEWHERE:
        out = ("--out", f"elsewhere/{table.name}", "--population", "--no-figures")
        _done(folder, "analyze", f"{table}-trials.csv", "--columns", f"{table}-columns.toml", *out)
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


def _written(folder: Path, name: str) -> list[Any]:
    """Read all files of a name, somewhere below a folder."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob(name))]


def _header_of_a_person(path: Path) -> dict[str, Any]:
    """Return what a session of a person keeps whose bursts are measured, on a real device."""
    from device.monitor.measured import Tap
    from experiment.apparatus import NoiseFacts, assemble, confirmed_now
    from experiment.session.setting import Setting, Sitting, header
    from experiment.study.read import read_study
    from experiment.trial import draw_plan

    study = read_study(path)
    rig = assemble(study, driver="mock", port=None, simulated=True)
    tap = Tap.AMPLIFIER
    noise = NoiseFacts(
        noise="pink", played=True, sha256="", sample_rate_hz=48e3, loop_s=30.0, level_dbfs=-30.0,
        max_level_dba=75.0, measured_level_dba=70.0, sound_card="headphones",
    )  # fmt: skip
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
