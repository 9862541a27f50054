"""The burst of most tests, a device made ready to play it, and the reason of a refusal."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device import Identity, RefusedError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from device import BurstDevice, Delivery, Refusal

IDENTITY = Identity(
    model="core",
    serial_number="core",
    boot_id=1,
    protocol_version="2.0",
    sample_rate_hz=48_000.0,
    bits=16,
    channels=2,
    ceiling_vpp=200.0,
    longest_waveform=65_536,
    emulated=True,
)


def identity(**changed: Any) -> Identity:
    """Return who answers, but for what is changed."""
    return replace(IDENTITY, **changed)


def sine(n_samples: int = 97, *, peak: float = 1.0, cycles: int = 1) -> NDArray[np.float64]:
    """Return whole cycles from exactly 0 to exactly 0."""
    samples = peak * np.sin(2 * np.pi * cycles * np.arange(n_samples) / (n_samples - 1))
    samples[-1] = 0.0
    return samples


BURST = sine()
SILENCE = np.zeros_like(BURST)


def changed(index: int, value: float) -> NDArray[np.float64]:
    """Return the burst with one other sample."""
    samples = BURST.copy()
    samples[index] = value
    return samples


def ready(
    device: BurstDevice, level_vpp: float = 0.0, *, burst: NDArray[np.float64] = BURST
) -> Identity:
    """Have a device live: slot 0 plays left, slot 1 right."""
    who = device.open()
    device.load(0, np.stack([burst, 0 * burst]))
    device.load(1, np.stack([0 * burst, burst]))
    device.enable()
    device.set_levels([level_vpp, level_vpp])
    return who


def play(device: BurstDevice, token: int, slot: int = 0, *, within_s: float = 1.0) -> Delivery:
    device.arm(token, slot, time_to_live_s=within_s)
    return device.fire(token)


def refusal(call: Callable[[], object], kind: type[RefusedError] = RefusedError) -> Refusal:
    with pytest.raises(kind) as refused:
        call()
    return refused.value.code
