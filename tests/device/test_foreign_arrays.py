"""Arrays of other libraries as a GPU's device sees them, and how threads are shared out; no GPU is needed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from eomgen.device.cuda_device import CudaDevice, choose_threads, read_interface
from eomgen.errors import EomgenError, UsageError


def interface(array: np.ndarray) -> dict[str, Any]:
    """What an array says that lies on a GPU, as CuPy's do."""
    own = array.__array_interface__
    return {
        "shape": own["shape"],
        "typestr": own["typestr"],
        "data": own["data"],
        "strides": array.strides,
        "version": 3,
    }


def test_arrays_on_a_gpu_are_read_as_they_are() -> None:
    array = np.zeros((4, 5))
    assert read_interface(interface(array)) == (array.ctypes.data, (4, 5))
    assert read_interface({**interface(array), "strides": None}) == (array.ctypes.data, (4, 5))
    assert read_interface(interface(array[:1, :1]))[1] == (1, 1)  # steps along a single entry say nothing
    assert read_interface(interface(array[:, ::2][:, :0]))[1] == (4, 0)
    for bad in (array.T, array[:, ::2], array[::2]):
        with pytest.raises(UsageError, match="in C order"):
            read_interface(interface(bad))
    for kind in (np.float32, np.int64, ">f8"):
        with pytest.raises(UsageError, match="must hold float64"):
            read_interface(interface(array.astype(kind)))


def test_blocks_are_small_until_every_processor_has_some() -> None:
    assert choose_threads(1, 132) == 32
    assert choose_threads(4096, 132) == 32  # 128 blocks
    assert choose_threads(65_536, 132) == 96
    assert choose_threads(1_000_000, 132) == 128
    for count in (1, 33, 5000, 70_000):
        assert choose_threads(count, 132) % 32 == 0


def test_without_a_gpu_a_named_error_says_what_is_missing() -> None:
    with pytest.raises(EomgenError, match=r"cuda-core is not installed; pip install|is NVIDIA's driver installed"):
        CudaDevice(987)
