"""A GPU of NVIDIA through cuda-core: compilation by NVRTC, memory, copies, kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any, Protocol

import numpy as np

from ...errors import MissingDependencyError, ToolchainError, UsageError, ill_typed

# -- arrays ------------------------------------------------------------------------------------------------------------


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

    def view(self, raw: Any) -> DeviceArray | None:
        """An array of another library without a copy; None if it does not lie on this device."""

    def kernel(self, text: str, name: str, wanted: Sequence[str]) -> Callable[..., None]:
        """A kernel of a text as ``launch(count, *arguments)``, compiled with macros defined.

        Arguments are DeviceArrays, whose pointers are handed on, and scalars of NumPy.
        """


# -- compilation -------------------------------------------------------------------------------------------------------


#: Packages of programs on a device, besides NumPy.
CUDA_REQUIREMENTS = ("cuda-core>=1.0", "cuda-bindings>=13.0", "nvidia-cuda-nvrtc>=13.0")
INSTALL = f"pip install {' '.join(repr(name) for name in CUDA_REQUIREMENTS)}"


def compile_device_text(text: str, architecture: str, wanted: Sequence[str] = (), options: Sequence[str] = ()) -> bytes:
    """Compile a text for an architecture: ``sm_90`` for machine code, ``compute_90`` for PTX, which the driver
    compiles.

    ``wanted`` are macros to define, ``EOMGEN_WANT_...`` of the kernels; ``options`` further ones of NVRTC.  Where NVRTC
    refuses the text, ``output`` of the ToolchainError is its log.
    """
    return compile_with_log(text, architecture, wanted, options)[0]


def compile_with_log(
    text: str, architecture: str, wanted: Sequence[str] = (), options: Sequence[str] = ()
) -> tuple[bytes, str]:
    """The same with what NVRTC says: warnings, and registers with ``--ptxas-options=-v``."""
    nvrtc = load_nvrtc()
    flags = [
        f"--gpu-architecture={architecture}",
        "--device-as-default-execution-space",  # the text is C: every function is one of the device
        "--disable-warnings",  # of helpers that a model does not use
        *(f"--define-macro={macro}" for macro in wanted),
        *options,
    ]
    program = _done(nvrtc, nvrtc.nvrtcCreateProgram(text.encode(), b"model.cu", 0, [], []))
    try:
        (status,) = nvrtc.nvrtcCompileProgram(program, len(flags), [flag.encode() for flag in flags])
        log = _buffer(_done(nvrtc, nvrtc.nvrtcGetProgramLogSize(program)))
        _done(nvrtc, nvrtc.nvrtcGetProgramLog(program, log))
        said = log.decode(errors="replace").strip("\0 \n")
        if int(status) != 0:
            raise ToolchainError(f"NVRTC could not compile for {architecture}", " ".join(("nvrtc", *flags)), said)
        sizes, gets = (
            (nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN)
            if architecture.startswith("sm_")
            else (nvrtc.nvrtcGetPTXSize, nvrtc.nvrtcGetPTX)
        )
        length = _done(nvrtc, sizes(program))
        code = _buffer(length)
        _done(nvrtc, gets(program, code))
        return code[:length], said
    finally:
        nvrtc.nvrtcDestroyProgram(program)


def best_architecture(capability: tuple[int, int]) -> str:
    """What to compile for a GPU of a compute capability: its machine code, or PTX where NVRTC is older than the GPU."""
    nvrtc = load_nvrtc()
    known = _done(nvrtc, nvrtc.nvrtcGetSupportedArchs())
    own = 10 * capability[0] + capability[1]
    if own in known:
        return f"sm_{own}"
    return f"compute_{max((number for number in known if number < own), default=min(known))}"


def load_nvrtc() -> Any:
    """The module ``cuda.bindings.nvrtc`` with its library."""
    try:
        from cuda.bindings import nvrtc

        nvrtc.nvrtcVersion()
    except (ImportError, RuntimeError) as error:  # without the library it raises RuntimeError, or one derived from it
        raise MissingDependencyError(f"NVRTC is not installed; {INSTALL}") from error
    return nvrtc


def _buffer(length: int) -> bytes:
    """Bytes that NVRTC writes into.  Python has each single byte only once, for everybody: so never one alone."""
    return bytes(length + 1)


def _done(nvrtc: Any, answer: Any) -> Any:
    """The value of an answer (status, value); a status that is not 0 is a defect, of the machine or of eomgen."""
    status, *values = answer
    if int(status) != 0:
        raise ToolchainError(f"NVRTC failed: {nvrtc.nvrtcGetErrorString(status)[1].decode()}", "nvrtc")
    return values[0] if values else None


# -- the device --------------------------------------------------------------------------------------------------------


WARP = 32  #: threads that run together
MOST = 4 * WARP  #: threads of a block: more would share the registers of a large model among too few
HOST = 1  #: device type of DLPack


class CudaDevice:
    """One GPU, for the thread that makes it.

    Parameters
    ----------
    number : int, optional
        Which one.
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
        result = self.empty(source.shape, source.dtype)
        if source.nbytes:
            self._buffer(result).copy_from(self._host(source), stream=self.stream)
            self.stream.sync()  # the array may change afterwards
        return result

    def get(self, array: DeviceArray) -> Array:
        """A copy on the host."""
        result = np.empty(array.shape, array.dtype)
        if result.nbytes:
            self._host(result).copy_from(self._buffer(array), stream=self.stream)
        self.stream.sync()
        return result

    def view(self, raw: Any) -> DeviceArray | None:
        """An array of another library that lies on this GPU."""
        if isinstance(raw, DeviceArray):
            return raw
        interface = getattr(raw, "__cuda_array_interface__", None)
        if interface is not None:
            pointer, shape = read_interface(interface)
            if interface.get("stream") not in (None, 1):
                self.device.sync()  # until what the other library has under way is done
            return DeviceArray(self, pointer, shape, np.float64, raw)
        if not hasattr(raw, "__dlpack_device__") or raw.__dlpack_device__()[0] == HOST:
            return None
        from cuda.core.utils import StridedMemoryView

        result = StridedMemoryView.from_any_interface(raw, stream_ptr=int(self.stream.handle))
        require_plain(result.shape, result.dtype, result.strides)
        return DeviceArray(self, int(result.ptr), result.shape, np.float64, (raw, result))

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


def read_interface(interface: Mapping[str, Any]) -> tuple[int, tuple[int, ...]]:
    """Pointer and shape of a ``__cuda_array_interface__``.

    Raises
    ------
    UsageError
        See :func:`require_plain`.
    """
    shape, dtype = tuple(interface["shape"]), np.dtype(interface["typestr"])
    strides = interface.get("strides")
    require_plain(shape, dtype, None if strides is None else [step // dtype.itemsize for step in strides])
    return int(interface["data"][0]), shape


def require_plain(shape: Sequence[int], dtype: Any, strides: Sequence[int] | None) -> None:
    """Refuse what kernels cannot read.

    Parameters
    ----------
    shape, dtype
    strides : sequence of int, optional
        In numbers, not in bytes; in C order if None.
    """
    if dtype != np.float64:
        raise ill_typed(f"an array on the GPU must hold float64 (double), not {dtype}")
    plain = [prod(shape[k + 1 :]) for k in range(len(shape))]
    steps = plain if strides is None or not prod(shape) else strides
    if any(n > 1 and step != wanted for n, step, wanted in zip(shape, steps, plain, strict=True)):
        raise ill_typed("an array on the GPU must lie in C order, without gaps; make a contiguous copy")
