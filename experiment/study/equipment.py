"""[device], [monitor], [masking], [contact]: what drives, is measured, hides, lies on the plate."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field, model_validator
from pydantic_core import ArgsKwargs

from experiment.names import NAME, NAME_RULE, inward, is_line
from experiment.study.base import section
from experiment.study.plate import Day, Line, dated
from stimuli.checks import finite
from stimuli.drive.noise import LEAST_LEVEL_DBFS

if TYPE_CHECKING:
    from stimuli import Burst, SampledDrive

Noise = Literal["pink", "none"]
ContactControl = Literal["not stated", "none", "instructed", "held", "measured"]
_Output = Annotated[int, Field(ge=1, le=256)]

MAX_MASKING_LEVEL_DBA = 80.0
"""Loudest masking noise, dB(A) re 20 uPa, that a person may hear for the length of a session."""
MAX_LEVEL_DBFS = -18.0
"""Louder noise would be clipped: its peaks lie up to 16 dB above its effective value."""


GENERATOR_MOST_VPP = 20.0
"""What the generators that are known reach into an open circuit; a test holds it to theirs."""


@section
class DeviceSettings:
    """What drives the actuators, and what it may do."""

    driver: str = Field(
        default="mock",
        description="mock | serial | generator | audio, or an installed one of your own",
    )
    sample_rate_hz: float = Field(
        default=48_000.0, ge=1_000, le=10_000_000, description="of its output"
    )
    ceiling_vpp: float = Field(
        default=200.0, ge=0.1, le=1_000, description="no level is ever above this"
    )
    least_interval_s: float = Field(
        default=0.05, ge=0.001, le=60, description="rest from a burst's end to the next onset"
    )
    port: str | None = Field(
        default=None, description="where a device is: port, URL, visa:resource or sound card"
    )
    amplifier_gain: float | None = Field(
        default=None,
        ge=0.01,
        le=10_000,
        description="volts at the actuator per volt of a generator",
    )
    volts_full_scale: float | None = Field(
        default=None,
        ge=0.01,
        le=1_000,
        description="peak volts at the actuator, behind the amplifier, half of peak-to-peak, of "
        "a sound card",
    )
    channels: tuple[_Output, _Output] = Field(
        default=(1, 2), strict=False, description="outputs of left and right, of a driver of yours"
    )
    baud: int = Field(default=115_200, ge=1200, le=10_000_000, description="of a serial line")
    dtr: bool = Field(
        default=True, description="false: the line DTR stays low, which starts some boards anew"
    )
    opens_within_s: float = Field(
        default=2.0, ge=0.01, le=60, description="until a device's first answer, once it is opened"
    )
    patience_s: float = Field(
        default=2.0, ge=0.01, le=60, description="until any other question is given up"
    )

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.driver):
            raise ValueError(f"driver must be {NAME_RULE}; got {self.driver!r}")
        if self.channels[0] == self.channels[1]:
            raise ValueError(f"channels must be two outputs; got {list(self.channels)}")
        if self.port is not None and not is_line(self.port):
            raise ValueError(f"port must be a name in one line of text; got {self.port!r}")

    @property
    def highest(self) -> tuple[float, str]:
        """What no level may exceed, Vpp, and the key that says so."""
        ceiling = self.ceiling_vpp, "device.ceiling_vpp"
        if self.driver == "audio" and self.volts_full_scale is not None:
            reached = 2 * self.volts_full_scale, "2 x device.volts_full_scale"
            return min(ceiling, reached, key=itemgetter(0))
        if self.driver == "generator" and self.amplifier_gain is not None:
            most_vpp = GENERATOR_MOST_VPP
            reached = most_vpp * self.amplifier_gain, f"{most_vpp:g} x device.amplifier_gain"
            return min(ceiling, reached, key=itemgetter(0))
        return ceiling


MonitorSource = Literal["none", "duplex", "input", "device"]
TapWord = Literal["line", "amplifier", "current", "motion"]

_Input = Annotated[int, Field(ge=1, le=256)]
_Scale = Annotated[float, Field(ge=-1e9, le=1e9)]
_PerVolt = Annotated[float, Field(ge=1e-9, le=1e6)]
_Delay = Annotated[float, Field(ge=-1000, le=1000)]
_VOLTAGES: Final = ("line", "amplifier")
_DRIVER_OF: Final[dict[str, str]] = {"device": "serial", "duplex": "audio"}
LEAST_PER_UNIT: Final = 1e-12

# As device.monitor has them, which takes a tenth of a second to import; a test holds them equal.
LEAST_QUIET: Final = 8
LEAST_QUIET_S: Final = 0.02
MOST_QUIET_S: Final = 1.0
MOST_OF_RATE: Final = 0.4
"""Above this part of its sample rate an input's own filter may shape a burst."""


@section
class MonitorSettings:
    """What measures each burst beside the device, and compares it with the planned one.

    Without a source nothing is verified. duplex: inputs of the sound card that drives; input: of
    another one, beside any driver; device: a serial device's own converter. It needs two inputs:
    docs/howto/second-input.md tells how to wire and calibrate them, docs/monitor.md what each tap
    never sees.
    """

    source: MonitorSource = Field(default="none", description="by what it is measured")
    tap: TapWord | None = Field(default=None, description="where it is measured")
    sound_card: str = Field(default="", description="of source = input; empty: the default one")
    inputs: tuple[_Input, _Input] = Field(
        default=(1, 2), strict=False, description="of left and right, counted from 1"
    )
    sample_rate_hz: float | None = Field(
        default=None, ge=8_000, le=768_000, description="of source = input; left out: 48000"
    )
    per_unit: tuple[_Scale, _Scale] | None = Field(
        default=None,
        strict=False,
        description="V, A or um at the tap for an input's full scale, such as [141, 141], below 0 "
        "where inverted; a device tells its own",
    )
    per_volt: tuple[_PerVolt, _PerVolt] | None = Field(
        default=None,
        strict=False,
        description="V, A or um at the tap per volt at the actuator; left out of a voltage: 1",
    )
    measured_by: Line | None = Field(default=None, description="both, by whom")
    measured_on: Day | None = Field(default=None, description="... and when, such as 2026-05-04")
    delay_ms: tuple[_Delay, _Delay] | None = Field(
        default=None,
        strict=False,
        description="from the onset as told to that measured; left out: as the first burst has it",
    )
    peak_tolerance: float = Field(
        default=0.1, ge=0.01, le=0.5, description="part of the planned peak"
    )
    onset_tolerance_ms: float = Field(
        default=1.0,
        ge=0.01,
        le=100,
        description="between planned and measured onset; of source = input begin with 20",
    )
    least_correlation: float = Field(
        default=0.95, ge=0.5, le=0.9999, description="with the planned burst"
    )
    silence: float = Field(
        default=0.2, ge=0.01, le=0.5, description="part of a burst's peak that counts as none"
    )
    disagreement: Literal["repeat", "flag"] = Field(
        default="repeat", description="repeat: pause, call the operator, present it again"
    )

    @model_validator(mode="before")
    @classmethod
    def _date(cls, given: Any) -> Any:
        if not isinstance(given, ArgsKwargs):
            return given
        keys = dated(given.kwargs)
        if keys and "source" not in keys:
            raise ValueError(
                "source is missing; must be duplex, input or device, or none to verify no burst"
            )
        return ArgsKwargs((), keys)

    def __post_init__(self) -> None:
        if self.inputs[0] == self.inputs[1]:
            raise ValueError(f"inputs must be two; got {list(self.inputs)}")
        if self.sound_card and not is_line(self.sound_card):
            raise ValueError(
                f"sound_card must be a name in one line of text; got {self.sound_card!r}"
            )
        if self.per_unit is not None and min(map(abs, self.per_unit)) < LEAST_PER_UNIT:
            raise ValueError(
                f"per_unit must be at least {LEAST_PER_UNIT:g} away from 0; "
                f"got {list(self.per_unit)}"
            )
        if self.source != "none":
            self._require_fitting()

    def _require_fitting(self) -> None:
        """Refuse what does not go with the source."""
        if self.sound_card and self.source != "input":
            raise ValueError(
                f"sound_card must be left out with source = {self.source}, which has its own; "
                f"got {self.sound_card!r}"
            )
        if self.sample_rate_hz is not None and self.source != "input":
            raise ValueError(
                f"sample_rate_hz must be left out with source = {self.source}, where "
                f"device.sample_rate_hz is its rate; got {self.sample_rate_hz:g}"
            )
        if self.source == "device" and self.per_unit is not None and min(self.per_unit) < 0:
            raise ValueError(
                "per_unit must be above 0 with source = device, which tells magnitudes; "
                f"got {list(self.per_unit)}"
            )
        of_inputs = () if self.source == "device" else ("per_unit", "measured_by", "measured_on")
        missing = [key for key in ("tap", *of_inputs) if getattr(self, key) is None]
        needs = f"source = {self.source}"
        if self.per_volt is None and self.tap not in {None, *_VOLTAGES}:
            missing.append("per_volt")
            needs = f"{needs} and tap = {self.tap}" if len(missing) > 1 else f"tap = {self.tap}"
        if len(missing) == 1:
            raise ValueError(f"{missing[0]} is missing; {needs} needs it")
        if missing:
            *most, last = missing
            need = "need" if " and " in needs else "needs"
            raise ValueError(f"{', '.join(most)} and {last} are missing; {needs} {need} them")

    def check_beside(self, driver: str, least_s: float) -> None:
        """Refuse a driver that has no such source, and a tolerance too wide to tell bursts apart.

        `least_s`: the least time from an answer to the next onset.
        """
        self.check_driver(driver)
        if self.source != "none" and self.onset_tolerance_ms >= 500 * least_s:
            raise ValueError(
                "monitor.onset_tolerance_ms must be less than half of design.foreperiod_s[0], "
                f"{500 * least_s:g}, or the burst before could be taken for the next; "
                f"got {self.onset_tolerance_ms:g}"
            )

    def check_driver(self, driver: str) -> None:
        """Refuse a driver beside which the source is not; the mock stands in for any."""
        needed = _DRIVER_OF.get(self.source)
        if needed is not None and driver not in {needed, "mock"}:
            raise ValueError(
                "monitor.source must be input, with the inputs of a sound card beside the driver "
                f"{driver}; got {self.source}, which needs the driver {needed}"
            )

    def check_drive(
        self, condition: str, drive: Burst | SampledDrive, rate_hz: float, least_s: float
    ) -> None:
        """Refuse a burst that no input could ever verify.

        `rate_hz` is the device's; `least_s` as in `check_beside`.
        """
        if self.source not in {"duplex", "input"}:
            return
        quiet_s = max(LEAST_QUIET_S, LEAST_QUIET * drive.duration_s)
        if quiet_s > MOST_QUIET_S:
            raise ValueError(
                f"condition {condition}: the burst must last at most "
                f"{MOST_QUIET_S / LEAST_QUIET:g} s to be measured by monitor.source = "
                f"{self.source}; got {drive.duration_s:.10g} s"
            )
        if least_s < quiet_s:
            raise ValueError(
                f"design.foreperiod_s[0] must be at least {inward(quiet_s, least=True)}: "
                f"monitor.source = {self.source} tells the noise from {LEAST_QUIET_S:g} s and "
                f"{LEAST_QUIET} lengths of the burst of condition {condition}; got {least_s:g}"
            )
        most_hz = MOST_OF_RATE * (self.record_rate_hz if self.source == "input" else rate_hz)
        if drive.band_hz()[1] > most_hz:
            key = "monitor" if self.source == "input" else "device"
            raise ValueError(
                f"{key}.sample_rate_hz must be at least "
                f"{inward(drive.band_hz()[1] / MOST_OF_RATE, least=True)} to measure the "
                f"burst of condition {condition}, whose band ends at {drive.band_hz()[1]:.6g} Hz; "
                f"got {most_hz / MOST_OF_RATE:g}"
            )

    @property
    def record_rate_hz(self) -> float:
        """Sample rate of a sound card beside the driver."""
        return 48_000.0 if self.sample_rate_hz is None else self.sample_rate_hz

    @property
    def at_the_tap(self) -> tuple[float, float]:
        """Volts, amperes or micrometres per volt at the actuator, left and right."""
        return (1.0, 1.0) if self.per_volt is None else self.per_volt


@section
class Masking:
    """The noise in the headphones that hides the sound of the actuators.

    To play it to a person, `run` needs sounddevice: pip install -e ".[audio]" -c constraints.txt.
    """

    noise: Noise = Field(default="pink", description="what is played")
    max_level_dba: float = Field(
        default=75.0,
        ge=20,
        le=MAX_MASKING_LEVEL_DBA,
        description=f"at the ear; {MAX_MASKING_LEVEL_DBA:g} at most",
    )
    measured_level_dba: float | None = Field(
        default=None, ge=20, description="at the ear, with these settings"
    )
    level_dbfs: float = Field(
        default=-30.0,
        ge=LEAST_LEVEL_DBFS,
        le=MAX_LEVEL_DBFS,
        description="effective value re a full-scale sine's peak",
    )
    sound_card: str = Field(default="", description="empty: the system's default")
    loop_s: float = Field(default=30.0, ge=1, le=600, description="it is repeated without a seam")
    sample_rate_hz: float = Field(
        default=48_000.0, ge=16_000, le=192_000, description="of the sound card"
    )

    def __post_init__(self) -> None:
        if self.measured_level_dba is not None:
            finite("measured_level_dba", self.measured_level_dba, least=20, most=self.max_level_dba)
        if self.sound_card and not is_line(self.sound_card):
            raise ValueError(
                f"sound_card must be a name in one line of text; got {self.sound_card!r}"
            )


_CONTACT_WORDS: Final = {
    "not stated": "not stated",
    "none": "not controlled",
    "instructed": "by instruction",
    "held": "held",
    "measured": "measured",
}


@section
class Contact:
    """How the fingers lay on the plate: a threshold depends on their force and area of contact.

    The program controls neither; what is stated here stands in header, report and data set.
    """

    control: ContactControl = Field(
        default="not stated", description="held: by weights or rests; measured: by a sensor"
    )
    force_n: float | None = Field(default=None, ge=0.01, le=20, description="of one finger, normal")
    how: str | None = Field(
        default=None, description="in a line: what was told, what held, what measured"
    )

    def __post_init__(self) -> None:
        if self.how is not None and not is_line(self.how):
            raise ValueError(f"how must be one line of text; got {self.how!r}")
        given = [key for key in ("force_n", "how") if getattr(self, key) is not None]
        if self.control == "not stated" and given:
            raise ValueError(
                f"control must be none, instructed, held or measured beside {given[0]}; "
                f"got {self.control!r}"
            )
        if self.control == "none" and self.force_n is not None:
            raise ValueError(
                "control must be instructed, held or measured beside force_n; got 'none'"
            )
        if self.control in {"held", "measured"} and self.how is None:
            raise ValueError(f"how is missing; control = {self.control} needs it")

    @property
    def words(self) -> str:
        """What is stated, in a line.

        >>> Contact().words, Contact(control="none").words
        ('not stated', 'not controlled')
        >>> Contact(control="measured", force_n=0.5, how="a load cell below each finger").words
        'measured, 0.5 N: a load cell below each finger'
        """
        force = "" if self.force_n is None else f", {self.force_n:g} N"
        how = "" if self.how is None else f": {self.how}"
        return f"{_CONTACT_WORDS[self.control]}{force}{how}"
