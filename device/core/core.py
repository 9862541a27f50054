"""The device's own logic, without I/O and without a clock: states, tokens, watchdog, ceilings.

Every call is given the device's time in microseconds. Which step leads where is the table in
states.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from device.checks import require_whole
from device.core.messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Beat,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Ping,
    Query,
    Stop,
    full_scale,
)
from device.core.output import Emission, OutputStage
from device.core.reports import OURS, About, DeviceLimits, Health, Measurement
from device.core.states import ILLEGAL, TRANSITIONS, State, Step
from device.core.tokens import Record, Reply, TokenHistory
from device.driver import LARGEST_TOKEN, Outcome
from device.errors import WATCHDOG_S, Refusal, rejection
from device.limits import (
    CodeArray,
    Limits,
    check_ceiling,
    check_channels,
    check_codes,
    check_memory,
    check_rest,
    check_slot,
    check_time_to_live,
    lowest_peaks,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# Five beats may be lost before the outputs go off, so that a busy host is not taken for a dead one.
# No actuator may be driven for longer without supervision. The time runs whatever else arrives:
# questions are no beats, for a host that hangs in a loop of them is dead to its operator too.
WATCHDOG_US = round(WATCHDOG_S * 1e6)
"""Without a beat for this long while the output is on, the device stops itself."""

HISTORY = 1024
"""Number of tokens a device remembers; exactly once reaches back as far: see `TokenHistory`."""

_ENABLED = (State.LIVE, State.ARMED, State.FIRED)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Slot:
    codes: CodeArray
    peaks: tuple[int, ...]


class DeviceCore:
    """A device from power-on to power-off; another power cycle is another object.

    `take` first lets happen what was due by `now_us` (`advance`), in the order of time. A message
    that is refused has changed nothing else.

    Parameters
    ----------
    boot_id : int
        Random number of this power cycle.
    limits : Limits
        The device's own; no message changes them.
    output : OutputStage
        Converter and amplifier.
    sink : callable
        Is given each `Emission` once, when it is over.
    measure : callable
        Returns what was measured of an `Emission` that is over, or None.
    about : About
        Its firmware and where its boot id comes from.
    history : int
        Number of tokens remembered.

    Raises
    ------
    ValueError
        `boot_id` or `history` is out of range.

    Examples
    --------
    >>> sine = np.array([0, 32767, 0, -32767, 0], dtype=np.int32)
    >>> core = DeviceCore(boot_id=1, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> core.take(0, LoadSlot(slot=0, codes=np.stack([sine, 0 * sine])))
    >>> core.take(10, Enable())
    >>> core.take(20, Levels(levels_mvpp=(150_000, 150_000)))
    >>> core.take(30, Arm(token=7, slot=0, time_to_live_us=1_000))
    >>> core.take(40, Fire(token=7)) == core.take(50, Fire(token=7))
    True
    >>> core.playing.volts[0].tolist(), core.playing.levels_vpp
    ([...74.99...], (150.0, 0.0))
    """

    def __init__(
        self,
        *,
        boot_id: int,
        limits: Limits,
        output: OutputStage,
        sink: Callable[[Emission], None],
        measure: Callable[[Emission], Measurement | None] = lambda _: None,
        about: About = OURS,
        history: int = HISTORY,
    ) -> None:
        require_whole("boot_id", boot_id, minimum=0, maximum=LARGEST_TOKEN)
        self.boot_id = boot_id
        self.limits = limits
        self.output = output
        self._sink = sink
        self._measure = measure
        self._about = about
        self._sensed = Health()
        self._measured: Measurement | None = None
        self._tokens = TokenHistory(history)
        self._slots: dict[int, _Slot] = {}
        self._levels = Levels(levels_mvpp=(0,) * output.channels)
        self._state = State.IDLE
        self._off_reason = Refusal.SAFE_STATE
        self._armed: Arm | None = None
        self._armed_until_us = 0
        self._last: Emission | None = None
        self._now_us = self._beat_us = 0

    @property
    def state(self) -> State:
        """The state as of the last call."""
        return self._state

    @property
    def now_us(self) -> int:
        """The device time of the last call."""
        return self._now_us

    @property
    def health(self) -> Health:
        """What is known of the amplifier; that it is enabled is this device's own doing."""
        return replace(self._sensed, amplifier_enabled=self._state in _ENABLED)

    @property
    def levels(self) -> Levels:
        """The levels that are set."""
        return self._levels

    @property
    def playing(self) -> Emission | None:
        """The burst that is under way, as of the last call."""
        return self._last if self._state is State.FIRED else None

    def advance(self, now_us: int) -> None:
        """Let happen what was due by `now_us`: end of a burst, end of a time to live, watchdog."""
        if now_us < self._now_us:
            raise ValueError(f"now_us must be {self._now_us} or later, got {now_us}")
        while (due := self._next_event()) is not None and due[0] <= now_us:
            self._happen(*due, Refusal.WATCHDOG_STOP)
        self._now_us = now_us

    def sense(self, now_us: int, sensed: Health) -> None:
        """Take what switch and amplifier report; over-current is a stop, kept until ENABLE."""
        self.advance(now_us)
        kept = self._sensed.over_current is True
        self._sensed = replace(sensed, over_current=True) if kept else sensed
        if sensed.over_current:
            self._happen(now_us, Step.STOP, Refusal.OVERLOAD_STOP)

    def lose_line(self, now_us: int) -> None:
        """Notice that the line to the host is gone: the outputs go to zero."""
        self.advance(now_us)
        self._happen(now_us, Step.STOP, Refusal.LINE_STOP)

    def take(self, now_us: int, message: Message[Reply]) -> Reply:
        """Do what a message asks and return its answer, or refuse it and change nothing.

        Raises
        ------
        Rejected
            State, limits or tokens forbid it.
        """
        self.advance(now_us)
        act = self._ACTIONS.get(type(message))
        if act is None:
            raise rejection(Refusal.BAD_MESSAGE, type(message).__name__)
        answer: Reply = act(self, message)
        return answer

    def held_beside(self, slot: int) -> int:
        """Return the samples of one channel in all other slots."""
        return sum(kept.codes.shape[1] for name, kept in self._slots.items() if name != slot)

    def _load(self, message: LoadSlot) -> None:
        check_slot(message.slot, self.limits)
        channels, n_samples = message.codes.shape
        check_channels(channels, self.output.channels)
        check_memory(self.held_beside(message.slot), n_samples, self.limits)
        after = self._after(Step.LOAD)
        full, codes = full_scale(self.output.bits), message.codes.astype(np.int32)
        peaks = check_codes(codes, full_scale=full, limits=self.limits)
        self._slots[message.slot] = _Slot(codes=codes, peaks=peaks)
        self._state = after

    def _set_levels(self, message: Levels) -> None:
        """Set the levels, unless no loaded waveform of a channel could use its level."""
        check_channels(len(message.levels_mvpp), self.output.channels)
        after = self._after(Step.LEVEL)
        loaded = (slot.peaks for slot in self._slots.values())
        self._check_ceiling(lowest_peaks(loaded, self.output.channels), message)
        self._levels = message
        self._state = after

    def _enable(self, _: Enable) -> None:
        """Switch the output on; the watchdog waits from here for its first beat."""
        self._state = self._after(Step.ENABLE)
        self._beat_us = self._now_us
        if self._sensed.over_current:
            self._sensed = replace(self._sensed, over_current=False)

    def _arm(self, message: Arm) -> None:
        check_slot(message.slot, self.limits)
        after = self._after(Step.ARM)
        self._require_amplifier()
        check_time_to_live(message.time_to_live_us, self.limits)
        if self._tokens.find(message.token) is not None:
            raise rejection(Refusal.TOKEN_SPENT)
        if message.slot not in self._slots:
            raise rejection(Refusal.EMPTY_SLOT, f"slot {message.slot}")
        self._check_ceiling(self._slots[message.slot].peaks, self._levels)
        self._armed = message
        self._armed_until_us = self._now_us + message.time_to_live_us
        self._state = after

    def _fire(self, message: Fire) -> Record:
        # The history is asked before the state: a token that has fired is answered with its record
        # in every state, so that a FIRE whose answer was lost can be sent again at any time.
        token = message.token
        record = self._tokens.find(token)
        if record is not None and record.outcome is Outcome.FIRED:
            return record
        if record is not None and self._state is not State.SAFE:
            is_expired = record.reason is Refusal.EXPIRED
            raise rejection(Refusal.EXPIRED if is_expired else Refusal.ABORTED)
        after = self._after(Step.FIRE)
        if self._armed is None or token != self._armed.token:
            raise rejection(Refusal.WRONG_TOKEN)
        self._require_amplifier()
        self._check_rest()
        record = self._emit(self._armed)
        self._tokens.keep(record)
        self._armed = None
        self._state = after
        return record

    def _disarm(self, message: Disarm) -> None:
        # A token that was never here is kept too: its ARM may still be under way.
        token = message.token
        if self._armed is not None and token == self._armed.token:
            self._resolve(Refusal.ABORTED)
            self._state = self._after(Step.DISARM)
        elif self._tokens.find(token) is None:
            self._tokens.keep(self._tokens.absent(token))

    def _query(self, message: Query) -> Record:
        token = message.token
        if self._armed is not None and token == self._armed.token:
            outcome, reason = Outcome.INDETERMINATE, Refusal.ALREADY_ARMED
            return Record(token=token, outcome=outcome, reason=reason)
        return self._tokens.find(token) or self._tokens.absent(token)

    def _require_amplifier(self) -> None:
        if self._sensed.switch_closed is False:
            raise rejection(Refusal.AMPLIFIER_OFF)

    def _report_limits(self, _: AskLimits) -> DeviceLimits:
        return DeviceLimits.of(self.limits, self._about)

    def _report_health(self, _: AskHealth) -> Health:
        return self.health

    def _report_measured(self, message: AskMeasured) -> Measurement:
        token, playing = message.token, self.playing
        if playing is not None and token == playing.token:
            raise rejection(Refusal.BUSY)
        if self._measured is not None and token == self._measured.token:
            return self._measured
        return Measurement(token=token)

    def _stop(self, _: Stop) -> None:
        self._happen(self._now_us, Step.STOP, Refusal.SAFE_STATE)

    def _hear(self, _: Beat) -> None:
        self._beat_us = self._now_us

    def _answer(self, _: Ping) -> None:
        pass

    _ACTIONS: ClassVar[dict[type[Message[Any]], Callable[..., Any]]] = {
        Ping: _answer,
        AskLimits: _report_limits,
        AskHealth: _report_health,
        AskMeasured: _report_measured,
        LoadSlot: _load,
        Levels: _set_levels,
        Enable: _enable,
        Arm: _arm,
        Fire: _fire,
        Disarm: _disarm,
        Query: _query,
        Stop: _stop,
        Beat: _hear,
    }

    def _after(self, step: Step) -> State:
        if (self._state, step) not in TRANSITIONS:
            is_safe = self._state is State.SAFE
            raise rejection(self._off_reason if is_safe else ILLEGAL[self._state], step.value)
        return TRANSITIONS[self._state, step]

    def _next_event(self) -> tuple[int, Step] | None:
        watchdog = (self._beat_us + WATCHDOG_US, Step.STOP)
        if self._state is State.LIVE:
            return watchdog
        if self._state is State.ARMED:
            event = (self._armed_until_us, Step.EXPIRE)
        elif self._state is State.FIRED and self._last is not None:
            event = (self._last.start_us + self._last.duration_us, Step.FINISH)
        else:
            return None
        return event if event[0] <= watchdog[0] else watchdog

    # What switched the outputs off stays the reason until they are on again: a stop that comes
    # later does not hide it.
    def _happen(self, at_us: int, step: Step, off_reason: Refusal) -> None:
        if step is Step.STOP and self._state is not State.SAFE:
            self._off_reason = off_reason
        if self._last is not None and self._state is State.FIRED:
            cut = step is Step.STOP
            self._sink(self._last.cut(at_us) if cut else self._last)
            self._measured = None if cut else self._measure(self._last)
        self._resolve(Refusal.EXPIRED if step is Step.EXPIRE else Refusal.ABORTED)
        self._state = self._after(step)

    def _resolve(self, reason: Refusal) -> None:
        """Put the token that is armed, if there is one, into the history: it has not fired.

        At least not this time: of one that may have been forgotten since it fired, that is all
        that can be said.
        """
        if self._armed is not None:
            record = self._tokens.absent(self._armed.token)
            if record.outcome is Outcome.NOT_FIRED:
                record = replace(record, reason=reason)
            self._tokens.keep(record)
            self._armed = None

    def _check_ceiling(self, peaks: Sequence[int], levels: Levels) -> None:
        full = full_scale(self.output.bits)
        check_ceiling(peaks, levels.levels_mvpp, full_scale=full, limits=self.limits)

    def _check_rest(self) -> None:
        if self._last is not None:
            since_us = self._now_us - self._last.start_us
            duration_us = self._last.duration_us
            check_rest(since_onset_us=since_us, duration_us=duration_us, limits=self.limits)

    def _emit(self, armed: Arm) -> Record:
        slot, set_mvpp = self._slots[armed.slot], self._levels.levels_mvpp
        channels = zip(set_mvpp, slot.peaks, strict=True)
        levels_mvpp = tuple(level_mvpp if peak else 0 for level_mvpp, peak in channels)
        token, start_us = armed.token, self._now_us
        self._last = Emission(
            token=token,
            start_us=start_us,
            volts=self.output.render(slot.codes, levels_mvpp=set_mvpp, limits=self.limits),
            levels_vpp=tuple(level_mvpp / 1000 for level_mvpp in levels_mvpp),
            sample_rate_hz=self.output.sample_rate_hz,
        )
        outcome = Outcome.FIRED
        return Record(token=token, outcome=outcome, start_us=start_us, levels_mvpp=levels_mvpp)
