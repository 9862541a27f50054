from .audio import audio_device
from .player import LoopPlayer
from .recorder import Recorder
from .stream import (
    Callback,
    Stream,
    in_a_thread,
    open_inputs,
    open_stream,
    sound_cards,
    sound_lack,
    stderr_kept,
)

__all__ = [
    "Callback",
    "LoopPlayer",
    "Recorder",
    "Stream",
    "audio_device",
    "in_a_thread",
    "open_inputs",
    "open_stream",
    "sound_cards",
    "sound_lack",
    "stderr_kept",
]
