"""Robots, MJCF: a text without files -> what MuJoCo compiles it to, in a process of its own.

MuJoCo is written in C++ and reads what strangers wrote: a model that crashes it, hangs it or fills the memory ends that
process (:mod:`.mjcf_child`), and here an error says so.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..base.limits.numbers import MEMORY, SECONDS, WAIT
from ..errors import MissingDependencyError, ModelError
from .mjcf_text import Text
from .xml_text import XmlElement

_PROGRAM = Path(__file__).with_name("mjcf_child.py")
_MISSING = "MJCF files need mujoco: pip install 'eomgen[robots]'"
_DTYPES = {"|b1", "|u1", "|i1", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8"}
_NAMED = {"body": "body", "joint": "jnt", "eq": "eq", "tendon": "tendon", "actuator": "actuator"}
#: Variables of the environment that the process keeps: where Windows and dynamic libraries are.
_KEPT = ("SYSTEMROOT", "PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
_SMALLER = "use fewer bodies, and meshes with fewer triangles"


def compile_mjcf(text: Text, root: XmlElement) -> SimpleNamespace:
    """A compiled model.

    Returns
    -------
    SimpleNamespace
        The arrays of MjModel by their names and those of ``opt``; its counts; ``names`` by kind of element; ``flags``,
        the bits of mjtDisableBit by their words; ``warnings``, what MuJoCo warns of.

    Raises
    ------
    MissingDependencyError
        mujoco is not installed.
    ModelError
        MuJoCo refuses the model, crashes on it, or needs too much time or memory.
    """
    if find_spec("mujoco") is None:
        raise MissingDependencyError(_MISSING)
    code, reply = _ask(text)
    line, _, data = reply.partition(b"\n")
    answer: dict[str, Any] = json.loads(line) if line and code == 0 else {"code": code}
    if "missing" in answer:
        raise MissingDependencyError(f"{_MISSING} ({answer['missing']})")
    if "refused" in answer:
        raise text.refusal(" ".join(answer["refused"].split()), root)
    if "arrays" not in answer:
        raise ModelError([root.problem("mujoco", *_why(answer), code="EG-FILE-DAMAGED")])
    return _read(answer, data)


def _why(answer: dict[str, Any]) -> tuple[str, str]:
    """What became of a process that gave no model."""
    code = answer.get("code", 0)
    if "memory" in answer:
        return f"MuJoCo needs more memory for it than the {MEMORY / 1e9:g} GB it may have", _SMALLER
    if code is None or code in (-getattr(signal, name, 0) for name in ("SIGXCPU", "SIGKILL")):
        return f"MuJoCo needs more time for it than the {SECONDS} s ({WAIT} s beside other work) it may have", _SMALLER
    if code < 0:
        return (
            f"MuJoCo crashes on it ({signal.Signals(-code).name})"
        ), "leave out parts until it loads, to find the cause"
    return f"MuJoCo ends without a model (exit {code})", "leave out parts until it loads, to find the cause"


def _ask(text: Text) -> tuple[int | None, bytes]:
    """Exit code (None where it took too long) and answer of the process."""
    main = text.main.encode()
    header = {
        "path": [os.path.abspath(folder) for folder in sys.path if folder],
        "memory": MEMORY,
        "seconds": SECONDS,
        "names": list(text.files),
        "sizes": [len(main), *map(len, text.files.values())],
    }
    message = b"".join([json.dumps(header).encode(), b"\n", main, *text.files.values()])
    environment = {key: os.environ[key] for key in _KEPT if key in os.environ}
    environment |= {"MALLOC_ARENA_MAX": "2", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "-I", "-B", os.fspath(_PROGRAM)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            reply, _ = process.communicate(message, timeout=WAIT)
        except subprocess.TimeoutExpired:
            return None, b""
        finally:
            if process.returncode is None:
                _end(process)
    return process.returncode, reply


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and what it started."""
    with contextlib.suppress(OSError):
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


def _read(answer: dict[str, Any], data: bytes) -> SimpleNamespace:
    """The arrays of an answer; no more is believed of it than that they are numbers."""
    opt: dict[str, np.ndarray] = {}
    found: dict[str, Any] = {}
    start = answer["letters"]
    for key, dtype, shape in answer["arrays"]:
        if dtype not in _DTYPES:
            raise TypeError(f"{key} is of type {dtype}")
        array = np.frombuffer(data, np.dtype(dtype), int(np.prod(shape, dtype=int)), start).reshape(shape)
        start += array.nbytes
        if key.startswith("opt."):
            opt[key.removeprefix("opt.")] = array
        else:
            found[key] = array
    kept = {key: answer[key] for key in ("flags", "warnings")}
    compiled = SimpleNamespace(**answer["counts"], **found, **kept, opt=SimpleNamespace(**opt))
    compiled.names = {
        kind: [_name(data, k) for k in found[f"name_{short}adr"].tolist()] for kind, short in _NAMED.items()
    }
    return compiled


def _name(letters: bytes, start: int) -> str:
    return letters[start : letters.index(b"\0", start)].decode(errors="replace")
