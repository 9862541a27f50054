"""The operator's view beside a loop that keeps time: ``python -m benchmarks.session_view RESULT``.

A process of its own, because the view needs a terminal.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from experiment.operator.requests import Requests, Status, StopSignal, Tally
from experiment.operator.view import OperatorView

if TYPE_CHECKING:
    from collections.abc import Callable

LOOPS = 1500
SLEEP_S = 1e-3
IDLE_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Seconds of each call and of each sleep beyond its length; share of a processor when idle."""

    show_s: list[float]
    late_bare_s: list[float]
    late_beside_s: list[float]
    late_answer_s: list[float]
    idle: float


def status(done: int, phase: str) -> Status:
    """Return the status of a session that has come so far."""
    tally = Tally(presented=done, correct=done, last=("left", "both", "left", "left", "right"))
    return Status(
        phase=phase,
        done=done,
        planned=LOOPS,
        block=1,
        blocks=5,
        left_s=600.0,
        noise="plays",
        device="ready",
        message="",
        tallies={"left": tally, "right": tally},
    )


def keep_time(show: Callable[[Status], object], phase: str) -> tuple[list[float], list[float]]:
    """Sleep a millisecond again and again; return how late each was, and how long `show` took."""
    late_s, shown_s = [], []
    for done in range(LOOPS):
        now = status(done, phase)
        began_s = time.perf_counter()
        show(now)
        shown_s.append(time.perf_counter() - began_s)
        began_s = time.perf_counter()
        time.sleep(SLEEP_S)
        late_s.append(time.perf_counter() - began_s - SLEEP_S)
    return late_s, shown_s


def measure() -> Found:
    """Return what the view costs the thread that keeps time."""
    late_bare_s, _ = keep_time(lambda _: None, "ready")
    with OperatorView(Requests(), StopSignal()) as view:
        late_beside_s, show_s = keep_time(view.show, "foreperiod")
        late_answer_s, _ = keep_time(view.show, "answer")
        view.show(status(1, "break"))
        began_s = time.process_time()
        time.sleep(IDLE_S)
        idle = (time.process_time() - began_s) / IDLE_S
    return Found(
        show_s=show_s,
        late_bare_s=late_bare_s,
        late_beside_s=late_beside_s,
        late_answer_s=late_answer_s,
        idle=idle,
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(asdict(measure())), encoding="utf-8")
