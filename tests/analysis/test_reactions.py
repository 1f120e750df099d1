"""Reactions balance every body by Newton and Euler and do no work in any motion the machine can make."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import judges
import mechanisms
import models
import numpy as np
import pinocchio as pin
import pytest
from wrenches import Balance, tangent

import eomgen as eg
from eomgen.api.equations import derive
from eomgen.generation import generate


def check_balance(
    module: Any, mechanism: Any, x: np.ndarray, applied: Callable[[Balance], np.ndarray] | None = None
) -> None:
    """Every body is in balance, and reactions do no work."""
    found = module.reactions(0.0, x)
    judge = Balance(module, mechanism, x)
    exerted = judge.exerted(found)
    if applied is not None:
        exerted += applied(judge)
    size = np.abs(judge.needed).max()
    np.testing.assert_allclose(exerted, judge.needed, atol=1e-8 * size, rtol=0)
    free = tangent(module, x[: module.n_q])
    for spec, wrench in zip(mechanism.joints, found, strict=True):
        np.testing.assert_allclose(wrench @ judge.relative(spec) @ free, 0.0, atol=1e-8 * size, rtol=0)


def moduled(made: Any, method: str = "auto", target: str = "numpy") -> Any:
    """A module of a random mechanism."""
    return derive(SimpleNamespace(mechanism=lambda: made.mechanism), method).compile(target=target)  # type: ignore[arg-type]


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("seed", range(3))
def test_every_body_of_random_trees(seed: int, rotation: str) -> None:
    made = mechanisms.random_mechanism(seed, 5, reverse=True, forces=False, rotation=rotation)
    module = moduled(made, "recursive" if seed % 2 else "embedding")
    for x in judges.random_states(module, seed, 2):
        check_balance(module, made.mechanism, x)
    assert not module.undetermined_reactions(0.0, x).any()


@pytest.mark.parametrize(("seed", "planar"), [(20, False), (22, False), (23, True), (24, True)])
def test_every_body_of_random_loops(seed: int, planar: bool) -> None:
    made = mechanisms.random_mechanism(seed, 5, planar=planar, reverse=True, forces=False, loop=True)
    module = moduled(made)
    for x in judges.random_states(module, seed, 2):
        check_balance(module, made.mechanism, x)


@pytest.mark.parametrize("name", ["slider_crank", "skewed_four_bar", "three_cranks", "spatial_loop", "peaucellier"])
def test_every_body_of_loops(name: str) -> None:
    bare = dataclasses.replace(models.build(name).mechanism(), forces=())
    module = moduled(SimpleNamespace(mechanism=bare))
    x = module.x0()
    x[module.n_q :] += 0.5
    check_balance(module, bare, module.project(x))


@pytest.mark.parametrize("seed", [31, 33])
def test_forces_of_drives_springs_and_dampers(seed: int) -> None:
    """The loads are written out here; a drive's wrench is a torque where its coordinate turns, a force where not."""
    types = ("revolute", "prismatic", "revolute", "cylindrical")
    made = mechanisms.random_mechanism(seed, 4, reverse=True, loop=True, types=types)
    module, mechanism = moduled(made), made.mechanism
    line = next(f for f in mechanism.forces if f.name == "s")

    def applied(judge: Balance) -> np.ndarray:
        total = np.zeros_like(judge.needed)
        here = line.path.end if line.path.end.body >= 0 else line.path.start
        axes, point = judge.marker(here)
        b, k = judge.bodies, here.body
        away = point - np.array([3.0, 2.0, 0.0])
        length = np.sqrt(away @ away)
        speed = b.v[k] + np.cross(b.w[k], point - b.r[k])
        pull = 20.0 * (length - 1.0) + 1.5 * (away @ speed) / length
        judge.add(total, k, point, np.array([*(-pull * away / length), 0, 0, 0]))
        judge.add(total, k, point, np.array([*(axes @ [1.0, -2.0, 0.0]), 0, 0, 0]))
        spec = mechanism.joints[0]
        name = spec.coordinates[0]
        column = module.kernels.motion("loop_coordinates") if name in module.loop_names else None
        assert column is None  # the first joint stays in the tree
        i = module.q_names.index(name)
        force = -3.0 * (x[i] - 0.2) - 0.4 * x[module.n_q + module.v_names.index(f"{name}_dot")] + 0.3
        along = force * judge.marker(spec.predecessor)[0][:, 2]
        wrench = [*along, 0, 0, 0] if spec.joint.coordinates[0].kind == "length" else [0, 0, 0, *along]
        _, at = judge.marker(spec.successor)
        judge.add(total, spec.successor.body, at, np.array(wrench))
        judge.add(total, spec.predecessor.body, at, np.array(wrench), -1.0)
        return total

    for x in judges.random_states(module, seed, 2):
        check_balance(module, mechanism, x, applied)


def test_a_chain_against_pinocchio() -> None:
    """``data.f`` of the recursive Newton-Euler algorithm is the force that the parent exerts, in joint axes."""
    made = mechanisms.random_mechanism(5, 5, forces=False, types=("revolute", "prismatic"))
    module, model = moduled(made), pin.Model()
    for k, kind in enumerate(made.kinds):
        outer, inner = (pin.SE3(p.rotation, p.position) for p in (made.outer[k], made.inner[k]))
        parent = made.parents[k]
        placed = (
            outer if parent < 0 else pin.SE3(made.inner[parent].rotation, made.inner[parent].position).actInv(outer)
        )
        axis = pin.JointModelRZ() if kind == "revolute" else pin.JointModelPZ()
        joint = model.addJoint(parent + 1, axis, placed, f"q{k}")
        body = pin.Inertia(made.masses[k], made.centers[k], made.inertias[k])
        model.appendBodyToJoint(joint, body, inner.inverse())
    model.gravity.linear = made.gravity
    data = model.createData()
    x = judges.random_states(module, 3, 1)[0]
    order = [module.q_names.index(f"q{k}") for k in range(5)]
    a = module.rhs(0.0, x)[5:]
    pin.forwardKinematics(model, data, x[:5][order])
    pin.rnea(model, data, x[:5][order], x[5:][order], a[order])
    found = module.reactions(0.0, x)
    for k in range(5):
        f = data.f[k + 1]
        expected = [*(data.oMi[k + 1].rotation @ f.linear), *(data.oMi[k + 1].rotation @ f.angular)]
        np.testing.assert_allclose(found[module.joint_names.index(f"q{k}")], expected, atol=1e-11)


@pytest.mark.parametrize("name", ["rolling_disc", "cam_follower", "planetary_gear", "rssr", "spatial_loop"])
def test_virtual_work_of_constraints_body_by_body(name: str, compiled: Callable[..., Any]) -> None:
    """C_q is what each row does on all bodies, summed, and along coordinates of the tree; in batches too."""
    module = compiled(name)
    states = np.array(judges.random_states(module, 4, 3, position=0.05)).T
    from eomgen.analysis.constrained import prepare
    from eomgen.analysis.joint_wrenches import joint_table, place
    from eomgen.analysis.self_stress import element_wrenches

    prepared = prepare(module, 0.0, states)
    table, geometry = joint_table(module), place(prepared)
    rows = np.array(geometry.rows)
    rows[[i for i, joint in enumerate(table["rows"]) if joint < 0]] = element_wrenches(prepared, table, geometry)
    for k in range(3):
        q = prepared.q[:, k]
        bodies = judges.Bodies(module, q, np.zeros(module.n_q))
        import rotations

        N = np.array([rotations.coordinate_rates(module.metadata, q, e) for e in np.eye(module.n_v)]).T
        moved = np.concatenate([bodies.J_r, bodies.J_w], axis=1) @ N
        C_q = module.constraint_jacobian(q, rows="all")
        np.testing.assert_allclose(np.einsum("cbi,bij->cj", rows[..., k], moved), C_q, atol=1e-9)


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disc", "rssr", "double_pendulum"])
def test_targets_batches_and_shapes(name: str, compiled: Callable[..., Any]) -> None:
    one, other = compiled(name), compiled(name, "cython")
    x = np.array(judges.random_states(one, 1, 4)).T
    for call in ("multipliers", "reactions"):
        many = getattr(one, call)(0.0, x)
        np.testing.assert_allclose(
            many, getattr(other, call)(0.0, x), atol=1e-10 * max(1.0, np.abs(many).max(initial=0))
        )
        single = np.stack([getattr(one, call)(0.0, column) for column in x.T], axis=-1)
        np.testing.assert_allclose(single, many, atol=1e-11 * max(1.0, np.abs(many).max(initial=0)))
        out = np.empty_like(many)
        assert getattr(one, call)(0.0, x, out=out) is out
        np.testing.assert_array_equal(out, many)
    assert one.undetermined_reactions(0.0, x).dtype == bool


def test_inputs_that_change_from_state_to_state(compiled: Callable[..., Any]) -> None:
    module = compiled("slider_crank")
    x = np.array(judges.random_states(module, 1, 3)).T
    u = np.array([[0.0, 2.0, -5.0]])
    found = module.reactions(0.0, x, u=u)
    for k in range(3):
        np.testing.assert_allclose(found[..., k], module.reactions(0.0, x[:, k], u=u[:, k]), atol=1e-10)
    assert np.abs(found[..., 2] - module.reactions(0.0, x[:, 2])).max() > 1.0
    with pytest.raises(eg.EomgenError, match=r"u must have shape \(1,\), or \(1, k\) for k states"):
        module.multipliers(0.0, x, u=np.zeros((1, 2)))


ALONE = """
import json, sys
sys.modules["scipy"] = sys.modules["eomgen"] = None
import slider_crank as model
x = model.x0()
hit = model.impact(0.0, x, lock=["s"])
found = [model.reactions(0.0, x), model.multipliers(0.0, x), model.actuator_forces(0.0, x).forces, hit.impulses,
         model.consistent(x + 0.05)]
print(json.dumps([y.tolist() for y in found]))
"""


def test_an_exported_package_has_them_with_numpy_alone(tmp_path: Path, compiled: Callable[..., Any]) -> None:
    generate(models.build("slider_crank"), tmp_path, target="numpy")
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    mod = compiled("slider_crank")
    x = mod.x0()
    here = [mod.reactions(0.0, x), mod.multipliers(0.0, x), mod.actuator_forces(0.0, x).forces,
            mod.impact(0.0, x, lock=["s"]).impulses, mod.consistent(x + 0.05)]  # fmt: skip
    for theirs, ours in zip(json.loads(done.stdout), here, strict=True):
        np.testing.assert_allclose(theirs, ours, atol=1e-9)


def test_what_is_refused(compiled: Callable[..., Any]) -> None:
    module = compiled("slider_crank")
    with pytest.raises(eg.EomgenError, match=r"x must have shape \(6,\) or \(6, k\)"):
        module.reactions(0.0, np.zeros(4))
    with pytest.raises(eg.EomgenError, match=r"t must be a number or have shape \(2,\)"):
        module.reactions(np.zeros(3), np.repeat(module.x0()[:, None], 2, axis=1))
    with pytest.raises(eg.EomgenError, match="out must be"):
        module.reactions(0.0, module.x0(), out=np.zeros(3))
    import sympy

    s, s_dot = sympy.symbols("s s_dot")
    bare = eg.Model.from_lagrangian("bare", s_dot**2 / 2 - s**2, [s]).compile(target="numpy")
    with pytest.raises(eg.EomgenError, match="no joints between bodies"):
        bare.reactions(0.0, bare.x0())
