"""Robots as eomgen and its peers have them, each behind one C loop, so that calls are timed in turns in one process."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.toolchain.compiler import find_compiler

from .measure import ROOT, Sample

HERE = Path(__file__).parent
sys.path.insert(0, str(ROOT / "tests"))
NUMBERS = ctypes.POINTER(ctypes.c_double)


@dataclass(frozen=True)
class Robot:
    """A file of the package example-robot-data; ``locked`` joints are welds."""

    name: str
    file: str
    floating: bool = False
    locked: tuple[str, ...] = ()


ROBOTS = (
    Robot("Panda", "panda_description/urdf/panda.urdf", locked=("panda_finger_joint1", "panda_finger_joint2")),
    Robot("UR5", "ur_description/urdf/ur5_robot.urdf"),
    Robot("Talos", "talos_data/robots/talos_reduced.urdf"),
    Robot("ANYmal", "anymal_b_simple_description/robots/anymal.urdf", floating=True),
)


def load(robot: Robot, **options: Any) -> eg.Model:
    """The robot with a torque on every joint, inertias as numbers unless ``symbolic``."""
    from shipped_robots import EXAMPLES

    settings = {"actuate": True, "lock": robot.locked, "floating": robot.floating, "rotation": "euler_parameters"}
    return eg.load(EXAMPLES / robot.file, **settings | options)


def load_pinocchio(robot: Robot) -> Any:
    """The same in Pinocchio."""
    from shipped_robots import EXAMPLES

    pin = import_module("pinocchio")
    root = (pin.JointModelFreeFlyer(),) if robot.floating else ()
    model = pin.buildModelFromUrdf(str(EXAMPLES / robot.file), *root)
    locked = [model.getJointId(name) for name in robot.locked]
    return pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model


def state(model: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v, tau of a Pinocchio model: all joints turned and moving."""
    pin = import_module("pinocchio")
    q, free = pin.neutral(model), model.nq - model.nv
    first = 7 if free else 0
    q[first:] = 0.1 + 0.05 * np.arange(model.nq - first)
    if free:
        q[3:7] = np.array([0.2, -0.1, 0.3, 0.927]) / np.linalg.norm([0.2, -0.1, 0.3, 0.927])
    tau = np.full(model.nv, 0.1)
    tau[: 6 if free else 0] = 0.0
    return q, np.full(model.nv, 0.3), tau


class Contestant:
    """A compiled right-hand side behind ``rhs_loop.c``."""

    def __init__(self, library: Path, n_q: int, n_v: int, x: np.ndarray, u: np.ndarray) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.measure.restype = ctypes.c_double
        self.sizes, self.start = (n_q, n_v), np.array(x, dtype=float)
        self.x, self.u, self.out = self.start.copy(), np.array(u, dtype=float), np.zeros(n_q + n_v)

    def measure(self, calls: int) -> float:
        """Nanoseconds a call."""
        self.x[:] = self.start
        x, u, out = (a.ctypes.data_as(NUMBERS) for a in (self.x, self.u, self.out))
        return float(self.library.measure(ctypes.c_long(calls), *self.sizes, x, u, out))

    def result(self) -> np.ndarray:
        """x' at the start."""
        self.measure(1)
        return self.out.copy()


def compile_loop(
    folder: Path, name: str, texts: Mapping[str, str], flags: Sequence[str], extra: Sequence[str] = ()
) -> tuple[Path, float]:
    """Compile texts and the loop into a library; the seconds are those of the texts alone, one after the other."""
    compiler, own = find_compiler(), folder / name
    own.mkdir()
    for file, text in texts.items():
        (own / file).write_text(text, encoding="utf-8")
    objects, seconds = [], 0.0
    for file in [f for f in texts if f.endswith(".c")]:
        start = perf_counter()
        includes = ["-I", str(own), "-DEOMGEN_LANES=0"]  # one state at a time: no files of vector kernels
        _run([*compiler.command, *flags, *includes, *extra, "-c", str(own / file), "-o", str(own / f"{file}.o")])
        seconds += perf_counter() - start
        objects.append(str(own / f"{file}.o"))
    library, loop = own / "loop.so", str(HERE / "rhs_loop.c")
    libraries = [word for word in extra if not word.startswith("-I")]
    _run([*compiler.command, "-O2", "-fPIC", "-shared", loop, *objects, *libraries, "-lm", "-o", str(library)])
    return library, seconds


def _run(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")


def of_eomgen(program: Any) -> dict[str, str]:
    """The C files of a program and what puts its right-hand side behind the loop."""
    name, upper = program.name, program.name.upper()
    values = ", ".join(repr(float(value)) for value in program.metadata["p_values"]) or "0.0"
    adapter = f"""#include "{name}.h"
static double constants[{upper}_N_CONST + 1], work[{upper}_N_WORK + 1];
void prepare(void)
{{
    const double p[] = {{{values}}};
    {name}_precompute(p, constants);
}}
void call(const double *x, const double *u, double *out)
{{
    {name}_rhs(0.0, x, u, constants, out, work);
}}
"""
    files = {file: text for file, text in emit_c(program).items() if file.endswith((".c", ".h"))}
    return {file: text for file, text in files.items() if "_lanes" not in file or file.endswith(".h")} | {
        "adapter.c": adapter
    }


def of_casadi(source: str) -> dict[str, str]:
    """CasADi's C text, whose work array is asked for when it is loaded."""
    adapter = """int f(const double **arg, double **res, long long *iw, double *w, int mem);
static double work[100000];
void call(const double *x, const double *u, double *out)
{
    const double *arguments[4] = {x, u};
    double *results[4] = {out};
    f(arguments, results, 0, work, 0);
}
"""
    return {"f.c": source, "adapter.c": adapter}


def mujoco_library() -> tuple[list[str], str]:
    """Flags for MuJoCo's headers and library, and the adapter."""
    package = Path(str(import_module("mujoco").__file__)).parent
    library = next(package.glob("libmujoco.so*"))
    return [f"-I{package / 'include'}", str(library), f"-Wl,-rpath,{package}"], "rhs_mujoco.c"


def as_mjcf(model: Any) -> str:
    """A Pinocchio model as MJCF text, without contacts."""
    pin = import_module("pinocchio")
    children: dict[int, list[int]] = {}
    for k in range(1, model.njoints):
        children.setdefault(model.parents[k], []).append(k)

    def numbers(values: Any) -> str:
        return " ".join(repr(float(x)) for x in values)

    def body(k: int) -> str:
        place, inertia, kind = model.jointPlacements[k], model.inertias[k], model.joints[k].shortname()
        x, y, z, w = pin.Quaternion(place.rotation).coeffs()
        J = np.asarray(inertia.inertia)
        axis = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}.get(kind[-1])
        damping = 0.0 if kind == "JointModelFreeFlyer" else float(model.damping[model.joints[k].idx_v])
        joint = f'<joint type="hinge" axis="{axis}" damping="{damping!r}"/>'
        if kind == "JointModelFreeFlyer":
            joint = "<freejoint/>"
        full = numbers((J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]))
        return (
            f'<body pos="{numbers(place.translation)}" quat="{numbers((w, x, y, z))}">{joint}'
            f'<inertial pos="{numbers(inertia.lever)}" mass="{float(inertia.mass)!r}" fullinertia="{full}"/>'
            + "".join(map(body, children.get(k, [])))
            + "</body>"
        )

    return (
        '<mujoco><compiler autolimits="true" balanceinertia="false" boundmass="0"/>'
        '<option gravity="0 0 -9.81"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{''.join(map(body, children[0]))}</worldbody></mujoco>"
    )


def pinocchio_calls(model: Any) -> dict[str, Callable[[int], float]]:
    """Nanoseconds a call of ABA from Python, and of the same call on a model without joints, which is its overhead."""
    pin = import_module("pinocchio")
    empty, found = pin.Model(), {}
    for title, one in (("aba", model), ("overhead", empty)):
        arguments = (one, one.createData(), *(state(one) if one.nv else (np.zeros(0),) * 3))

        def timed(calls: int, arguments: tuple[Any, ...] = arguments, aba: Any = pin.aba) -> float:
            start = perf_counter()
            for _ in range(calls):
                aba(*arguments)
            return (perf_counter() - start) / calls * 1e9

        found[title] = timed
    return found


def in_turns(actions: Mapping[str, Callable[[int], float]], rounds: int, burst: float) -> dict[str, Sample]:
    """Nanoseconds a call: many short bursts (s), a contestant after the other."""
    calls = {who: max(3, int(burst * 1e9 / action(10))) for who, action in actions.items()}
    values: dict[str, list[float]] = {who: [] for who in actions}
    for _ in range(rounds):
        for who, action in actions.items():
            values[who].append(action(calls[who]))
    return {who: Sample(tuple(found)) for who, found in values.items()}


def build(robot: Robot, **options: Any) -> tuple[Any, Any]:
    """The derived equations and the program of the right-hand side alone."""
    equations = load(robot, **options).derive()
    return equations, pipeline.build(equations, "c", kernels=["rhs"])
