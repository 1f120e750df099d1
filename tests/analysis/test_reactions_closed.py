"""Reactions and multipliers against free-body diagrams, ADAMS, and the smallest reactions of redundant constraints."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import judges
import models
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from wrenches import Balance

import eomgen as eg
from eomgen import rotations
from eomgen.api.equations import derive

G = 9.81


def test_rod_of_a_pendulum() -> None:
    """A point mass on a rod: tension m (l w^2 + g cos) along it, nothing across it, whatever the bearing's axes."""
    m = eg.Model("rod", gravity=(0, -G, 0))
    bob = m.body("bob", mass=2.0, com=(0.7, 0, 0))
    m.revolute("A", m.ground.at(0.1, 0.2, 0.3, rpy=(0, 0, 0.5)), bob.at(0, 0, 0), coordinate="theta")
    mod = m.compile(target="numpy")
    for theta, rate in ((-2.0, 0.0), (-1.0, 3.0), (0.4, -5.0)):
        along = np.array([np.cos(theta + 0.5), np.sin(theta + 0.5), 0.0])
        tension = 2.0 * (0.7 * rate**2 - G * along[1])
        expected = [*(-tension * along), 0, 0, 0]
        np.testing.assert_allclose(mod.reactions(0.0, [theta, rate])[0], expected, atol=1e-13)
    # the centripetal part and gravity only: the bob accelerates freely across the rod


def test_pin_forces_of_a_slider_crank() -> None:
    """Eight equations of three free bodies with the accelerations of the closed-form motion."""
    r, l, m_c, m_r, m_s, tau, k = 0.1, 0.35, 1.0, 0.8, 0.5, 0.4, 200.0
    m = eg.Model("slider_crank", gravity=(0, -G, 0))
    crank = m.body("crank", mass=m_c, com=(r / 2, 0, 0), inertia={"zz": m_c * r**2 / 12})
    rod = m.body("rod", mass=m_r, com=(l / 2, 0, 0), inertia={"zz": m_r * l**2 / 12})
    slider = m.body("slider", mass=m_s)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod)
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.torque("motor", "A", tau)
    m.spring("k", m.ground.at(0.5, 0, 0), slider, stiffness=k, length=0.1)
    mod = m.compile(target="numpy")
    for theta, w in ((0.3, 10.0), (1.9, -4.0), (4.0, 20.0)):
        x = mod.x0(theta=theta, theta_dot=w)
        alpha = mod.rhs(0.0, x)[mod.n_q + mod.v_names.index("theta_dot")]
        e, n = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
        beta = -np.arcsin(r * np.sin(theta) / l)
        f, g = np.array([np.cos(beta), np.sin(beta)]), np.array([-np.sin(beta), np.cos(beta)])
        w_b = -r * w * np.cos(theta) / (l * np.cos(beta))
        a_b = (-r * alpha * e[0] + r * w**2 * e[1] + l * w_b**2 * f[1]) / (l * f[0])
        pin = r * (alpha * n - w**2 * e)
        a_c, a_r, a_s = pin / 2, pin + l / 2 * (a_b * g - w_b**2 * f), pin + l * (a_b * g - w_b**2 * f)
        s = r * e[0] + l * f[0]
        pull = k * ((0.5 - s) - 0.1)
        # unknowns A, B, C (forces of the predecessor on the successor), N; three bodies, moments about their centres
        K, b = np.zeros((8, 8)), np.zeros(8)
        K[0:2, 0:2], K[0:2, 2:4] = np.eye(2), -np.eye(2)
        b[0:2] = m_c * (a_c + np.array([0, G]))
        K[2, 0:2] = [r / 2 * e[1], -r / 2 * e[0]]
        K[2, 2:4] = [r / 2 * e[1], -r / 2 * e[0]]
        b[2] = m_c * r**2 / 12 * alpha - tau
        K[3:5, 2:4], K[3:5, 4:6] = np.eye(2), -np.eye(2)
        b[3:5] = m_r * (a_r + np.array([0, G]))
        K[5, 2:4] = K[5, 4:6] = [l / 2 * f[1], -l / 2 * f[0]]
        b[5] = m_r * l**2 / 12 * a_b
        K[6:8, 4:6] = np.eye(2)
        K[7, 6] = 1.0
        b[6:8] = m_s * (a_s + np.array([0, G])) - [pull, 0]
        K = np.delete(K, 7, axis=1)
        solved, left, *_ = np.linalg.lstsq(K, b, rcond=None)
        assert left.size == 0 or left[0] < 1e-18 * (b @ b)  # eight equations, seven unknowns: the motion is right
        found = mod.reactions(0.0, x)
        by_name = dict(zip(mod.joint_names, found, strict=True))
        plane = np.concatenate([by_name["A"][:2], by_name["B"][:2], by_name["C"][:2], by_name["D"][1:2]])
        np.testing.assert_allclose(plane, solved, rtol=0, atol=1e-10 * np.abs(solved).max())
        np.testing.assert_allclose(found[:, 5], 0.0, atol=1e-12)
        marks = mod.undetermined_reactions(0.0, x)
        np.testing.assert_array_equal(marks, np.array([[0, 0, 1, 1, 1, 0]] * 4, dtype=bool))
        np.testing.assert_allclose(found[:, 2:5], 0.0, atol=1e-12)  # the smallest of what is undetermined
        # reactions equal multipliers: C is cut, and its rows are the components of its force
        rows = [mod.constraint_labels.index(f"C.r_{letter}") for letter in "xy"]
        assert mod.metadata["loop_joint_names"] == ["C"]
        force = -mod.multipliers(0.0, x)[rows]
        C = by_name["C"][:2]
        turned = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ force for a in (0.0, theta)]
        assert min(np.abs(turned_force - C).max() for turned_force in turned) < 1e-9 * np.abs(C).max()


def test_pin_forces_of_a_four_bar() -> None:
    """Nine equations of three links for eight forces and the torque that holds the crank's speed."""
    mod = models.build("four_bar").compile(target="numpy")
    given = models.reference("four_bar_kinematics")
    assert given["name"]
    lengths = {"crank": 0.04, "coupler": 0.12, "rocker": 0.08}
    p = dict(zip(mod.p_names, mod.p, strict=True))
    rho = p.get("rho", 1.0)
    x = mod.x0()
    forces = mod.actuator_forces(0.0, x, {mod.minimal.q_names[0]: 3.0})
    outer = Balance(mod, models.build("four_bar").mechanism(), x)
    a = forces.a
    bodies = outer.bodies
    K, b = np.zeros((9, 9)), np.zeros(9)
    joints = {s.name: s for s in outer.mechanism.joints}
    names = list(mod.joint_names)
    for i, (body, length) in enumerate(lengths.items()):
        k = mod.body_names.index(body)
        alpha = (bodies.w_dot + bodies.J_w @ a)[k][2]
        w = bodies.w[k][2]
        arm = bodies.R[k] @ [length / 2, 0, 0]
        acc = (bodies.r_ddot + bodies.J_r @ a)[k] + alpha * np.cross([0, 0, 1], arm) - w**2 * arm
        mass = rho * length
        b[3 * i : 3 * i + 2], b[3 * i + 2] = mass * acc[:2], mass * length**2 / 12 * alpha
        for j, name in enumerate(names):
            for marker, sign in ((joints[name].successor, 1.0), (joints[name].predecessor, -1.0)):
                if marker.body == k:
                    d = outer.marker(marker)[1] - bodies.r[k] - arm
                    K[3 * i : 3 * i + 2, 2 * j : 2 * j + 2] += sign * np.eye(2)
                    K[3 * i + 2, 2 * j : 2 * j + 2] += sign * np.array([-d[1], d[0]])
    K[2, 8] = 1.0  # the torque on the crank
    solved = np.linalg.solve(K, b)
    found = forces.reactions[:, :2].ravel()
    np.testing.assert_allclose(found, solved[:8], atol=1e-7 * np.abs(solved).max())
    np.testing.assert_allclose(forces.forces, solved[8:], atol=1e-7 * np.abs(solved[8]))


def smallest(module: Any, mechanism: Any, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least norm of all reactions, moments over the model's length, by one pseudo-inverse; and what is undetermined."""
    judge = Balance(module, mechanism, x)
    length = module.metadata["length_scale"]
    columns, places = [], []
    for j, spec in enumerate(mechanism.joints):
        axes, point = judge.marker(spec.successor)
        if spec.joint.type_name == "revolute":
            blocks = [*np.hstack([np.eye(3), np.zeros((3, 3))]), *np.hstack([np.zeros((2, 3)), axes.T[:2]])]
        else:
            axis = judge.marker(spec.predecessor)[0]
            blocks = [*np.hstack([axis.T[:2], np.zeros((2, 3))]), *np.hstack([np.zeros((3, 3)), np.eye(3)])]
        for wrench in np.array(blocks) * [1, 1, 1, length, length, length]:
            total = np.zeros_like(judge.needed)
            judge.add(total, spec.successor.body, point, wrench)
            judge.add(total, spec.predecessor.body, point, wrench, -1.0)
            columns.append(total.ravel())
            places.append((j, wrench))
    K = np.array(columns).T
    found = np.linalg.pinv(K, rcond=1e-9) @ judge.needed.ravel()
    result = np.zeros((len(mechanism.joints), 6))
    null = np.linalg.svd(K)[2]
    rank = np.linalg.matrix_rank(K, tol=1e-9 * np.linalg.norm(K, 2))
    stress = np.zeros((len(mechanism.joints), 6, len(null) - rank))
    for (j, wrench), value, row in zip(places, found, null[rank:].T, strict=True):
        result[j] += value * wrench
        stress[j] += np.outer(wrench, row)
    return result, np.abs(stress).max(axis=2, initial=0.0) > 1e-7


@pytest.mark.parametrize("name", ["three_cranks", "skewed_four_bar", "tilted_four_bar", "peaucellier"])
def test_smallest_reactions_of_redundant_constraints(name: str) -> None:
    mechanism = dataclasses.replace(models.build(name).mechanism(), forces=())
    module = derive(SimpleNamespace(mechanism=lambda: mechanism), "auto").compile(target="numpy")  # type: ignore[arg-type]
    x = judges.random_states(module, 2, 1, position=0.05)[0]
    expected, undetermined = smallest(module, mechanism, x)
    np.testing.assert_allclose(module.reactions(0.0, x), expected, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_array_equal(module.undetermined_reactions(0.0, x), undetermined)
    assert undetermined.any()


def test_reactions_do_not_depend_on_the_joint_that_is_cut() -> None:
    """The same machine with other coordinates chosen, hence other cuts; a spring acts on a joint that is cut or not."""
    found, cuts, poses = [], set(), None
    for kept in ("B", "C", "D"):
        m = eg.Model(f"cut_{kept}", gravity=(0.3, -G, 0.5))
        bar = [m.body(n, mass=1.0 + i, com=(0.2, 0.03, 0.01), inertia=(0.01, 0.02, 0.02)) for i, n in enumerate("abc")]
        ends = {
            "A": (m.ground, bar[0]),
            "B": (bar[0].at(0.3, 0, 0), bar[1]),
            "C": (bar[1].at(0.6, 0, 0), bar[2].at(0.5, 0, 0)),
            "D": (m.ground.at(0.7, 0, 0), bar[2]),
        }
        for joint, pair in ends.items():
            m.revolute(joint, *pair, **({"coordinate": f"q{joint}"} if joint in ("A", kept) else {}))
        m.torsional_spring("k", joint="B", stiffness=3.0)
        m.initial(qA=1.0, qA_dot=2.0)
        if poses is None:
            m.guess(qB=-1.5)
        else:  # the branch of the first
            turns = [np.arctan2(R[1, 0], R[0, 0]) for R in poses[:, :3, :3]]
            m.guess(**{f"q{kept}": turns[2] - turns[1] if kept == "C" else turns[2]})
        mod = m.compile(target="numpy")
        x = mod.x0()
        here = mod.poses(x[: mod.n_q])
        poses = here if poses is None else poses
        np.testing.assert_allclose(here, poses, atol=1e-9)
        cuts.add(tuple(mod.metadata["loop_joint_names"]))
        found.append(mod.reactions(0.0, x))
    assert len(cuts) > 1
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)
    np.testing.assert_allclose(found[2], found[0], atol=1e-9)


def test_contact_force_of_a_rolling_disc(compiled: Callable[..., Any]) -> None:
    """The free joint exerts nothing; ground pushes with m (a - g) at the contact."""
    mod = compiled("rolling_disc")
    for x in judges.random_states(mod, 3, 2):
        np.testing.assert_allclose(mod.reactions(0.0, x), 0.0, atol=1e-9)
        a = mod.rhs(0.0, x)[mod.n_q :]
        acc = a[[mod.v_names.index(f"{axis}_dot") for axis in "xyz"]]
        force = mod.driving_forces(0.0, x)
        found = [force[f"roll.{row}"] for row in ("slip_x", "slip_y", "height")]
        np.testing.assert_allclose(found, 2.0 * (acc + np.array([0, 0, G])), atol=1e-9)


def test_torque_of_a_driver() -> None:
    """A driven pendulum: torque m l^2 theta'' + m g l cos theta, and the pin force of the prescribed motion."""
    m = eg.Model("driven", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, com=(0.5, 0, 0))
    m.revolute("A", m.ground, rod, coordinate="theta")
    m.coupling("drive", equation="theta - 0.3 - 2*t - 0.5*t**2")
    mod = m.compile(target="numpy")
    t = 0.7
    theta, rate = 0.3 + 2 * t + 0.5 * t**2, 2 + t
    x = np.array([theta, rate])
    torque = mod.driving_forces(t, x)["drive"]
    np.testing.assert_allclose(torque, 2.0 * 0.25 * 1.0 + 2.0 * G * 0.5 * np.cos(theta), rtol=1e-12)
    e, n = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    pin = 2.0 * (0.5 * (1.0 * n - rate**2 * e) + [0, G])
    np.testing.assert_allclose(mod.reactions(t, x)[0], [*pin, 0, 0, 0, 0], atol=1e-12)


def placed(body: Any, rotation: Rotation, position: Any) -> Any:
    rpy = rotations.euler_angles_from_matrix("zyx", rotation.as_matrix())[::-1]
    return body.at(*map(float, position), rpy=tuple(map(float, rpy)))


KINDS = {"rev": "revolute", "rev_spring": "revolute", "sph": "spherical", "pri": "prismatic", "cyl": "cylindrical"}


@pytest.mark.parametrize("case", models.reference("adams_single_body_joints")["cases"])
def test_reaction_histories_of_adams(case: str) -> None:
    """MSC ADAMS, stored with Project Chrono (data/testing/joints): ``rforce`` is minus the force on the body."""
    given = models.reference("adams_single_body_joints")["cases"][case]
    geometry = given["geometry"]
    m = eg.Model(case, gravity=(0, 0, -9.80665))
    body = m.body("body", mass=1, inertia=tuple(geometry["inertia_cm_frame"]))
    ground = Rotation.from_matrix(geometry["ground_joint_frame_columns_xyz"])
    frame, joint = (Rotation.from_matrix(geometry[key]) for key in ("cm_frame0", "body_joint_frame0"))
    arm = frame.inv().apply(np.subtract(geometry["body_point0_global"], geometry["cm0"]))
    base, end = placed(m.ground, ground, geometry["ground_point"]), placed(body, frame.inv() * joint, arm)
    kind = geometry["joint_type"]
    m.joint(KINDS[kind], "j", base, end)
    if kind == "rev_spring":
        m.torsional_spring("k", joint="j", stiffness=200)
        m.torsional_damper("d", joint="j", damping=10)
    rows = [row for row in given["rows"] if row["t"] <= 1.0]
    mod = m.compile(target="numpy")
    run = mod.simulate((0, 1.0), t_eval=[row["t"] for row in rows], rtol=1e-10, atol=1e-11)
    found = mod.reactions(run.t, run.x)[0, :3].T
    own = np.array([row["own"]["net_joint_force_on_body_global"] for row in rows])
    theirs = -np.array([row["rforce"] for row in rows])
    np.testing.assert_allclose(found, own, atol=2e-6 * np.abs(own).max())
    np.testing.assert_allclose(found, theirs, atol=2 * given["check"]["rforce_err"] + 1e-6)


@pytest.mark.parametrize("load", ["where(t > 2, 10, 0)", "10*max(s - 5, 0)", "10*(th > 3)", "10*abs(s)*(s < -1)"])
def test_loads_across_the_plane_are_refused_also_where_they_act_later(load: str) -> None:
    m = with_friction_in_a_loop((0, 0, load))
    with pytest.raises(eg.ModelError, match="the load of joint 'P' is undetermined"):
        m.compile(target="numpy")
    assert with_friction_in_a_loop((load, load, 0)).compile(target="numpy").n_dof == 1


def with_friction_in_a_loop(load: tuple[object, ...]) -> eg.Model:
    """A slider-crank in a plane, with friction by the force that its slide carries, and a force on the slider."""
    m = eg.Model("rubbing", gravity=(0, -9.81, 0))
    crank, rod, block = (m.body(n, mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.3)) for n in ("a", "b", "c"))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.revolute("B", crank.at(0.4, 0, 0), rod)
    m.prismatic("P", m.ground, block, axis="x", coordinate="s")
    m.revolute("C", rod.at(0.9, 0, 0), block)
    m.friction("rub", "P", coefficient=0.2, smoothing=1e-2)
    m.force("push", block, value=load)
    m.guess(B=-0.5, s=1.2)
    m.initial(th=0.4, th_dot=1.0)
    return m
