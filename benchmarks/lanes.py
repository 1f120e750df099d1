"""Right-hand sides of robots in C, one state at a time and in lanes, beside CasADi's C of the same robots."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .measure import Sample, interleaved
from .report import Limit, Report, Table

TITLE = "several states at a time, in vector registers"
TESTS = Path(__file__).parents[1] / "tests"
#: Robot -> file, joints to lock, the promised time of a state in lanes over CasADi's time of one.
ROBOTS = {
    "Panda": ("panda_description/urdf/panda.urdf", ("panda_finger_joint1", "panda_finger_joint2"), 0.19),
    "UR5": ("ur_description/urdf/ur5_robot.urdf", (), 0.19),
    "Talos": ("talos_data/robots/talos_reduced.urdf", (), 0.24),
}
#: Compilations of CasADi's code: the flags of ours, and what its users would take; never -ffast-math.
PEER_FLAGS = {
    "same flags": ["-O2", "-ffp-contract=off", "-fno-math-errno"],
    "-O3 -march=native": ["-O3", "-march=native"],
}
WIDTHS = (2, 4, 8)


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def aligned(length: int) -> np.ndarray:
    """Zeros that begin at a multiple of 64 bytes."""
    room = np.zeros(length + 8)
    return room[-(room.ctypes.data // 8) % 8 :][:length]


def robot(file: str, lock: tuple[str, ...]) -> Any:
    """The model of a robot's file, with a motor at every joint."""
    if str(TESTS) not in sys.path:
        sys.path.insert(0, str(TESTS))
    from shipped_robots import EXAMPLES

    import eomgen as eg

    return eg.load(str(EXAMPLES / file), actuate=True, lock=lock)


class Ours:
    """A robot's right-hand side as eomgen writes and compiles it."""

    def __init__(self, file: str, lock: tuple[str, ...], folder: Path) -> None:
        from eomgen import pipeline
        from eomgen.codegen.c import emit_c
        from eomgen.toolchain.compiler import Options, compile_flags, find_compiler

        model = robot(file, lock)
        equations = model.derive()
        program = pipeline.build(equations, "c", kernels=["rhs"])
        if "rhs" not in program.block_names:  # the chosen form solves in loops, which have no lanes
            equations = model.derive("recursive")
            program = pipeline.build(equations, "c", kernels=["rhs"])
        self.names = equations.kinematics.velocity_names
        self.inputs = equations.kinematics.input_names
        self.operations = program.counts["rhs"].total
        folder.mkdir()
        sources = emit_c(program)
        for name, text in sources.items():
            (folder / name).write_text(text)
        files = [str(folder / name) for name in sources if name.endswith(".c")]
        compiler = find_compiler()
        size = sum(len(sources[Path(f).name]) for f in files if "_lanes" not in f)
        flags = compile_flags(Options(), compiler, size)
        command = [
            *compiler.command,
            *flags,
            f"-I{folder}",
            "-shared",
            *files,
            str(Path(__file__).with_name("lanes.c")),
        ]
        subprocess.run([*command, "-o", str(folder / "ours.so"), "-lm"], check=True)
        self.library = ctypes.CDLL(str(folder / "ours.so"))
        self.library.time_plain.restype = self.library.time_lanes.restype = ctypes.c_double
        self.n = program.sizes.n_v
        areas = {key: int(value) for key, value in numbers(sources[f"{program.name}.h"])}
        self.c, self.w = np.zeros(areas["N_CONST"] + 1), np.zeros(areas["N_WORK"] + 1)
        p = np.array([*program.metadata["p_values"], 0.0], dtype=float)
        getattr(self.library, f"{program.name}_precompute")(pointer(p), pointer(self.c))
        self.room = aligned(8 * (1 + areas["N_U"] + areas["N_CONST"] + 4 * self.n + areas["N_WORK"]))

    def plain(self, calls: int, x: np.ndarray, u: np.ndarray, out: np.ndarray) -> float:
        given = [pointer(a) for a in (x, u, self.c, out, self.w)]
        return float(self.library.time_plain(ctypes.c_long(calls), self.n, *given))

    def lanes(self, width: int, calls: int, x: np.ndarray, u: np.ndarray, out: np.ndarray) -> float:
        given = [pointer(a) for a in (x, u, self.c, out, self.room)]
        return float(self.library.time_lanes(ctypes.c_long(calls), width, self.n, *given))


def numbers(header: str) -> list[tuple[str, str]]:
    """The sizes that a header tells."""
    rows = (line.strip(" ,").split(" = ") for line in header.splitlines() if " = " in line and "_N_" in line)
    return [("N_" + name.rsplit("_N_", 1)[1], value) for name, value in rows if value.isdigit()]


class Peer:
    """CasADi's code of a robot that Pinocchio has read."""

    def __init__(self, file: str, lock: tuple[str, ...], folder: Path) -> None:
        import pinocchio as pin
        from shipped_robots import EXAMPLES

        from eomgen.toolchain.compiler import find_compiler

        from .casadi_robots import casadi_source

        model = pin.buildModelFromUrdf(str(EXAMPLES / file))
        if lock:
            model = pin.buildReducedModel(model, [model.getJointId(j) for j in lock], pin.neutral(model))
        self.names = list(model.names)[1:]
        self.damping = np.array(model.damping)
        text, self.operations = casadi_source(model)
        (folder / "peer.c").write_text(text)
        self.libraries = {}
        for k, (label, flags) in enumerate(PEER_FLAGS.items()):
            library = folder / f"peer{k}.so"
            files = [str(folder / "peer.c"), str(Path(__file__).with_name("lanes.c"))]
            command = [*find_compiler().command, "-std=gnu99", "-w", "-fPIC", "-DPEER", *flags, "-shared", *files]
            subprocess.run([*command, "-o", str(library), "-lm"], check=True)
            self.libraries[label] = ctypes.CDLL(str(library))
            self.libraries[label].time_peer.restype = ctypes.c_double

    def time(self, label: str, calls: int, x: np.ndarray, tau: np.ndarray, out: np.ndarray) -> float:
        given = [pointer(a) for a in (x, tau, out)]
        return float(self.libraries[label].time_peer(ctypes.c_long(calls), len(self.names), *given))


def compare(name: str, quick: bool, folder: Path) -> dict[str, Any]:
    """Nanoseconds a state of every contestant, and the largest relative difference between them."""
    file, lock, _ = ROBOTS[name]
    ours = Ours(file, lock, folder / name)
    peer = Peer(file, lock, folder / name)
    n = ours.n
    places = [ours.names.index(f"{joint}_dot") for joint in peer.names]
    drives = [ours.inputs.index(f"tau_{joint}") for joint in peer.names]
    theirs = np.concatenate([0.1 + 0.05 * np.arange(n), np.full(n, 0.3)])
    x, u, tau = np.empty(2 * n), np.empty(len(ours.inputs)), np.full(n, 0.1)
    x[places], x[[n + k for k in places]], u[drives] = theirs[:n], theirs[n:], tau
    tau = tau - peer.damping * theirs[n:]  # the files' damping, which the recursions leave out
    calls = max(20, 1400 // n)  # about a tenth of a millisecond: short enough to be undisturbed now and then
    outs = {label: np.empty(2 * n) for label in (*PEER_FLAGS, "plain", *map(str, WIDTHS))}
    actions: dict[str, Callable[[], float]] = {
        label: lambda label=label: peer.time(label, calls, theirs, tau, outs[label]) for label in PEER_FLAGS
    }
    actions["plain"] = lambda: ours.plain(calls, x, u, outs["plain"])
    for width in WIDTHS:
        if ours.lanes(width, 1, x, u, outs[str(width)]) >= 0.0:
            actions[str(width)] = lambda width=width: ours.lanes(width, calls, x, u, outs[str(width)])
    for action in actions.values():
        action()
    expected = outs["same flags"][:n]
    found = [outs[label][n:][places] for label in actions if label not in PEER_FLAGS]
    difference = max(np.abs(y - expected).max() for y in found) / np.abs(expected).max()
    samples: dict[str, Sample] = interleaved(20 if quick else 800, **actions)
    return {
        "n": n,
        "operations": {"ours": ours.operations, "CasADi": peer.operations},
        "difference": float(difference),
        "ns": {label: sample.best for label, sample in samples.items()},
    }


def run(quick: bool) -> Report:
    """Time everything in turns, in short bursts; the best burst of each counts."""
    details: dict[str, Any] = {}
    rows, limits = [], []
    names = list(ROBOTS)[1:2] if quick else list(ROBOTS)
    with TemporaryDirectory() as folder:
        for name in names:
            found = details[name] = compare(name, quick, Path(folder))
            ns, promised = found["ns"], ROBOTS[name][2]
            reference, fastest = ns["same flags"], min(ns[label] for label in PEER_FLAGS)
            widest = max(width for width in WIDTHS if str(width) in ns)
            rows.append([name, "CasADi", found["operations"]["CasADi"], *(ns[label] for label in PEER_FLAGS)])
            for label in ("plain", *(str(width) for width in WIDTHS if str(width) in ns)):
                shown = "eomgen" if label == "plain" else f"eomgen, {label} lanes"
                rows.append([name, shown, found["operations"]["ours"], ns[label], None])
                rows[-1] += [ns[label] / ns[other] for other in PEER_FLAGS]
            limits.append(Limit(f"{name}, largest relative difference from CasADi", found["difference"], 1e-7))
            if quick:
                continue
            if "4" in ns:
                limits.append(
                    Limit(f"{name}, a state of 4 lanes over CasADi, same flags,", ns["4"] / reference, promised)
                )
            what = f"{name}, a state of {widest} lanes over CasADi's fastest"
            limits.append(Limit(what, ns[str(widest)] / fastest, promised))
    columns = (
        "robot",
        "code",
        "operations",
        "ns a state",
        "ns, -O3 -march=native",
        "over CasADi",
        "over that, -O3 native",
    )
    for row in rows:
        row += [None] * (len(columns) - len(row))
    notes = (
        "A loop in C around the right-hand side, inputs as they are made; the best of many bursts, taken in turns.",
        "CasADi: the better of articulated bodies and of mass matrix and factor, after its own cse; -O3 -march=native",
        "lets the compiler fuse products and sums; ours never does. Rotations within 1e-9 of exact ones are exact.",
    )
    return Report((Table("right-hand sides of robots", columns, rows),), tuple(limits), notes, details)
