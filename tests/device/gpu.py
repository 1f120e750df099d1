"""The GPU as the tests of devices use it."""

from __future__ import annotations

import numpy as np

from eomgen.device.arrays_on_device import DeviceArray
from eomgen.device.cuda_device import CudaDevice


class OnGpu:
    """An array of another library: it says where it lies and which memory it keeps, and no more."""

    def __init__(self, array: DeviceArray) -> None:
        self.array, self.__cuda_array_interface__ = array, array.__cuda_array_interface__


class Gpu(CudaDevice):
    """See :class:`eomgen.device.cuda_device.CudaDevice`; it counts copies to the GPU."""

    def __init__(self) -> None:
        super().__init__()
        self.copies = 0

    def put(self, array: np.ndarray) -> DeviceArray:
        self.copies += 1
        return super().put(array)

    def foreign(self, array: np.ndarray) -> OnGpu:
        """An array as another library would hold it on the GPU."""
        return OnGpu(super().put(array))
