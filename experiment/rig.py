"""The device and the clock that a session is run with, by the names of the command line."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from device.mock import DEVICE_LIMITS, MockDevice
from device.output import OutputStage
from experiment.stimulus import host_limits

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from device.clock import Clock
    from device.driver import BurstDevice
    from experiment.study import Study


def mock_device(study: Study, clock: Clock) -> MockDevice:
    """Return a mock device under the study's limits.

    Parameters
    ----------
    study : Study
        Gives the ceiling, the rest between bursts and the sample rate.
    clock : Clock
        The host's clock.
    """
    limits = host_limits(study.device)
    return MockDevice(
        clock,
        limits=limits,
        device_limits=replace(DEVICE_LIMITS, least_interval_s=limits.least_interval_s),
        output=OutputStage(sample_rate_hz=study.device.sample_rate_hz),
    )


DRIVERS: Mapping[str, Callable[[Study, Clock], BurstDevice]] = {"mock": mock_device}
"""Every driver by its name in the study file and on the command line."""
