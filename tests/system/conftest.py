"""What the system tests share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="session")
def firmware_build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the firmware is compiled, once for each target."""
    return tmp_path_factory.mktemp("firmware")
