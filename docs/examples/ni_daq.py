"""Analogue outputs of a National Instruments device, over nidaqmx, as a driver.

Offer it as an entry point of the group tactstrip.drivers; `port` in [device] is the device's name,
such as Dev1, `amplifier_gain` is volts at the actuator per volt of the output, `channels = [1, 2]`
are ao0 and ao1. Written from the documentation of nidaqmx-python and tested against a stand-in
that checks each call: not tried on hardware. Watch the outputs on an oscilloscope, without an
amplifier behind them, before anything is connected.
"""

import threading

from device import Converter, LinkError, Outcome, Played, converter_device

LARGEST_V = 10.0
"""Of the outputs of the usual devices, to both sides."""
PATIENCE_S = 2.0


class NiDaq(Converter):
    """What plays waveforms on a device with a clock and a buffer of its own."""

    name, bits, emulated = "NI-DAQ", 16, False
    cannot = (
        "bring its outputs to zero when this program hangs: nothing in it watches the host",
        "hold a ceiling of its own: its outputs reach 10 V",
        "tell the onset better than between the start of its task and its end",
    )

    def __init__(self, settings):
        if settings.port is None or settings.amplifier_gain is None:
            raise ValueError("port and amplifier_gain must be given for the driver")
        self.serial_number = settings.port
        self.sample_rate_hz = settings.sample_rate_hz
        self.full_scale_v = LARGEST_V * settings.amplifier_gain
        self.channels = len(settings.channels)
        self._gain = settings.amplifier_gain
        self._outputs = [f"{settings.port}/ao{channel - 1}" for channel in settings.channels]
        self._stopped = threading.Event()

    def connect(self):
        """Put the outputs to zero; that also tells whether the device is there."""
        import nidaqmx.errors

        try:
            self._hold_zero()
        except nidaqmx.errors.Error as error:
            raise LinkError(f"{self.serial_number}: {str(error).splitlines()[0]}") from error

    def play(self, volts):
        """Play once from the device's buffer, by its own clock."""
        import nidaqmx
        from nidaqmx.constants import AcquisitionType

        self._stopped.clear()
        volts = volts / self._gain
        with nidaqmx.Task() as task:
            for output in self._outputs:
                task.ao_channels.add_ao_voltage_chan(output, min_val=-LARGEST_V, max_val=LARGEST_V)
            task.timing.cfg_samp_clk_timing(
                self.sample_rate_hz,
                sample_mode=AcquisitionType.FINITE,
                samps_per_chan=volts.shape[1],
            )
            task.write(volts, auto_start=False)
            task.start()
            duration_s = volts.shape[1] / self.sample_rate_hz
            over = not self._stopped.wait(duration_s)
            if over:
                task.wait_until_done(timeout=PATIENCE_S)
            task.stop()
        if not over:
            self._hold_zero()
        return Played(outcome=Outcome.FIRED if over else Outcome.INDETERMINATE)

    def zero(self):
        """Have what plays cut short by the thread that plays it, which holds the outputs."""
        self._stopped.set()

    def disconnect(self):
        """Leave the outputs at zero."""
        self._hold_zero()

    def _hold_zero(self):
        import nidaqmx

        with nidaqmx.Task() as task:
            for output in self._outputs:
                task.ao_channels.add_ao_voltage_chan(output, min_val=-LARGEST_V, max_val=LARGEST_V)
            task.write([0.0] * len(self._outputs), auto_start=True)


def ni_daq(settings, clock):
    """Make the device, for the entry point."""
    return converter_device(NiDaq(settings), limits=settings.limits, clock=clock)
