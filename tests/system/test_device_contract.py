"""The contract of devices, behind real lines, on the firmware, and on what the command line names.

With ``--device-url`` on real hardware, with ``--driver NAME --port P`` on an installed driver of a
lab's own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.system.firmware import FIRMWARE_RIGS
from tests.test_device import rigs
from tests.test_device.contract import DeviceContract

if TYPE_CHECKING:
    import pytest


class TestContract(DeviceContract):
    @staticmethod
    def implementations(config: pytest.Config) -> rigs.Rigs:
        return rigs.EMULATED | FIRMWARE_RIGS | rigs.given_rigs(config)
