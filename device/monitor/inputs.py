"""The inputs of a sound card as a monitor: the card that drives, or an additional one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from scipy import signal

from device.errors import LinkError
from device.monitor.judge import correlations_of, judge
from device.monitor.matching import Template
from device.monitor.measured import Fault, Measured, Planned, Tap, Tolerances, void

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import Delivery, FloatArray
    from device.monitor.matching import TemplateMatch
    from device.sound.audio import AudioConverter
    from device.sound.recorder import Recorder
    from device.sound.stream import Stream

QUIET_S: Final = 0.25
MAX_QUIET_S: Final = 1.0
_QUIET_SHAPES: Final = 40
"""The record of this time before a burst gives the noise, if it is there: of a long burst more."""
MIN_QUIET_S: Final = 0.02
SEARCHED_S: Final = 0.1
"""So long after its time a burst is waited for."""
MAX_DELAY_S: Final = 0.3
"""Longest delay of a sound server that is allowed for if it has not been measured."""
_TIMEOUT_S: Final = 1.0
_SETTLES_S: Final = 10.0
"""A sound server has been seen to need 3.5 s, on an idle machine."""
_POLL_S: Final = 0.002
_NO_ONSET: Final = ", nor that a burst is early or late: monitor.delay_ms is not set"
_FULL: Final = 32768
_LIMIT: Final = 32766 / _FULL


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Calibration of a record.

    Attributes
    ----------
    per_unit : tuple of float
        Value of each channel at the tap, in its unit, at the record's full scale; below 0 if the
        channel is inverted.
    delay_s : tuple of float or None
        Delay of each channel from the onset that the driver reports to the recorded one. None if it
        has not been measured; then no burst is judged early or late.
    """

    per_unit: tuple[float, ...]
    delay_s: tuple[float, ...] | None = None


class InputMonitor:
    """A `Monitor` by inputs of a sound card, one for each channel.

    Parameters
    ----------
    recorder : Recorder
        What keeps the last seconds of the inputs.
    clock : Clock
        The host's.
    tap : Tap
        Where the inputs are connected.
    calibration : Calibration
        What the recorded numbers stand for.
    tolerances : Tolerances
        By how much a burst may differ.
    source : str
        What the record says of the inputs.
    connect : callable or None
        Opens the stream of the inputs; None if the driver's stream has them.
    card : AudioConverter or None
        The driver's sound card, if the inputs are its own.
    """

    def __init__(
        self,
        recorder: Recorder,
        clock: Clock,
        *,
        tap: Tap,
        calibration: Calibration,
        tolerances: Tolerances,
        source: str,
        connect: Callable[[Recorder], Stream] | None = None,
        card: AudioConverter | None = None,
    ) -> None:
        self.tap = tap
        self.source = source
        self._recorder = recorder
        self._clock = clock
        self._calibration = calibration
        self._tolerances = tolerances
        self._connect = connect
        self._card = card
        self._listened = False
        self._stream: Stream | None = None
        self._first = self._gaps = self._over = 0
        self._planned: Planned | None = None

    @property
    def unseen(self) -> str:
        """What is never seen at its tap, nor without a delay that was measured."""
        return self.tap.unseen + (_NO_ONSET if self._calibration.delay_s is None else "")

    def open(self) -> None:
        """Open or reopen the inputs, unless the driver has opened them, and wait until they settle.

        A sound server that interrupts a stream may delay it from then on. Reopening the stream
        after a burst that was not verified removes that delay.
        """
        self._over = 0
        self._recorder.release()
        if self._listened and self._card is not None:
            self._card.renew()
        self._listened = True
        if self._connect is not None:
            self.close()
            self._recorder.restart()
            self._stream = self._connect(self._recorder)
        give_up_s = self._clock.now_s() + _SETTLES_S
        while not self._recorder.settled:
            if self._clock.now_s() > give_up_s:
                raise LinkError(
                    f"the inputs of the sound card did not run steadily for a second in "
                    f"{_SETTLES_S:g} s: {self._recorder.unsettled}"
                )
            self._clock.wait(_POLL_S)

    def close(self) -> None:
        """Close them."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def begin(self, token: int, planned: Planned) -> None:
        """Note the position of the record."""
        self._recorder.release()
        self._first = self._recorder.frames
        self._gaps = self._recorder.gaps
        self._planned = planned
        self._recorder.hold(self._first - self._quiet())

    def end(self, delivery: Delivery) -> Measured:
        """Look at what was heard since."""
        planned = self._planned
        if planned is None:
            raise LinkError("nothing was begun that could be measured")
        template = Template(_at_rate(planned, self._recorder.sample_rate_hz))
        reason = self._wait(delivery.host_after_s, template)
        quiet, self._over = self._quiet(), self._recorder.frames
        matches = None if reason else self._match(template, quiet)
        self._recorder.release()  # what comes until the next burst is its quiet part
        if matches is None:
            return Measured(
                token=delivery.token, tap=self.tap, source=self.source, unmeasured=reason
            )
        return self._judge(delivery, planned, matches)

    def _quiet(self) -> int:
        recorder, planned = self._recorder, self._planned
        shapes_s = 0.0 if planned is None else len(planned.shape) / planned.sample_rate_hz
        quiet_s = min(max(QUIET_S, _QUIET_SHAPES * shapes_s), MAX_QUIET_S)
        since = max(recorder.first, self._over)
        return min(self._first - since, round(quiet_s * recorder.sample_rate_hz))

    def _wait(self, onset_s: float, template: Template) -> str:
        """Wait until all of the burst must have been heard; return why it was not."""
        recorder = self._recorder
        rate_hz = recorder.sample_rate_hz
        delay_s = self._calibration.delay_s
        later_s = MAX_DELAY_S if delay_s is None else SEARCHED_S + max(delay_s)
        began = None if self._card is None else self._card.first_frame
        give_up_s = self._clock.now_s() + _TIMEOUT_S + later_s + len(template.shape) / rate_hz
        waited_from = recorder.frames
        while not self._heard_all(len(template.shape), began, onset_s, later_s):
            if self._clock.now_s() > give_up_s:
                if began is not None or recorder.frames < waited_from + _TIMEOUT_S / 2 * rate_hz:
                    return "nothing comes from the inputs"
                break  # it is the word of the sound system's latency that is wrong
            self._clock.wait(_POLL_S)
        if recorder.gaps != self._gaps:
            return "the record has a gap"
        min_s = max(MIN_QUIET_S, template.min_quiet / rate_hz)
        if self._quiet() < min_s * rate_hz:
            return f"the record before the burst is shorter than {min_s:.3g} s"
        return ""

    def _heard_all(self, frames: int, began: int | None, onset_s: float, later_s: float) -> bool:
        """Return whether a burst this much later would be in the record."""
        recorder = self._recorder
        last = recorder.frames - frames
        if began is None:
            return recorder.time_of(last)[0] >= onset_s + later_s
        return last >= began + later_s * recorder.sample_rate_hz

    def _match(self, template: Template, quiet: int) -> list[TemplateMatch]:
        record = self._recorder.frames_between(self._first - quiet, self._recorder.frames) / _FULL
        return [
            template.find(record[:, i] * per_unit, quiet=quiet, limit=abs(per_unit) * _LIMIT)
            for i, per_unit in enumerate(self._calibration.per_unit)
        ]

    def _judge(
        self, delivery: Delivery, planned: Planned, matches: list[TemplateMatch]
    ) -> Measured:
        rate_hz = self._recorder.sample_rate_hz
        reported_s = (delivery.host_before_s + delivery.host_after_s) / 2
        frames = [self._first + match.onset for match in matches]
        times = [self._recorder.time_of(frame) for frame in frames]
        began = None if self._card is None else self._card.first_frame
        delay_s = self._calibration.delay_s
        late_s = [
            (at_s - reported_s if began is None else (frame - began) / rate_hz) - channel_delay_s
            for frame, (at_s, _), channel_delay_s in zip(
                frames, times, delay_s or (0.0,) * len(matches), strict=True
            )
        ]
        faults, unmeasured = judge(
            planned,
            matches,
            tap=self.tap,
            tolerances=self._tolerances,
            late_s=None if delay_s is None else late_s,
            sample_rate_hz=rate_hz,
        )
        correlations = correlations_of(planned, matches, self._tolerances.silence)
        heard = (i for i, correlation in enumerate(correlations) if correlation is not None)
        first = min(heard, key=lambda i: frames[i], default=None)
        is_clipped = Fault.CLIPPED in faults
        onset: dict[str, float] = {}
        if first is not None and not unmeasured:
            onset_s, clock_s = times[first]
            shape_s = matches[first].onset_uncertainty / rate_hz
            onset = {
                "onset_s": onset_s,
                "onset_uncertainty_s": math.hypot(shape_s, clock_s),
                "late_s": late_s[first],
            }
        voiding = void(faults, self.tap)
        return Measured(
            token=delivery.token,
            tap=self.tap,
            source=self.source,
            peaks=tuple(
                _peak(match, is_driven=peak > 0, is_clipped=is_clipped)
                for peak, match in zip(planned.peaks, matches, strict=True)
            ),
            correlations=correlations,
            noise=tuple(match.noise_rms for match in matches),
            faults=voiding,
            noted=tuple(fault for fault in faults if fault not in voiding),
            unmeasured=unmeasured,
            blank=planned.blank,
            **onset,
        )


def _peak(match: TemplateMatch, *, is_driven: bool, is_clipped: bool) -> float:
    """Return the peak of a channel: of a clipped burst that of its flat tops."""
    if not is_driven:
        return max(match.largest, match.loudest)
    return max(min(match.tops)[0] if is_clipped else match.amplitude, 0.0)


def _at_rate(planned: Planned, sample_rate_hz: float) -> FloatArray:
    """Return the planned shape at the record's rate."""
    if planned.sample_rate_hz == sample_rate_hz:
        return planned.shape
    ratio = Fraction(sample_rate_hz / planned.sample_rate_hz).limit_denominator(1000)
    resampled: FloatArray = signal.resample_poly(planned.shape, ratio.numerator, ratio.denominator)
    return resampled
