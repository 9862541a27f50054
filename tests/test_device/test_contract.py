"""The contract of devices, on every driver whose device can be emulated in this process."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.test_device import rigs
from tests.test_device.contract import DeviceContract

if TYPE_CHECKING:
    import pytest


class TestContract(DeviceContract):
    @staticmethod
    def implementations(config: pytest.Config) -> rigs.Rigs:
        return rigs.VIRTUAL
