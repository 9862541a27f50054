"""Any outputs of a sound card as a driver: `channels = [3, 4]` in [device].

Offer it as an entry point of the group tactstrip.drivers. Not tried with an actuator behind it.
"""

import numpy as np

from device import Converter, LinkError, Outcome, Played, converter_device


class SoundCardChannels(Converter):
    """What plays waveforms on chosen outputs of a card with several."""

    name, bits, emulated = "sound card", 16, False
    cannot = (
        "hold a ceiling of its own: a mixer's volume changes what full scale is",
        "cut short what the sound card was given already",
        "tell the onset better than within the time that the sound system takes",
    )

    def __init__(self, settings):
        if settings.port is None or settings.volts_full_scale is None:
            raise ValueError("port and volts_full_scale must be given for the driver")
        self.serial_number = settings.port
        self.sample_rate_hz = settings.sample_rate_hz
        self.full_scale_v = settings.volts_full_scale
        self.channels = len(settings.channels)
        self._outputs = settings.channels

    def connect(self):
        """Refuse a card that is not there, or has too few outputs."""
        import sounddevice

        try:
            card = sounddevice.query_devices(self.serial_number, "output")
        except (ValueError, sounddevice.PortAudioError) as error:
            raise LinkError(f"the sound card {self.serial_number}: {error}") from error
        if card["max_output_channels"] < max(self._outputs):
            raise LinkError(
                f"channels must be at most {card['max_output_channels']} on {card['name']}, "
                f"got {list(self._outputs)}"
            )

    def play(self, volts):
        """Play once; FIRED only if the card told of no gap."""
        import sounddevice

        frames = volts.T / self.full_scale_v
        sounddevice.play(
            frames.astype(np.float32),
            samplerate=self.sample_rate_hz,
            device=self.serial_number,
            mapping=list(self._outputs),
            blocking=True,
        )
        gap = sounddevice.get_status()
        return Played(outcome=Outcome.INDETERMINATE if gap else Outcome.FIRED)

    def zero(self):
        """Stop the stream; without one the card plays nothing."""
        import sounddevice

        sounddevice.stop()

    def disconnect(self):
        """Leave nothing open."""
        self.zero()


def sound_card_channels(settings, clock):
    """Make the device, for the entry point."""
    return converter_device(SoundCardChannels(settings), limits=settings.limits, clock=clock)
