"""A lab's own driver and responder: a printer of volts, and somebody who always answers left."""

from device import Converter, Outcome, Played, converter_device
from experiment import Press, Responder


class Printer(Converter):
    """What plays two waveforms; here it only prints how large they are."""

    name = "printer"
    bits = 16
    emulated = True  # no actuator can move; of a real device nobody may say so
    cannot = ("move anything",)

    def __init__(self, port, sample_rate_hz, full_scale_v):
        self.serial_number = port or "1"
        self.sample_rate_hz = sample_rate_hz
        self.full_scale_v = full_scale_v

    def connect(self):
        """Open the device here, its outputs at zero."""

    def play(self, left_v, right_v):
        """Play volts at the actuators, wait until it is over, and say what is known."""
        print(f"{abs(left_v).max():.0f} V left, {abs(right_v).max():.0f} V right")
        return Played(outcome=Outcome.FIRED)

    def zero(self):
        """Bring the outputs to zero; called from any thread, at any time."""

    def disconnect(self):
        """Close the device."""


def printer(settings, clock):
    """Make the device: tokens, rests, levels and ceilings are kept around the printer."""
    converter = Printer(settings.port, settings.sample_rate_hz, settings.volts_full_scale or 100.0)
    return converter_device(converter, limits=settings.limits, clock=clock)


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
