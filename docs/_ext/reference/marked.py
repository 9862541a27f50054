"""Sessions that an analysis marks: of practice without a device, and modified ones."""

from __future__ import annotations

import runpy
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

_OWN_DEVICE = Path(__file__).parents[2] / "examples" / "own_device" / "lab_device.py"


def practise(path: Path, out: Path, participant: str) -> None:
    """Run a session that is not marked as simulated, on a device that moves nothing."""
    from device.clock import VirtualClock
    from device.drivers import DriverSettings
    from device.limits import Limits
    from experiment import read_study, run_session

    study, clock, made = read_study(path), VirtualClock(), runpy.run_path(str(_OWN_DEVICE))
    someone = made["Impatient"](None, clock)
    someone.simulated = False
    limits = Limits(ceiling_vpp=study.device.ceiling_vpp, min_interval_s=0.02)
    device = made["printer"](DriverSettings(limits=limits), clock)
    with redirect_stdout(StringIO()):
        run_session(
            study,
            participant,
            device,
            someone,
            out=out,
            clock=clock,
            practice_without_device=True,
            seed=7,
        )


def alter(table: Path) -> None:
    """Change a time in the first row of a table of trials, so that it contradicts its journal."""
    heading, row, *rows = table.read_text(encoding="utf-8").splitlines(keepends=True)
    place, cells = heading.split(",").index("rt_s"), row.split(",")
    cells[place] = f"{cells[place]}1"
    table.write_text("".join([heading, ",".join(cells), *rows]), encoding="utf-8")
