"""Robots with closed loops: accelerations by eomgen, Pinocchio with constraints, and MuJoCo, from one MJCF text."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.program import BY_MOTIONS, BY_SYSTEM
from eomgen.expr.schedule import Operations

from .call import compile_call_loop, over_kernel
from .loop_robots import ROBOTS
from .report import Limit, Report, Table
from .robot_calls import in_turns
from .robot_kernels import timed

TITLE = "robots with closed loops beside Pinocchio and MuJoCo"
#: What peers take at least of our time, and the largest relative residual of accelerations of ours.
FASTER, RESIDUAL = 5.0, 1e-10
#: Of Pinocchio's proximal solver: tolerances, regularisation, steps; its residuals come nearest to ours with these.
PROXIMAL = (1e-12, 1e-12, 1e-10, 20)
#: MuJoCo with as small a residual as its solver reaches: until nothing changes, or so many iterations.
STRICT, ITERATIONS, LINE_SEARCH = "MuJoCo, tolerance 0", 100, 1e-10
PAUSE = 0.05  #: seconds of motion before the state that all are given
BESIDE = 1e-9  #: by how much positions are off the loops where ours steps onto them, as in an integrator


class Pinocchio:
    """A robot in Pinocchio, which judges the accelerations of all."""

    def __init__(self, path: Path) -> None:
        self.pin = pin = import_module("pinocchio")
        self.model, self.loops = pin.buildModelAndLegacyConstraintsFromMJCF(str(path))[:2]
        self.data, self.loop_data = self.model.createData(), pin.StdVec_RigidConstraintData()
        for loop in self.loops:
            self.loop_data.append(loop.createData())
        pin.initConstraintDynamics(self.model, self.data, self.loops, self.loop_data)
        self.names: list[str] = []
        for joint, name in list(zip(self.model.joints, self.model.names, strict=True))[1:]:
            body = name.removeprefix("Composite_").removesuffix("_0")
            self.names += [f"{body}_{k}" for k in range(joint.nv)]
        self.settings = pin.ProximalSettings(*PROXIMAL)
        self.torques = np.zeros(self.model.nv)

    def call(self, q: np.ndarray, v: np.ndarray) -> Callable[[], Any]:
        """Its constrained forward dynamics."""
        dynamics, model, data, settings = self.pin.constraintDynamics, self.model, self.data, self.settings
        torques, loops, loop_data = self.torques, self.loops, self.loop_data
        return lambda: dynamics(model, data, q, v, torques, loops, loop_data, settings)

    def residual(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> float:
        """By how much the connected points accelerate apart, over their accelerations."""
        model, data = self.model, self.model.createData()
        self.pin.forwardKinematics(model, data, q, v, a)

        def point(joint: int, place: Any) -> np.ndarray:
            motion, twist = place.actInv(data.a[joint]), place.actInv(data.v[joint])
            local = motion.linear + np.cross(twist.angular, twist.linear)
            return np.asarray((data.oMi[joint] * place).rotation @ local)

        worst, size = 0.0, 1.0
        for loop in self.loops:
            one = point(loop.joint1_id, loop.joint1_placement)
            other = point(loop.joint2_id, loop.joint2_placement)
            worst, size = max(worst, np.abs(one - other).max()), max(size, np.abs(one).max())
        return float(worst / size)


def taken(counts: Mapping[str, Operations]) -> int:
    """Operations of a call of rhs near the constraints, away from change points, with one Newton step."""
    blocks = BY_MOTIONS if counts.keys() >= set(BY_MOTIONS) else BY_SYSTEM
    return sum(counts[name].total for name in blocks)


def contest(name: str, folder: Path, rounds: int, burst: float, loop: Any) -> dict[str, Any]:
    """One robot: sizes, operations, residuals, and the least nanoseconds of one call of each."""
    mujoco = import_module("mujoco")
    path = folder / "robot.xml"
    path.write_text(ROBOTS[name]().text(), encoding="utf-8")
    equations = eg.load(path).derive()
    module = equations.compile()
    rates = dict.fromkeys((module.v_names[i] for i in module.layout.independent), 0.4)
    x = module.simulate((0.0, PAUSE), rates).x[:, -1]
    ours = module.rhs(0.0, x)[module.n_q :]

    peer = Pinocchio(path)
    place = [module.q_names.index(name) for name in peer.names]
    q, v = x[: module.n_q][place], x[module.n_q :][place]
    theirs = np.array(peer.call(q, v)())
    model = mujoco.MjModel.from_xml_path(str(path))
    data, empty = mujoco.MjData(model), mujoco.MjModel.from_xml_string("<mujoco/>")
    joints = [module.q_names.index(model.joint(k).name) for k in range(model.njnt)]
    data.qpos[:], data.qvel[:] = x[: module.n_q][joints], x[module.n_q :][joints]
    strict, exact = mujoco.MjModel.from_xml_path(str(path)), mujoco.MjData(model)
    strict.opt.tolerance, strict.opt.ls_tolerance, strict.opt.iterations = 0.0, LINE_SEARCH, ITERATIONS
    exact.qpos[:], exact.qvel[:] = data.qpos, data.qvel
    soft, solved = np.empty(module.n_v), np.empty(module.n_v)
    for settings, at, found in ((model, data, soft), (strict, exact, solved)):
        mujoco.mj_forward(settings, at)
        found[joints] = at.qacc
    nothing, none = import_module("pinocchio").Model(), mujoco.MjData(empty)
    zero, spare, pin = np.zeros(0), import_module("pinocchio").Model().createData(), import_module("pinocchio")
    open_x = x.copy()
    open_x[: module.n_q] += BESIDE * np.random.default_rng(1).normal(size=module.n_q)
    address, *pointers, kept = over_kernel(module, "rhs", x, np.empty(module.n_x))
    _, *beside, kept_too = over_kernel(module, "rhs", open_x, np.empty(module.n_x))
    actions = {
        "eomgen": lambda calls: float(loop(address, ctypes.c_long(calls), *pointers)),
        "eomgen, a step": lambda calls: float(loop(address, ctypes.c_long(calls), *beside)),
        "Pinocchio": timed(peer.call(q, v)),
        "MuJoCo": timed(lambda: mujoco.mj_forward(model, data)),
        STRICT: timed(lambda: mujoco.mj_forward(strict, exact)),
        "a call of Pinocchio": timed(lambda: pin.aba(nothing, spare, zero, zero, zero)),
        "a call of MuJoCo": timed(lambda: mujoco.mj_forward(empty, none)),
    }
    times = {who: sample.best for who, sample in in_turns(actions, rounds, burst).items()}
    calls = {who: times.pop(f"a call of {who}") for who in ("Pinocchio", "MuJoCo")}
    for who in ("Pinocchio", "MuJoCo", STRICT):
        times[who] -= calls[who.partition(",")[0]]
    del kept, kept_too
    counts = pipeline.build(equations, "c", ["rhs"]).counts
    return {
        "velocities": module.n_v, "rows": module.n_rows, "freedoms": module.n_dof,
        "method": equations.method, "operations": taken(counts),
        "ns": times,
        "residual": {
            "eomgen": peer.residual(q, v, ours[place]), "Pinocchio": peer.residual(q, v, theirs),
            "MuJoCo": peer.residual(q, v, soft[place]), STRICT: peer.residual(q, v, solved[place]),
        },
        "difference": float(np.abs(theirs - ours[place]).max() / np.abs(ours).max()),
    }  # fmt: skip


def run(quick: bool) -> Report:
    """All robots, the first alone if it is to be quick."""
    rounds, burst = (3, 2e-4) if quick else (60, 2e-3)
    found = {}
    with TemporaryDirectory() as name:
        loop = compile_call_loop(Path(name))
        for robot in [*ROBOTS][:1] if quick else ROBOTS:
            found[robot] = contest(robot, Path(name), rounds, burst, loop)
    rows: list[list[Any]] = []
    limits = []
    for robot, r in found.items():
        own, sizes = r["ns"]["eomgen"], [r[key] for key in ("velocities", "rows", "freedoms", "method", "operations")]
        rows.append([robot, *sizes, *r["ns"].values(), *(r["ns"][who] / own for who in ("Pinocchio", "MuJoCo", STRICT)),
                     *(f"{r['residual'][who]:.0e}" for who in ("eomgen", "Pinocchio", "MuJoCo", STRICT))])  # fmt: skip
        limits.append(Limit(f"{robot}: residual of the accelerations", r["residual"]["eomgen"], RESIDUAL))
        if not quick:
            for who in ("Pinocchio", "MuJoCo"):
                limits.append(Limit(f"{robot}, {who} over ours,", r["ns"][who] / own, FASTER, at_least=True))
    columns = ("robot", "n", "rows", "freedoms", "method", "operations", "eomgen ns", "with a step ns", "Pinocchio ns",
               "MuJoCo ns", "tolerance 0 ns", "Pinocchio over", "MuJoCo over", "tolerance 0 over",
               "residual", "Pinocchio's", "MuJoCo's", "tolerance 0")  # fmt: skip
    notes = (
        "One MJCF text for all: hinges and slides, points connected; a state after 0.05 s of motion from the first.",
        "Ours: rhs in a loop in C; it brings velocities onto the loops, and positions where these are off by more than",
        "rounding: with a step, which the others never make, off by 1e-9. Pinocchio: constraintDynamics of its wheel.",
        "MuJoCo: mj_forward, constraints as stiff as it allows (solimp 0.9999, the largest that it takes), so that its",
        "residual has a floor: a solver that goes on until nothing changes (tolerance 0) takes longer and leaves it.",
        "At a residual near ours, Pinocchio alone is a peer. Both from Python, less a call of an empty model.",
        "Residual: by how much connected points accelerate apart, relative, computed by Pinocchio from each result.",
        "Operations: of a call of rhs away from change points, with one Newton step of the projection.",
    )
    return Report((Table("accelerations", columns, rows),), tuple(limits), notes, found)
