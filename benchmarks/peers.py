"""The same robots in eomgen, Pinocchio, MuJoCo and CasADi, at one state; heyoka over our right-hand sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import eomgen as eg
from eomgen.expr.core import reachable

from .harness import Timed, timed
from .kernels import Kernel, compile_text

#: MuJoCo behind the interface of a kernel: mj_forward of a model without contacts.
MUJOCO = """
#include <mujoco/mujoco.h>
#include <string.h>
static mjModel *model;
static mjData *data;
int prepare(const char *path)
{
    char error[500] = "";
    model = mj_loadXML(path, NULL, error, sizeof error);
    data = model == NULL ? NULL : mj_makeData(model);
    return data == NULL;
}
int kernel(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    (void)t, (void)c, (void)w;
    memcpy(data->qpos, x, (size_t)model->nq * sizeof(double));
    memcpy(data->qvel, x + model->nq, (size_t)model->nv * sizeof(double));
    memcpy(data->qfrc_applied, u, (size_t)model->nv * sizeof(double));
    mj_forward(model, data);
    memcpy(out + model->nq, data->qacc, (size_t)model->nv * sizeof(double));
    return 0;
}
"""


def installed(package: str) -> bool:
    """Whether a peer can be imported."""
    return find_spec(package) is not None


# -- robots ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Robot:
    """A file of the package example-robot-data, or a path; ``locked`` joints are welds."""

    name: str
    file: str
    floating: bool = False
    locked: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """Where it is."""
        from shipped_robots import EXAMPLES

        return EXAMPLES / self.file

    def model(self, **options: Any) -> eg.Model:
        """With a torque on every joint, inertias as numbers unless ``symbolic``."""
        settings = {"actuate": True, "lock": self.locked, "floating": self.floating, "rotation": "euler_parameters"}
        return eg.load(self.path, **settings | options)

    def pinocchio(self) -> Any:
        """The same in Pinocchio."""
        pin = import_module("pinocchio")
        model = pin.buildModelFromUrdf(str(self.path), *((pin.JointModelFreeFlyer(),) if self.floating else ()))
        locked = [model.getJointId(name) for name in self.locked]
        return pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model


ROBOTS = (
    Robot("Panda", "panda_description/urdf/panda.urdf", locked=("panda_finger_joint1", "panda_finger_joint2")),
    Robot("UR5", "ur_description/urdf/ur5_robot.urdf"),
    Robot("Talos", "talos_data/robots/talos_reduced.urdf"),
    Robot("ANYmal", "anymal_b_simple_description/robots/anymal.urdf", floating=True),
)


def state(model: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v, tau of a Pinocchio model: all joints turned and moving."""
    q, free = import_module("pinocchio").neutral(model), model.nq - model.nv
    first = 7 if free else 0
    q[first:] = 0.1 + 0.05 * np.arange(model.nq - first)
    if free:
        q[3:7] = np.array([0.2, -0.1, 0.3, 0.927]) / np.linalg.norm([0.2, -0.1, 0.3, 0.927])
    tau = np.full(model.nv, 0.1)
    tau[: 6 if free else 0] = 0.0
    return q, np.full(model.nv, 0.3), tau


class InOurOrder:
    """A state of a Pinocchio model as a module of the same robot has it, and accelerations of joints back again.

    The base's velocity is along ground axes here, along its own axes in Pinocchio.
    """

    def __init__(self, module: Any, model: Any) -> None:
        self.q, self.v, self.tau = q, v, tau = state(model)
        pin, joints = import_module("pinocchio"), dict(zip(model.names, model.joints, strict=True))
        names = [name for name in model.names if name in module.q_names]
        values = {name: q[joints[name].idx_q] for name in names}
        values |= {f"{name}_dot": v[joints[name].idx_v] for name in names}
        if model.nq > model.nv:
            R = pin.Quaternion(*q[[6, 3, 4, 5]]).toRotationMatrix()
            base = ("x", "y", "z", "e0", "e1", "e2", "e3", "x_dot", "y_dot", "z_dot", "wx", "wy", "wz")
            there = np.concatenate([q[:3], q[[6, 3, 4, 5]], R @ v[:3], v[3:6]])
            values |= {f"base_{name}": x for name, x in zip(base, there, strict=True)}
        self.x = np.array([values[name] for name in module.x_names])
        self.u = np.array([tau[joints[name.removeprefix("tau_")].idx_v] for name in module.u_names])
        self.own = [module.n_q + module.v_names.index(f"{name}_dot") for name in names]
        self.places = [joints[name].idx_v for name in names]
        damped = tau - np.asarray(model.damping) * v
        self.reference = np.array(pin.aba(model, model.createData(), q, v, damped))

    def difference(self, x_dot: np.ndarray) -> float:
        """Of accelerations of joints from Pinocchio's, relative to the largest."""
        gap = np.abs(x_dot[self.own] - self.reference[self.places]).max()
        return float(gap / np.abs(self.reference).max())


def pinocchio_calls(model: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, Callable[[], Any]]:
    """Its algorithms by the names of our kernels; ``a`` are torques where these are what is given."""
    pin, data = import_module("pinocchio"), model.createData()
    return {
        "mass_matrix": lambda: pin.crba(model, data, q),
        "inverse_dynamics": lambda: pin.rnea(model, data, q, v, a),
        "rhs": lambda: pin.aba(model, data, q, v, a),
        "inverse_dynamics_derivatives": lambda: pin.computeRNEADerivatives(model, data, q, v, a),
        "jacobian": lambda: pin.computeABADerivatives(model, data, q, v, a),
    }


def pinocchio_timed(model: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray, kernel: str) -> dict[str, Timed]:
    """An algorithm called from Python, and the same of a model without joints, which is what the call costs."""
    nothing, empty = np.zeros(0), import_module("pinocchio").Model()
    return {
        "Pinocchio": timed(pinocchio_calls(model, q, v, a)[kernel]),
        "a call": timed(pinocchio_calls(empty, nothing, nothing, nothing)[kernel]),
    }


def mujoco_kernel(model: Any, x: np.ndarray, tau: np.ndarray) -> Kernel:
    """Forward dynamics of a Pinocchio model by MuJoCo from C."""
    package = Path(str(import_module("mujoco").__file__)).parent
    library = next(package.glob("libmujoco.so*"))
    link = [f"-I{package / 'include'}", str(library), f"-Wl,-rpath,{package}"]
    code = compile_text(MUJOCO, ["-O2"], link)
    with TemporaryDirectory() as folder:
        path = Path(folder, "robot.xml")
        path.write_text(as_mjcf(model), encoding="utf-8")
        if code.prepare(str(path).encode()):
            raise RuntimeError("MuJoCo refuses the robot")
    x = x.copy()
    if model.nq > model.nv:
        x[3:7] = np.roll(x[3:7], 1)
    return Kernel(code.kernel, x, len(x), tau)


def as_mjcf(model: Any) -> str:
    """A Pinocchio model as MJCF text, without contacts."""
    pin = import_module("pinocchio")

    def numbers(*values: float) -> str:
        return " ".join(repr(float(x)) for x in values)

    def body(k: int) -> str:
        place, inertia, joint = model.jointPlacements[k], model.inertias[k], model.joints[k]
        x, y, z, w = pin.Quaternion(place.rotation).coeffs()
        J, kind = np.asarray(inertia.inertia), joint.shortname()
        if kind == "JointModelFreeFlyer":
            text = "<freejoint/>"
        else:
            axis = numbers(*np.eye(3)["XYZ".index(kind[-1])])
            text = f'<joint type="hinge" axis="{axis}" damping="{float(model.damping[joint.idx_v])!r}"/>'
        full = numbers(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        below = "".join(body(other) for other in range(k + 1, model.njoints) if model.parents[other] == k)
        return (
            f'<body pos="{numbers(*place.translation)}" quat="{numbers(w, x, y, z)}">{text}'
            f'<inertial pos="{numbers(*inertia.lever)}" mass="{float(inertia.mass)!r}" fullinertia="{full}"/>'
            f"{below}</body>"
        )

    roots = "".join(body(k) for k in range(1, model.njoints) if model.parents[k] == 0)
    return (
        '<mujoco><compiler autolimits="true" balanceinertia="false" boundmass="0"/>'
        '<option gravity="0 0 -9.81"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{roots}</worldbody></mujoco>"
    )


# -- heyoka ------------------------------------------------------------------------------------------------------------
def heyoka_system(program: Any, values: Mapping[str, float]) -> list[tuple[Any, Any]]:
    """The straight-line right-hand side of a program, node by node, as heyoka's pairs; values of its parameters."""
    hk = import_module("heyoka")
    block = next(b for b in program.blocks if b.name == "rhs")
    names = [*program.coordinates, *program.velocities]
    variables = dict(zip(names, hk.make_vars(*(f"x{k}" for k in range(len(names)))), strict=True))
    operations = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "neg": lambda a: -a,
        "sin": hk.sin,
        "cos": hk.cos,
    }
    made: dict[int, Any] = {}
    for i in reachable(program.graph, [y.id for y in block.outputs]):
        kind, *given = program.graph.nodes[i]
        if kind == "const":
            made[i] = hk.expression(float(given[0]))
        elif kind == "sym":
            made[i] = variables.get(given[0]) if given[0] in variables else hk.expression(float(values[given[0]]))
        else:
            made[i] = operations[kind](*(made[k] for k in given))
    return [(variables[name], made[y.id]) for name, y in zip(names, block.outputs, strict=True)]


class Heyoka:
    """heyoka's Taylor method over a system, ready to be run again and again."""

    def __init__(self, equations: list[tuple[Any, Any]], tolerance: float) -> None:
        self.integrator = import_module("heyoka").taylor_adaptive(equations, [0.0] * len(equations), tol=tolerance)

    def __call__(self, x0: np.ndarray, end: float) -> np.ndarray:
        """The state at a time, from x0 at time 0."""
        self.integrator.time = 0.0
        self.integrator.state[:] = x0
        self.integrator.propagate_until(end)
        return np.array(self.integrator.state)


def heyoka_exact(equations: list[tuple[Any, Any]], x0: np.ndarray, end: float) -> np.ndarray:
    """The state at a time by long doubles, where the machine has them, far below all tolerances asked."""
    start, options = [np.longdouble(x) for x in x0], {"fp_type": np.longdouble, "compact_mode": True}
    integrator = import_module("heyoka").taylor_adaptive(equations, start, tol=np.longdouble(1e-19), **options)
    integrator.propagate_until(np.longdouble(end))
    return np.array(integrator.state, dtype=float)
