"""Calls and outputs that sum over all bodies: against MuJoCo, and against the balance of momentum in simulations."""

from functools import cache

import mujoco
import numpy as np
import pytest
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg

XML = """
<mujoco><option gravity="0 0 0"/><worldbody>
 <body name="a" pos="0.1 0.2 0.3"><joint type="hinge" axis="0 0 1"/><inertial pos="0.1 -0.2 0.3" mass="2"
   fullinertia="0.3 0.4 0.5 0.01 0.02 0.03"/>
  <body name="b" pos="0.4 0.1 -0.2"><joint type="slide" axis="1 0 0"/><inertial pos="0.2 0.1 0" mass="1.5"
    fullinertia="0.2 0.25 0.3 0 -0.02 0.01"/></body>
  <body name="c" pos="-0.3 0.2 0.1"><joint type="hinge" axis="0 1 0"/><inertial pos="0 0.3 0.1" mass="0.7"
    fullinertia="0.1 0.15 0.12 0.01 0 0"/></body>
 </body></worldbody></mujoco>
"""


@cache
def tree(target: str = "numpy"):
    m = eg.Model("tree")

    def tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> dict[str, float]:
        return {"xx": xx, "yy": yy, "zz": zz, "xy": xy, "xz": xz, "yz": yz}

    a = m.body("a", mass=m.parameter("m_a", 2), com=(0.1, -0.2, 0.3), inertia=tensor(0.3, 0.4, 0.5, 0.01, 0.02, 0.03))
    b = m.body("b", mass=1.5, com=(0.2, 0.1, 0), inertia=tensor(0.2, 0.25, 0.3, 0, -0.02, 0.01))
    c = m.body("c", mass=0.7, com=(0, 0.3, 0.1), inertia=tensor(0.1, 0.15, 0.12, 0.01, 0, 0))
    m.revolute("J1", m.ground.at(0.1, 0.2, 0.3), a)
    m.prismatic("J2", a.at(0.4, 0.1, -0.2), b, axis="x")
    m.revolute("J3", a.at(-0.3, 0.2, 0.1), c, axis="y")
    com = m.center_of_mass
    for name, values in {
        "r": com.position, "v": com.velocity, "a": com.acceleration, "p": m.momentum,
        "L": m.angular_momentum(), "O": m.angular_momentum(m.ground), "B": m.angular_momentum(b.at(0.1, 0, 0)),
        "I": [x for row in m.inertia_about() for x in row], "G": [x for row in m.inertia_about(m.ground) for x in row],
        "M": [m.total_mass], "E": [m.total_energy],
    }.items():  # fmt: skip
        for k, value in enumerate(values):
            m.output(f"{name}{k}", value)
    return m.compile(target=target)


def states(mod, count: int = 4) -> np.ndarray:
    return np.random.default_rng(5).uniform(-1, 1, (mod.n_x, count))


@pytest.mark.parametrize("target", TARGETS)
def test_calls_and_outputs_equal_mujoco(target: str) -> None:
    mod = tree(target)
    world = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(world)
    order = [mod.q_names.index(name) for name in ("J1", "J2", "J3")]
    for x in states(mod).T:
        q, v = x[:3], x[3:]
        data.qpos[:], data.qvel[:] = q[order], v[order]
        mujoco.mj_forward(world, data)
        mujoco.mj_subtreeVel(world, data)
        com, velocity, angular = data.subtree_com[1], data.subtree_linvel[1], data.subtree_angmom[1]
        close = {"rtol": 1e-12, "atol": 1e-13}
        np.testing.assert_allclose(mod.center_of_mass(q), com, **close)
        np.testing.assert_allclose(mod.com_jacobian(q) @ v, velocity, **close)
        np.testing.assert_allclose(mod.momentum(x), [*(4.2 * velocity), *angular], **close)
        y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))

        def of(name: str, n: int = 3, y: dict[str, float] = y) -> np.ndarray:
            return np.array([y[f"{name}{k}"] for k in range(n)])

        np.testing.assert_allclose(of("r"), com, **close)
        np.testing.assert_allclose(of("v"), velocity, **close)
        np.testing.assert_allclose(of("p"), 4.2 * velocity, **close)
        np.testing.assert_allclose(of("L"), angular, **close)
        np.testing.assert_allclose(of("O"), angular + np.cross(com, 4.2 * velocity), **close)
        b = mod.poses(q)[mod.body_names.index("b")]
        point = b[:3, :3] @ [0.1, 0, 0] + b[:3, 3]
        np.testing.assert_allclose(of("B"), angular + np.cross(com - point, 4.2 * velocity), **close)
        inertia = sum(
            data.ximat[k].reshape(3, 3) @ np.diag(world.body_inertia[k]) @ data.ximat[k].reshape(3, 3).T
            + world.body_mass[k] * (d @ d * np.eye(3) - np.outer(d, d))
            for k in (1, 2, 3)
            for d in [data.xipos[k] - com]
        )
        np.testing.assert_allclose(mod.centroidal_inertia(q), inertia, **close)
        np.testing.assert_allclose(of("I", 9).reshape(3, 3), inertia, **close)
        about_ground = inertia + 4.2 * (com @ com * np.eye(3) - np.outer(com, com))
        np.testing.assert_allclose(of("G", 9).reshape(3, 3), about_ground, **close)
        assert y["M0"] == pytest.approx(4.2)
        assert y["E0"] == pytest.approx(sum(mod.energy(x)))


# -- names -------------------------------------------------------------------------------------------------------------
def pendulum(text: str, mass: object = 1, body: str = "bob") -> eg.Model:
    m = eg.Model("p")
    m.revolute("q", m.ground, m.body(body, mass=mass, com=(1, 0, 0), inertia={"zz": 1}))
    m.output("y", text)
    return m


@pytest.mark.parametrize("text", ["x(com)", "total_mass"])
def test_a_mechanism_without_mass_has_no_sums(text: str) -> None:
    refuses("EG-NO-INERTIA outputs", lambda: pendulum(text, mass=0).check())
