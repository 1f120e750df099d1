"""A constraint means the same multiplied by any number; units, far places, small wheels and loops beside large ones."""

from typing import Any

import models
import numpy as np
import pytest
from refusals import refused, refuses
from scipy.spatial.transform import Rotation
from sweeps import TARGETS

import eomgen as eg
from eomgen.expr import identity
from eomgen.expr.core import Expr, Graph, substitute


# -- Rows --------------------------------------------------------------------------------------------------------------
def pump(area, target):
    """Two pistons on one fluid, A1 x1 + A2 x2 = 0, beside two geared wheels; 1 N on the first."""
    m = eg.Model("pump", gravity=(0, 0, 0))
    a, b = m.body("a", mass=1.0), m.body("b", mass=1.0)
    m.prismatic("x1", m.ground, a)
    m.prismatic("x2", m.ground, b)
    m.parameter("A1", 2 * area)
    m.parameter("A2", area)
    m.coupling("flow", equation="A1*x1 + A2*x2")
    for name in "cd":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1.0, inertia={"zz": 1.0}))
    m.gear("mesh", "C", "D", teeth=(20, 40))
    m.actuator("push", joint="x1", value=1.0)
    return m.compile(target=target)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("area", [1e-12, 1e-8, 1.0, 1e9])
def test_areas_of_any_unit_leave_the_freedoms(area, target):
    """x2 = -2 x1, so that (m + 4 m) x1'' = 1."""
    mod = pump(area, target)
    assert mod.n_dof == 2
    x = mod.x0(x1=0.3, x1_dot=0.1)
    assert x[mod.x_names.index("x2")] == pytest.approx(-0.6, rel=1e-12)
    assert mod.rhs(0.0, x)[mod.x_names.index("x1_dot")] == pytest.approx(0.2, rel=1e-12)
    assert np.isfinite(mod.jacobian(0.0, x)).all()


@pytest.mark.parametrize("target", TARGETS)
def test_a_factor_changed_later_changes_the_size_of_its_row(target):
    mod = pump(1.0, target).bind(p={"A1": 2e-9, "A2": 1e-9})
    x = mod.x0(x1=0.3)
    assert x[mod.x_names.index("x2")] == pytest.approx(-0.6, rel=1e-12)
    off = np.array(x)
    off[mod.x_names.index("x1")] += 1e-3
    assert mod.project(off)[mod.x_names.index("x2")] == pytest.approx(-0.6 - 0.4e-3, rel=1e-12)  # nearest point
    assert mod.rhs(0.0, x)[mod.x_names.index("x1_dot")] == pytest.approx(0.2, rel=1e-12)


def crank(F, kind, target="numpy"):
    """A slider-crank beside two wheels that turn together: P = F Q, or F P = F Q."""
    m = eg.Model("crank", gravity=(0, -9.81, 0))
    r, l = 0.1, 0.35
    a = m.body("a", mass=1, com=(r / 2, 0, 0), inertia={"zz": 1e-3})
    b = m.body("b", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 8e-3})
    s = m.body("s", mass=0.5)
    models.join_slider_crank(m, (a, b, s), r, l, "th - s")
    for name in "pq":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1, inertia={"zz": 0.1}))
    if kind == "gear":
        m.gear("pair", "P", "Q", teeth=(1, F))
    elif kind == "coupling":
        m.coupling("pair", coordinates={"P": F, "Q": -F})
    elif kind == "curve":
        m.parameter("F", F)
        m.coupling("pair", equation="F*(sin(P) - Q)")
    m.initial = {"th": 0.3, "th_dot": 10.0}
    return m.compile(target=target)


@pytest.mark.parametrize("kind", ["gear", "coupling", "curve"])
@pytest.mark.parametrize("F", [1e-10, 1e-4, 1e6, 1e10])
def test_no_row_of_a_loop_is_lost_beside_a_large_or_small_one(kind, F):
    mod, alone = crank(F, kind), crank(1.0, "coupling")
    assert mod.n_dof == 2
    x = mod.x0()
    i, j = mod.x_names.index("th_dot"), alone.x_names.index("th_dot")
    assert mod.rhs(0.0, x)[i] == pytest.approx(alone.rhs(0.0, alone.x0())[j], rel=1e-10)


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_the_factor_of_a_row_of_velocities_does_not_matter(factor):
    """A skate on a plane, m x'' = 0 but for the knife edge: factor (x' sin h - y' cos h) = 0, coasting on a circle."""
    m = eg.Model("skate", gravity=(0, 0, 0))
    body = m.body("s", mass=2.0, inertia={"zz": 0.5})
    m.planar("place", m.ground, body, coordinates=["x", "y", "h"])
    m.parameter("f", factor)
    m.coupling("edge", equation="f*(x_dot*sin(h) - y_dot*cos(h))")
    for name in "cd":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1.0, inertia={"zz": 1.0}))
    m.gear("mesh", "C", "D", teeth=(20, 40))
    mod = m.compile(target="numpy")
    assert mod.n_dof == 3  # ahead, about, and the wheels
    x = mod.x0(h=0.4, h_dot=0.7, x_dot=np.cos(0.4))
    a = dict(zip(mod.x_names, mod.rhs(0.0, x), strict=True))
    np.testing.assert_allclose([a["x_dot"], a["y_dot"]], 0.7 * np.array([-np.sin(0.4), np.cos(0.4)]), atol=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_a_relation_that_parameters_leave_idle_holds_nothing(target):
    """3 k - l = 6e-17 for k = 0.1 and l = 0.3 is rounding of terms of 0.3: the pendulum beside a gear swings on."""
    m = eg.Model("idle", gravity=(0, -9.81, 0))
    m.parameter("k", 0.1), m.parameter("l", 0.3)
    for name in "ABC":
        m.revolute(name, m.ground, m.body(f"body{name}", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1}))
    m.gear("mesh", "B", "C", teeth=(20, 40))
    m.coupling("idle", equation="(3*k - l)*sin(A)")
    mod = m.compile(target=target)
    assert mod.n_dof == 2
    angle = 0.3
    swing = mod.rhs(0.0, mod.x0(A=angle, B=0.2))[mod.x_names.index("A_dot")]
    assert swing == pytest.approx(-9.81 * 0.5 * np.cos(angle) / (0.1 + 0.25), rel=1e-12)


@pytest.mark.parametrize(("k1", "k2"), [(0.1, 0.3), (0.0, 0.0)])
def test_a_relation_that_cancels_at_the_declared_values_is_refused_where_it_stands_alone(k1, k2):
    """3 * 0.1 - 0.3 is 5.6e-17: taken for a row it held A still; left out it would be missing with other values."""
    m = eg.Model("two", gravity=(0, -9.81, 0))
    a, b = (m.body(n, mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.5, 0, 0), b)
    m.parameter("k1", k1)
    m.parameter("k2", k2)
    m.coupling("none", equation="(3*k1 - k2)*sin(A)")
    refuses("EG-REDUNDANT constraints.none none.equation k1 k2", m.check)


# -- Far from the origin -----------------------------------------------------------------------------------------------
EPS = np.finfo(float).eps


def tether(R, length, rotation="euler_angles", at=0.0, target="numpy"):
    """Two bodies on an orbit of radius R, a rod between them, held at `at` from their origins."""
    m = eg.Model("tether", gravity=(0, 0, 0))
    a, b = m.body("a", mass=100.0, inertia=(1, 1, 1)), m.body("b", mass=50.0, inertia=(1, 1, 1))
    m.free("fa", m.ground, a, rotation=rotation)
    m.free("fb", m.ground, b, rotation=rotation)
    m.distance("rod", a.at(at, 0, 0) if at else a, b.at(-at, 0, 0) if at else b, length=length)
    m.point_gravity("ga", m.ground, "a", mu=3.986e14)
    m.point_gravity("gb", m.ground, "b", mu=3.986e14)
    m.initial = {"fa_x": R, "fb_x": R + length + 2 * at}
    return m.compile(target=target)


def places(mod, R, length, count):
    """States closed to rounding, in all directions from the centre and from each other."""
    random = np.random.default_rng(1)
    i, j = mod.x_names.index("fa_x"), mod.x_names.index("fb_x")
    for _ in range(count):
        x = np.array(mod.x0())
        out, along = (u / np.linalg.norm(u) for u in random.normal(size=(2, 3)))
        x[i : i + 3], x[j : j + 3] = R * out, R * out + length * along
        yield x


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("R", [7e6, 4e8, 1.5e11])
def test_states_closed_to_rounding_are_accepted(R, rotation, target):
    """mu / R^2 towards the centre for both, the rod being short; its length kept to rounding."""
    length = 10.0
    mod = tether(R, length, rotation, target=target)
    i, j = mod.x_names.index("fa_x"), mod.x_names.index("fb_x")
    for x in places(mod, R, length, 25):
        z = mod.project(x)
        assert np.linalg.norm(z[j : j + 3] - z[i : i + 3]) == pytest.approx(length, abs=16 * EPS * R)
        a = mod.rhs(0.0, x)[mod.n_q :]
        k = mod.v_names.index("fa_x_dot")
        pull = -3.986e14 * x[i : i + 3] / R**3
        np.testing.assert_allclose(a[k : k + 3], pull, rtol=0, atol=10 * length / R * 3.986e14 / R**2)
        assert np.isfinite(mod.outputs(0.0, x)).all() if mod.y_names else True


# -- Inertia -----------------------------------------------------------------------------------------------------------
def two_wheels(inertia):
    """Two independent wheels on the ground, 1 kg m^2 and `inertia`."""
    m = eg.Model("wheels", gravity=(0, 0, 0))
    a = m.body("a", mass=1.0, inertia={"zz": 1.0})
    b = m.body("b", mass=0.0, inertia={"zz": inertia})
    m.revolute("A", m.ground, a)
    m.revolute("B", m.ground, b)
    m.actuator("turn", joint="B", value=inertia)
    return m


@pytest.mark.parametrize("method", ["embedding", "recursive", "lagrange"])
@pytest.mark.parametrize("inertia", [1e-12, 1e-14, 1e-16])
def test_a_small_wheel_beside_a_large_one_has_its_inertia(method, inertia):
    mod = two_wheels(inertia).compile(target="numpy", method=method)
    np.testing.assert_allclose(mod.rhs(0.0, mod.x0()), [0, 0, 0, 1.0], rtol=1e-12)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("polar", [0.0, np.pi])
def test_what_rounding_leaves_of_a_zero_is_no_inertia(target, polar):
    """A point mass on a spherical pendulum hanging straight: the azimuth moves nothing; sin^2(pi) is 1.5e-32."""
    m = eg.Model("pendulum", gravity=(0, 0, -9.81))
    a, b = m.body("a", mass=0.0), m.body("b", mass=1.0, com=(0, 0, 1))
    m.revolute("phi", m.ground, a, axis="z")
    m.revolute("theta", a, b, axis="x")
    mod = m.compile(target=target)
    refuses("EG-SINGULAR phi", lambda: mod.rhs(0.0, mod.x0(theta=polar)))
    assert np.isfinite(mod.rhs(0.0, mod.x0(theta=polar + 1e-6))).all()  # sizes 1 and 1e-12


# -- Small loops -------------------------------------------------------------------------------------------------------
def four_bar(m: eg.Model, base: Any, size: float, mass: float, tag: str) -> None:
    """A crank-rocker with bars of 0.04, 0.12, 0.08 and 0.1 times the size."""
    lengths = [part * size for part in (0.04, 0.12, 0.08)]
    bars = [
        m.body(f"{name}_{tag}", mass=mass, com=(l / 2, 0, 0), inertia={"zz": mass * l**2 / 12})
        for name, l in zip(("crank", "coupler", "rocker"), lengths, strict=True)
    ]
    m.revolute(f"A_{tag}", base, bars[0], coordinate=f"theta_{tag}")
    m.revolute(f"B_{tag}", bars[0].at(lengths[0], 0, 0), bars[1], coordinate=f"bend_{tag}")
    m.revolute(f"C_{tag}", bars[1].at(lengths[1], 0, 0), bars[2].at(lengths[2], 0, 0))
    m.revolute(f"D_{tag}", base.at(0.1 * size, 0, 0), bars[2], coordinate=f"psi_{tag}")
    m.guess(**{f"bend_{tag}": -0.7, f"psi_{tag}": 1.1})
    m.initial(**{f"theta_{tag}": 1.0, f"theta_{tag}_dot": 3.0})


def rocker(unit: float, target: str, beside: bool) -> tuple[np.ndarray, float]:
    """The rocker of a four-bar of a micrometre on a free car, and its gap, with or without one of a kilometre."""
    m = eg.Model("beside" if beside else "alone")
    car = m.body("car", mass=10)
    m.prismatic("P", m.ground, car, axis="x", coordinate="s")
    four_bar(m, car, 1e-5 * unit, 1.0, "small")
    if beside:
        four_bar(m, m.ground, 1e4 * unit, 1e-6, "large")
    mod = m.compile(target=target)
    run = mod.simulate((0, 2), rtol=1e-10, atol=1e-13, t_eval=np.linspace(0, 2, 5))
    gaps = mod.kernels.constraints(run.x[: mod.n_q])
    small = [k for k, label in enumerate(mod.constraint_labels) if "_small" in label]
    assert len(small) == 2
    return run["psi_small"], float(np.abs(gaps[small]).max())


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_micrometre_loop_beside_a_kilometre_one_moves_as_alone(unit: float, target: str) -> None:
    alone, _ = rocker(unit, target, beside=False)
    together, gap = rocker(unit, target, beside=True)
    assert np.ptp(alone) > 1.0
    np.testing.assert_allclose(together, alone, atol=1e-8)
    assert gap <= 1e-10 * 1e-6 * unit  # by the loop's own size


# -- what counts as closed, as a freedom and as inertia, on both sides of the limits -----------------------------------
def slides(*equations: Any, **parameters: float) -> eg.Model:
    """Three sliders x, y, z side by side, coupled by equations or by factors of their coordinates."""
    m = eg.Model("slides")
    for name, value in parameters.items():
        m.parameter(name, value)
    for name in "xyz":
        m.prismatic(name, m.ground, m.body(f"body_{name}", mass=1))
    for k, equation in enumerate(equations):
        m.coupling(f"c{k}", **({"equation": equation} if isinstance(equation, str) else {"coordinates": equation}))
    return m


def test_rows_that_agree_to_ten_digits_are_met_halfway_and_no_others() -> None:
    """Lengths written with ten digits need not agree better; a larger gap is never passed over."""
    mod = slides("x", "x - gap", gap=0.0).compile(target="numpy", kernels=["rhs", "project", "constraints"])
    start = np.array([0.3, 0.7, 0.0, 0.0, 0.0, 0.0])
    for gap in (1e-11, 1e-10):
        assert mod.bind(p={"gap": gap}).project(start)[0] == pytest.approx(gap / 2, abs=1e-15)
    for gap in (1e-9, 1e-6, 0.1):
        with refused("EG-PROJECTION residual"):
            mod.bind(p={"gap": gap}).project(start)


@pytest.mark.parametrize(("weak", "rank"), [(1e-7, 2), (3e-9, 1)])
def test_the_rank_of_a_mechanism(weak: float, rank: int) -> None:
    """Loops are closed to 1e-10 where rank is judged: rows that depend on each other may look so different."""
    report = slides({"x": 0.8, "y": -0.6}, {"x": 0.8 + weak, "y": -0.6}).check()
    assert (report.rank, report.degrees_of_freedom) == (rank, 3 - rank)


def test_chosen_coordinates_may_move_others_fast() -> None:
    """Half of the digits are left where the dependent one moves 1e8 times as fast."""
    kernels = ["rhs", "project", "mass_matrix", "kinematics", "constraint_jacobian", "constraints"]
    mod = slides({"x": 1, "y": 1e-7}).compile(target="numpy", independent=["x", "z"], kernels=kernels)
    np.testing.assert_allclose(mod.kinematics([0.0, 0.2], [1.0, 0.0])[1], [1.0, -1e7, 0.0], rtol=1e-9)
    with refused("EG-PARTITION independent x"):
        slides({"x": 1, "y": 3e-9}).compile(target="numpy", independent=["x", "z"], kernels=kernels)


@pytest.mark.quick
def test_rows_that_repeat_earlier_ones_are_redundant() -> None:
    a, b = {"x": 1, "z": 2}, {"x": 0.3, "y": 0.2, "z": 0.6}
    report = slides(a, {"x": 3, "z": 6}, b, "x + 2*z - 2*(0.3*x + 0.2*y + 0.6*z)").check()
    assert report.redundant == ["c1.relation", "c3.equation"]


@pytest.mark.parametrize("left", [1e-11, 3e-12])
@pytest.mark.parametrize("method", ["embedding", "recursive"])
def test_inertia_that_is_left_of_a_large_one(left: float, method: str) -> None:
    """A light carriage under a heavy body: what is left of the mass matrix is a difference of terms 1e12 as large."""
    m = eg.Model("carts")
    a, b = m.body("a", mass=m.parameter("light", 1.0)), m.body("b", mass=1.0)
    m.prismatic("x", m.ground, a)
    m.prismatic("y", a, b)
    m.force("push", b, (0, 0, 1.0))
    mod = m.compile(method, target="numpy", kernels=["rhs"]).bind(p={"light": left})
    np.testing.assert_allclose(mod.rhs(0.0, np.zeros(4)), [0, 0, 0, 1], atol=1e-3)


def driven_slider_crank() -> eg.Model:
    """A slider-crank on a carriage that is driven along x; the slider closes the loop."""
    m = eg.Model("carried", gravity=(0, -9.81, 0))
    base, crank, rod, slider = (m.body(n, mass=1, inertia={"zz": 0.01}) for n in ("base", "crank", "rod", "slider"))
    m.prismatic("S", m.ground, base, axis="x", coordinate="u")
    m.driver("shake", "u", "0.1*sin(3*t) + 0.05*t")
    m.revolute("A", base, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod, coordinate="bend")
    m.revolute("C", rod.at(0.35, 0, 0), slider, coordinate="turn")
    m.prismatic("D", m.ground, slider, axis="x")
    m.guess(theta=0.8, D=0.4)
    m.independent("theta")
    return m


def test_wanted_rates_of_a_cut_slider_that_moves_by_itself() -> None:
    """s = u(t) + r cos(theta) + l cos(beta): with s' given theta' follows from what the carriage leaves of it."""
    mod = driven_slider_crank().compile(target="numpy")
    assert mod.metadata["loop_names"] == ["D"]
    t, theta, rate = 0.4, 0.8, 0.7
    x = mod.x0({"theta": theta, "D_dot": rate}, t=t)
    found = dict(zip(mod.x_names, x, strict=True))
    beta = -np.arcsin(0.1 * np.sin(theta) / 0.35)
    slope = -0.1 * np.sin(theta) + 0.1 * np.cos(theta) * np.tan(beta)
    u_dot = 0.3 * np.cos(3 * t) + 0.05
    assert found["u_dot"] == pytest.approx(u_dot, abs=1e-12)
    assert found["theta_dot"] == pytest.approx((rate - u_dot) / slope, rel=1e-10)
    # positions, velocities and accelerations of all by the one that is free and the driver
    q, v, a = (dict(zip(mod.q_names, part, strict=True)) for part in mod.kinematics([theta], [2.0], [0.0], t=t))
    assert (q["u"], v["u"], a["u"]) == pytest.approx((0.1 * np.sin(1.2) + 0.02, u_dot, -0.9 * np.sin(1.2)), abs=1e-12)
    assert v["bend"] + 2.0 == pytest.approx(-0.1 * np.cos(theta) * 2.0 / (0.35 * np.cos(beta)), rel=1e-10)


def test_a_wanted_angle_of_a_cut_joint_counts_modulo_full_turns() -> None:
    m = eg.load_example("four_bar")
    mod = m.compile(target="numpy")
    (name,) = mod.metadata["loop_names"]
    x = mod.x0(theta=1.0)
    angle = float(mod.simulate(1e-3, initial={"theta": 1.0, "theta_dot": 0.0})[name][0])
    for turns in (-1, 1):
        again = mod.x0({"theta": 1.0, name: angle + 2 * np.pi * turns})
        np.testing.assert_allclose(again[: mod.n_q], x[: mod.n_q], atol=1e-9)


# -- sources -----------------------------------------------------------------------------------------------------------


# -- faults that were reported of turned frames, as they were reported -------------------------------------------------
@pytest.mark.parametrize("seed", range(6))
def test_an_equation_that_holds_identically(seed: int) -> None:
    """Out-of-plane coordinate of a planar mechanism: no freedom goes, however frames are turned."""
    rpy = tuple(np.random.default_rng(seed).uniform(-3, 3, 3).tolist()) if seed else (0.0, 0.0, 0.0)
    turn = Rotation.from_euler("xyz", rpy).as_matrix()
    m = eg.Model("planar", gravity=(0, -9.81, 0))
    a, b = (m.body(n, mass=1, inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a.at(0, 0, 0, rpy=rpy))
    m.revolute("B", a.at(*(turn @ [0.5, 0, 0]).tolist(), rpy=rpy), b)
    b.marker("tip", at=(0.4, 0, 0))
    m.coupling("level", equation="z(b.tip)")
    report = m.check()
    assert (report.degrees_of_freedom, report.rank) == (2, 0)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("factor", "rows"), [("sqrt(p)*sqrt(r)*sqrt(p) - p*sqrt(r)", 0), ("sqrt(p)*sqrt(r) - p", 1), ("sqrt(p) - p", 1)]
)
def test_an_equation_whose_roots_cancel(factor: str, rows: int) -> None:
    """It holds identically only where it does so with either sign of each root."""
    m = eg.Model("arms", gravity=(0, -9.81, 0))
    m.parameter("p", 2.0)
    m.parameter("r", 3.0)
    a, b = (m.body(n, mass=1, inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.5, 0, 0), b)
    b.marker("tip", at=(0.4, 0, 0))
    m.coupling("level", equation=f"({factor})*(x(b.tip) - 0.3)")
    report = m.check()
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (rows, rows, 2 - rows)


def test_signs_of_roots_are_put_in_for_all_expressions_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chained expressions with the same four roots take one pass a root; those that do not vanish as written, none."""
    graph = Graph()
    x, *squares = (graph.symbol(name) for name in "xabcd")
    first, *others = roots = [graph.apply("sqrt", 1.0 + y) for y in squares]
    total = sum(others, first)
    for zero, passes in (((x + 1.0) * (x - 1.0) - x * x + 1.0, len(roots)), (x, 0)):
        chain = [zero * total]
        for _ in range(20):
            chain.append(chain[-1] * x + zero * total)
        calls: list[int] = []

        def counted(*given: Any, calls: list[int] = calls) -> list[Expr]:
            calls.append(1)
            return substitute(*given)

        monkeypatch.setattr(identity, "substitute", counted)
        assert identity.vanishes(chain) == [passes > 0] * len(chain)
        assert len(calls) == passes


@pytest.mark.quick
def test_angular_velocity_of_bodies_without_mass() -> None:
    """It needs no mass: w = theta' e_z, alpha = theta'' e_z."""
    m = eg.Model("massless")
    arm = m.body("arm", mass=0)
    m.revolute("A", m.ground, arm, coordinate="theta")
    m.driver("drive", coordinate="theta", value="0.3 + 2*t + t**2")
    m.output("w", "wz(arm)")
    m.output("alpha", "wz_dot(arm)")
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.outputs(0.0, mod.x0()), [2.0, 2.0], rtol=1e-14)


def test_a_turn_may_have_no_value_at_some_parameters() -> None:
    """asin(10 h/l) is a number at the declared values, not at all values that a random point may have."""
    m = eg.Model("links", gravity=(0, -9.81, 0))
    m.parameter("h", 0.01)
    l = m.parameter("l", 0.5)
    links = [m.body(f"b{k}", mass=1.0, com=(l / 2, 0, 0), inertia={"zz": 0.02}) for k in range(3)]
    turn = (0, 0, "asin(10*h/l)")
    m.revolute("A", m.ground, links[0])
    m.revolute("B", links[0].at(l, 0, 0, rpy=turn), links[1])
    m.revolute("C", links[1].at(l, 0, 0, rpy=turn), links[2])
    m.revolute("D", links[2].at(l, 0, 0), m.ground.at(0.6, 0, 0))
    assert m.derive().report.degrees_of_freedom == 1
