"""Stage device: arrays in the memory of a device, and what a device has to offer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any, Protocol

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


class DeviceArray:
    """Numbers in the memory of a device, in C order.

    CuPy, PyTorch and Numba take it as it is (``cupy.asarray(a)``), without a copy; ``a.numpy()`` is a copy on the host.

    Attributes
    ----------
    pointer : int
    shape : tuple of int
    dtype : numpy.dtype
    """

    def __init__(self, device: Device, pointer: int, shape: Sequence[int], dtype: Any, owner: object) -> None:
        self.device, self.pointer, self.shape, self.dtype = device, pointer, tuple(shape), np.dtype(dtype)
        self.owner = owner  #: keeps the memory

    @property
    def nbytes(self) -> int:
        """Length in bytes."""
        return prod(self.shape) * int(self.dtype.itemsize)

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        # stream 1: the default stream, on which everything of a DeviceModule runs
        return {
            "shape": self.shape,
            "typestr": self.dtype.str,
            "data": (self.pointer, False),
            "version": 3,
            "stream": 1,
        }

    def numpy(self) -> Array:
        """A copy on the host, when all that comes before it is done."""
        return self.device.get(self)

    def reshaped(self, shape: Sequence[int]) -> DeviceArray:
        """The same numbers in another shape."""
        return DeviceArray(self.device, self.pointer, shape, self.dtype, self.owner)

    def __repr__(self) -> str:
        return f"DeviceArray({self.shape}, {self.dtype})"


class Device(Protocol):
    """What runs kernels: a GPU, or anything else with memory of its own."""

    def empty(self, shape: Sequence[int], dtype: Any) -> DeviceArray:
        """New memory."""

    def put(self, array: Array) -> DeviceArray:
        """A copy of an array of the host, in C order."""

    def get(self, array: DeviceArray) -> Array:
        """A copy on the host."""

    def view(self, given: Any) -> DeviceArray | None:
        """An array of another library without a copy; None if it does not lie on this device."""

    def kernel(self, text: str, name: str, wanted: Sequence[str]) -> Callable[..., None]:
        """A kernel of a text as ``launch(count, *arguments)``, compiled with macros defined.

        Arguments are DeviceArrays, whose pointers are handed on, and scalars of NumPy.
        """
