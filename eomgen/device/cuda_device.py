"""Stage device: a GPU of NVIDIA through cuda-core: memory, copies, kernels; everything runs on its default stream."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from ..errors import MissingDependencyError, UsageError, ill_typed
from .arrays_on_device import Array, DeviceArray
from .nvrtc import INSTALL, best_architecture, compile_device_text

WARP = 32  #: threads that run together
MOST = 4 * WARP  #: threads of a block: more would share the registers of a large model among too few
HOST = 1  #: device type of DLPack


class CudaDevice:
    """One GPU, for the thread that makes it.

    Parameters
    ----------
    number : int, optional
        Which one.

    Raises
    ------
    MissingDependencyError
        cuda-core is not installed, or there is no driver.
    UsageError
        There is no such GPU.
    """

    def __init__(self, number: int = 0) -> None:
        try:
            from cuda import core
        except ImportError as error:
            raise MissingDependencyError(f"cuda-core is not installed; {INSTALL}") from error
        self.core = core
        try:
            self.device = core.Device(number)
            self.device.set_current()
        except Exception as error:  # of several libraries, by what is missing
            raise UsageError(
                f"GPU {number} cannot be used: {error}; is NVIDIA's driver installed?", code="EG-COMPILER-MISSING"
            ) from error
        self.stream = self.device.default_stream
        capability = self.device.compute_capability
        self.architecture = best_architecture((capability.major, capability.minor))
        self.processors = int(self.device.properties.multiprocessor_count)
        self._codes: dict[tuple[int, tuple[str, ...]], Any] = {}

    def empty(self, shape: Sequence[int], dtype: Any) -> DeviceArray:
        """New memory."""
        length = prod(shape) * np.dtype(dtype).itemsize
        buffer = self.device.allocate(max(length, 1), stream=self.stream)
        return DeviceArray(self, int(buffer.handle), shape, dtype, buffer)

    def put(self, array: Array) -> DeviceArray:
        """A copy of an array of the host."""
        source = np.ascontiguousarray(array)
        found = self.empty(source.shape, source.dtype)
        if source.nbytes:
            self._buffer(found).copy_from(self._host(source), stream=self.stream)
            self.stream.sync()  # the array may change afterwards
        return found

    def get(self, array: DeviceArray) -> Array:
        """A copy on the host."""
        found = np.empty(array.shape, array.dtype)
        if found.nbytes:
            self._host(found).copy_from(self._buffer(array), stream=self.stream)
        self.stream.sync()
        return found

    def view(self, given: Any) -> DeviceArray | None:
        """An array of another library that lies on this GPU."""
        if isinstance(given, DeviceArray):
            return given
        told = getattr(given, "__cuda_array_interface__", None)
        if told is not None:
            pointer, shape = read_interface(told)
            if told.get("stream") not in (None, 1):
                self.device.sync()  # until what the other library has under way is done
            return DeviceArray(self, pointer, shape, np.float64, given)
        if not hasattr(given, "__dlpack_device__") or given.__dlpack_device__()[0] == HOST:
            return None
        from cuda.core.utils import StridedMemoryView

        found = StridedMemoryView.from_any_interface(given, stream_ptr=int(self.stream.handle))
        require_plain(found.shape, found.dtype, found.strides)
        return DeviceArray(self, int(found.ptr), found.shape, np.float64, (given, found))

    def kernel(self, text: str, name: str, wanted: Sequence[str]) -> Callable[..., None]:
        """A kernel as ``launch(count, *arguments)``; texts are compiled once."""
        key = (hash(text), tuple(wanted))
        if key not in self._codes:
            code = compile_device_text(text, self.architecture, wanted)
            make = self.core.ObjectCode.from_cubin if self.architecture[:3] == "sm_" else self.core.ObjectCode.from_ptx
            self._codes[key] = make(code)
        kernel = self._codes[key].get_kernel(name)

        def launch(count: int, *arguments: Any) -> None:
            threads = choose_threads(count, self.processors)
            config = self.core.LaunchConfig(grid=-(-count // threads), block=threads)
            values = [a.pointer if isinstance(a, DeviceArray) else a for a in arguments]
            self.core.launch(self.stream, config, kernel, np.int64(count), *values)

        return launch

    def _buffer(self, array: DeviceArray) -> Any:
        return self.core.Buffer.from_handle(array.pointer, array.nbytes, owner=array.owner)

    def _host(self, array: Array) -> Any:
        return self.core.Buffer.from_handle(array.ctypes.data, array.nbytes, owner=array)


def choose_threads(count: int, processors: int) -> int:
    """Threads of a block: whole warps, as few as spread the states over all processors of the GPU."""
    warps = -(-count // WARP)
    return int(min(MOST, WARP * max(1, warps // (4 * processors))))


def read_interface(told: Mapping[str, Any]) -> tuple[int, tuple[int, ...]]:
    """Pointer and shape of a ``__cuda_array_interface__``.

    Raises
    ------
    UsageError
        See :func:`require_plain`.
    """
    shape, dtype = tuple(told["shape"]), np.dtype(told["typestr"])
    strides = told.get("strides")
    require_plain(shape, dtype, None if strides is None else [step // dtype.itemsize for step in strides])
    return int(told["data"][0]), shape


def require_plain(shape: Sequence[int], dtype: Any, strides: Sequence[int] | None) -> None:
    """Refuse what kernels cannot read.

    Parameters
    ----------
    shape, dtype
    strides : sequence of int, optional
        In numbers, not in bytes; in C order if None.

    Raises
    ------
    UsageError
        It holds other numbers than float64, or not in C order.
    """
    if dtype != np.float64:
        raise ill_typed(f"an array on the GPU must hold float64 (double), not {dtype}")
    plain = [prod(shape[k + 1 :]) for k in range(len(shape))]
    steps = plain if strides is None or not prod(shape) else strides
    if any(n > 1 and step != wanted for n, step, wanted in zip(shape, steps, plain, strict=True)):
        raise ill_typed("an array on the GPU must lie in C order, without gaps; make a contiguous copy")
