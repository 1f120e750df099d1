"""Arrays of other libraries as a GPU's device sees them, and how threads are shared out; no GPU is needed."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.device.cuda_device import CudaDevice, choose_threads, view_foreign
from eomgen.errors import EomgenError, UsageError


NOTHING = -1  #: stream that waits for nothing


class Foreign:
    """An array that says it lies on a GPU, as CuPy's do."""

    def __init__(self, array: np.ndarray) -> None:
        pointer = array.__array_interface__["data"]
        self.array = array
        self.__cuda_array_interface__ = {
            "shape": array.shape, "typestr": array.dtype.str, "data": pointer, "strides": array.strides, "version": 3,
        }  # fmt: skip


def test_arrays_of_the_host_are_none_of_it() -> None:
    assert view_foreign(np.zeros(3), NOTHING) is None
    assert view_foreign([1.0, 2.0], NOTHING) is None
    assert view_foreign(0.5, NOTHING) is None


@pytest.mark.needs("NVRTC")
def test_arrays_on_a_gpu_are_seen_as_they_are() -> None:
    array = np.zeros((4, 5))
    found = view_foreign(Foreign(array), NOTHING)
    assert (found.ptr, tuple(found.shape)) == (array.ctypes.data, (4, 5))
    view_foreign(Foreign(array[:, :1][:1]), NOTHING)  # steps along a single entry say nothing
    with pytest.raises(UsageError, match="in C order"):
        view_foreign(Foreign(array.T), NOTHING)
    with pytest.raises(UsageError, match="in C order"):
        view_foreign(Foreign(array[:, ::2]), NOTHING)
    with pytest.raises(UsageError, match="must hold float64"):
        view_foreign(Foreign(array.astype(np.float32)), NOTHING)


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
