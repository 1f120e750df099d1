"""Equations -> the functions of a model on a GPU, made in this process."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import pipeline
from .device.device_module import DeviceModule
from .emit.cuda.device_text import describe_device, emit_device_text

if TYPE_CHECKING:
    from .derivation import Derivation
    from .device.arrays_on_device import Device


def cuda_functions(equations: Derivation, device: Device | None = None) -> DeviceModule:
    """The functions of a model on a device.

    Parameters
    ----------
    equations : Derivation
    device : Device, optional
        The first GPU by default.

    Returns
    -------
    DeviceModule
        The same as the package that ``eomgen generate --target cuda`` writes.

    Raises
    ------
    UsageError
        The model calls functions in C; there is no such GPU.
    MissingDependencyError
        cuda-core or NVRTC is not installed.
    """
    program = pipeline.with_start(equations, pipeline.build(equations, "cuda"))
    return DeviceModule(emit_device_text(program), describe_device(program), program.metadata, device)
