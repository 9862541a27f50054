"""What the system tests share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.test_device.contract import STOOD_STILL

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path


@pytest.fixture(scope="session")
def firmware_build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the firmware is compiled, once for each target."""
    return tmp_path_factory.mktemp("firmware")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Report a failed contract test as skipped, with what failed, if the machine stood still.

    Nothing can be said then of a device that has to hear from its host within a time.
    """
    report = yield
    stood_still = item.stash.get(STOOD_STILL, lambda: False)
    if report.failed and call.excinfo is not None and stood_still():
        path, line, _ = item.location
        failure = call.excinfo.exconly().partition("\n")[0]
        report.outcome = "skipped"
        report.longrepr = (path, (line or 0) + 1, f"the machine stood still: {failure}")
    return report
