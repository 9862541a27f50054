"""Sessions whose bursts are measured: by a sound card that hears itself, or by the device."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from device import MockDevice, VirtualClock
from device.core.reports import Health
from device.emulate.amplifier import Adc
from experiment import SessionFolder, draw_plan
from experiment.check.device import check_device
from experiment.commands.check import end_check
from experiment.exits import CommandError
from experiment.hardware.monitor import make_monitor
from experiment.hardware.noise import SilentNoise
from experiment.hardware.safety import confirmed_now
from experiment.hardware.setup import Hardware, host_limits
from experiment.operator.requests import Requests, StopSignal
from experiment.record.files import UNWAITED
from experiment.session.config import SessionConfig
from experiment.session.run import run
from experiment.session.simulate import simulated_responder
from tests.plates import study_from_text
from tests.test_device.in_process import LoopCard, audio_on
from tests.test_experiment.lab import Watching

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device import BurstDevice, Clock
    from experiment import AwaitedAnswer, Press
    from experiment.check.device import DeviceCheck
    from experiment.session.config import SessionResult

STUDY = """
[burst]
window = "hann"
[device]
driver = "audio"
port = "card"
volts_full_scale = 125
min_interval_s = 0.01
[design]
levels_vpp = [100, 200]
trials_per_side = {trials}
both_trials = 2
blank_trials = 2
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.3, 0.4]
break_every = 0
[masking]
noise = "none"
[simulation]
threshold_vpp = 50
[monitor]
source = "duplex"
tap = "{tap}"
per_unit = [125, 125]
per_volt = [1, 1]
measured_by = "us"
measured_on = 2026-05-04
delay_ms = [5, 5]
disagreement = "{disagreement}"
"""


class Wired:
    """A session on a sound card that hears itself, with a simulated participant."""

    def __init__(
        self,
        root: Path,
        *,
        trials: int = 4,
        tap: str = "line",
        disagreement: str = "repeat",
        more: str = "",
    ) -> None:
        text = STUDY.format(trials=trials, tap=tap, disagreement=disagreement) + more
        self.study = study_from_text(text, "study.toml")
        self.card = LoopCard()
        self.card.line.noise = 1e-3
        self.device = audio_on(self.card, host_limits(self.study.device))
        self.monitor = make_monitor(self.study.monitor, self.device, self.card, self.card.recorder)
        self.folder = SessionFolder(root, "01", "01", disk=UNWAITED)
        self.plan = draw_plan(self.study, participant="01", session="01", seed=3)
        self.requests = Requests()
        self.display = Watching()
        self.messages: list[str] = []
        self.pauses = 0
        self.at_pause: Callable[[], object] = lambda: None
        self.at_ask: Callable[[int], object] = lambda trial: None

    def config(self) -> SessionConfig:
        someone = simulated_responder(self.study, self.plan, self.card)
        pause, ask = someone.pause, someone.ask

        def paused(*args: object, **named: object) -> bool:
            self.pauses += 1
            self.at_pause()
            return pause(*args, **named)  # type: ignore[arg-type]

        def asked(question: object) -> object:
            self.at_ask(question.trial)  # type: ignore[attr-defined]
            return ask(question)  # type: ignore[arg-type]

        someone.pause, someone.ask = paused, asked  # type: ignore[method-assign,assignment]
        return SessionConfig(
            device=self.device,
            responder=someone,
            noise=SilentNoise(),
            clock=self.card,
            stop=StopSignal(),
            requests=self.requests,
            show=self.display.show,
            report=self.messages.append,
            monitor=self.monitor,
            confirmation=None,
        )

    def begin(self) -> SessionResult:
        return run(self.folder, self.plan, self.config())

    def resume(self) -> SessionResult:
        return run(self.folder, self.folder.read_plan(), replace(self.config(), resume=True))

    @property
    def header(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads(self.folder.header_path.read_text("utf-8"))
        return facts

    def table(self, name: str = "trials.csv") -> list[dict[str, str]]:
        with (self.folder.path / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def check(self) -> tuple[DeviceCheck, str]:
        """Check device and monitor as `check --device`; returns what is wrong, if anything is."""
        rig = Hardware(
            device=self.driven, clock=self.time, settings=self.study.device, monitor=self.monitor
        )
        found = check_device(self.study, rig, confirmation=confirmed_now("asked"), ask=None)
        try:
            end_check(found)
        except CommandError as ended:
            return found, f"{ended.exit_code}: {ended}"
        return found, ""

    @property
    def driven(self) -> BurstDevice:
        return self.device

    @property
    def time(self) -> Clock:
        return self.card

    def cut(self) -> None:
        self.card.line.path = lambda past: 0 * past

    def repair(self) -> None:
        self.card.line.path = lambda past: past


BY_ITSELF = """
[burst]
window = "hann"
[design]
levels_vpp = [100, 200]
trials_per_side = 4
both_trials = 2
foreperiod_s = [0.3, 0.4]
[masking]
noise = "none"
[simulation]
threshold_vpp = 50
[monitor]
source = "device"
tap = "{tap}"
per_volt = [{gain}, {gain}]
"""


class ByItself(Wired):
    """The same on a mock whose own converter measures."""

    def __init__(
        self,
        root: Path,
        *,
        tap: str = "amplifier",
        per_volt: float = 1.0,
        keys: str = "",
        **adc: Any,
    ) -> None:
        super().__init__(root)
        self.markers: Any = None
        self.study = study_from_text(BY_ITSELF.format(tap=tap, gain=per_volt) + keys, "study.toml")
        self.clock = VirtualClock()
        limits = host_limits(self.study.device)
        self.mock = MockDevice(self.clock, limits=limits, adc=Adc(tap=tap, **adc))
        self.monitor = make_monitor(self.study.monitor, self.mock, self.clock, None)
        self.plan = draw_plan(self.study, participant="01", session="01", seed=3)

    @property
    def driven(self) -> BurstDevice:
        return self.mock

    @property
    def time(self) -> Clock:
        return self.clock

    def config(self) -> SessionConfig:
        someone = simulated_responder(self.study, self.plan, self.clock)
        ask = someone.ask

        def asked(question: AwaitedAnswer) -> Press | None:
            self.at_ask(question.trial)
            return ask(question)

        someone.ask = asked  # type: ignore[method-assign]
        made = super().config()
        made = replace(made, device=self.mock, responder=someone, clock=self.clock)
        return made if self.markers is None else replace(made, markers=self.markers)

    def health(self, *, switch_closed: bool) -> Health:
        return Health(amplifier_enabled=True, switch_closed=switch_closed, over_current=False)
