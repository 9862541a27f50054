"""The inputs of a sound card as a monitor: of the one that drives, or of one beside any driver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from scipy import signal

from device.checks import require_real
from device.errors import LinkError
from device.monitor.delays import LONGEST_OWN_S, Delays, OwnDelay
from device.monitor.matching import Template
from device.monitor.measured import Fault, Measured, Planned, Tap, Tolerances, judge, void

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import Delivery, FloatArray
    from device.monitor.matching import Found
    from device.sound.recorder import Recorder
    from device.sound.stream import Stream

QUIET_S: Final = 0.25
MOST_QUIET_S: Final = 1.0
_QUIET_SHAPES: Final = 40
"""So much before a burst tells the noise, where it is there: of a long burst more."""
LEAST_QUIET_S: Final = 0.02
SEARCHED_S: Final = 0.1
"""So long after its time a burst is waited for."""
_PATIENCE_S: Final = 1.0
_SETTLES_S: Final = 10.0
"""A sound server has been seen to need 3.5 s, on an idle machine."""
_POLL_S: Final = 0.002
_UNKNOWN: Final = "the burst before was not heard, and this may be that one"
_FULL: Final = 32768
_LIMIT: Final = 32766 / _FULL


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What a record's numbers stand for.

    Attributes
    ----------
    per_unit : tuple of float
        At the tap, in its unit, for the record's full scale, left and right; less than 0 where a
        channel is inverted.
    delay_s : tuple of float or None
        From the onset that the driver tells to the one that is heard, left and right; None where
        nobody has measured it, so that each stream's first burst tells it.

    Raises
    ------
    ValueError
        One is out of range.
    """

    per_unit: tuple[float, float]
    delay_s: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for one in self.per_unit:
            require_real("per_unit", abs(one), least=1e-12, most=1e12)
        for one in self.delay_s or ():
            require_real("delay_s", one, least=-1.0, most=1.0)


class InputMonitor:
    """A `Monitor` by two inputs of a sound card.

    `connect` opens their stream; None where the driver does that, whose stream they are, and
    `renew` opens that anew. `played` tells at which frame the driver's last burst began, where its
    frames are the record's.
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
        played: Callable[[], int | None] | None = None,
        renew: Callable[[], None] | None = None,
    ) -> None:
        self.tap = tap
        self.source = source
        self._recorder = recorder
        self._clock = clock
        self._calibration = calibration
        self._tolerances = tolerances
        self._connect = connect
        self._played = played
        self._renew = renew
        self._listened = False
        self._stream: Stream | None = None
        self._first = self._gaps = self._over = 0
        self._planned: Planned | None = None
        self._delays, self._own = Delays(), OwnDelay()
        self._opened = recorder.opened

    @property
    def unseen(self) -> str:
        """What is never seen at its tap."""
        return self.tap.unseen

    def open(self) -> None:
        """Open the inputs, also anew; the driver's own are open. Wait until they run steadily.

        Opened again after a burst that was not verified, a stream has lost the delay that it got
        where a sound server tore it.
        """
        self._over = 0
        self._recorder.release()
        if self._listened and self._renew is not None:
            self._renew()
        self._listened = True
        if self._connect is not None:
            self.close()
            self._recorder.restart()
            self._stream = self._connect(self._recorder)
        if self._opened != self._recorder.opened:  # with another delay, it may be
            self._opened = self._recorder.opened
            self._delays, self._own = Delays(), OwnDelay()
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
        """Note where the record stands."""
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
        why = self._wait(delivery.host_after_s, template)
        quiet, self._over = self._quiet(), self._recorder.frames
        found = None if why else self._found(template, quiet)
        self._recorder.release()  # what comes until the next burst is its quiet part
        if found is None:
            return Measured(token=delivery.token, tap=self.tap, source=self.source, unmeasured=why)
        return self._measured(delivery, planned, found)

    def _quiet(self) -> int:
        recorder, planned = self._recorder, self._planned
        shapes_s = 0.0 if planned is None else len(planned.shape) / planned.sample_rate_hz
        wanted_s = min(max(QUIET_S, _QUIET_SHAPES * shapes_s), MOST_QUIET_S)
        since = max(recorder.first, self._over)
        return min(self._first - since, round(wanted_s * recorder.sample_rate_hz))

    def _wait(self, onset_s: float, template: Template) -> str:
        """Wait until all of the burst must have been heard; return why it was not."""
        recorder = self._recorder
        rate_hz = recorder.sample_rate_hz
        delay_s = self._calibration.delay_s
        later_s = LONGEST_OWN_S if delay_s is None else SEARCHED_S + max(delay_s)
        began = None if self._played is None else self._played()
        give_up_s = self._clock.now_s() + _PATIENCE_S + later_s + len(template.shape) / rate_hz
        asked = recorder.frames
        while not self._heard_all(len(template.shape), began, onset_s, later_s):
            if self._clock.now_s() > give_up_s:
                if began is not None or recorder.frames < asked + _PATIENCE_S / 2 * rate_hz:
                    return "nothing comes from the inputs"
                break  # it is the word of the sound system's latency that is wrong
            self._clock.wait(_POLL_S)
        if recorder.gaps != self._gaps:
            return "the record has a gap"
        least_s = max(LEAST_QUIET_S, template.least_quiet / rate_hz)
        if self._quiet() < least_s * rate_hz:
            return f"the record before the burst is shorter than {least_s:.3g} s"
        return ""

    def _heard_all(self, frames: int, began: int | None, onset_s: float, later_s: float) -> bool:
        """Tell whether a burst this much later would be in the record, by frames if they tell."""
        recorder = self._recorder
        last = recorder.frames - frames
        if began is None:
            return recorder.time_of(last)[0] >= onset_s + later_s
        return last >= began + later_s * recorder.sample_rate_hz

    def _found(self, template: Template, quiet: int) -> tuple[Found, Found]:
        record = self._recorder.part(self._first - quiet, self._recorder.frames) / _FULL
        left, right = (
            template.find(record[:, i] * per_unit, quiet=quiet, limit=abs(per_unit) * _LIMIT)
            for i, per_unit in enumerate(self._calibration.per_unit)
        )
        return left, right

    def _measured(
        self, delivery: Delivery, planned: Planned, found: tuple[Found, Found]
    ) -> Measured:
        rate_hz = self._recorder.sample_rate_hz
        told_s = (delivery.host_before_s + delivery.host_after_s) / 2
        frames = [self._first + one.onset for one in found]
        times = [self._recorder.time_of(frame) for frame in frames]
        began = None if self._played is None else self._played()
        stated_s = self._calibration.delay_s or (0.0, 0.0)
        late_s = [
            (at_s - told_s if began is None else (frame - began) / rate_hz) - delay_s
            for frame, (at_s, _), delay_s in zip(frames, times, stated_s, strict=True)
        ]
        sounding = [
            i for i in range(2) if found[i].amplitude >= self._tolerances.silence * planned.burst[i]
        ]
        main = min(sounding, key=lambda i: frames[i], default=None)
        near_s: float | None = 0.0
        if self._calibration.delay_s is None and main is not None:
            near_s = self._own.near(late_s[main], within_s=self._tolerances.onset_s)
        off_s = late_s if near_s is None else [one - near_s for one in late_s]
        faults, noisy = judge(
            planned,
            found,
            tap=self.tap,
            tolerances=self._tolerances,
            late_s=(off_s[0], off_s[1]),
            sample_rate_hz=rate_hz,
        )
        flat = Fault.CLIPPED in faults
        peaks = [
            max(min(one.tops)[0] if flat else one.amplitude, 0.0)
            if peak
            else max(one.largest, one.loudest)
            for peak, one in zip(planned.peaks, found, strict=True)
        ]
        if main is None and not planned.blank:
            self._own.miss()
        if noisy:
            main = None
        if main is not None and not {*faults} - {Fault.EARLY, Fault.LATE}:
            self._own.keep(late_s[main], good=not faults)
            if near_s is None:
                noisy, faults = _UNKNOWN, ()
        voided = void(faults, self.tap)
        noted = tuple(one for one in faults if one not in voided)
        if main is not None and not voided:
            known_s = found[main].onset_uncertainty / rate_hz
            if began is None:
                known_s += times[main][1] + delivery.uncertainty_s
            noted += (Fault.DELAYED,) * self._delays.changed(late_s[main], known_s)
        return Measured(
            token=delivery.token,
            tap=self.tap,
            source=self.source,
            peak_left=peaks[0],
            peak_right=peaks[1],
            onset_s=None if main is None else times[main][0],
            onset_uncertainty_s=None
            if main is None
            else math.hypot(found[main].onset_uncertainty / rate_hz, times[main][1]),
            late_s=None if main is None else late_s[main],
            correlation_left=found[0].correlation if 0 in sounding else None,
            correlation_right=found[1].correlation if 1 in sounding else None,
            noise_left=found[0].noise_rms,
            noise_right=found[1].noise_rms,
            faults=voided,
            noted=noted,
            unmeasured=noisy,
            blank=planned.blank,
        )


def _at_rate(planned: Planned, sample_rate_hz: float) -> FloatArray:
    """Return the planned shape at the record's rate."""
    if planned.sample_rate_hz == sample_rate_hz:
        return planned.shape
    ratio = Fraction(sample_rate_hz / planned.sample_rate_hz).limit_denominator(1000)
    resampled: FloatArray = signal.resample_poly(planned.shape, ratio.numerator, ratio.denominator)
    return resampled
