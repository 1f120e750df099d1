"""Tables against SciPy's interpolants by every target, in laws with closed forms, in files; their faults."""

from pathlib import Path
from typing import Any

import judges
import numpy as np
import pytest
import sympy
from model_files import load
from refusals import refused, refuses
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline
from scipy.special import ellipj

import eomgen as eg

REFERENCES: dict[str, Any] = {
    "cubic": lambda x, y: CubicSpline(x, y),
    "natural": lambda x, y: CubicSpline(x, y, bc_type="natural"),
    "monotone": lambda x, y: PchipInterpolator(x, y),
    "periodic": lambda x, y: CubicSpline(x, y, bc_type="periodic"),
}
COUNTS = (2, 3, 4, 5, 30)


def points(n: int, kind: str, even: bool) -> tuple[np.ndarray, np.ndarray]:
    n = max(n, 3) if kind == "periodic" else n
    rng = np.random.default_rng(n)
    x = np.linspace(-1.0, 2.0, n) if even else np.cumsum(rng.uniform(0.2, 1.0, n)) - 1.0
    y = rng.normal(size=n)
    if kind == "periodic":
        y[-1] = y[0]
    return x, y


def near(found: Any, expected: Any, digits: float = 1e-13) -> None:
    assert np.max(np.abs(found - expected)) <= digits * max(1.0, np.max(np.abs(expected)))


def reader(tables: dict[str, tuple[Any, ...]], target: str = "numpy", **keys: Any) -> Any:
    """Name -> the table and its derivatives at many places: ``read(name, places, order)``."""
    m = eg.Model("reader")
    m.prismatic("s", m.ground, m.body("b", mass=1), axis="x")
    s = m.coordinate("s")
    for name, (x, y) in tables.items():
        f = m.table(name, x, y, **keys)
        for order in range(4):
            m.output(f"{name}_{order}", f(s).diff(s, order) if order else f(s))
    mod = m.compile(target=target, kernels=["outputs"], **({"optimize": 0} if target == "cython" else {}))

    def read(name: str, places: Any, order: int = 0) -> np.ndarray:
        states = np.array([places, np.zeros(len(places))])
        return np.asarray(mod.outputs(0.0, states)[mod.y_names.index(f"{name}_{order}")])

    read.module = mod  # type: ignore[attr-defined]
    return read


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
@pytest.mark.parametrize("kind", REFERENCES)
@pytest.mark.parametrize("target", ["numpy", pytest.param("cython", marks=pytest.mark.thorough)])
def test_a_table_is_scipys(target: str, kind: str, even: bool) -> None:
    tables = {f"f{n}": points(n, kind, even) for n in COUNTS}
    read = reader(tables, target, kind=kind)
    smooth = {"monotone": 1, "periodic": 2}.get(kind, 3)  # orders that are compared at the points themselves
    for name, (x, y) in tables.items():
        expected = REFERENCES[kind](x, y)
        inside = np.unique([*x, *np.linspace(x[0], x[-1], 211)])
        inside = inside[:-1] if kind == "periodic" else inside  # at its end a periodic one begins
        for order in range(4):
            places = inside if order <= smooth else np.setdiff1d(inside, x)
            near(read(name, places, order), expected(places, order), 1e-12 if kind == "periodic" else 1e-13)
    x, y = tables["f30"]
    single = [read.module.outputs(0.0, [place, 0.0])[-4] for place in x[:-1:7]]
    near(np.array(single), REFERENCES[kind](x, y)(x[:-1:7]), 1e-12)
    refuses("EG-NOT-FINITE s", read.module.outputs, 0.0, [np.nan, 0.0])


@pytest.mark.parametrize("extrapolation", ["linear", "constant"])
def test_beyond_its_points_a_curve_goes_on_as_its_ends(extrapolation: str) -> None:
    x, y = points(7, "cubic", even=False)
    read, inside = reader({"f": (x, y)}, extrapolation=extrapolation), CubicSpline(x, y)
    for end, places in ((x[0], x[0] - np.array([1e-9, 0.5, 30.0])), (x[-1], x[-1] + np.array([1e-9, 0.5, 30.0]))):
        slope = float(inside(end, 1)) if extrapolation == "linear" else 0.0
        near(read("f", places), float(inside(end)) + slope * (places - end))
        near(read("f", places, 1), slope)
        assert not read("f", places, 2).any()
        assert not read("f", places, 3).any()


def test_a_periodic_curve_repeats_and_a_monotone_one_never_overshoots() -> None:
    x = np.linspace(0.0, 2 * np.pi, 25)
    y = np.sin(x) + 0.3 * np.cos(3 * x)
    y[-1] = y[0]
    read, places = reader({"f": (x, y)}, kind="periodic"), np.linspace(0.01, 6.2, 90)
    for order in range(3):
        for turns in (-3, 1, 100):
            near(read("f", places + turns * 2 * np.pi, order), read("f", places, order), 1e-10)
    steps = {"f": ([0, 1, 2, 3, 4, 5], [0, 0, 0, 1, 1, 1])}
    found, cubic = (reader(steps, kind=kind)("f", np.linspace(0, 5, 501)) for kind in ("monotone", "cubic"))
    assert (np.diff(found) >= 0).all()
    assert (found.min(), found.max()) == (0, 1)
    assert cubic.max() > 1.01  # so the test can fail


@pytest.mark.parametrize("target", ["numpy", pytest.param("cython", marks=pytest.mark.thorough)])
def test_a_surface_is_scipys_and_goes_on_as_its_edges(target: str) -> None:
    rng = np.random.default_rng(5)
    x, y = np.cumsum(rng.uniform(0.2, 1.0, 7)), np.cumsum(rng.uniform(0.2, 1.0, 9))
    z = rng.normal(size=(7, 9))
    m = eg.Model("reader")
    m.planar("p", m.ground, m.body("b", mass=1, inertia={"zz": 1}), coordinates=("u", "v", "w"))
    g, (u, v) = m.table("g", x, y, z), (m.coordinate(name) for name in "uv")
    orders = [(i, j) for i in range(3) for j in range(3)]
    for i, j in orders:
        m.output(f"g{i}{j}", g(u, v).diff(u, i, v, j) if (i, j) != (0, 0) else g(u, v))
    mod, judge = m.compile(target=target, kernels=["outputs"]), RectBivariateSpline(x, y, z, s=0)

    def read(a: Any, b: Any) -> np.ndarray:
        a, b = np.atleast_1d(a), np.atleast_1d(b)
        states = np.zeros((6, len(a)))
        states[:2] = a, b
        return np.asarray(mod.outputs(0.0, states))

    a = np.r_[rng.uniform(x[0], x[-1], 300), x[0], x[-1], x[1], x[0]]
    b = np.r_[rng.uniform(y[0], y[-1], 300), y[0], y[-1], y[2], y[-1]]
    for found, (i, j) in zip(read(a, b), orders, strict=True):
        near(found, judge.ev(a, b, dx=i, dy=j), 1e-13 * 10 ** (i + j))
    edge, beyond = read(x[-1], y[3] + 0.01)[:, 0], read(x[-1] + 2.5, y[3] + 0.01)[:, 0]
    at = {name: edge[orders.index(name)] for name in orders}
    for order, value in (((0, 0), at[0, 0] + 2.5 * at[1, 0]), ((1, 1), at[1, 1]), ((2, 0), 0.0)):
        near(beyond[orders.index(order)], value, 1e-12)


# -- in laws ----------------------------------------------------------------------------------------------------------
#: Texts with f(u) = u^3 - 2 u and h(u, v) = u^2 v + u v^3, which splines reproduce.
TEXTS = ["f(x)", "f(2*x + y)*h(x, y)", "h(x*y, x)", "h(x, x) + f(f(x))", "sin(f(x))*exp(-h(y, f(x)))",
         "max(f(x), h(x, y))", "diff(f(x*y), 1) + diff(h(x, y), 1, 1)"]  # fmt: skip


def test_values_and_derivatives_follow_the_chain_rule() -> None:
    """The Jacobian of accelerations of unit masses that each text pulls, against SymPy's of the formulas."""
    x, y, u, v = sympy.symbols("x y u v")
    formulas = {"f": (u**3 - 2 * u, (u,)), "h": (u**2 * v + u * v**3, (u, v))}
    grid = np.linspace(-4, 4, 9)
    m = eg.Model("pulled")
    m.table("f", grid, grid**3 - 2 * grid)
    m.table("h", grid, grid, np.outer(grid**2, grid) + np.outer(grid, grid**3))
    for k, text in enumerate(TEXTS):
        m.prismatic(f"s{k}", m.ground, m.body(f"b{k}", mass=1), axis="x")
        m.actuator(f"a{k}", f"s{k}", text.replace("exp", "EXP").replace("x", f"s{k}").replace("y", f"s{k}_dot")
                   .replace("EXP", "exp").replace(f"mas{k}", "max"))  # fmt: skip
    mod, n = m.compile(target="numpy"), len(TEXTS)
    at = {x: 0.83, y: -0.47}
    state = np.concatenate([np.full(n, 0.83), np.full(n, -0.47)])
    rates, slopes = mod.rhs(0.0, state), mod.jacobian(0.0, state)

    def call(name: str) -> Any:
        formula, symbols = formulas[name]
        return lambda *given: formula.subs(dict(zip(symbols, given, strict=True)), simultaneous=True)

    for k, text in enumerate(TEXTS):
        written = text.replace("diff(f(x*y), 1)", "df(x*y)").replace("diff(h(x, y), 1, 1)", "dh(x, y)")
        known = {"f": call("f"), "h": call("h"), "x": x, "y": y, "max": sympy.Max, "sin": sympy.sin, "exp": sympy.exp}
        known |= {"df": lambda a: 3 * a**2 - 2, "dh": lambda a, b: 2 * a + 3 * b**2}
        formula = eval(written, {"__builtins__": {}}, known)  # noqa: S307 - the texts above
        found = [rates[n + k], slopes[n + k, k], slopes[n + k, n + k]]
        wanted = [float(part.subs(at)) for part in (formula, formula.diff(x), formula.diff(y))]
        np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-10, err_msg=text)


def test_a_table_of_a_cubic_spring_swings_as_duffings_closed_form() -> None:
    """x'' + x + x^3 = 0 from rest at A: x = A cn(w t, m), w^2 = 1 + A^2, m = A^2 / (2 w^2)."""
    grid = np.linspace(-3.0, 3.0, 13)  # a not-a-knot spline reproduces a cubic
    m = eg.Model("duffing")
    pull = m.table("pull", grid, grid + grid**3)
    m.prismatic("s", m.ground, m.body("b", mass=2.0), axis="x")
    m.actuator("spring", "s", -2.0 * pull(m.coordinate("s")))
    times = np.linspace(0, 10, 51)
    run = m.compile(target="numpy").simulate(10, initial={"s": 2.0}, rtol=1e-11, atol=1e-13, t_eval=times)
    w = np.sqrt(5.0)
    expected = 2.0 * ellipj(w * run.t, 4.0 / (2.0 * 5.0))[1]
    assert np.ptp(expected) > 3.9
    assert np.max(np.abs(run["s"] - expected)) < 1e-8


def follower() -> tuple[eg.Model, np.ndarray, np.ndarray]:
    """A cam of inertia 2 turns and lifts a follower of mass 3 by a periodic table of its angle."""
    angle = np.linspace(0.0, 2 * np.pi, 37)
    lift = 0.2 + 0.05 * np.exp(np.cos(angle))
    lift[-1] = lift[0]
    theta, s, theta_dot, s_dot = sympy.symbols("theta s theta_dot s_dot")
    L = theta_dot**2 + sympy.Rational(3, 2) * s_dot**2 - 3 * 9.81 * s
    m = eg.Model.from_lagrangian("cam", L, [theta, s], constraints=[s - sympy.Function("profile")(theta)])
    m.table("profile", angle, lift, kind="periodic")
    m.initial(theta=1.0, theta_dot=8.0)
    m.independent("theta")
    return m, angle, lift


def test_a_follower_on_a_periodic_table_keeps_its_energy_and_its_cam() -> None:
    m, angle, lift = follower()
    module = m.compile(target="numpy")
    run = module.simulate((0, 0.5), rtol=1e-8, atol=1e-10)
    spline = CubicSpline(angle, lift, bc_type="periodic")
    assert np.ptp(run["theta"]) > 3
    assert np.max(np.abs(run["s"] - spline(run["theta"]))) < 1e-12
    assert np.max(np.abs(run["s_dot"] - spline(run["theta"], 1) * run["theta_dot"])) < 1e-11
    T = run["theta_dot"] ** 2 + 1.5 * run["s_dot"] ** 2
    energy = T + 3 * 9.81 * run["s"]
    assert np.max(np.abs(energy - energy[0])) < 1e-5 * T.max()


def test_accelerations_of_the_follower_are_those_of_the_reduced_equation() -> None:
    """(2 + 3 s'^2) theta'' + 3 s' s'' theta'^2 + 3 g s' = 0, with SciPy's spline s(theta)."""
    m, angle, lift = follower()
    spline = CubicSpline(angle, lift, bc_type="periodic")
    module = m.compile(target="numpy")
    for theta in (0.3, 2.0, 4.5, -7.7, 12.0):
        x = module.x0(theta=theta, theta_dot=5.0)
        names = module.x_names
        a, b, c = (float(spline(theta, k)) for k in (1, 2, 0))
        acceleration = -(3 * a * b * 25.0 + 3 * 9.81 * a) / (2 + 3 * a * a)
        found = dict(zip(names, module.rhs(0, x), strict=True))
        assert x[names.index("s")] == pytest.approx(c, abs=1e-12)
        assert found["theta_dot"] == pytest.approx(acceleration, rel=1e-9)
        central = judges.differences(module, x, 1e-6)
        assert np.max(np.abs(module.jacobian(0, x) - central)) < 1e-5 * np.abs(central).max()


def test_a_lagrangian_and_a_mass_call_functions_too() -> None:
    q = sympy.Symbol("q")
    m = eg.Model.from_lagrangian("well", "q_dot**2/2 - V(q, k)", [q], parameters={"k": 1.5})
    grid = np.linspace(-2, 2, 21)
    m.table("V", grid, grid, np.outer(grid**3, grid))
    module = m.compile(target="numpy")
    assert module.rhs(0.0, [0.7, 0.0])[1] == pytest.approx(-3 * 0.7**2 * 1.5, rel=1e-12)
    m = eg.Model("worn")
    m.table("mass_of", grid, 2 + grid**2)
    m.prismatic("s", m.ground, m.body("b", mass=f"mass_of({m.parameter('wear', 0.7)})"), axis="x")
    m.actuator("push", "s", 1)
    assert m.compile(target="numpy").bind(p={"wear": 1.1}).rhs(0.0, [0.0, 0.0])[1] == pytest.approx(1 / (2 + 1.1**2))


# -- in files, and faults ---------------------------------------------------------------------------------------------
HEAD = """\
name: sample
functions:
{functions}
bodies: {{b: {{mass: 1.5}}}}
joints: {{s: {{type: prismatic, between: [ground, b], axis: x}}}}
forces: {{push: {{type: actuator, joint: s, value: "{law}"}}}}
outputs: {{slope: "{output}"}}
initial: {{s: 0.4}}
"""
TABLE = "  law: {type: table, x: [-1, 0, 1, 2], y: [-2, 0, 0.5, pi/2]}"


def written(functions: str, law: str = "-law(s)", output: str = "diff(law(s), 1)") -> str:
    return HEAD.format(functions=functions, law=law, output=output)


def test_a_table_in_a_file(tmp_path: Path) -> None:
    m = load(tmp_path, written(TABLE))
    module, spline = m.compile(target="numpy"), CubicSpline([-1, 0, 1, 2], [-2, 0, 0.5, np.pi / 2])
    assert module.rhs(0, [0.4, 0])[1] == pytest.approx(-float(spline(0.4)) / 1.5, rel=1e-13)
    assert module.outputs(0, [0.4, 0])[0] == pytest.approx(float(spline(0.4, 1)), rel=1e-13)
    assert load(tmp_path, m.to_yaml()).to_yaml() == m.to_yaml()
    assert "<Model sample: 1 function, 1 body" in repr(m)


BROKEN: list[tuple[str, str, str]] = [
    ("  law: {type: tabel, x: [0, 1], y: [0, 1]}", "EG-CHOICE functions.law.type: 'table'?"),
    ("  law: {x: [0, 1], y: [0, 1]}", "EG-CHOICE functions.law.type:"),
    ("  law: {type: table, x: [0, 1]}", "EG-MISSING functions.law.y:"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], w: 1}", "EG-NAME-UNKNOWN functions.law.w:"),
    ("  law: {type: table, x: [0], y: [1]}", "EG-SHAPE functions.law.x:"),
    ("  law: {type: table, x: [0, 1, 1], y: [1, 2, 3]}", "EG-RANGE functions.law.x[2]: 1"),
    ("  law: {type: table, x: [0, .nan, 1], y: [1, 2, 3]}", "EG-TYPE functions.law.x[1]:"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, true, 3]}", "EG-TYPE functions.law.y[1]:"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, s, 3]}", "EG-REFERENCE functions.law.y[1]: s"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, null, 3]}", "EG-MISSING functions.law.y[1]:"),
    ("  law: {type: table, x: [0, 1e-300, 1], y: [1, 2, 3]}", "EG-RANGE functions.law.x:"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, 2]}", "EG-SHAPE functions.law.y: 2 3"),
    ("  law: {type: table, kind: cubik, x: [0, 1], y: [1, 2]}", "EG-CHOICE functions.law.kind: 'cubic'?"),
    ("  law: {type: table, kind: periodic, x: [0, 1, 2], y: [1, 2, 3]}", "EG-CONTRADICTION functions.law.y: 3"),
    ("  law: {type: table, kind: periodic, x: [0, 1], y: [1, 1]}", "EG-SHAPE functions.law.x:"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2]]}", "EG-SHAPE functions.law.z: 1 2"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2], [3]]}", "EG-SHAPE functions.law.z[1]: 2"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2], 3]}", "EG-TYPE functions.law.z[1]: 3"),
    ("  law: {type: table, kind: monotone, x: [0, 1], y: [0, 1], z: [[1, 2], [3, 4]]}", "EG-UNSUPPORTED law.kind:"),
    ("  law: {type: table, x: [0, 1e-9, 1], y: [1e299, -1e299, 0]}", "EG-RANGE functions.law:"),
    ("  2law: {type: table, x: [0, 1], y: [0, 1]}", "EG-NAME-FORM functions.2law:"),
    ("  cos: {type: table, x: [0, 1], y: [0, 1]}", "EG-NAME-FORM functions.cos:"),
]


@pytest.mark.parametrize(("functions", "demand"), BROKEN)
def test_broken_entries_are_reported_once_with_their_line(tmp_path: Path, functions: str, demand: str) -> None:
    two = "z: [[" in functions
    usable = functions.strip().startswith("law:")
    law = ("law(s, s)" if two else "law(s)") if usable else "s"
    output = ("diff(law(s, s), 1, 0)" if two else "diff(law(s), 1)") if usable else "s"
    with refused(f"{demand} {tmp_path / 'model.yaml'}:3:") as caught:
        load(tmp_path, written(functions, law, output)).check()
    assert len(caught.value.problems) == 1


def test_huge_tables_are_refused(tmp_path: Path) -> None:
    many = ", ".join(map(str, range(20_001)))
    with refused("EG-TOO-LARGE 20000"):
        load(tmp_path, written(f"  law: {{type: table, x: [{many}], y: [{many}]}}")).check()


CALLS = {
    "law(s, s)": "EG-EXPRESSION law() 1 2", "none(s)": "EG-EXPRESSION 'none'", "law": "EG-EXPRESSION 'law'",
    "law(s).real": "EG-EXPRESSION dot", "law(x=1)": "EG-EXPRESSION keywords", "diff(s, 1)": "EG-EXPRESSION call",
    "diff(sin(s), 1)": "EG-EXPRESSION call", "diff(law(s), 1, 1)": "EG-EXPRESSION 1",
    "diff(law(s), 4)": "EG-EXPRESSION 0, 1, 2, 3", "diff(law(s), s)": "EG-EXPRESSION 1",
}  # fmt: skip


def test_calls_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for call, demand in CALLS.items():
        with refused(demand) as caught:
            load(tmp_path, written(TABLE, call)).check()
        assert len(caught.value.problems) == 1
