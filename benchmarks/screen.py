"""How evenly a window flips, and what it costs to wait in front of it."""

from __future__ import annotations

import os
import time

import numpy as np

from device.clock import MonotonicClock
from experiment.participant.screen import ScreenResponder
from experiment.participant.settings import ResponderSettings
from experiment.participant.window import NoScreenError, Stage
from experiment.study.presentation import Keys, Screen, Texts
from experiment.trial.responder import Progress, SessionPart

FLIPS = 300
WAIT_S = 5.0


def _flips(stage: Stage) -> str:
    times_s = np.empty(FLIPS)
    for i in range(FLIPS):
        stage.show(())
        times_s[i] = time.perf_counter()
    steps_ms = 1e3 * np.diff(times_s)
    low, middle, high = np.percentile(steps_ms, (1, 50, 99))
    renderer = stage.window.winHandle.context.get_info().get_renderer()
    return (
        f"by {renderer}. From flip to flip it takes {middle:.2f} ms (median; 1st to 99th "
        f"percentile {low:.2f} to {high:.2f} ms, longest of {FLIPS} {steps_ms.max():.2f} ms)."
    )


def _waiting(responder: ScreenResponder, clock: MonotonicClock) -> str:
    responder.cue(Progress(done=0, planned=1, part=SessionPart.MAIN))
    until_s, before_s = clock.now_s() + WAIT_S, time.process_time()
    responder.wait(until_s)
    share = (time.process_time() - before_s) / WAIT_S
    return (
        f"A waiting window takes {100 * share:.1f} % of a core; a foreperiod ends late by "
        f"{1e3 * (clock.now_s() - until_s):.2f} ms."
    )


def _words() -> str:
    clock, screen = MonotonicClock(), Screen(full_screen=False)
    settings = ResponderSettings(
        responses=("left", "right", "both"), screen=screen, keys=Keys(), texts=Texts()
    )
    with ScreenResponder(settings, clock) as responder:
        waiting = _waiting(responder, clock)
    stage = Stage(screen)
    try:
        return f"{_flips(stage)} {waiting}"
    finally:
        stage.close()


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    head = ["## Window", ""]
    try:
        words = _words()
    except NoScreenError as error:
        return "\n".join([*head, f"Not measured: {error}.", ""])
    display = (
        f"On display {os.environ.get('DISPLAY', 'of the system')} (Xvfb has no refresh: its flips "
        "return when they are drawn),"
    )
    return "\n".join([*head, f"{display} {words}", ""])
