"""Stage device: the text of a model and a device -> its functions for many states at once, all but the runs.

States are columns, as in the batches of a module: an array (n, k) in C order holds k of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from ..errors import ill_shaped, ill_typed, incomplete, no_such
from ..targets import TIMED_ON_DEVICE
from .arrays_on_device import Array, Device, DeviceArray


class DeviceFunctions:
    """What :class:`~.device_module.DeviceModule` has besides runs, and what runs need of it."""

    def __init__(
        self, text: str, facts: Mapping[str, Any], metadata: Mapping[str, Any], device: Device | None = None
    ) -> None:
        if device is None:
            from .cuda_device import CudaDevice

            device = CudaDevice()
        self.device, self.text, self.facts, self.metadata = device, text, facts, dict(metadata)
        self.name = str(facts["name"])
        self.q_names, self.v_names, self.u_names, self.p_names, self.y_names, self.body_names = (
            tuple(metadata[f"{kind}_names"]) for kind in ("q", "v", "u", "p", "y", "body")
        )
        self.x_names = self.q_names + self.v_names
        self.n_q, self.n_v, self.n_x = len(self.q_names), len(self.v_names), len(self.x_names)
        self.n_u, self.n_p, self.n_dof = len(self.u_names), len(self.p_names), int(metadata["n_dof"])
        self.p, self.u = (np.array(metadata[f"{kind}_values"], dtype=float) for kind in ("p", "u"))
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

    def columns(self, label: str, given: Any, length: int, count: int | None = None) -> tuple[DeviceArray, int | None]:
        """Numbers (length,) or (length, k) on the device, and k, or None where they are one column.

        Raises
        ------
        UsageError
            Another shape, or another number of columns than `count`.
        """
        found: DeviceArray | Array | None = self.device.view(given)
        if found is None:
            try:
                found = np.asarray(given, dtype=float)
            except (TypeError, ValueError):
                raise ill_typed(f"{label} must be an array of numbers, not {type(given).__name__}") from None
        shape = tuple(found.shape)
        if len(shape) not in (1, 2) or shape[0] != length or (len(shape) == 2 and count not in (None, 1, shape[1])):
            wanted = f"({length},) or ({length}, {'k' if count in (None, 1) else count})"
            raise ill_shaped(f"{label} must have shape {wanted}, not {shape}")
        on_device = found if isinstance(found, DeviceArray) else self.device.put(found)
        return on_device, shape[1] if len(shape) == 2 else None

    def kept(self, label: str, given: Array) -> DeviceArray:
        """Numbers on the device; those of the last call where they are the same."""
        told, found = self._there.get(label, (None, None))
        if found is None or told != given.tobytes():
            found = self.device.put(given)
            self._there[label] = (given.tobytes(), found)
        return found

    def constants(self, p: Any, count: int) -> tuple[DeviceArray, bool]:
        """What kernels take in place of parameters, and whether each state has its own."""
        if p is None and self._constants is not None:
            return self._constants, False
        given, each = self.columns("p", self.p if p is None else p, self.n_p, count)
        columns = 1 if each is None else each
        found = self.device.empty((self.facts["n_const"], columns), np.float64)
        if columns:
            self.kernel("constants")(columns, given, found)
        if p is None:
            self._constants = found
        return found, each is not None


class BatchCall:
    """One function of a model on a device."""

    def __init__(
        self, module: DeviceFunctions, name: str, ports: Sequence[tuple[str, int]], shape: tuple[int, ...]
    ) -> None:
        self.module, self.name, self.ports, self.shape = module, name, ports, shape
        labels = [port for port, _ in ports]
        self.labels = ["t", *labels, "p", "u"] if name in TIMED_ON_DEVICE else [*labels, "p", "u", "t"]

    def __call__(self, *given: Any, status: bool = False, **named: Any) -> Any:
        """Evaluate at one state or many.

        Raises
        ------
        UsageError
            Missing arguments, wrong shapes.
        """
        module, device = self.module, self.module.device
        values = self._values(given, named)
        found, count, batch = [], 1, False
        for port, length in self.ports:
            array, each = module.columns(port, values[port], length, count if batch else None)
            found.append((array, each))
            count, batch = (count, batch) if each is None else (each, True)
        if any((1 if each is None else each) != count for _, each in found):
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
            launch(count, t, flags[0], *(array for array, _ in found), u, flags[1], c, flags[2], result, codes)
        shape = (*self.shape, count) if batch else self.shape
        on_device = any(device.view(values[port]) is not None for port, _ in self.ports)
        results = result.reshaped(shape) if on_device else result.numpy().reshape(shape)
        if not status:
            return results
        codes = codes.reshaped((count,) if batch else ())
        return results, codes if on_device else codes.numpy()

    def _values(self, given: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        unknown = [name for name in named if name not in self.labels]
        twice = [name for name in self.labels[: len(given)] if name in named]
        if unknown or twice or len(given) > len(self.labels):
            raise no_such(f"{self.name} takes {', '.join(self.labels)} and status, each once")
        values = {"t": 0.0, "p": None, "u": None, **dict(zip(self.labels, given, strict=False)), **named}
        missing = [name for name in self.labels if name not in values]
        if missing:
            raise incomplete(f"{self.name} needs {', '.join(missing)}")
        return values

    def _times(self, given: Any, count: int) -> tuple[DeviceArray, bool]:
        there = self.module.device.view(given)
        if there is None:
            array = np.asarray(given, dtype=float)
            there = self.module.kept("t", array) if array.ndim == 0 else self.module.device.put(array)
        if there.shape not in ((), (1,), (count,)):
            raise ill_shaped(f"t must be a number or of shape ({count},), not {there.shape}")
        return there, there.shape == (count,) and count > 1
