from .noise import NoiseError, NoiseFacts, NoiseHealth, NoisePlayer, SilentNoise, noise_player
from .rig import (
    QUESTION,
    Confirmation,
    Rig,
    assemble,
    chosen_settings,
    confirmed_now,
    mock_device,
    require_confirmed,
)
from .slots import (
    SLOTS,
    SuitabilityError,
    host_limits,
    load_condition,
    onset_interval_s,
    require_playable,
    require_suitable,
)

__all__ = [
    "QUESTION",
    "SLOTS",
    "Confirmation",
    "NoiseError",
    "NoiseFacts",
    "NoiseHealth",
    "NoisePlayer",
    "Rig",
    "SilentNoise",
    "SuitabilityError",
    "assemble",
    "chosen_settings",
    "confirmed_now",
    "host_limits",
    "load_condition",
    "mock_device",
    "noise_player",
    "onset_interval_s",
    "require_confirmed",
    "require_playable",
    "require_suitable",
]
