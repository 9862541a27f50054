"""[device], [monitor], [masking] and [contact]: the equipment, and the fingers on the plate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from experiment.names import is_line
from experiment.study.base import Day, Line, Name, Section, is_distinct, obeying
from stimuli.drive.noise import LEAST_LEVEL_DBFS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.base import Rule
    from stimuli import Burst, SampledDrive

_Connector = Annotated[int, Field(ge=1, le=256)]
_Outputs = Annotated[tuple[_Connector, ...], obeying(is_distinct, "must be different outputs")]
_Inputs = Annotated[tuple[_Connector, ...], obeying(is_distinct, "must be different inputs")]
_CARD_RULE: Final = "must be one line of text, or empty for the system's sound card"
_Card = Annotated[str, obeying(lambda text: not text or is_line(text), _CARD_RULE)]

MAX_MASKING_LEVEL_DBA: Final = 80.0
"""Loudest masking noise, dB(A) re 20 uPa, that a person may hear for the length of a session."""
MAX_LEVEL_DBFS: Final = -18.0
"""Louder noise would be clipped: its peaks lie up to 16 dB above its effective value."""
GENERATOR_MAX_VPP: Final = 20.0
"""Highest level of the supported generators into an open circuit; a test compares it to theirs."""


class DeviceSettings(Section):
    """What drives the actuators, and its limits."""

    driver: Name = "mock"
    """mock, serial, generator, audio, or an installed driver"""
    sample_rate_hz: Annotated[float, Field(ge=1_000, le=10_000_000)] = 48_000.0
    """sample rate of the output"""
    ceiling_vpp: Annotated[float, Field(ge=0.1, le=1_000)] = 200.0
    """highest level that the device may ever play"""
    min_interval_s: Annotated[float, Field(ge=0.001, le=60)] = 0.05
    """shortest rest from the end of a burst to the next onset"""
    port: Line | None = None
    """port, URL, visa:resource or sound card of the device"""
    amplifier_gain: Annotated[float, Field(ge=0.01, le=10_000)] | None = None
    """volts at the actuator per volt of a generator"""
    volts_full_scale: Annotated[float, Field(ge=0.01, le=1_000)] | None = None
    """peak voltage at the actuator, behind the amplifier, at a sound card's full scale"""
    channels: _Outputs = ()
    """output of each site, counted from 1; by default the first ones"""
    baud: Annotated[int, Field(ge=1200, le=10_000_000)] = 115_200
    """rate of a serial line"""
    dtr: bool = True
    """whether the line DTR is raised; false keeps boards that it resets running"""
    open_timeout_s: Annotated[float, Field(ge=0.01, le=60)] = 2.0
    """longest time to the first answer of a device that was opened"""
    response_timeout_s: Annotated[float, Field(ge=0.01, le=60)] = 2.0
    """longest time to any other answer"""

    @property
    def highest(self) -> tuple[float, str]:
        """The level that none may exceed, Vpp, and the key that limits it."""
        limits = {"device.ceiling_vpp": self.ceiling_vpp}
        if self.driver == "audio" and self.volts_full_scale is not None:
            limits["2 x device.volts_full_scale"] = 2 * self.volts_full_scale
        if self.driver == "generator" and self.amplifier_gain is not None:
            key = f"{GENERATOR_MAX_VPP:g} x device.amplifier_gain"
            limits[key] = GENERATOR_MAX_VPP * self.amplifier_gain
        key = min(limits, key=limits.__getitem__)
        return limits[key], key


MonitorSource = Literal["none", "duplex", "input", "device"]
TapName = Literal["line", "amplifier", "current", "motion"]

MIN_PER_UNIT: Final = 1e-12
_SCALE_RULE: Final = f"must be at least {MIN_PER_UNIT:g} in size"
_is_scale = obeying(lambda value: abs(value) >= MIN_PER_UNIT, _SCALE_RULE)
_Scale = Annotated[float, Field(ge=-1e9, le=1e9), _is_scale]
_PerVolt = Annotated[float, Field(ge=1e-9, le=1e6)]
_Delay = Annotated[float, Field(ge=-1000, le=1000)]
_DRIVER_OF: Final[dict[str, str]] = {"device": "serial", "duplex": "audio"}
_MAX_OF_RATE: Final = 0.4
"""Above this fraction of its sample rate an input's own filter may shape a burst."""


class MonitorSettings(Section):
    """What measures each burst and compares it with the planned burst."""

    source: MonitorSource = "none"
    """inputs of the sound card that drives (duplex), of another (input), of a serial device"""
    tap: TapName | None = None
    """where the burst is measured"""
    sound_card: _Card = ""
    """sound card of source = "input"; by default the system's"""
    inputs: _Inputs = ()
    """input of each site, counted from 1; by default the first ones"""
    sample_rate_hz: Annotated[float, Field(ge=8_000, le=768_000)] | None = None
    """sample rate of source = "input"; by default 48000"""
    per_unit: tuple[_Scale, ...] | None = None
    """of each site, V, A or um at the tap for an input's full scale, negative if inverted"""
    per_volt: tuple[_PerVolt, ...] | None = None
    """of each site, V, A or um at the tap per volt at the actuator; for a voltage by default 1"""
    measured_by: Line | None = None
    """who measured these two"""
    measured_on: Day | None = None
    """day of the measurement"""
    delay_ms: tuple[_Delay, ...] | None = None
    """of each site, from the reported to the measured onset; by default that of the first burst"""
    peak_tolerance: Annotated[float, Field(ge=0.01, le=0.5)] = 0.1
    """largest deviation of the peak, as a fraction"""
    onset_tolerance_ms: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    """largest deviation of the onset; with source = "input" begin with 20"""
    min_correlation: Annotated[float, Field(ge=0.5, le=0.9999)] = 0.95
    """smallest correlation with the planned burst"""
    silence: Annotated[float, Field(ge=0.01, le=0.5)] = 0.2
    """fraction of a burst's peak that counts as silence"""
    disagreement: Literal["repeat", "flag"] = "repeat"
    """after a wrong burst: repeat pauses and presents the trial again, flag only records it"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of keys that a source does not have, and of those that it needs."""
        given = self.model_fields_set
        lack = bool(given) and "source" not in given
        yield lack, "source", f"is required with {min(given, default='')}", None
        if self.source == "none":
            return
        for key in ("sound_card", "sample_rate_hz"):
            excess = self.source != "input" and bool(getattr(self, key))
            yield excess, key, 'is for source = "input" only'
        is_device = self.source == "device"
        needed = ["tap"] if is_device else ["tap", "per_unit", "measured_by", "measured_on"]
        needed += ["per_volt"] if self.tap in {"current", "motion"} else []
        for key in needed:
            yield getattr(self, key) is None, key, f'is required with source = "{self.source}"'
        is_inverted = is_device and self.per_unit is not None and min(self.per_unit) < 0
        yield is_inverted, "per_unit", 'must be above 0 with source = "device"'

    def driver_rules(self, driver: str) -> Iterator[Rule]:
        """Yield the rule that a driver has the source; the mock replaces any driver."""
        needed = _DRIVER_OF.get(self.source, driver)
        rule = f'needs the driver "{needed}"; with "{driver}" use "input"'
        yield driver not in {needed, "mock"}, "monitor.source", rule, self.source

    def drive_rules(
        self, drive: Burst | SampledDrive, rate_hz: float, interval_s: float
    ) -> Iterator[Rule]:
        """Yield the rules that the inputs can verify a burst, and not take it for the next.

        `rate_hz` is the device's sample rate, `interval_s` the shortest time from an answer to the
        next onset.
        """
        tolerance_ms, high_ms = self.onset_tolerance_ms, 500 * interval_s
        is_wide = self.source != "none" and tolerance_ms >= high_ms
        rule = f"must be below half of design.foreperiod_s[0], {high_ms:g}"
        yield is_wide, "monitor.onset_tolerance_ms", rule, tolerance_ms
        if self.source not in {"duplex", "input"}:
            return
        # scipy.signal takes a tenth of a second to import: only a study with a monitor needs it
        from device.monitor.inputs import MAX_QUIET_S, MIN_QUIET_S
        from device.monitor.matching import MIN_QUIET

        quiet_s = max(MIN_QUIET_S, MIN_QUIET * drive.duration_s)
        rule = f"needs bursts of at most {MAX_QUIET_S / MIN_QUIET:g} s"
        yield quiet_s > MAX_QUIET_S, "monitor.source", rule, f"{drive.duration_s:.10g} s"
        rule = f"must be at least {quiet_s:.6g} s, so that a monitor can measure the noise"
        yield interval_s < quiet_s, "design.foreperiod_s[0]", rule, interval_s
        section = "monitor" if self.source == "input" else "device"
        sample_rate_hz = self.record_rate_hz if self.source == "input" else rate_hz
        low_hz = drive.band_hz()[1] / _MAX_OF_RATE
        rule = f"must be at least {low_hz:.7g} to measure the burst"
        yield sample_rate_hz < low_hz, f"{section}.sample_rate_hz", rule, sample_rate_hz

    @property
    def record_rate_hz(self) -> float:
        """Sample rate of a sound card that records in addition to the driver."""
        return 48_000.0 if self.sample_rate_hz is None else self.sample_rate_hz


class Masking(Section):
    """The masking noise in the headphones, which hides the sound of the actuators."""

    noise: Literal["pink", "none"] = "pink"
    """what is played"""
    max_level_dba: Annotated[float, Field(ge=20, le=MAX_MASKING_LEVEL_DBA)] = 75.0
    """highest level at the ear"""
    measured_level_dba: Annotated[float, Field(ge=20)] | None = None
    """level at the ear, measured with these settings"""
    level_dbfs: Annotated[float, Field(ge=LEAST_LEVEL_DBFS, le=MAX_LEVEL_DBFS)] = -30.0
    """effective value re the peak of a full-scale sine"""
    sound_card: _Card = ""
    """sound card; by default the system's"""
    loop_s: Annotated[float, Field(ge=1, le=600)] = 30.0
    """length of the noise, which repeats without a gap"""
    sample_rate_hz: Annotated[float, Field(ge=16_000, le=192_000)] = 48_000.0
    """sample rate of the sound card"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rule of the highest level."""
        level_dba, high_dba = self.measured_level_dba or 0.0, self.max_level_dba
        yield level_dba > high_dba, "measured_level_dba", f"must be at most {high_dba:g}"


class Contact(Section):
    """How the fingers rest on the plate: thresholds depend on their force and area of contact.

    The program controls neither; the plan, the report and the data set repeat these values.
    """

    control: Literal["not stated", "none", "instructed", "held", "measured"] = "not stated"
    """held: by weights or rests; measured: by a sensor"""
    force_n: Annotated[float, Field(ge=0.01, le=20)] | None = None
    """normal force of one finger"""
    how: Line | None = None
    """how it was instructed, held or measured"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of what is stated with a control, and without."""
        control, has_force, has_method = (
            self.control,
            self.force_n is not None,
            self.how is not None,
        )
        lack = control == "not stated" and (has_force or has_method)
        yield lack, "control", "must be stated with force_n or how"
        rule = "must be instructed, held or measured with force_n"
        yield control == "none" and has_force, "control", rule
        lack = control in {"held", "measured"} and not has_method
        yield lack, "how", f'is required with control = "{control}"'

    @property
    def summary(self) -> str:
        """What is stated, in one line.

        >>> Contact(control="measured", force_n=0.5, how="a load cell below each finger").summary
        'measured, 0.5 N, a load cell below each finger'
        """
        force = None if self.force_n is None else f"{self.force_n:g} N"
        return ", ".join(filter(None, (self.control, force, self.how)))
