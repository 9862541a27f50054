"""What the system tests share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from _pytest.runner import runtestprotocol

from tests.test_device.contract import STOOD_STILL

if TYPE_CHECKING:
    from pathlib import Path

MAX_REPEATS = 2
"""A contract test is repeated so often where it failed because the machine stood still."""


@pytest.fixture(scope="session")
def firmware_build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the firmware is compiled, once for each target."""
    return tmp_path_factory.mktemp("firmware")


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test; a failed contract test again, on a new rig, if the machine stood still."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for n_repeats in range(MAX_REPEATS + 1):
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        has_failed = any(report.failed for report in reports)
        stood_still = item.stash.get(STOOD_STILL, lambda: False)
        if not has_failed or not stood_still() or n_repeats == MAX_REPEATS:
            break
        item._initrequest()  # type: ignore[attr-defined] # fixtures are made anew
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True
