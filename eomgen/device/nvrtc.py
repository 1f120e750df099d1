"""Stage device: a text of device code -> machine code by NVRTC, which needs no GPU, no driver and no headers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import MissingDependencyError, ToolchainError
from ..targets import CUDA_REQUIREMENTS

INSTALL = f"pip install {' '.join(repr(name) for name in CUDA_REQUIREMENTS)}"


def compile_device_text(text: str, architecture: str, wanted: Sequence[str] = (), options: Sequence[str] = ()) -> bytes:
    """Compile a text for an architecture.

    Parameters
    ----------
    text : str
    architecture : str
        ``sm_90`` for machine code, ``compute_90`` for PTX, which the driver compiles for its GPU.
    wanted : sequence of str
        Macros to define: ``EOMGEN_WANT_...`` of the kernels.
    options : sequence of str
        Further options of NVRTC.

    Returns
    -------
    bytes

    Raises
    ------
    MissingDependencyError
        cuda-bindings or the library of NVRTC is not installed.
    ToolchainError
        NVRTC refuses the text; ``output`` is its log.
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
        log = _room(_done(nvrtc, nvrtc.nvrtcGetProgramLogSize(program)))
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
        code = _room(length)
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
    """The module ``cuda.bindings.nvrtc`` with its library.

    Raises
    ------
    MissingDependencyError
    """
    try:
        from cuda.bindings import nvrtc

        nvrtc.nvrtcVersion()
    except (ImportError, RuntimeError) as error:  # without the library it raises RuntimeError, or one derived from it
        raise MissingDependencyError(f"NVRTC is not installed; {INSTALL}") from error
    return nvrtc


def _room(length: int) -> bytes:
    """Bytes that NVRTC writes into.  Python has each single byte only once, for everybody: so never one alone."""
    return bytes(length + 1)


def _done(nvrtc: Any, answer: Any) -> Any:
    """The value of an answer (status, value); a status that is not 0 is a defect, of the machine or of eomgen."""
    status, *values = answer
    if int(status) != 0:
        raise ToolchainError(f"NVRTC failed: {nvrtc.nvrtcGetErrorString(status)[1].decode()}", "nvrtc")
    return values[0] if values else None
