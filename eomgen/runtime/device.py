"""The text of a model and a device, such as a GPU of NVIDIA -> its functions for many states at once, and its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.value_rules import read_count
from ..errors import (
    MissingDependencyError,
    ToolchainError,
    UsageError,
    cannot,
    ill_shaped,
    ill_typed,
    incomplete,
    no_choice,
    no_such,
)
from .ensembles.block import RunBlock
from .layout import ModelInfo
from .runs.run_arguments import declare, declared_step, find_span, ordered_times, steps_of
from .trajectory import Span

if TYPE_CHECKING:
    from .bound_model import BoundModel

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
    version = 10 * capability[0] + capability[1]
    if version in known:
        return f"sm_{version}"
    return f"compute_{max((number for number in known if number < version), default=min(known))}"


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


# -- functions of a model on a device ----------------------------------------------------------------------------------


#: Kernels of a device that are called with the time first, as functions of a module; others take it by name.
TIMED_ON_DEVICE = ("rhs", "jacobian", "bias", "outputs", "events")

# States are columns, as in the batches of a module: an array (n, k) in C order holds k of them.


class DeviceModule:
    """The functions of a model on a device.

    ``rhs(t, x, p=None, u=None)`` and the others have the arguments of a module: x (n_x,) or (n_x, k); t, p and u the
    same for all states, or (k,), (n_p, k), (n_u, k).  Arrays of NumPy are copied to the device and the result comes
    back as an array of NumPy; where one of the states is an array on the device (of CuPy, PyTorch, JAX or Numba), the
    result is a :class:`DeviceArray`.  An entry is NaN where the state has no value there; with
    ``status=True`` the result is (result, status), with 0 where all is well.

    Parameters
    ----------
    text : str
        Device code, as ``emit_device_text`` gives it.
    facts : mapping
        As ``describe_device`` gives them.
    metadata : mapping
        Of the model.
    device : Device, optional
        The first GPU by default.

    Attributes
    ----------
    q_names, v_names, x_names, u_names, p_names, y_names : tuple of str
    p, u : arrays
        Declared values.
    x0 : (n_x,) array
        A consistent state.
    """

    def __init__(
        self, text: str, facts: Mapping[str, Any], metadata: Mapping[str, Any], device: Device | None = None
    ) -> None:
        if device is None:
            device = CudaDevice()
        self.device, self.text, self.facts, self.metadata = device, text, facts, dict(metadata)
        self.info = info = ModelInfo.of(metadata)
        self.name = str(facts["name"])
        self.q_names, self.v_names, self.u_names, self.p_names, self.y_names, self.body_names = (
            tuple(getattr(info, f"{kind}_names")) for kind in ("q", "v", "u", "p", "y", "body")
        )
        self.x_names = self.q_names + self.v_names
        self.n_q, self.n_v, self.n_x = len(self.q_names), len(self.v_names), len(self.x_names)
        self.n_u, self.n_p, self.n_dof = len(self.u_names), len(self.p_names), info.sizes.n_dof
        self.p, self.u = (np.array(values, dtype=float) for values in (info.p_values, info.u_values))
        self.x0 = np.array(facts["x0"], dtype=float)
        for declared in (self.p, self.u, self.x0):
            declared.flags.writeable = False  # the device may hold them already
        self._constants: DeviceArray | None = None
        self._there: dict[str, tuple[bytes, DeviceArray]] = {}
        self._kernels: dict[str, Callable[..., None]] = {}
        self._calls: dict[str, BatchCall] = {}
        for name, (ports, shape) in facts["kernels"].items():
            self._calls[name] = BatchCall(self, name, [(port, int(n)) for port, n in ports], tuple(shape))
        vars(self).update(self._calls)

    def call(self, name: str) -> BatchCall:
        """One of the functions, by its name."""
        return self._calls[name]

    def kernel(self, name: str, *wanted: str) -> Callable[..., None]:
        """A kernel of the text, compiled at the first call."""
        if name not in self._kernels:
            macros = tuple(f"EOMGEN_WANT_{want.upper()}" for want in wanted)
            self._kernels[name] = self.device.kernel(self.text, f"{self.name}_{name}", macros)
        return self._kernels[name]

    def columns(self, label: str, raw: Any, length: int, count: int | None = None) -> tuple[DeviceArray, int | None]:
        """Numbers (length,) or (length, k) on the device, and k, or None where they are one column."""
        result: DeviceArray | Array | None = self.device.view(raw)
        if result is None:
            try:
                result = np.asarray(raw, dtype=float)
            except (TypeError, ValueError):
                raise ill_typed(f"{label} must be an array of numbers, not {type(raw).__name__}") from None
        shape = tuple(result.shape)
        if len(shape) not in (1, 2) or shape[0] != length or (len(shape) == 2 and count not in (None, 1, shape[1])):
            wanted = f"({length},) or ({length}, {'k' if count in (None, 1) else count})"
            raise ill_shaped(f"{label} must have shape {wanted}, not {shape}")
        on_device = result if isinstance(result, DeviceArray) else self.device.put(result)
        return on_device, shape[1] if len(shape) == 2 else None

    def kept(self, label: str, raw: Array) -> DeviceArray:
        """Numbers on the device; those of the last call where they are the same."""
        signature, result = self._there.get(label, (None, None))
        if result is None or signature != raw.tobytes():
            result = self.device.put(raw)
            self._there[label] = (raw.tobytes(), result)
        return result

    def constants(self, p: Any, count: int) -> tuple[DeviceArray, bool]:
        """What kernels take in place of parameters, and whether each state has its own."""
        if p is None and self._constants is not None:
            return self._constants, False
        raw, each = self.columns("p", self.p if p is None else p, self.n_p, count)
        columns = 1 if each is None else each
        result = self.device.empty((self.facts["n_const"], columns), np.float64)
        if columns:
            self.kernel("constants")(columns, raw, result)
        if p is None:
            self._constants = result
        return result, each is not None

    def simulate_many(
        self,
        span: Span,
        x0: Any,
        p: Any = None,
        u: Any = None,
        *,
        method: str | None = None,
        t_eval: ArrayLike | None = None,
        rtol: float | None = None,
        atol: ArrayLike | None = None,
        max_step: float | None = None,
        first_step: float | None = None,
        step: float | None = None,
        max_steps: int = 1_000_000,
        keep_events: int = 16,
    ) -> RunBlock:
        """Integrate the equations of motion from many states, every run with steps of its own.

        Parameters
        ----------
        span : (float, float) or float
            Times of start and end, or the end of a run from 0.
        x0 : (n_x, k) array
            Where the runs start, on the constraints; also an array on the device.
        p, u : (n_p,) or (n_p, k), (n_u,) or (n_u, k) arrays, optional
            Parameters and constant inputs; the declared values by default.
        method : {'DOP853', 'RK4'}, optional
            DOP853 controls its steps, each run its own; RK4 takes steps of the size `step`.
        t_eval : (m,) array, optional
            Times to store; the end alone by default.
        rtol, atol, max_step, first_step
            As for ``simulate``.
        step : float, optional
            Size of the steps of RK4 (s), and only of it.
        max_steps : int
            A run that takes more is given up.
        keep_events : int
            Events of the model to keep of each run, the first ones.

        Returns
        -------
        RunBlock
            With arrays of NumPy: what became of the runs, as of a block of an ensemble.

        Raises
        ------
        UsageError
            Wrong shapes or values; a model whose runs need Python.
        """
        options = {"rtol": rtol, "atol": atol, "max_step": max_step, "first_step": first_step}
        if self.facts["no_runs"]:
            raise cannot(f"simulate_many of {self.name!r} on a device: {self.facts['no_runs']}")
        like = cast("BoundModel", self)  # metadata and n_dof are all that is read
        declared, device, n = declare(like), self.device, self.n_x
        start, end = find_span(span, float(declared["end"]))
        if self.info.clocks and (start != 0.0 or end < 0.0):
            raise cannot(
                "runs on a device of a model with sampled states begin at 0 s and go forward, not from "
                f"{start:.6g} s to {end:.6g} s; use simulate_many of the module"
            )
        method, step = declared_step(like, declared["method"] if method is None else method, step)
        methods = [name.upper() for name in self.facts["methods"]]
        if method not in methods:
            raise no_choice(f"no method {method!r} on a device; there are {', '.join(methods)}")
        chosen = steps_of(like, (start, end), method, step, options)
        if not isinstance(chosen["rtol"], float):
            raise ill_shaped(f"rtol must be one number on a device, not of shape {np.shape(chosen['rtol'])}")
        times = np.empty(0) if t_eval is None else ordered_times(t_eval, start, end, n)
        most, keep = read_count("max_steps", max_steps, 1), read_count("keep_events", keep_events, 1)
        states, count = self.columns("x0", x0, n)
        if count is None:
            states, count = states.reshaped((n, 1)), 1
        parameters, each_p = self.columns("p", self.p if p is None else p, self.n_p, count)
        inputs, each_u = self.columns("u", self.u if u is None else u, self.n_u, count)
        events = len(self.info.events)
        kept = keep if events else 0
        shapes = {
            "times": (len(times),), "samples": (count, len(times), n), "x": (n, count), "t": (count,),
            "status": (count,), "counts": (3, count), "failure": (count,), "failure_time": (count,),
            "notes": (count, kept, 2 + n), "noted": (count,),
        }  # fmt: skip
        kinds = {"status": np.int32, "failure": np.int32, "counts": np.int64, "noted": np.int64}
        made = {name: device.empty(shape, kinds.get(name, np.float64)) for name, shape in shapes.items()}
        if events:
            made["notes"] = device.put(np.full(shapes["notes"], np.nan))
        results = ("times", "samples", "x", "t", "status", "counts", "failure", "failure_time")
        launch = self.kernel(f"{method.lower()}_runs", "runs", method)
        if not count:
            raise ill_shaped("x0 holds no states; give one column for each run")
        nodes, tolerances = device.put(np.array([start, end])), device.put(np.broadcast_to(chosen["atol"], (n,)) * 1.0)
        launch(
            count, nodes, np.int32(2), states, parameters, np.int64(each_p is not None), inputs,
            np.int64(each_u is not None), np.float64(chosen["rtol"]), tolerances,
            np.float64(chosen.get("max_step", np.inf)), np.float64(chosen.get("first_step", 0.0)), np.int64(most),
            device.put(times), np.int64(len(times)), *(made[name] for name in results),
            *((made["notes"], np.int64(kept), made["noted"]) if events else ()),
        )  # fmt: skip
        result = {name: made[name].numpy() for name in shapes if name != "times"}
        steps, rejected, evaluations = result["counts"]
        x = _projected(self, result["x"], result["t"], p, u)
        samples = None
        if t_eval is not None:
            samples = np.ascontiguousarray(result["samples"].transpose(2, 1, 0))
            every = np.broadcast_to(times[:, None], samples.shape[1:])
            samples = _projected(self, samples, every, p, u)
        notes = None
        if events:
            notes = np.ascontiguousarray(result["notes"].transpose(2, 1, 0))
            notes[2:] = _projected(self, notes[2:], notes[1], p, u)
        return RunBlock(
            x, result["t"], samples, result["status"], result["failure"], result["failure_time"], steps, rejected,
            evaluations, result["noted"] if events else np.zeros(count, dtype=np.int64), notes,
        )  # fmt: skip


def _projected(module: DeviceModule, x: Array, t: Array, p: Any, u: Any) -> Array:
    """States (n_x, ..., k) at times (..., k) brought onto the constraints; NaN stays NaN."""
    if "project" not in module.facts["kernels"] or not x.size:
        return x
    flat = np.ascontiguousarray(x.reshape(x.shape[0], -1))
    repeated = [None if raw is None else _repeated(module, raw, flat.shape[1] // x.shape[-1]) for raw in (p, u)]
    result = module.call("project")(flat, *repeated, t=np.ascontiguousarray(t).ravel())
    return np.asarray(result).reshape(x.shape)


def _repeated(module: DeviceModule, raw: Any, times: int) -> Any:
    """Parameters of k runs for as many states of each."""
    there = module.device.view(raw)
    array = np.asarray(raw, dtype=float) if there is None else there.numpy()
    return np.tile(array, (1, times)) if array.ndim == 2 else array


class BatchCall:
    """One function of a model on a device."""

    def __init__(
        self, module: DeviceModule, name: str, ports: Sequence[tuple[str, int]], shape: tuple[int, ...]
    ) -> None:
        self.module, self.name, self.ports, self.shape = module, name, ports, shape
        labels = [port for port, _ in ports]
        self.labels = ["t", *labels, "p", "u"] if name in TIMED_ON_DEVICE else [*labels, "p", "u", "t"]

    def __call__(self, *raw: Any, status: bool = False, **named: Any) -> Any:
        """Evaluate at one state or many."""
        module, device = self.module, self.module.device
        values = self._values(raw, named)
        collected, count, batch = [], 1, False
        for port, length in self.ports:
            array, each = module.columns(port, values[port], length, count if batch else None)
            collected.append((array, each))
            count, batch = (count, batch) if each is None else (each, True)
        if any((1 if each is None else each) != count for _, each in collected):
            raise ill_shaped(f"{' and '.join(port for port, _ in self.ports)} must have the same number of columns")
        t, each_t = self._times(values["t"], count)
        given_u = module.kept("u", module.u) if values["u"] is None else values["u"]
        u, each_u = module.columns("u", given_u, module.n_u, count)
        c, each_c = module.constants(values["p"], count)
        if not batch and (each_t or each_u is not None or each_c):
            raise ill_shaped(f"{self.ports[0][0]} is one state, so t, p and u must be too")
        result = device.empty((prod(self.shape), count), np.float64)
        codes = device.empty((count,), np.int32)
        launch = module.kernel(f"{self.name}_batch", self.name)
        flags = [np.int64(each) for each in (each_t, each_u is not None, each_c)]
        if count:
            launch(count, t, flags[0], *(array for array, _ in collected), u, flags[1], c, flags[2], result, codes)
        shape = (*self.shape, count) if batch else self.shape
        on_device = any(device.view(values[port]) is not None for port, _ in self.ports)
        results = result.reshaped(shape) if on_device else result.numpy().reshape(shape)
        if not status:
            return results
        codes = codes.reshaped((count,) if batch else ())
        return results, codes if on_device else codes.numpy()

    def _values(self, raw: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        unknown = [name for name in named if name not in self.labels]
        twice = [name for name in self.labels[: len(raw)] if name in named]
        if unknown or twice or len(raw) > len(self.labels):
            raise no_such(f"{self.name} takes {', '.join(self.labels)} and status, each once")
        values = {"t": 0.0, "p": None, "u": None, **dict(zip(self.labels, raw, strict=False)), **named}
        missing = [name for name in self.labels if name not in values]
        if missing:
            raise incomplete(f"{self.name} needs {', '.join(missing)}")
        return values

    def _times(self, raw: Any, count: int) -> tuple[DeviceArray, bool]:
        there = self.module.device.view(raw)
        if there is None:
            array = np.asarray(raw, dtype=float)
            there = self.module.kept("t", array) if array.ndim == 0 else self.module.device.put(array)
        if there.shape not in ((), (1,), (count,)):
            raise ill_shaped(f"t must be a number or of shape ({count},), not {there.shape}")
        return there, there.shape == (count,) and count > 1
