"""The text of a model and a device -> its functions for many states at once, and its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ...base.value_rules import read_count
from ...errors import cannot, ill_shaped, ill_typed, incomplete, no_choice, no_such
from ..ensembles.block import RunBlock
from ..layout import ModelInfo
from ..runs.run_arguments import declare, declared_step, find_span, ordered_times, steps_of
from ..trajectory import Span
from .cuda_device import Array, Device, DeviceArray

if TYPE_CHECKING:
    from ..bound_model import BoundModel

#: Kernels of a device that are called with the time first, as functions of a module; others take it by name.
TIMED_ON_DEVICE = ("rhs", "jacobian", "bias", "outputs", "events")

# States are columns, as in the batches of a module: an array (n, k) in C order holds k of them.


class DeviceModule:
    """The functions of a model on a device.

    ``rhs(t, x, p=None, u=None)`` and the others have the arguments of a module: x (n_x,) or (n_x, k); t, p and u the
    same for all states, or (k,), (n_p, k), (n_u, k).  Arrays of NumPy are copied to the device and the result comes
    back as an array of NumPy; where one of the states is an array on the device (of CuPy, PyTorch, JAX or Numba), the
    result is a :class:`~.cuda_device.DeviceArray`.  An entry is NaN where the state has no value there; with
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
            from .cuda_device import CudaDevice

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
