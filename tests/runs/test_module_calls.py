"""Calls of a module: shapes, batches, arguments by place, by name, as text, in memory of the result, from threads."""

import functools
import math
import sys
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import models
import mujoco
import numpy as np
import pytest
from analysed import compiled
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg


@pytest.mark.parametrize("target", TARGETS)
def test_shapes_of_every_call_for_one_state_and_a_batch(target: str) -> None:
    """Of a linkage with a redundant row; strided, lists and other real types mean the same."""
    m = models.build("three_cranks")
    m.torque("motor", "A1", m.input("tau")), m.output("angle", "theta2")
    mod = m.compile(target=target)
    n, n_q, n_rows = mod.n_x, mod.n_q, len(mod.constraints(mod.x0()[: mod.n_q], rows="all"))
    assert n_rows == mod.n_c + 1
    x = mod.x0()
    batch = np.repeat(x[:, None], 4, axis=1)
    timed = {"rhs": (n,), "jacobian": (n, n), "bias": (mod.n_v,), "outputs": (mod.n_y,), "input_jacobian": (n, mod.n_u)}
    state = {"energy": (2,), "project": (n,), "velocity_constraints": (mod.n_c,), "momentum": (6,)}
    position = {
        "mass_matrix": (mod.n_v, mod.n_v), "embedded_mass_matrix": (1, 1), "poses": (mod.n_bodies, 4, 4),
        "constraints": (mod.n_c,), "constraint_jacobian": (mod.n_c, mod.n_v), "center_of_mass": (3,),
    }  # fmt: skip
    for name, shape in (timed | state | position).items():
        call, before = getattr(mod, name), (0.0,) if name in timed else ()
        one, many = (x[:n_q], batch[:n_q]) if name in position else (x, batch)
        result, every = call(*before, one), call(*before, many)
        assert (result.shape, every.shape) == (shape, (*shape, 4)), name
        np.testing.assert_allclose(every[..., 2], result, rtol=1e-12, atol=1e-12)
        wide = np.zeros((len(one), 8))
        wide[:, ::2] = many
        np.testing.assert_array_equal(call(*before, wide[:, ::2]), every)
        np.testing.assert_array_equal(call(*before, one.tolist()), result)
        out = np.empty(shape)
        assert call(*before, one, out=out) is out
        np.testing.assert_array_equal(out, result)
        with pytest.raises(eg.UsageError):
            call(*before, np.zeros(n + 1))
        for wrong in ([0.0] * max(1, result.size), np.zeros(shape, np.float32), np.zeros((2, *shape))):
            refuses("EG-SHAPE out", call, *before, one, out=wrong)
    assert mod.inverse_dynamics(batch[:n_q], batch[n_q:], batch[n_q:]).shape == (mod.n_v, 4)
    refuses("EG-CHOICE independent", mod.constraints, x[:n_q], rows="some")
    assert "redundant at the reference" in mod.report()
    assert "1 degree of freedom" in repr(mod)


@pytest.fixture(scope="module")
def arm() -> Any:
    return compiled("two_link_manipulator", "cython")


def test_every_way_to_name_the_arguments_gives_the_same(arm: Any) -> None:
    x, p, u = np.array([0.3, -0.4, 1.0, 2.0]), arm.p * 1.1, np.array([0.5, -0.2])
    timed = {"t": 0.5, "x": x, "p": p, "u": u, "out": None}
    state = {"x": x[:2], "p": p, "u": u, "out": None, "t": 0.5}
    for call, every in ((arm.rhs, timed), (arm.bias, timed), (arm.mass_matrix, state), (arm.poses, state)):
        expected = call(*every.values())
        for positional in range(len(every) + 1):
            first = list(every.values())[:positional]
            rest = list(every.items())[positional:]
            np.testing.assert_array_equal(call(*first, **dict(rest)), expected)
            np.testing.assert_array_equal(call(*first, **dict(reversed(rest))), expected)
        out = np.empty_like(expected)
        assert call(**{**every, "out": out}) is out
        np.testing.assert_array_equal(out, expected)
        np.testing.assert_array_equal(functools.partial(call, **every)(), expected)
        made = {"".join(list(name)): value for name, value in every.items()}  # names that are not interned
        np.testing.assert_array_equal(call(**made), expected)
    np.testing.assert_array_equal(arm.rhs(0, x), arm.rhs(0.0, x, None, None, None))
    np.testing.assert_array_equal(arm.mass_matrix(x[:2]), arm.mass_matrix(x[:2], t=0.0))
    by_place = arm.inverse_dynamics(x[:2], x[:2], x[2:])
    np.testing.assert_array_equal(arm.inverse_dynamics(x[:2], a=x[2:], v=x[:2]), by_place)
    with pytest.raises(TypeError, match="unexpected keyword argument 'y'"):
        arm.rhs(0.0, x, y=1)
    with pytest.raises(TypeError, match="keywords must be strings"):
        arm.rhs(0.0, x, **{1: 2})


def test_results_may_overwrite_what_they_are_made_from(arm: Any) -> None:
    """x, u or p in the memory of ``out``: read whole before it is written; lists and strided arrays mean the same."""
    x, p, u = np.array([0.3, -0.4, 1.0, 2.0]), arm.p * 1.1, np.array([0.5, -0.2])
    expected = arm.bind(p=p, u=u).rhs(0.5, x)
    for start in range(5):
        room = np.zeros(12)
        inner = room[start : start + 2]
        inner[:] = u
        out = room[2:6]
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p, u=inner, out=out), expected)
        np.testing.assert_array_equal(out, expected)
    room = np.concatenate([p, np.zeros(8)])
    np.testing.assert_array_equal(arm.rhs(0.5, x, p=room[: len(p)], u=u, out=room[1:5]), expected)
    strided = np.zeros((2, 3))
    strided[:, 1] = u
    for given in (u.tolist(), strided[:, 1], u.astype(np.float64)[::1], u.astype(">f8")):
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p.tolist(), u=given), expected)
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p, u=given), expected)


def test_a_call_keeps_nothing_and_can_be_made_by_many_threads(arm: Any) -> None:
    x, out, t = np.array([0.3, -0.4, 1.0, 2.0]), np.empty(4), 0.123
    arguments = (x, out, t)
    before = [sys.getrefcount(value) for value in arguments]
    for _ in range(100):
        arm.rhs(t, x, out=out)
        arm.energy(x, t=t)
        with pytest.raises(eg.UsageError):
            arm.rhs(t, x, out=out[:1])
        with pytest.raises(TypeError):
            arm.rhs(t, x, out=out, wrong=x)
    assert [sys.getrefcount(value) for value in arguments] == before
    expected, wrong = arm.rhs(t, x), []

    def run() -> None:
        mine = np.empty(4)
        for _ in range(2000):
            if arm.rhs(t, x, out=mine) is not mine or not np.array_equal(mine, expected):
                wrong.append(mine.copy())

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def columns(call: Any, *arrays: np.ndarray, **more: Any) -> np.ndarray:
    """The call for one column after the other."""
    k = arrays[-1].shape[1]
    each = [call(*(np.ascontiguousarray(a[:, j]) for a in arrays), **more) for j in range(k)]
    return np.stack(each, axis=-1)


@pytest.mark.parametrize("k", [1, 3, 8, 33])
def test_columns_have_the_bits_of_single_calls(arm: Any, k: int) -> None:
    rng = np.random.default_rng(k)
    x = rng.uniform(-3.0, 3.0, (4, k))
    u = np.array([0.3, -0.2])
    np.testing.assert_array_equal(arm.rhs(0.0, x, u=u), columns(lambda s: arm.rhs(0.0, s, u=u), x))
    for call, rows in ((arm.mass_matrix, 2), (arm.energy, 4), (arm.poses, 2)):
        np.testing.assert_array_equal(call(x[:rows]), columns(call, x[:rows]))
    for timed in (arm.bias, arm.outputs, arm.jacobian):
        np.testing.assert_array_equal(timed(0.5, x), columns(lambda s, f=timed: f(0.5, s), x))
    q, v, a = x[:2], x[2:], rng.uniform(-3.0, 3.0, (2, k))
    np.testing.assert_array_equal(arm.inverse_dynamics(q, v, a), columns(arm.inverse_dynamics, q, v, a))


TIMED = ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian", "reactions", "multipliers")
OF_STATE = ("energy", "project", "velocity_constraints", "momentum")
OF_POSITION = (
    "mass_matrix", "embedded_mass_matrix", "poses", "constraints", "constraint_jacobian", "center_of_mass",
    "com_jacobian", "centroidal_inertia",
)  # fmt: skip

OF_MOTION = ("inverse_dynamics", "inverse_dynamics_derivatives")
CALLS = (*TIMED, *OF_STATE, *OF_POSITION, *OF_MOTION)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def turning(request: pytest.FixtureRequest) -> eg.Module:
    return compiled("slider_crank", request.param)


def arguments(turning: eg.Module, name: str, x: Any) -> tuple[Any, ...]:
    q, v = x[: turning.n_q], x[turning.n_q :]
    return (0.3, x) if name in TIMED else (x,) if name in OF_STATE else (q,) if name in OF_POSITION else (q, v, 0.5 * v)


def test_calls_take_values_by_name_under_either_name(turning: eg.Module) -> None:
    p, u = {"m_r": 1.7, "g": "9.81 - 0.2"}, {"tau": "2*0.3"}
    bound = turning.bind(p={"m_r": 1.7, "g": 9.61}, u=[0.6])
    x = bound.x0({"theta": 0.4, "theta_dot": 1.0})
    for name in CALLS:
        given = arguments(turning, name, x)
        call, wanted = getattr(turning, name), getattr(bound, name)(*given)
        for words in ({"p": p, "u": u}, {"parameters": p, "inputs": u}, {"parameters": bound.p, "inputs": bound.u}):
            for found, one in zip(call(*given, **words), wanted, strict=True):
                np.testing.assert_allclose(found, one, rtol=1e-12, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", ["rhs", "project", "mass_matrix", "inverse_dynamics"])
def test_what_is_given_twice_or_not_known_is_refused(turning: eg.Module, name: str) -> None:
    given, call = arguments(turning, name, turning.x0()), getattr(turning, name)
    second = [0.0] if name == "project" else []  # t
    for keys, places in (
        ({"p": {"m_r": 1.0}, "parameters": {"m_r": 1.0}}, ()),
        ({"parameters": {"m_r": 1.0}}, (*second, turning.p)),
        ({"u": [0.0], "inputs": {"tau": 0.0}}, ()),
    ):
        refuses("EG-CONFLICT argument", call, *given, *places, **keys)
    refuses("EG-NAME-UNKNOWN m_x", call, *given, p={"m_x": 1.0})
    refuses("EG-NUMBER tau", call, *given, inputs={"tau": "fast"})


@pytest.fixture(scope="module")
def links() -> Any:
    return models.build("double_pendulum").compile(target="numpy")


def same(a: Any, b: Any) -> None:
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.x, b.x)


def test_texts_are_numbers(links: Any) -> None:
    plain = links.simulate((0, math.pi / 4), {"theta1": math.pi / 6, "bend_dot": -0.5}, {"l1": 0.75})
    same(plain, links.simulate((0, "pi/4"), {"theta1": "deg(30)", "bend_dot": "-1/2"}, {"l1": "3/4"}))
    same(plain, links.simulate("pi/4", {"theta1": "30*pi/180", "bend_dot": "-sqrt(0.25)"}, {"l1": "0.5 + 0.25"}))
    np.testing.assert_array_equal(links.x0(theta1="deg(30)"), links.x0(theta1=math.pi / 6))
    np.testing.assert_array_equal(links.bind({"l1": "3/4"}).p, links.bind({"l1": 0.75}).p)
    given = {"rtol": "1e-6", "atol": "2e-8/2", "max_step": "1/50", "first_step": "1e-4"}
    same(links.simulate("0.2", **given), links.simulate(0.2, rtol=1e-6, atol=1e-8, max_step=0.02, first_step=1e-4))
    held = [links.equilibrium(hold={"theta1": value}).q for value in ("pi/3", math.pi / 3)]
    np.testing.assert_array_equal(*held)


def test_a_run_goes_on_from_the_last_state_of_another(links: Any) -> None:
    first = links.simulate((0.0, 1.0), rtol=1e-10)
    same(links.simulate((1.0, 2.0), first, rtol=1e-10), links.simulate((1.0, 2.0), first.x[:, -1], rtol=1e-10))
    many = links.simulate_many(1.0, initial=first, parameters={"g": [9.81, 1.62]})
    np.testing.assert_array_equal(many.x[:, 0], links.simulate((0, 1.0), first).x[:, -1])
    other = models.build("slider_crank").compile(target="numpy")
    refuses("EG-SHAPE theta1 B", other.simulate, 1.0, first)
    loop = other.simulate((0.0, 0.5))
    np.testing.assert_allclose(other.simulate((0.5, 0.6), loop).x[:, 0], loop.x[:, -1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("call", [lambda m: m.x0(theta=90), lambda m: m.simulate(0.01, initial={"theta": 90.0})])
def test_an_initial_angle_of_many_turns_is_noted(call: Callable[[Any], Any]) -> None:
    module = eg.load_example("pendulum").compile(target="numpy")
    with pytest.warns(UserWarning, match=r"theta = 90 .*14.3 .*deg\(90\)") as noted:
        call(module)
    assert [Path(str(one.filename)).name for one in noted] == [Path(__file__).name]
    module.x0(theta=12.0)
    module.simulate(0.01, initial={"theta": "deg(90)"})


@pytest.fixture(scope="module")
def held() -> dict[str, Any]:
    equations = models.build("pendulum").derive()
    module = equations.compile(target="numpy")
    return {"a Module": module, "a Trajectory": module.simulate(0.1), "Equations": equations}


WRONG = {
    "a Module": {"simualte": "simulate", "simulat_many": "simulate_many", "mass_matrx": "mass_matrix"},
    "a Trajectory": {"t_evnts": "t_events", "to_panda": "to_pandas"},
    "Equations": {"compil": "compile", "mass_matrx": "mass_matrix"},
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_name_is_reported_with_the_nearest(held: dict[str, Any], kind: str) -> None:
    for name, near in WRONG[kind].items():
        with pytest.raises(AttributeError, match=rf"^{kind} has no attribute '{name}'; did you mean .*\b{near}\b.*\?$"):
            getattr(held[kind], name)
        assert not hasattr(held[kind], name)
        assert getattr(held[kind], name, 3) == 3
    refuses(f"EG-UNAVAILABLE {kind} 'zzz'", getattr, held[kind], "zzz")


# -- calls and outputs that sum over all bodies ------------------------------------------------------------------------
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


# -- calls of derivatives ----------------------------------------------------------------------------------------------
EXAMPLES = Path(__file__).parents[2] / "examples"


def ball_and_hinge(turned: float = 0.0) -> eg.Model:
    """A ball joint in Euler parameters and a hinge with a motor; `turned` turns the frame of the first body."""
    m = eg.Model("ball_and_hinge", gravity=(0, 0, -9.81))
    length = m.parameter("l", 0.5)
    m.input("tau", 0.3)
    c, s = np.cos(turned), np.sin(turned)
    inertia = {"xx": 0.02, "yy": 0.03, "zz": 0.015}
    if turned:
        inertia = {"xx": 0.02 * c * c + 0.03 * s * s, "yy": 0.02 * s * s + 0.03 * c * c, "zz": 0.015}
        inertia["xy"] = (0.03 - 0.02) * s * c
    upper = m.body("upper", mass=1.5, com=(0, 0, "-l/2"), inertia=inertia)
    lower = m.body("lower", mass=0.8, com=(0.1, 0, -0.2), inertia={"xx": 0.01, "yy": 0.01, "zz": 0.002})
    frame = {"rpy": (0, 0, -turned)} if turned else {}
    m.spherical("ball", m.ground, upper.marker("top", at=(0, 0, 0), **frame), rotation="euler_parameters")
    hinge = m.revolute("hinge", upper.marker("end", at=(0, 0, -length), **frame), lower, axis="y", coordinate="b")
    m.actuator("motor", joint=hinge, value="tau*cos(b)")
    m.joint_damper("friction", joint=hinge, damping=0.1)
    return m


def state(module: Any, seed: int = 0, columns: tuple[int, ...] = ()) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    q, v, a = (random.uniform(-1, 1, (n, *columns)) for n in (module.n_q, module.n_v, module.n_v))
    return q, v, a


def slope(f: Any, h: float = 1e-3) -> np.ndarray:
    """f'(0) by central differences, extrapolated twice."""
    d = [(f(k * h) - f(-k * h)) / (2 * k * h) for k in (1, 2, 4)]
    first = [(4 * d[0] - d[1]) / 3, (4 * d[1] - d[2]) / 3]
    return np.asarray((16 * first[0] - first[1]) / 15)


@pytest.mark.parametrize("target", TARGETS)
def test_derivatives_are_slopes_of_the_calls(target: str) -> None:
    module = ball_and_hinge().compile(target=target)
    q, v, a = state(module)
    found = module.inverse_dynamics_derivatives(q, v, a)
    assert found.dtau_dq.shape == (4, 5)
    np.testing.assert_allclose(found.dtau_da, module.mass_matrix(q), atol=1e-14)
    for mine, place in zip(found, range(3), strict=True):
        for k, column in enumerate(mine.T):

            def along(e: float, place: int = place, k: int = k) -> np.ndarray:
                moved = [q.copy(), v.copy(), a.copy()]
                moved[place][k] += e
                return np.asarray(module.inverse_dynamics(*moved))

            np.testing.assert_allclose(column, slope(along), atol=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_differentiates_by_what_is_named(target: str) -> None:
    module = compiled("slider_crank", target)
    x = module.x0()
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="x"), module.jacobian(0.0, x))
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="u"), module.input_jacobian(0.0, x))
    by_p = module.jacobian(0.0, x, wrt="p")
    np.testing.assert_array_equal(by_p, module.parameter_jacobian(0.0, x))
    assert by_p.shape == (module.n_x, module.n_p)
    out = np.empty((module.n_x, module.n_u))
    assert module.jacobian(0.0, x, out=out, wrt="u") is out
    refuses("EG-SHAPE x q", module.jacobian, 0.0, x, wrt="q")


@pytest.mark.parametrize("name", [pytest.param("puma560", marks=pytest.mark.thorough), "slider_crank"])
def test_states_side_by_side_have_the_bits_of_one_alone(name: str) -> None:
    """Eleven columns: lanes of the processor, and a rest that does not fill them."""
    module = compiled(name, "cython")
    random = np.random.default_rng(5)
    x = module.project(module.x0()[:, None] + 0.1 * random.uniform(-1, 1, (module.n_x, 11)))
    q, v, a = x[: module.n_q], x[module.n_q :], random.uniform(-1, 1, (module.n_v, 11))
    first = module.inverse_dynamics_derivatives(q, v, a)
    for k in range(11):
        for mine, theirs in zip(first, module.inverse_dynamics_derivatives(q[:, k], v[:, k], a[:, k]), strict=True):
            np.testing.assert_array_equal(mine[..., k], theirs)


def strip(cells: int) -> eg.Model:
    """Two wheels, each by itself, on a strip of soil with cells of 3 cm."""
    m = eg.Model("strip", gravity=(0, -9.81, 0))
    for k in (0, 1):
        m.body(f"wheel{k}", mass=100.0, inertia={"zz": 10.0})
        m.planar(f"j{k}", m.ground, f"wheel{k}")
        m.initial(**{f"j{k}_y": 0.49, f"j{k}_x": 0.9 - 0.5 * k, f"j{k}_x_dot": 1.0, f"j{k}_3_dot": -2.2})
    wheels = [{"shape": "circle", "on": f"wheel{k}", "radius": 0.5, "width": 0.3} for k in (0, 1)]
    bed = {"shape": "bed", "on": m.ground, "length": 0.03 * cells, "cells": cells}
    m.contacts("sand", wheels, bed, {"soil": "dry_sand", "dissipation": 1.0})
    return m


@pytest.fixture(scope="module")
def soil() -> tuple[eg.Module, np.ndarray]:
    """The strip and a state in which the wheels stand in ruts."""
    mod = strip(60).compile()
    return mod, mod.simulate((0, 0.11), method="DOP853", rtol=1e-9).x[:, -1]


def test_columns_of_cells_by_differences(soil: Any) -> None:
    """Where differences of both sides agree: elsewhere a law turns, as that of the size of a shear that is 0."""
    mod, x = soil
    J, here, smooth, touched = mod.jacobian(0.0, x), mod.rhs(0.0, x), 0, 0
    for k in range(12, mod.n_x):
        e = np.zeros(len(x))
        e[k] = 1e-7
        ahead, back = ((mod.rhs(0.0, x + s * e) - here) / (s * e[k]) for s in (1.0, -1.0))
        size = np.abs(ahead).max()
        if np.abs(ahead - back).max() > 1e-3 * size:
            continue
        smooth += 1
        touched += np.count_nonzero(ahead[6:12]) > 0
        np.testing.assert_allclose(J[:, k], (ahead + back) / 2.0, atol=2e-5 * size + 1e-6)
    assert smooth > 150
    assert touched > 30
