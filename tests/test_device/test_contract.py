"""The contract of devices, on every driver whose device can be emulated in this process."""

import pytest

from tests.test_device import rigs
from tests.test_device.contract import DeviceContract


class TestContract(DeviceContract):
    @staticmethod
    def implementations(config: pytest.Config) -> rigs.Rigs:
        return rigs.VIRTUAL
