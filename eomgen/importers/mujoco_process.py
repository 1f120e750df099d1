"""Importers, MuJoCo's compiler in a process of its own: the path of an MJCF file -> the arrays of the compiled model.

MuJoCo is written in C++ and reads what strangers wrote.  The process gives up memory, time, written files and, where
the kernel has Landlock (Linux 5.13), all files outside one folder: a model that crashes, hangs or fills it breaks
nothing else.  This file is also the program of that process, and imports nothing of eomgen.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import struct
import subprocess
import sys
import warnings
from typing import Any

MOST, LONGEST = 20, 2000  #: warnings that are passed on; characters of a message
FIELDS = ("body", "jnt", "dof", "geom", "site", "eq", "tendon", "wrap", "actuator", "qpos", "qpos0")
OPTIONS = ("gravity", "density", "viscosity", "disableflags", "enableflags", "disableactuator")
NAMED = {"body": "nbody", "joint": "njnt", "equality": "neq", "tendon": "ntendon", "actuator": "nactuator"}
#: Variables of the environment that the process keeps: where Windows and dynamic libraries are.
KEPT = ("SYSTEMROOT", "PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")


def compile_model(path: str, folder: str, memory: int, seconds: int, wait: int) -> tuple[dict[str, Any], Any]:
    """What a process of its own makes of an MJCF file in a folder, which holds all files that it names.

    The answer has ``names`` by kind of element, ``flags`` (bits of mjtDisableBit) and ``warnings``; or why there is no
    model: ``missing``, ``refused``, ``memory``, or ``code``, with which the process ended (None if it took too long).
    Beside it stand the arrays of MjModel and its counts by their names, those of ``opt`` with ``opt_`` before.
    """
    import numpy as np

    modules = [os.path.abspath(place) for place in sys.path if place]
    order = {"path": path, "folder": folder, "memory": memory, "seconds": seconds, "modules": modules}
    environment = {key: os.environ[key] for key in KEPT if key in os.environ}
    environment |= {"MALLOC_ARENA_MAX": "2", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-I", "-B", __file__, json.dumps(order)]
    ends: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, env=environment, start_new_session=True, **ends) as process:
        try:
            reply, _ = process.communicate(timeout=wait)
        except subprocess.TimeoutExpired:
            return {"code": None}, {}
        finally:
            if process.returncode is None:
                process.kill()
    line, _, data = reply.partition(b"\n")
    if process.returncode or not line:
        return {"code": process.returncode}, {}
    return json.loads(line), np.load(io.BytesIO(data), allow_pickle=False) if data else {}


def main(order: dict[str, Any]) -> None:
    """Compile the model of an order, and write the answer to the standard output: a line of JSON, then the arrays."""
    out = os.dup(1)
    os.dup2(2, 1)  # whatever MuJoCo prints must not come between
    sys.path[:] = order["modules"]
    _bound({"CORE": 0, "FSIZE": 0, "CPU": order["seconds"], "AS": order["memory"]})
    answer: dict[str, Any] = {}
    data, messages = b"", dict[str, None]()  # warnings, in order
    try:
        import mujoco

        if sys.platform == "linux":
            _confine(order["folder"])
        mujoco.set_mju_user_warning(lambda text: messages.setdefault(text[:LONGEST]))
        warnings.showwarning = lambda message, *_, **__: messages.setdefault(str(message)[:LONGEST])
        warnings.simplefilter("always")
        spec = mujoco.MjSpec.from_file(order["path"])
        _strip(spec, mujoco.MjSpec())
        data = _arrays(mujoco, spec.compile(), answer)
        answer["warnings"] = list(messages)[:MOST]
    except ImportError as error:
        answer = {"missing": str(error)}
    except MemoryError:
        answer = {"memory": True}
    except Exception as error:  # ValueError, mujoco.FatalError and what its later releases raise
        answer = {"refused": str(error)[:LONGEST]}
    left = memoryview(json.dumps(answer).encode() + b"\n" + data)
    while left:
        left = left[os.write(out, left) :]
    os._exit(0)


def _bound(bounds: dict[str, int]) -> None:
    """Give up memory, processor time, dumps and written files."""
    with contextlib.suppress(ImportError):  # Windows, where the other process ends this one after a time
        import resource

        for name, most in bounds.items():
            _, hard = resource.getrlimit(number := getattr(resource, f"RLIMIT_{name}"))
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            with contextlib.suppress(ValueError, OSError):  # macOS has no bound of the address space
                resource.setrlimit(number, (most, most))


def _confine(folder: str) -> None:
    """Give up all files but those of a folder, to be read, by Landlock; nothing on a kernel without it."""
    kernel, (create, add, restrict) = ctypes.CDLL(None), (444, 445, 446)  # system calls
    rights, read = (1 << 13) - 1, 1 << 2 | 1 << 3  # all of the first version; files and folders to be read
    rules = kernel.syscall(create, struct.pack("Q", rights), 8, 0)
    kernel.syscall(add, rules, 1, struct.pack("=Qi", read, os.open(folder, os.O_PATH)), 0)
    kernel.prctl(38, 1, 0, 0, 0)  # no new privileges
    kernel.syscall(restrict, rules, 0)


def _strip(spec: Any, blank: Any) -> None:
    """Take out of a model what says nothing of the motion, so that it need not be there, nor be right."""
    for kind in ("keys", "sensors", "skins", "numerics", "texts", "tuples"):
        for element in list(getattr(spec, kind)):
            spec.delete(element) if hasattr(spec, "delete") else element.delete()
    for texture in spec.textures:  # flat ones
        texture.builtin, texture.width, texture.height, texture.file, texture.cubefiles = 3, 1, 1, "", [""] * 6
    for field in spec.hfields:
        field.file, field.nrow, field.ncol, field.userdata = "", 2, 2, [0.0] * 4
    for size in dir(blank):  # of memory, and of what is gone
        if size == "memory" or (size.startswith("n") and isinstance(getattr(blank, size), int)):
            setattr(spec, size, getattr(blank, size))


def _arrays(mujoco: Any, model: Any, answer: dict[str, Any]) -> bytes:
    """The arrays of a compiled model; the answer takes the names and the bits of flags."""
    import numpy as np

    arrays: dict[str, Any] = {f"opt_{key}": np.asarray(getattr(model.opt, key)) for key in OPTIONS}
    for key in dir(model):
        value = getattr(model, key)
        if isinstance(value, int if key.startswith("n") else np.ndarray if key.partition("_")[0] in FIELDS else ()):
            arrays[key] = value
    flags = mujoco.mjtDisableBit.__members__.items()
    answer["flags"] = {key.removeprefix("mjDSBL_"): int(value) for key, value in flags}
    counts = {kind: getattr(model, count, model.nu) for kind, count in NAMED.items()}
    answer["names"] = {kind: [getattr(model, kind)(k).name for k in range(n)] for kind, n in counts.items()}
    np.savez(buffer := io.BytesIO(), **arrays)
    return buffer.getvalue()


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
