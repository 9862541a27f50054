"""The contract of devices, behind real lines and on whatever the command line names.

With ``--device-command`` on what a command starts, such as firmware, with ``--device-url`` on real
hardware, with ``--driver NAME --port P`` on an installed driver of a lab's own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.test_device import rigs
from tests.test_device.contract import DeviceContract

if TYPE_CHECKING:
    import pytest


class TestContract(DeviceContract):
    @staticmethod
    def implementations(config: pytest.Config) -> rigs.Rigs:
        return rigs.EMULATED | rigs.given_rigs(config)
