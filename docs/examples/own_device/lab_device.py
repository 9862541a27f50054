"""A lab's own driver and responder: a printer of volts, and somebody who always answers left."""

from device import Converter, Outcome, Played, converter_device
from experiment import Press, Responder


class Printer(Converter):
    """What plays a waveform on each channel; here it only prints how large they are."""

    name = "printer"
    bits = 16
    emulated = True  # no actuator can move; of a real device nobody may say so
    cannot = ("move anything",)

    def __init__(self, settings):
        self.serial_number = settings.port or "1"
        self.sample_rate_hz = settings.sample_rate_hz
        self.full_scale_v = settings.volts_full_scale or 100.0
        self.channels = len(settings.channels)

    def connect(self):
        """Open the device here, its outputs at zero."""

    def play(self, volts):
        """Play volts at the actuators, wait until it is over, and say what is known."""
        print(", ".join(f"{peak_v:.0f} V" for peak_v in abs(volts).max(axis=1)))
        return Played(outcome=Outcome.FIRED)

    def zero(self):
        """Bring the outputs to zero; called from any thread, at any time."""

    def disconnect(self):
        """Close the device."""


def printer(settings, clock):
    """Make the device: tokens, rests, levels and ceilings are kept around the printer."""
    return converter_device(Printer(settings), limits=settings.limits, clock=clock)


class Impatient(Responder):
    """Somebody who answers left, a third of a second after every stimulus."""

    simulated = True

    def __init__(self, settings, clock):
        self.clock = clock

    def begin(self, progress):
        return True

    def introduce(self, part, progress):
        return True

    def cue(self, progress):
        pass

    def wait(self, until_s):
        self.clock.wait(max(0.0, until_s - self.clock.now_s()))

    def ask(self, question):
        self.clock.wait(max(0.0, question.onset_s + 0.33 - self.clock.now_s()))
        return Press(question.answers[0], self.clock.now_s())

    def feedback(self, *, correct):
        pass

    def pause(self, progress, *, paused, minimum_s):
        self.clock.wait(minimum_s)
        return True

    def end(self, progress, *, finished):
        pass
