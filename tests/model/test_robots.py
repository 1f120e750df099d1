"""Robots that PyPI packages ship: URDF against Pinocchio, MJCF against MuJoCo, fixed and floating, by every method.

Always, every robot on its own base by the method that is chosen for large trees, in NumPy; by ``make thorough`` all
methods on all bases, in C too.
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from mujoco_judge import Judge as MujocoJudge
from pinocchio_judge import Judge as PinocchioJudge
from refusals import refuses
from robot_comparison import Compiled, difference, largest_differences
from shipped_robots import mjcf_models, urdf_robots

import eomgen as eg

ROBOTS, MODELS = urdf_robots(), mjcf_models()
#: What robots are simulated by; the other forms are held against these elsewhere.
FORMS = ("embedding", "lagrange", "recursive")
LIMIT = 1e-9
FEW = 8
FIXED, FLOATING, ANGLES = "fixed", "euler_parameters", "euler_angles"
OWN = [(name, FLOATING if floating else FIXED) for name, (_, floating) in ROBOTS.items()]
MASSLESS = [name for name in ("cart-pole", "pendulum of five") if name in ROBOTS]  #: their roots
OTHER = [
    (name, FIXED if floating else FLOATING)
    for name, (_, floating) in ROBOTS.items()
    if name not in MASSLESS and name != "iris"  # a drone: nothing moves once it is fixed
]
TURNED = [(name, ANGLES) for name in ("panda", "bolt", "solo12", "anymal", "borinot", "talos")]
#: By all methods always; MJCF models of this list have free or ball joints, which turn either way.
ALWAYS = ("finger", "bolt", "acrobot", "fish")
TURNING = ("humanoid", "humanoid of Gymnasium", "fish", "ant", "humanoid of motion capture")


def marked(cases: list[tuple[str, str, str]], own: Any) -> list[Any]:
    """All but some cases by ``make thorough``."""
    kept = [name in ALWAYS or (method == "recursive" and own(name, base)) for name, base, method in cases]
    return [c if k else pytest.param(*c, marks=pytest.mark.thorough) for c, k in zip(cases, kept, strict=True)]


def load(name: str, base: str, **options: Any) -> Any:
    rotation = ANGLES if base == FIXED else base
    options = {"mimic": "independent", **options}  # as in Pinocchio
    return eg.load(ROBOTS[name][0], floating=base != FIXED, rotation=rotation, actuate=True, **options)


def compare(model: Any, judge: Any, method: str, thorough: bool, large: bool) -> None:
    equations = model.derive(method)
    plain = Compiled(equations, "numpy")
    states = judge.states(plain.module, 20 if thorough else 4, seed=plain.module.n_v)
    runs = [plain]
    if thorough and (len(states[0].v) <= FEW or large):
        runs.append(Compiled(equations, optimize=0, lanes=0))  # called state by state
    for run in runs:
        worst = largest_differences(model, run, states)
        assert max(worst.values()) <= LIMIT, (run.module.metadata["target"], worst)


URDF_CASES = [(name, base, method) for name, base in [*OWN, *OTHER, *TURNED] for method in FORMS]


@pytest.mark.parametrize(("name", "base", "method"), marked(URDF_CASES, lambda name, base: (name, base) in OWN))
def test_robot_equals_pinocchio(name: str, base: str, method: str, request: pytest.FixtureRequest) -> None:
    model = load(name, base)
    judge = PinocchioJudge(ROBOTS[name][0], base != FIXED, model, base)
    large = (name, base) in OWN and method != "lagrange"
    compare(model, judge, method, request.config.getoption("--thorough"), large)


ROTATIONS = (ANGLES, FLOATING)
MJCF_CASES = [(name, r, m) for name in MODELS for r in ROTATIONS[: 2 if name in TURNING else 1] for m in FORMS]


@pytest.mark.parametrize(
    ("name", "rotation", "method"), marked(MJCF_CASES, lambda name, rotation: rotation == ROTATIONS[name in TURNING])
)
def test_model_equals_mujoco(name: str, rotation: str, method: str, request: pytest.FixtureRequest) -> None:
    path, assets = MODELS[name]
    model = eg.load(path, assets=str(assets), rotation=rotation)
    large = (method == "embedding" and rotation == ANGLES) or (method == "recursive" and rotation == FLOATING)
    compare(model, MujocoJudge(path, model, rotation), method, request.config.getoption("--thorough"), large)


@pytest.mark.parametrize("name", MASSLESS)
def test_a_base_without_mass_cannot_float(name: str) -> None:
    refuses("EG-NO-INERTIA joints.base", lambda: load(name, FLOATING).compile(target="numpy", kernels=["rhs"]))


@pytest.mark.parametrize(("name", "base"), [("panda", FIXED), ("solo12", FLOATING)])
def test_written_apart_and_symbolic_it_is_the_same_robot(name: str, base: str, tmp_path: Path) -> None:
    model = load(name, base)
    judge, first = PinocchioJudge(ROBOTS[name][0], base != FIXED, model, base), Compiled(model.derive(), "numpy")
    states = judge.states(first.module, 3, seed=2)
    model.save(tmp_path / "robot.yaml")
    (one,), (two,) = first(states[:1]), Compiled(eg.load(tmp_path / "robot.yaml").derive(), "numpy")(states[:1])
    for key, value in one.items():
        assert (two[key] == value).all()
    apart = load(name, base, merge=False)
    run = Compiled(apart.derive(), "numpy")
    assert len(run.body_names) > len(first.body_names)
    assert max(largest_differences(apart, run, states).values()) <= LIMIT
    symbolic = load(name, base, symbolic=True)
    module = symbolic.compile(target="numpy", kernels=["mass_matrix", "bias"])
    assert module.n_p > 6 * (module.n_v - 6)
    assert module.mass_matrix(states[0].q) == pytest.approx(states[0].mass_matrix, rel=1e-9, abs=1e-10)
    heavier = module.mass_matrix(states[0].q, p=module.p * 2)
    assert abs(heavier - module.mass_matrix(states[0].q)).max() > 0.1


@pytest.mark.parametrize(("name", "floating"), [("anymal", True), ("panda", False)])
def test_auto_takes_what_needs_fewer_operations_and_says_so(name: str, floating: bool) -> None:
    equations = load(name, FLOATING if floating else FIXED).derive()
    choice = equations.choice
    assert str(choice) in " ".join(str(equations).split())  # folded at 80 columns
    assert equations.method == choice.method == min(choice.operations, key=lambda m: choice.operations[m])


# -- joints that mimic others -----------------------------------------------------------------------------------------
def laws_of(path: Path) -> dict[str, tuple[str, float, float]]:
    """Mimicking joint -> joint, multiplier and offset, as the file has them."""
    found = {}
    for joint in ElementTree.parse(path).getroot().iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed":
            numbers = (float(mimic.get(key, default)) for key, default in (("multiplier", "1"), ("offset", "0")))
            found[str(joint.get("name"))] = (str(mimic.get("joint")), *numbers)
    return found


def eliminate(velocities: tuple[str, ...], laws: dict[str, tuple[str, float, float]]) -> tuple[np.ndarray, list[str]]:
    """G (n_v, n_v - joints that mimic) with v = G v_moving, and the names of v_moving."""
    tied = {f"{joint}_dot": (f"{other}_dot", factor) for joint, (other, factor, _) in laws.items()}
    moving = [name for name in velocities if name not in tied]
    G = np.zeros((len(velocities), len(moving)))
    for k, name in enumerate(velocities):
        other, factor = tied.get(name, (name, 1.0))
        G[k, moving.index(other)] = factor
    return G, moving


MIMICKING = {"panda": (1, False), "baxter": (2, False), "pr2": (10, False), "panda flying": (1, True)}


@pytest.mark.parametrize(
    "case", ["panda", "panda flying", *(pytest.param(n, marks=pytest.mark.thorough) for n in ("baxter", "pr2"))]
)
def test_coupled_mimics_equal_pinocchio_without_them(case: str) -> None:
    name, (count, floating) = case.removesuffix(" flying"), MIMICKING[case]
    path = ROBOTS[name][0]
    laws = laws_of(path)
    assert len(laws) == count
    model = eg.load(path, floating=floating, actuate=True, mimic="coupling", rotation="euler_parameters")
    assert not any("mimic" in note for note in model.notes)
    equations = model.derive()
    module = equations.compile(
        "numpy", kernels=["mass_matrix", "rhs", "embedded_mass_matrix", "constraints", "centroidal"]
    )
    assert module.n_dof == module.n_v - count
    G, moving = eliminate(module.v_names, laws)
    order = [moving.index(f"{name}_dot" if f"{name}_dot" in moving else name) for name in equations.independent]
    judge = PinocchioJudge(path, floating, model)
    for drawn in judge.states(module, 5, seed=3):
        q, v = drawn.q.copy(), G @ drawn.v[[module.v_names.index(name) for name in moving]]
        for joint, (other, factor, offset) in laws.items():
            q[module.q_names.index(joint)] = factor * q[module.q_names.index(other)] + offset
        s = judge.at(module.q_names, module.v_names, q, v, drawn.a, drawn.tau)
        assert np.abs(module.constraints(q)).max() < 1e-14
        assert difference(module.mass_matrix(q), s.mass_matrix) < LIMIT
        assert np.abs(module.center_of_mass(q) - s.com).max() < LIMIT
        reduced = G.T @ s.mass_matrix @ G
        assert difference(module.embedded_mass_matrix(q), reduced[np.ix_(order, order)]) < LIMIT
        expected = G @ np.linalg.solve(reduced, G.T @ (s.tau - s.bias))
        u = np.array([s.u[name] for name in module.u_names])
        found = module.rhs(0.0, np.concatenate([q, v]), u=u)[module.n_q :]
        assert difference(found, expected) < LIMIT * max(1.0, np.linalg.cond(reduced) / 1e3)


# -- derivatives ------------------------------------------------------------------------------------------------------
class Slopes(NamedTuple):
    """Derivatives of the forces along positions (a floating base's by its velocities) and velocities, by Pinocchio."""

    by_position: np.ndarray
    by_velocity: np.ndarray
    mass_matrix: np.ndarray


def slopes(judge: PinocchioJudge, module: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Slopes:
    """Of J^T tau(q, J v, J a + b): the base's linear velocity is in body axes there, l = R^T v_l, and b_l = -w x l."""
    model, order = judge.pin, [judge.velocities[name] for name in module.v_names]
    n = model.nv
    J, bend = np.zeros((n, n)), np.zeros((n, n))  # pin's velocities by ours; change of b by ours
    J[order, range(n)] = 1.0
    place = judge.position(module.q_names, q)
    drift = np.zeros(n)
    turned = np.eye(3)
    if judge.flyer:
        turned = pin.XYZQUATToSE3(place[:7]).rotation.T
        J[:3] = turned @ J[:3]
        linear, omega = J[:3] @ v, J[3:6] @ v
        drift[:3] = -np.cross(omega, linear)
        bend[:3] = pin.skew(linear) @ J[3:6] - pin.skew(omega) @ J[:3]
    pv, pa, drag = J @ v, J @ a + drift, np.diag(model.damping)
    tau = pin.rnea(model, judge.data, place, pv, pa) + drag @ pv
    dq, dv, M = (x.copy() for x in pin.computeRNEADerivatives(model, judge.data, place, pv, pa))
    M, dv = np.triu(M) + np.triu(M, 1).T, dv + drag
    by_position = J.T @ dq @ J
    if judge.flyer:  # along a turn w of the base d(R^T) = -[w] R^T
        for k in range(n):
            w = J[3:6, k]
            dJ = np.zeros((n, n))
            dJ[:3] = -pin.skew(w) @ J[:3]
            db = np.zeros(n)
            db[:3] = -np.cross(omega, dJ[:3] @ v)
            by_position[:, k] += dJ.T @ tau + J.T @ (dv @ (dJ @ v) + M @ (dJ @ a + db))
    return Slopes(by_position, J.T @ (dv @ J + M @ bend), J.T @ M @ J)


def tangent(module: Any, q: np.ndarray) -> np.ndarray:
    """N (n_q, n_v) with q' = N v."""
    return np.array([module.rhs(0.0, np.concatenate([q, unit]))[: module.n_q] for unit in np.eye(module.n_v)]).T


@cache
def with_inverse(name: str, method: str, target: str) -> tuple[Any, PinocchioJudge]:
    base = dict(OWN)[name]
    model = load(name, base)
    kernels = ["inverse_dynamics", "inverse_dynamics_derivatives", "rhs", "jacobian", "mass_matrix"]
    options = {"optimize": 0} if target == "cython" else {}
    module = model.derive(method).compile(target, kernels=kernels, **options)
    return module, PinocchioJudge(ROBOTS[name][0], base != FIXED, model)


SLOPED = [("ur5", "auto", "numpy"), ("solo12", "auto", "numpy")]
FURTHER = [(n, "auto", "numpy") for n in ("panda", "kinova", "tiago", "baxter", "anymal", "g1", "talos")]
FURTHER += [("anymal", "embedding", "cython"), ("anymal", "recursive", "cython"), ("panda", "recursive", "cython")]


@pytest.mark.parametrize(
    ("name", "method", "target"), [*SLOPED, *(pytest.param(*case, marks=pytest.mark.thorough) for case in FURTHER)]
)
def test_derivatives_of_inverse_dynamics_are_those_of_pinocchio(name: str, method: str, target: str) -> None:
    """J. Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018."""
    module, judge = with_inverse(name, method, target)
    n_q = module.n_q
    for state in judge.states(module, 3, seed=7):
        q, v, a = state.q, state.v, state.a
        found, expected = module.inverse_dynamics_derivatives(q, v, a), slopes(judge, module, q, v, a)
        N = tangent(module, q)
        for mine, theirs in zip((found[0] @ N, *found[1:]), expected, strict=True):
            assert np.abs(mine - theirs).max() <= 1e-10 * np.abs(theirs).max()
        u = np.array([state.u[name] for name in module.u_names])
        forward = slopes(judge, module, q, v, state.acceleration)
        wanted = -np.linalg.solve(forward.mass_matrix, np.hstack([forward.by_position, forward.by_velocity]))
        J = module.jacobian(0.0, np.concatenate([q, v]), u=u)[n_q:]
        J = np.hstack([J[:, :n_q] @ N, J[:, n_q:]])
        size = max(1.0, np.linalg.cond(forward.mass_matrix) / 1e3) * np.abs(wanted).max()
        assert np.abs(J - wanted).max() <= 1e-10 * size
