"""What runs the kernels in these tests: the processor, and where there is one, a GPU."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from device.gpu import Gpu
from device.host_device import HostDevice


@pytest.fixture(params=["host", pytest.param("gpu", marks=pytest.mark.needs("a GPU"))])
def device(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """A device of the test's own."""
    return HostDevice(tmp_path) if request.param == "host" else Gpu()
