"""Robots, MJCF: the program of the process in which MuJoCo compiles a model; it imports nothing of eomgen.

It reads a model and its meshes from its standard input, and writes the numbers of the compiled model to its standard
output.  Before the model is looked at, the process gives up memory, time, and the right to open or write any file, so
that a model that breaks MuJoCo breaks nothing else.  A message is a line of JSON, and then the bytes it speaks of.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

SHOWN = 20  #: warnings that are passed on
LONGEST = 2000  #: characters of a message that are passed on
KINDS = ("body", "jnt", "dof", "geom", "site", "eq", "tendon", "wrap", "actuator", "qpos", "qpos0", "name")
COUNTS = ("nbody", "njnt", "nu", "nv", "nq", "neq", "ntendon", "nactuator", "npair", "nflex", "nplugin")


def main() -> None:
    """Answer the one message of the standard input."""
    out = os.dup(1)
    os.dup2(2, 1)  # whatever MuJoCo prints must not come between
    header = json.loads(sys.stdin.buffer.readline())
    text, *meshes = (sys.stdin.buffer.read(size) for size in header["sizes"])
    sys.path[:] = header["path"]
    _bound(header["memory"], header["seconds"])
    answer: dict[str, Any] = {}
    blobs: list[bytes] = []
    try:
        import mujoco
    except ImportError as error:
        answer["missing"] = str(error)
    else:
        _close(out)
        said: list[str] = []
        mujoco.set_mju_user_warning(lambda text: said.append(text[:LONGEST]) if len(said) < SHOWN else None)
        try:
            compiled = mujoco.MjModel.from_xml_string(text.decode(), dict(zip(header["names"], meshes, strict=True)))
            blobs = _numbers(mujoco, compiled, answer)
        except MemoryError:
            answer = {"memory": True}
        except Exception as error:  # ValueError, mujoco.FatalError and what its later releases raise
            answer = {"refused": str(error)[:LONGEST]}
        answer["warnings"] = said
    for piece in (json.dumps(answer).encode(), b"\n", *blobs):
        left = memoryview(piece)
        while left:
            left = left[os.write(out, left) :]
    os._exit(0)


def _bound(memory: int, seconds: int) -> None:
    """Give up memory (bytes of address space), processor time (s), dumps and written files."""
    try:
        import resource
    except ImportError:  # Windows, where the other process ends this one after a time
        return
    bounds = {"CORE": 0, "FSIZE": 0, "CPU": seconds, "AS": memory}
    for name, most in bounds.items():
        _, hard = resource.getrlimit(number := getattr(resource, f"RLIMIT_{name}"))
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(number, (most, most))
        except (ValueError, OSError):  # macOS has no bound of the address space
            continue


def _close(out: int) -> None:
    """Give up the right to open any file, socket or library."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_NOFILE, (out, out))  # only numbers up to this one are given out: none is left


def _numbers(mujoco: Any, compiled: Any, answer: dict[str, Any]) -> list[bytes]:
    """The arrays of a compiled model; the answer says what they are."""
    import numpy as np

    arrays = {f"opt.{key}": np.asarray(getattr(compiled.opt, key)) for key in ("gravity", "density", "viscosity")}
    arrays |= {
        f"opt.{key}": np.asarray(getattr(compiled.opt, key))
        for key in ("disableflags", "enableflags", "disableactuator")
    }
    for key in dir(compiled):
        if key.partition("_")[0] in KINDS and isinstance(value := getattr(compiled, key), np.ndarray):
            arrays[key] = value
    flags = mujoco.mjtDisableBit.__members__.items()
    answer["flags"] = {key.removeprefix("mjDSBL_"): int(value) for key, value in flags}
    answer["counts"] = {key: int(getattr(compiled, key)) for key in COUNTS if hasattr(compiled, key)}
    answer["letters"] = len(compiled.names)
    answer["arrays"] = [[key, value.dtype.str, value.shape] for key, value in arrays.items()]
    return [bytes(compiled.names), *(value.tobytes() for value in arrays.values())]


if __name__ == "__main__":
    main()
