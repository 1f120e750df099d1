"""Calls and outputs that sum over all bodies: against MuJoCo, and against the balance of momentum in simulations."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

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


@pytest.mark.parametrize("target", ["numpy", "cython"])
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


def test_batches_parameters_and_out() -> None:
    mod = tree()
    x = states(mod)
    q = x[:3]
    for call, given, shape in (
        (mod.center_of_mass, q, (3,)),
        (mod.com_jacobian, q, (3, 3)),
        (mod.momentum, x, (6,)),
        (mod.centroidal_inertia, q, (3, 3)),
    ):
        every = call(given)
        assert every.shape == (*shape, 4)
        for k in range(4):
            np.testing.assert_allclose(every[..., k], call(given[:, k]), rtol=1e-15, atol=1e-16)
        out = np.empty(shape)
        assert call(given[:, 0], out=out) is out
        np.testing.assert_array_equal(out, call(given[:, 0]))
        with pytest.raises(eg.UsageError, match="must have shape"):
            call(np.zeros(len(given) + 1))
        with pytest.raises(eg.UsageError, match="out must be .* of shape"):
            call(given[:, 0], out=np.empty(2))
        heavy = mod.bind(p={"m_a": 5.0})
        assert np.abs(getattr(heavy, call.name)(given) - every).max() > 1e-3


def flying(gravity: tuple[float, float, float]):
    m = eg.Model("flying", gravity=gravity)
    hull = m.body("hull", mass=3, com=(0.1, 0, 0.05), inertia=(0.3, 0.4, 0.5))
    arm = m.body("arm", mass=1, com=(0.3, 0, 0), inertia=(0.01, 0.05, 0.05))
    fan = m.body("fan", mass=0.5, com=(0, 0.1, 0), inertia=(0.02, 0.02, 0.03))
    m.free("F", m.ground, hull)
    m.revolute("A", hull.at(0.2, 0.1, 0), arm, axis="y")
    m.revolute("B", hull.at(-0.2, 0, 0.1), fan, axis="x")
    m.torsional_spring("s", "A", stiffness=4, angle=0.5)
    m.actuator("drive", "B", value="0.2*cos(3*t)")
    for name, values in {"p": m.momentum, "L": m.angular_momentum(m.ground), "H": m.angular_momentum()}.items():
        for k, value in enumerate(values):
            m.output(f"{name}{k}", value)
    for k in range(3):
        m.output(f"c{k}", m.center_of_mass.position[k])
        m.output(f"ac{k}", m.center_of_mass.acceleration[k])
    mod = m.compile(target="numpy")
    start = {"F_x_dot": 0.5, "F_y_dot": -0.3, "F_z_dot": 0.2, "F_1_dot": 0.6, "F_3_dot": 0.8, "A_dot": 1.0, "A": -0.4}
    return mod, mod.simulate((0, 1.5), initial=start, rtol=1e-11, atol=1e-12)


def column(run, name: str) -> np.ndarray:
    return np.array([run[f"{name}{k}"] for k in range(3)])


def test_momenta_of_a_free_system_are_kept() -> None:
    """Springs and motors inside change nothing: both momenta stay, the centre of mass moves on a straight line."""
    _, run = flying((0, 0, 0))
    assert np.ptp(run["A"]) > 0.5
    for name in ("p", "L", "H"):
        values = column(run, name)
        assert np.abs(values[:, 0]).max() > 0.1
        assert np.abs(values - values[:, :1]).max() < 1e-9
    straight = column(run, "c")[:, :1] + column(run, "p")[:, :1] / 4.5 * run.t
    assert np.abs(column(run, "c") - straight).max() < 1e-9
    assert np.abs(column(run, "ac")).max() < 1e-10


def test_gravity_changes_momenta_as_it_must() -> None:
    """p' = m g; about the origin of ground L' = c x m g, integrated along the parabola of the centre of mass."""
    g = np.array([0.5, -2.0, -9.81])
    _, run = flying(tuple(g))
    t, mass = run.t, 4.5
    p, c = column(run, "p"), column(run, "c")
    v = p[:, 0] / mass
    assert np.abs(p - p[:, :1] - mass * np.outer(g, t)).max() < 1e-8
    moved = np.cross(np.outer(c[:, 0], t).T + np.outer(v, t**2 / 2).T, mass * g).T
    assert np.abs(column(run, "L") - column(run, "L")[:, :1] - moved).max() < 1e-8
    assert np.abs(column(run, "H") - column(run, "H")[:, :1]).max() < 1e-9
    assert np.abs(column(run, "ac") - g[:, None]).max() < 1e-9


# -- names -------------------------------------------------------------------------------------------------------------
def pendulum(text: str, mass: object = 1, body: str = "bob") -> eg.Model:
    m = eg.Model("p")
    m.revolute("q", m.ground, m.body(body, mass=mass, com=(1, 0, 0), inertia={"zz": 1}))
    m.output("y", text)
    return m


def test_the_models_own_names_come_first() -> None:
    m = pendulum("total_mass + x(com)", body="com")
    m.parameter("total_mass", 7.0)
    mod = m.compile(target="numpy")
    assert mod.outputs(0.0, mod.x0(q=0.3))[0] == 7.0  # the origin of the body called com
    again = pendulum("total_mass", mass=3)
    again.output("total_mass", "total_mass")
    mod = again.compile(target="numpy")
    np.testing.assert_array_equal(mod.outputs(0.0, mod.x0(q=0.3)), [3.0, 3.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("angle(com)", "has no rotation"),
        ("x(comm)", "no body 'comm'"),
        ("momentum", "unknown name 'momentum'"),
        ("angular_momentum_x(bob.tip)", "no marker 'tip'"),
        ("inertia_zx(com)", "unknown function 'inertia_zx'"),
    ],
)
def test_unknown_sums_are_told(text: str, message: str) -> None:
    with pytest.raises(eg.ModelError, match=message):
        pendulum(text).mechanism()


@pytest.mark.parametrize("text", ["x(com)", "total_mass", "momentum_x", "inertia_zz(ground)"])
def test_a_mechanism_without_mass_has_no_sums(text: str) -> None:
    with pytest.raises(eg.ModelError, match="no body has a mass"):
        pendulum(text, mass=0).mechanism()


def test_a_bare_lagrangian_has_no_sums() -> None:
    import sympy

    q, q_dot = sympy.symbols("q q_dot")
    m = eg.Model.from_lagrangian("spring", q_dot**2 / 2 - q**2 / 2, [q])
    m.output("E", "total_energy")
    mod = m.compile(target="numpy")
    assert mod.outputs(0.0, np.array([3.0, 4.0]))[0] == 12.5
    with pytest.raises(eg.UsageError, match="has no momentum: no body of it has a mass"):
        mod.momentum(np.zeros(2))
    m.output("p", "momentum_x")
    with pytest.raises(eg.ModelError, match="no bodies"):
        m.mechanism()


def test_forces_use_sums_but_no_energies() -> None:
    """Momentum p of a point mass and inertia 1 about its centre at radius 1: p_x = -m q' sin(q), p_y = m q' cos(q)."""
    m = pendulum("1", mass=3)
    m.torque("T", "q", "2*total_mass - 0.5*momentum_y + momentum_x*angular_momentum_z(ground) - x(com)")
    for target in ("numpy", "cython"):
        mod = m.compile(target=target)
        q, v = 0.4, 1.7
        torque = 6 - 0.5 * 3 * v * np.cos(q) - 3 * v * np.sin(q) * 4 * v - np.cos(q)
        assert mod.rhs(0.0, np.array([q, v]))[1] == pytest.approx(torque / 4, rel=1e-14)
    m = pendulum("1")
    m.torque("T", "q", "total_energy")
    with pytest.raises(eg.ModelError, match="total_energy"):
        m.mechanism()


def test_a_negative_mass_is_refused_at_run_time_too() -> None:
    mod = tree()
    for given in ({"m_a": -1.0}, np.array([-1.0])):
        with pytest.raises(eg.UsageError, match=r"bodies\.a\.mass: is -1 with m_a = -1; give a mass of 0 or more"):
            mod.bind(p=given)
    with pytest.raises(eg.UsageError, match=r"bodies\.a\.mass"):
        mod.simulate((0, 0.1), parameters={"m_a": -1.0})
    m = pendulum("1", mass="m")
    m.parameter("m", 1.0)
    m.check_inertia = False
    m.compile(target="numpy").bind(p={"m": -0.5})
