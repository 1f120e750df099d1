"""The inertial regressor: column by column Pinocchio's, and Y pi the inverse dynamics of trees of every joint type."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from acceptance.test_random_trees import CASES
from mechanisms import _inertia, matrix
from pinocchio_judge import Judge
from powered import derived, tree
from robot_comparison import link_frames
from shipped_robots import urdf_robots

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.generation import generate
from eomgen.graph import vectors

KERNELS = ["inverse_dynamics", "inertial_terms"]
ROBOTS = ("ur5", "panda", "kinova", "xarm7", "z1", "tiago", "allegro hand", "solo12", "anymal", "hyq", "g1", "talos")
#: Pinocchio's ten parameters (m, mc, xx, xy, yy, xz, yz, zz) in our order.
THEIRS = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]


def robot(name: str) -> tuple[eg.Model, Judge, Any]:
    file, floating = urdf_robots()[name]
    rotation = "euler_parameters" if floating else "euler_angles"
    model = eg.load(file, floating=floating, rotation=rotation, mimic="independent")
    module = model.derive("recursive").compile(target="numpy", kernels=KERNELS)
    return model, Judge(file, floating, model, rotation), module


def pi_of(module: Any) -> np.ndarray:
    return np.array(list(module.standard_parameters().values()))


def of_pinocchio(judge: Judge, module: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Pinocchio's regressor in our velocities, (n_v, joints, 10), columns in our order."""
    theirs = judge.position(module.q_names, q)
    J, drift = np.zeros((judge.pin.nv, len(v))), np.zeros(judge.pin.nv)
    J[[judge.velocities[name] for name in module.v_names], range(len(v))] = 1.0
    if judge.flyer:  # its linear velocity is in body axes, ours in ground axes
        turned = pin.XYZQUATToSE3(theirs[:7]).rotation.T
        linear, omega = J[:3] @ v, J[3:6] @ v
        J[:3] = turned @ J[:3]
        drift[:3] = -np.cross(omega, turned @ linear)
    Y = pin.computeJointTorqueRegressor(judge.pin, judge.data, theirs, J @ v, J @ a + drift)
    return (J.T @ Y).reshape(len(v), -1, 10)[:, :, THEIRS]


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_have_the_columns_of_pinocchio_and_give_the_inverse_dynamics(name: str) -> None:
    model, judge, module = robot(name)
    for k, placed in enumerate(judge.pin.jointPlacements):  # eleven digits of a quarter turn are read as one
        whole = np.round(placed.rotation)
        if np.abs(placed.rotation - whole).max() < 1e-10:
            judge.pin.jointPlacements[k] = pin.SE3(whole, placed.translation)
    frames = link_frames(model)
    body_of = {}
    for frame in judge.pin.frames:
        if frame.type == pin.FrameType.BODY and frame.placement.isIdentity(1e-14) and frame.parentJoint:
            ours, placed = frames[frame.name]
            if ours is not None and np.abs(placed - np.eye(4)).max() < 1e-14:
                body_of.setdefault(frame.parentJoint, ours)
    assert len(body_of) == module.n_bodies == judge.pin.njoints - 1
    order = [module.body_names.index(body_of[joint]) for joint in range(1, judge.pin.njoints)]
    random = np.random.default_rng(3)
    q = random.uniform(-1, 1, (module.n_q, 5))
    v, a = random.uniform(-1, 1, (2, module.n_v, 5)) * np.array([[[3.0]], [[5.0]]])
    Y = module.regressor(q, v, a)
    assert Y.shape == (module.n_v, 10 * module.n_bodies, 5)
    for k in range(5):
        expected = of_pinocchio(judge, module, q[:, k], v[:, k], a[:, k])
        ours = Y[:, :, k].reshape(module.n_v, -1, 10)[:, order]
        size = np.abs(expected).max(axis=(0, 1))
        assert (np.abs(ours - expected) <= 1e-12 * size).all()
    damping = np.array([float(judge.pin.damping[judge.velocities[name]]) for name in module.v_names])
    torque = module.inverse_dynamics(q, v, a)
    found = np.einsum("ijk,j->ik", Y, pi_of(module)) + damping[:, None] * v
    assert np.abs(found - torque).max() <= 1e-12 * np.abs(torque).max()
    remainder = module.inertial_remainder(q, v, a)
    assert np.abs(remainder - damping[:, None] * v).max() <= 1e-12 * np.abs(torque).max()


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{'-'.join(c[0])}-{c[2]}")
def test_every_joint_type_and_any_inertia(case: Any) -> None:
    """Y knows nothing of the inertia: with that of one tree it gives the forces of the same tree with other bodies."""
    made = tree(*case)
    made = replace(made, mechanism=replace(made.mechanism, forces=()))
    random = np.random.default_rng(4)
    first = derived(made, "recursive").compile(target="numpy", kernels=KERNELS)
    q, v, a = random.uniform(-1, 1, first.n_q), *random.normal(size=(2, first.n_v))
    Y = first.regressor(q, v, a)
    for _ in range(3):
        graph = made.mechanism.graph
        bodies = tuple(
            replace(
                body,
                mass=graph.constant(random.uniform(0.5, 2.0)),
                com=vectors.vector(graph, random.uniform(-0.4, 0.4, 3).tolist()),
                inertia=matrix(graph, _inertia(random)),
            )
            for body in made.mechanism.bodies
        )
        other = derived(replace(made, mechanism=replace(made.mechanism, bodies=bodies)), "embedding")
        module = other.compile(target="numpy", kernels=KERNELS)
        torque = module.inverse_dynamics(q, v, a)
        assert Y @ pi_of(module) == pytest.approx(torque, rel=0, abs=1e-12 * np.abs(torque).max())


def arm(**options: Any) -> eg.Model:
    """Two links with a spring, friction, a drive's inertia and an input, all parameters by name."""
    m = eg.Model("arm", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "m1": 2.0, "m2": 1.2, "c": 0.2, "J": 0.3, "k": 5.0, "d": 0.4}.items():
        m.parameter(name, value)
    m.body("upper", mass="m1", com=("c", 0.02, 0), inertia=(0.02, 0.04, 0.05), markers={"tip": (0.5, 0, 0)})
    m.body("lower", mass="m2", com=(0.2, 0, 0), inertia={"zz": 0.03})
    m.revolute("shoulder", m.ground, "upper", coordinate="a", armature="J")
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.torsional_spring("spring", "elbow", stiffness="k")
    m.torsional_damper("damper", "shoulder", damping="d")
    m.torque("drive", "elbow", m.input("tau"))
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_what_is_not_inertial_remains(target: str) -> None:
    module = arm().derive().compile(target=target, kernels=KERNELS, **({"optimize": 0} if target == "cython" else {}))
    q, v, a = np.array([[0.3, 1.0], [-0.8, 0.2]]), np.array([[1.0, -2.0], [0.5, 1.5]]), np.array([[3.0, 0], [0, -4]])
    expected = np.array([0.3 * a[0] + 0.4 * v[0], 5.0 * q[1] - 0.7])
    found = module.inertial_remainder(q, v, a, u={"tau": 0.7})
    assert found == pytest.approx(expected, abs=1e-13)
    other = {"m1": 3.0, "c": 0.1, "J": 0.1}
    assert module.standard_parameters(other)["mx(upper)"] == pytest.approx(0.3, rel=1e-15)
    assert module.standard_parameters()["Ixx(upper)"] == pytest.approx(0.02 + 2.0 * 0.02**2)
    assert module.standard_parameters()["Ixy(upper)"] == pytest.approx(-2.0 * 0.2 * 0.02)
    expected[0] += (0.1 - 0.3) * a[0]
    assert module.inertial_remainder(q, v, a, u={"tau": 0.7}, p=other) == pytest.approx(expected, abs=1e-13)
    one, out = module.regressor(q[:, 1], v[:, 1], a[:, 1]), np.empty((2, 20, 2))
    assert module.regressor(q, v, a, out=out) is out
    assert one == pytest.approx(out[:, :, 1], abs=1e-14)


def test_wrong_calls_say_what_is_wrong() -> None:
    module = arm().compile(target="numpy")
    with pytest.raises(UsageError, match=r"q, v, a must have shapes \(2,\), \(2,\), \(2,\)"):
        module.regressor([0.1], [0.1, 0.2], [0.1, 0.2])
    with pytest.raises(UsageError, match="or \\(..., k\\) for k states"):
        module.regressor(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 4)))
    bare = eg.Model.from_equations("bare", ["x"], mass_matrix=[["1"]], forcing=["-x"]).compile(target="numpy")
    with pytest.raises(UsageError, match="has no bodies"):
        bare.regressor([0.1], [0.1], [0.1])


def test_a_generated_package_has_it_too(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By what it carries, without the equations."""
    generate(arm(), tmp_path, target="numpy")
    monkeypatch.syspath_prepend(str(tmp_path))
    package = __import__("arm")
    module = arm().compile(target="numpy")
    q, v, a = [0.1, 0.2], [0.3, -1.0], [2.0, 1.0]
    assert package.regressor(q, v, a) == pytest.approx(module.regressor(q, v, a), abs=1e-14)
