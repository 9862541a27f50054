"""Ten thousand bursts with a fault, measured on a line in this process."""

from __future__ import annotations

import pytest

from tests.long.test_fuzz import rounds
from tests.test_device.monitors import check_bursts


@pytest.mark.parametrize("noise_db", [20.0, 40.0])
@pytest.mark.parametrize("seed", range(100, 110))
def test_every_fault_is_caught_and_no_good_burst_is_blamed(noise_db: float, seed: int) -> None:
    check_bursts(rounds(500), noise_db=noise_db, seed=seed)
