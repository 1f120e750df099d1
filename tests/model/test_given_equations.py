"""Equations that are given, in files and in Python; a bare Lagrangian in every way to write one; rates of inputs."""

import re
from pathlib import Path
from typing import Any

import command
import judges
import matplotlib
import numpy as np
import pytest
import sympy
from model_files import load, schema_faults
from refusals import refused, refuses
from sympy.physics.mechanics import dynamicsymbols

import eomgen as eg

TARGETS = ["numpy", pytest.param("cython", marks=pytest.mark.thorough)]


def given(name: str, parameters: Any = (), **equations: Any) -> eg.Model:
    return eg.Model.from_equations(name, **equations, parameters={"w": 1.3, **dict(parameters)})


def tied(**more: Any) -> eg.Model:
    """Three coordinates, two speeds that move one each and one that moves two; a surface and a blade, both moving."""
    rows: dict[str, Any] = {
        "coordinates": ["a", "b", "c"],
        "velocities": ["r", "v", "s", "z"],
        "rates": {"a": "w*cos(c)*r + 0.1*sin(t)", "b": "v + r*sin(a)", "c": "s + 0.2*b"},
        "mass_matrix": [[2, 0.1, 0, 0], [0.1, "1 + b**2", 0, 0], [0, 0, "w", 0.3], [0, 0, 0.3, 1]],
        "forcing": ["-4*a - r*v", "-b + s*z", "sin(t) - c", "-0.1*z + r*s"],
        "constraints": ["a**2 + b - 0.3*c - 0.1*t - 0.5", "z - 0.2*s*cos(a) - 0.1*t"],
        "kinetic_energy": "r**2",
    }
    return given("tied", **rows | more)


@pytest.mark.parametrize("target", TARGETS)
def test_constraints_with_given_rates(target: str) -> None:
    module = tied().compile(target=target)
    assert (module.n_q, module.n_v, module.n_dof) == (3, 4, 2)
    t = 0.4
    x = module.x0(a=0.3, c=0.2, r=0.5, t=t)
    a, b, c, u, v, s, z = x
    assert (a, c, u) == pytest.approx((0.3, 0.2, 0.5), abs=1e-15)
    rates = [1.3 * np.cos(c) * u + 0.1 * np.sin(t), v + u * np.sin(a), s + 0.2 * b]
    x_dot = module.rhs(t, x)
    assert x_dot[:3] == pytest.approx(rates, rel=1e-13)
    assert a**2 + b - 0.3 * c - 0.1 * t == pytest.approx(0.5)
    assert 2 * a * rates[0] + rates[1] - 0.3 * rates[2] == pytest.approx(0.1)
    assert z == pytest.approx(0.2 * s * np.cos(a) + 0.1 * t)
    # an augmented solve of its own: [M C_q^T; C_q 0] [a; l] = [f; -gamma], gamma by differences along the motion
    C_q = np.array([[2 * a * 1.3 * np.cos(c) + np.sin(a), 1.0, -0.3, 0.0], [0.0, 0.0, -0.2 * np.cos(a), 1.0]])
    assert module.constraint_jacobian(x[:3]) == pytest.approx(C_q, rel=1e-12)

    def level(y: np.ndarray, time: float) -> np.ndarray:
        return np.asarray(module.velocity_constraints(y, t=time))

    h, flow = 1e-5, np.concatenate([x_dot[:3], np.zeros(4)])
    gamma = (level(x + h * flow, t + h) - level(x - h * flow, t - h)) / (2 * h)
    M = np.array([[2, 0.1, 0, 0], [0.1, 1 + b**2, 0, 0], [0, 0, 1.3, 0.3], [0, 0, 0.3, 1]])
    f = np.array([-4 * a - u * v, -b + s * z, np.sin(t) - c, -0.1 * z + u * s])
    solved = np.linalg.solve(np.block([[M, C_q.T], [C_q, np.zeros((2, 2))]]), np.concatenate([f, -gamma]))
    assert x_dot[3:] == pytest.approx(solved[:4], abs=1e-9)
    assert module.jacobian(t, x) == pytest.approx(judges.differences(module, x, 1e-6, t), abs=1e-8)
    run = module.simulate((0.0, 0.5), initial={"a": 0.3, "c": 0.2, "r": 0.5})
    assert run["a_dot"] == pytest.approx(1.3 * np.cos(run["c"]) * run["r"] + 0.1 * np.sin(run.t))
    assert run.residuals.raw_position < 1e-8
    assert run["a"] ** 2 + run["b"] - 0.3 * run["c"] - 0.1 * run.t == pytest.approx(0.5, abs=1e-12)
    off = module.project(x + 0.01, t=t)
    assert off[0] ** 2 + off[1] - 0.3 * off[2] - 0.1 * t == pytest.approx(0.5, abs=1e-12)
    refuses("EG-UNSUPPORTED coordinates velocities", getattr, module, "minimal")
    refuses("EG-NAME-UNKNOWN a_dot r", module.x0, a_dot=1.0)
    named = given("named", coordinates=["a"], velocities=["p"], mass_matrix=[[1]], forcing=[0])
    refuses("EG-REFERENCE p p=", named.compile(target="numpy").x0, p=1.0)


def test_what_no_velocity_changes_is_closed_by_the_nearest_coordinates() -> None:
    """Two points that stay on circles about the origin by their rates: from beside them along the radius."""
    module = eg.Model.from_equations(
        "dials", ["a", "b", "c", "d"], velocities=["v", "w"],
        rates={"a": "-b*v", "b": "a*v", "c": "-d*w", "d": "c*w"}, mass_matrix=[["2", 0], [0, "3"]], forcing=[0, 0],
        constraints=["a**2 + b**2 - 1", "c**2 + d**2 - 4"],
    ).compile(target="numpy")  # fmt: skip
    on = np.array([np.cos(0.4), np.sin(0.4), 2.0 * np.cos(2.0), 2.0 * np.sin(2.0), 0.3, -0.2])
    np.testing.assert_allclose(module.project(on * [1.3, 1.3, 0.7, 0.7, 1, 1]), on, atol=1e-12)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("blade", [False, True])
@pytest.mark.parametrize(("n", "k"), [(3, 2), (1, 2), (2, 3), (7, 6)])
def test_speeds_and_coordinates_that_differ_in_number(n: int, k: int, blade: bool, target: str) -> None:
    q, v = [f"q{i}" for i in range(n)], [f"s{i}" for i in range(k)]
    rates = {a: f"(1.5 + 0.3*sin(q{(i + 1) % n}))*s{i % k} + w*cos(t)" for i, a in enumerate(q)}
    mass = [["2 + cos(q0)" if i == j else 0.1 for j in range(k)] for i in range(k)]
    forcing = [f"-q{i % n} - 0.3*s{i}*s{(i + 1) % k}" for i in range(k)]
    rows = [f"s{k - 1} - 0.5*s0*cos(q0)"] if blade else []
    moving = {"coordinates": q, "velocities": v, "rates": rates}
    model = given("differ", **moving, mass_matrix=mass, forcing=forcing, constraints=rows)
    module, t = model.compile(target=target), 0.4
    x = module.project(np.random.default_rng(n).uniform(-1.0, 1.0, n + k), t=t)
    p, s = x[:n], x[n:]
    M = np.full((k, k), 0.1) + np.diag(np.full(k, 1.9 + np.cos(p[0])))
    f = np.array([-p[i % n] - 0.3 * s[i] * s[(i + 1) % k] for i in range(k)])
    q_dot = np.array([(1.5 + 0.3 * np.sin(p[(i + 1) % n])) * s[i % k] + 1.3 * np.cos(t) for i in range(n)])
    a = np.linalg.solve(M, f)
    if blade:
        row = np.zeros(k)
        row[-1], row[0] = 1.0, row[0] - 0.5 * np.cos(p[0])
        push = np.linalg.solve(M, row)
        a -= push * (row @ a + 0.5 * s[0] * np.sin(p[0]) * q_dot[0]) / (row @ push)
    assert module.rhs(t, x) == pytest.approx(np.concatenate([q_dot, a]), abs=1e-12)
    assert module.jacobian(t, x) == pytest.approx(judges.differences(module, x, 1e-6, t), abs=1e-8)
    assert len(module.branches(q0=0.2)) == 1
    assert module.assemble(q0=0.2)[0] == 0.2
    start = dict(zip(module.x_names, x, strict=True))
    ends = [module.simulate(0.3, initial=start, method=m).x[:, -1] for m in ("DOP853", "Radau")]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    assert module.linearize(x).A.shape[0] == n + k - blade
    if (n, target) == (3, "numpy"):
        assert model.derive().explain().difference < 1e-9


@pytest.mark.parametrize("names", [("a", "v"), ("a", "c", "r", "s"), ("b",), ("z",), ("a", "b")])
def test_independent_ones_as_linearize_takes_them(names: tuple[str, ...]) -> None:
    """Coordinates and velocities are chosen apart, and completed."""
    module = tied().compile(target="numpy", independent=names)
    chosen = {module.v_names[k] for k in module.metadata["independent"]}
    assert {name for name in names if name in module.v_names} <= chosen
    x = module.x0(a=0.3, c=0.2, r=0.5)
    near = module.linearize(x)
    assert set(names) <= set(near.states)
    if len(names) == 4:
        chosen_later = tied().compile(target="numpy").linearize(x, independent=names)
        np.testing.assert_allclose(near.A, chosen_later.A, atol=1e-12)


def test_directions_stay_on_moving_constraints_and_carry_the_rates() -> None:
    mod, t, h = tied().compile(target="numpy"), 0.3, 1e-5
    x = mod.project(np.array([0.4, 0.5, 0.1, 0.3, -0.2, 0.6, 0.1]), t=t)
    near = mod.linearize(x, t)
    assert near.tangent is not None
    assert len(near.states) == 2 + mod.n_dof
    T, chosen = near.tangent.T, [mod.x_names.index(name) for name in near.states]
    np.testing.assert_allclose(T[chosen], np.eye(len(chosen)), atol=1e-12)
    for k, column in enumerate(T.T):
        ahead, behind = near.x + h * column, near.x - h * column
        assert np.abs(mod.constraints(ahead[:3], t=t) - mod.constraints(behind[:3], t=t)).max() <= 1e-12
        rows = [mod.velocity_constraints(side, t=t) for side in (ahead, behind)]
        assert np.abs(rows[0] - rows[1]).max() <= 1e-12
        slope = (mod.rhs(t, ahead) - mod.rhs(t, behind))[chosen] / (2 * h)
        np.testing.assert_allclose(near.A[:, k], slope, atol=1e-7)
    refuses("EG-UNSUPPORTED jacobian", mod.linearize, x, t, form="full")
    refuses("EG-PARTITION 2 b c", mod.linearize, x, t, independent=["a"])


def test_inputs_beside_given_rates_are_refused_by_name() -> None:
    model = tied(forcing=["push - 4*a - r*v", "-b + s*z", "sin(t) - c", "-0.1*z + r*s"], inputs={"push": 0})
    mod = model.compile(target="numpy")
    refuses("EG-UNSUPPORTED push", mod.linearize, np.array([0.4, 0.5, 0.1, 0.3, -0.2, 0.6, 0.1]))


# -- energy -----------------------------------------------------------------------------------------------------------
FREE_MASS = """
name: free_mass
parameters: {m: 2.0, k: 5.0}
equations:
  coordinates: [x]
  mass_matrix: [[m]]
  forcing: ["-k*x"]
  MORE
outputs: {pull: OUT}
initial: {x: 1.0}
"""


def free_mass(folder: Path, more: str = "", out: str = "k*x") -> eg.Model:
    return load(folder, FREE_MASS.replace("MORE", more).replace("OUT", out))


@pytest.mark.parametrize("target", TARGETS)
def test_an_energy_that_is_not_known_is_refused(target: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"optimize": 0} if target == "cython" else {}
    module = free_mass(tmp_path).compile(target=target, **options)
    refuses("EG-UNSUPPORTED equations.kinetic_energy equations.potential_energy", module.energy, np.array([1.0, 0.0]))
    run = module.simulate((0.0, 2.0), rtol=1e-10, atol=1e-12)
    assert run["x"][-1] == pytest.approx(np.cos(2.0 * np.sqrt(2.5)), abs=1e-8)
    assert not run.has_energies
    assert not {"T", "V", "energy"} & set(run.names)
    for what in ("energies", "energy_drift"):
        refuses("EG-UNSUPPORTED kinetic_energy", getattr, run, what)
    loaded = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    assert loaded.names == run.names
    assert not loaded.has_energies
    refuses("EG-UNSUPPORTED kinetic_energy", getattr, loaded, "energies")


@pytest.mark.parametrize("name", ["kinetic_energy", "potential_energy", "total_energy"])
def test_an_output_of_it_is_refused(name: str, tmp_path: Path) -> None:
    refuses(f"EG-MISSING 9 outputs.pull {name} equations.kinetic_energy", lambda: free_mass(tmp_path, out=name).check())


def test_the_command_line_copes(tmp_path: Path) -> None:
    free_mass(tmp_path)
    given = ("run", tmp_path / "model.yaml", "--end", "0.5", "--target", "numpy")
    assert "not known: the equations have no kinetic_energy" in command.run(*given).out
    assert command.run(*given, "--json").json["energy"] is None


# -- in Python --------------------------------------------------------------------------------------------------------
BALL = """
name: ball
parameters: {r: 0.3, m: 2, k: 5}
equations:
  coordinates: [x, y, phi]
  velocities: [w, v_y, spin]
  rates: {x: r*w, y: v_y, phi: spin}
  mass_matrix: [[m*r**2*7/5, 0, 0], [0, m, 0], [0, 0, 0.4*m*r**2]]
  forcing: [-k*r*x, -0.1*v_y, 0]
  constraints: [v_y - r*spin]
  multipliers: [grip]
  kinetic_energy: m*r**2*w**2*7/10 + m*v_y**2/2 + 0.2*m*r**2*spin**2
  potential_energy: k*x**2/2
outputs: {friction: grip}
initial: {x: 0.2, w: 1.0, spin: 2.0}
"""


def ball(texts: bool) -> eg.Model:
    value = (lambda text: text) if texts else sympy.sympify
    M = [[value("m*r**2*7/5"), 0, 0], [0, value("m"), 0], [0, 0, value("0.4*m*r**2")]]
    m = eg.Model.from_equations(
        "ball", ["x", "y", "phi"], M if texts else sympy.Matrix(M), [value("-k*r*x"), value("-0.1*v_y"), 0],
        velocities=["w", "v_y", "spin"], rates={"x": value("r*w"), "y": value("v_y"), "phi": value("spin")},
        constraints=[value("v_y - r*spin")], multipliers=["grip"], potential_energy=value("k*x**2/2"),
        kinetic_energy=value("m*r**2*w**2*7/10 + m*v_y**2/2 + 0.2*m*r**2*spin**2"),
        parameters={"r": 0.3, "m": 2, "k": 5},
    )  # fmt: skip
    m.output("friction", "grip")
    m.initial(x=0.2, w=1.0, spin=2.0)
    return m


@pytest.mark.parametrize("texts", [True, False])
def test_python_and_yaml_agree(texts: bool, tmp_path: Path) -> None:
    file, own = load(tmp_path, BALL).compile(target="numpy"), ball(texts).compile(target="numpy")
    assert own.x_names == file.x_names
    x = file.x0()
    np.testing.assert_allclose(own.x0(), x, rtol=0, atol=1e-15)
    np.testing.assert_allclose(own.rhs(0, x), file.rhs(0, x), rtol=1e-13)
    np.testing.assert_allclose(own.outputs(0, x), file.outputs(0, x), rtol=1e-12)
    ball(texts).save(tmp_path / "again.yaml")
    again = eg.load(tmp_path / "again.yaml").compile(target="numpy")
    np.testing.assert_allclose(again.rhs(0, x), file.rhs(0, x), rtol=1e-13)


def test_functions_of_time() -> None:
    """A pendulum in SymPy's dynamicsymbols: theta'' = (tau - m g l sin theta) / (m l^2)."""
    m, l, g, tau, t = sympy.symbols("m l g tau t")
    theta = sympy.Function("theta")(t)

    def make(**more: float) -> eg.Model:
        force = tau - m * g * l * sympy.sin(theta) - theta.diff(t) / 10
        known = {m: 2.0, l: 0.5} | {sympy.Symbol(name): value for name, value in more.items()}
        mass = sympy.Matrix([[m * l**2]])
        return eg.Model.from_equations("p", [theta], mass, [force], parameters=known, inputs={tau: 0.3})

    assert list(make().parameters) == ["m", "l", "g"]
    refuses("EG-MISSING parameters.g", lambda: make().compile(target="numpy"))
    mod = make(g=9.81).compile(target="numpy")
    wanted = (0.3 - 2 * 9.81 * 0.5 * np.sin(0.7) - 0.2 / 10) / (2 * 0.25)
    np.testing.assert_allclose(mod.rhs(0, [0.7, 0.2]), [0.2, wanted], rtol=1e-13)


def test_faults_of_the_call() -> None:
    refuses("EG-NAME-UNKNOWN masses from_equations", eg.Model.from_equations, "p", ["q"], [[1]], [0], masses=1)
    refuses("EG-SHAPE equations.mass_matrix 1 2", lambda: eg.Model.from_equations("p", ["q"], [[1, 0]], [0]).check())
    refuses("EG-SHAPE equations.forcing 2 1", lambda: eg.Model.from_equations("p", ["q"], [[1]], [0, "q"]).check())


# -- laTeX that a model gives for its names ----------------------------------------------------------------------------
matplotlib.use("Agg")
TEXT = r"""
name: cart
gravity: [0, -g, 0]
parameters:
  g: 9.81
  m_c: {value: 2, unit: kg, latex: 'm_{\rm c}'}
  l_12: {value: 0.5, unit: m}
inputs: {push: {value: 0, unit: N, latex: F_p}}
bodies:
  cart: {mass: m_c}
  rod: {mass: 1, com: [0, -l_12, 0], inertia: {zz: 0.1}}
  ball: {mass: 1, inertia: {xx: 0.1, yy: 0.1, zz: 0.1}}
joints:
  slide: {type: prismatic, between: [ground, cart], axis: x, coordinate: s, latex: 'x_{w}'}
  swing: {type: revolute, between: [cart, rod], coordinate: theta1}
  turn: {type: spherical, between: [rod, ball], latex: {turn_2: \psi}}
forces:
  motor: {type: actuator, joint: slide, value: push}
outputs:
  E: {expression: total_energy, latex: '\mathcal{E}'}
  pin_x: x(rod)
initial: {theta1: 0.3, s_dot: 0.2}
"""
GIVEN = {"m_c": r"m_{\rm c}", "push": "F_p", "s": "x_{w}", "turn_2": r"\psi", "E": r"\mathcal{E}"}
PLAIN = re.sub(r", latex: ('.*?'|F_p|\{.*?\})", "", TEXT)


def test_python_says_the_same_as_the_file(tmp_path: Path) -> None:
    m = eg.Model("cart", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.parameter("m_c", 2, unit="kg", latex=r"m_{\rm c}")
    m.parameter("l_12", 0.5, unit="m")
    m.input("push", 0, unit="N", latex="F_p")
    cart = m.body("cart", mass="m_c")
    rod = m.body("rod", mass=1, com=(0, "-l_12", 0), inertia={"zz": 0.1})
    ball = m.body("ball", mass=1, inertia=(0.1, 0.1, 0.1))
    m.prismatic("slide", m.ground, cart, axis="x", coordinate="s", latex="x_{w}")
    m.revolute("swing", cart, rod, coordinate="theta1")
    m.spherical("turn", rod, ball, latex=[None, r"\psi", None])
    m.actuator("motor", "slide", value="push")
    m.output("E", m.total_energy, latex=r"\mathcal{E}")
    m.output("pin_x", rod.position[0])
    m.initial(theta1=0.3, s_dot=0.2)
    file = load(tmp_path, TEXT)
    own, read, plain = (each.compile(target="numpy") for each in (m, file, load(tmp_path, PLAIN, "plain.yaml")))
    assert own.metadata["latex"] == read.metadata["latex"] == GIVEN
    assert "latex" not in plain.metadata
    digests = {each.metadata["model_digest"] for each in (own, read, plain)}
    assert len(digests) == 1  # nothing that is computed depends on it
    assert load(tmp_path, file.to_yaml()).to_yaml() == file.to_yaml()
    assert schema_faults(TEXT) == []
    assert schema_faults(TEXT.replace(r"'m_{\rm c}'", "3")) == ["parameters.m_c"]


def test_documents_plots_and_stored_runs_print_it(tmp_path: Path) -> None:
    equations = load(tmp_path, TEXT).derive()
    document = equations.explain(level="short")
    for words in (r"m_{\rm c}", "x_{w}", r"\psi"):
        assert words in document.latex
    run = equations.compile("numpy").simulate((0, 0.1))
    for one in (run, eg.load_trajectory(run.save(tmp_path / "run.npz"))):
        assert one.plot("s_dot").get_ylabel() == r"$\dot{x}_{w}$ (m/s)"
        panel = one.plot("theta1", "turn_2")
        panel.figure.canvas.draw()
        assert [text.get_text() for text in panel.get_legend().get_texts()] == [r"$\theta_{1}$", r"$\psi$"]


def test_names_of_multipliers_and_velocities_take_it(tmp_path: Path) -> None:
    """A bead on a circle: the multiplier is the tension over twice the radius."""
    text = r"""
name: bead
parameters: {m: 2, g: 9.81}
lagrangian:
  coordinates: [x, y]
  expression: m*(x_dot**2 + y_dot**2)/2 - m*g*y
  constraints: [x**2 + y**2 - 1]
  latex: {x: '\xi', x_dot: '\Omega', lambda_1: '\mu_{\rm s}'}
initial: {y: -1, x_dot: 1}
"""
    document = load(tmp_path, text).derive("augmented").explain()
    for words in (r"\mu_{\rm s}", r"\Omega"):
        assert words in document.markdown
    assert r"\lambda_1" not in document.markdown
    assert "<mi>μ</mi>" in document.html
    with refused("EG-NAME-UNKNOWN lagrangian.latex.lambda_2"):
        load(tmp_path, text.replace("lambda_1", "lambda_2")).check()


def test_instances_of_components_tell_their_names_apart(tmp_path: Path) -> None:
    text = r"""
name: pair
components:
  leg:
    attachments: [top]
    parameters: {k: {value: 3, latex: 'k_{s}'}, l: 1}
    bodies: {rod: {mass: 1, com: [l, 0, 0], inertia: {zz: 0.1}}}
    joints: {hip: {type: revolute, between: [top, rod], coordinate: theta, latex: \vartheta}}
bodies: {cart: {mass: 1}}
joints: {slide: {type: prismatic, between: [ground, cart], coordinate: s}}
add:
  leg1: {component: leg, at: cart}
  leg2: {component: leg, at: cart}
"""
    document = load(tmp_path, text).derive().explain()
    for words in (r"k_{s,\mathrm{leg1}}", r"\dot{\vartheta}_{\mathrm{leg2}}", r"l_{\mathrm{leg2}}"):
        assert words in document.latex, words


def test_lagrangians_and_equations_of_python_take_a_mapping_of_any_name() -> None:
    q, q_dot, k = sympy.symbols("q q_dot k")
    given = {q: r"\varphi", k: "k_s", "u": r"\mu"}
    L = q_dot**2 / 2 - k * q**2 / 2
    swing = eg.Model.from_lagrangian("swing", L, [q], forces=["u"], inputs={"u": 0}, parameters={k: 1}, latex=given)
    spring = eg.Model.from_equations("s", [q], [[1]], ["u - k*q"], inputs={"u": 0}, parameters={"k": 1}, latex=given)
    for model in (swing, spring):
        found = model.compile(target="numpy").metadata["latex"]
        assert found == {"q": r"\varphi", "k": "k_s", "u": r"\mu"}
    with refused("EG-NAME-UNKNOWN equations.latex.z"):
        eg.Model.from_equations("spring", [q], [[1]], ["-q"], latex={"z": "z"}).check()


#: Name -> as Matplotlib prints it.
PRINTED = {
    "q12": "q_{12}", "m_c": "m_{c}", "l_1_2": "l_{1,2}", "theta1": r"\theta_{1}", "Omega": r"\Omega",
    "theta_1": r"\mathrm{theta\_1}", "k_max": r"k_{\mathrm{max}}", "J_yy": "J_{yy}", "vx": "v_{x}",
}  # fmt: skip


def test_names_without_latex_are_printed_as_in_a_textbook_and_kept_apart() -> None:
    m = eg.Model("names")
    m.prismatic("p", m.ground, m.body("b", mass=1), coordinate="w")
    for name in PRINTED:
        m.output(name, 1)
    run = m.compile(target="numpy").simulate(0.01)
    labels = [text.get_text() for text in run.plot(*PRINTED).get_legend().get_texts()]
    assert labels == [f"${latex}$" for latex in PRINTED.values()]
    assert run.plot("w_dot").get_ylabel().startswith(r"$\dot{w}$")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("'m_{\\rm c}'", "'m_{c'"), "EG-NOTATION parameters.m_c.latex m_{c"),
        (("F_p", "$F$"), "EG-NOTATION inputs.push.latex: $F$"),
        (("'x_{w}'", "'\\input{x}'"), "EG-NOTATION joints.slide.latex \\input{x}"),
        (("{turn_2: \\psi}", "{turn_4: \\psi}"), "EG-NAME-UNKNOWN joints.turn.latex.turn_4"),
        (("{turn_2: \\psi}", "[a, b]"), "EG-SHAPE joints.turn.latex 2 3"),
        (("{turn_2: \\psi}", "3"), "EG-TYPE joints.turn.latex 3"),
        (("'\\mathcal{E}'", "'<script>'"), "EG-NOTATION outputs.E.latex <script>"),
    ],
)
def test_what_is_wrong_is_reported_with_its_place(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    assert change[0] in TEXT
    refuses(message, lambda: load(tmp_path, TEXT.replace(*change)).check())


#: What no symbol has -> a word of the message.
REFUSED = {
    "{}": "nothing", "$m$": "'$'", "m}": "'}'", "m_{c": "'{'", "m_": "_", "_c": "'_'", "a_b_c": "twice",
    r"\dot": "nothing after", r"\dot{}": "nothing", "m\\": "backslash", r"m\\n": r"\\",
    r"\input{/etc/passwd}": r"\input", r"\write18{ls}": r"\write", r"\href{javascript:alert(1)}{x}": r"\href",
    r"\def\x{y}": r"\def", r"\csname input\endcsname": r"\csname", r"\catcode`\$=12": r"\catcode",
    r"\begin{matrix}": r"\begin", r"\color{red}x": r"\color", r"\(": r"\(", "m%": "'%'", "m&n": "'&'", "m#1": "'#'",
    "m~n": "'~'", '"': "'\"'", "<script>alert(1)</script>": "'<'", "θ": r"θ", "x\x00": "U+0000", "x\u202e": "U+202E",
    r"\text{a_b}": "'_'", r"\thet": r"\thet", "x" * 121: "121", "{" * 9 + "x" + "}" * 9: "groups",
}  # fmt: skip


def test_what_could_leave_the_formula_is_refused() -> None:
    m = eg.Model("names")
    m.prismatic("p", m.ground, m.body("b", mass=1), coordinate="w")
    for k, latex in enumerate(REFUSED):
        m.parameter(f"p{k}", 1, latex=latex)
    with pytest.raises(eg.ModelError) as raised:
        m.check()
    told = {p.path: p for p in raised.value.problems}
    for k, (latex, word) in enumerate(REFUSED.items()):
        problem = told[f"parameters.p{k}.latex"]
        assert word in f"{problem.message}; {problem.remedy}", latex
        assert str(problem).isprintable()


def test_a_quaternion_whose_norm_is_a_constraint_takes_long_steps(tmp_path: Path) -> None:
    """Four Euler parameters and three speeds with e.e = 1 as a constraint."""
    text = """name: quat
equations:
  coordinates: [e0, e1, e2, e3]
  velocities: [wx, wy, wz]
  rates:
    {e0: -(e1*wx + e2*wy + e3*wz)/2, e1: (e0*wx + e2*wz - e3*wy)/2, e2: (e0*wy + e3*wx - e1*wz)/2,
     e3: (e0*wz + e1*wy - e2*wx)/2}
  mass_matrix: [[1, 0, 0], [0, 2, 0], [0, 0, 3]]
  forcing: [-wy*wz, 2*wx*wz, -wx*wy]
  constraints: [e0**2 + e1**2 + e2**2 + e3**2 - 1]
initial: {e0: 1, wx: 0.01, wy: 2, wz: 0.01}
"""
    mod = load(tmp_path, text).compile(target="numpy")
    x = mod.x0()
    x[:4] *= 1 + 1e-9
    mod.rhs(0.0, x)
    steps = len(mod.simulate(0.05).t)
    assert steps < 60, f"{steps} steps for 0.05 s"


m, l, g, c, tau, t = sympy.symbols("m l g c tau t", positive=True)
VALUES = {"m": 1.3, "l": 0.7, "g": 9.8, "c": 0.2}
FILE = """\
name: p
parameters: {m: 1.3, l: 0.7, g: 9.8, c: 0.2}
inputs: {tau: 0.9}
lagrangian:
  coordinates: [q]
  expression: m*l**2*q_dot**2/2 + m*g*l*cos(q) + m*q_dot*sin(t)
  forces: {q: tau}
  dissipation: c*q_dot**2
"""


def energy(q: Any, v: Any) -> Any:
    return m * l**2 * v**2 / 2 + m * g * l * sympy.cos(q) + m * v * sympy.sin(t)


@pytest.mark.parametrize("way", ["functions of time", "symbols", "texts", "file"])
def test_ways_to_write_it(way: str, tmp_path: Path) -> None:
    """m l^2 q'' + m cos t = tau - m g l sin q - 2 c q'."""
    known = {"parameters": VALUES, "inputs": {tau: 0.9}}
    moving, (q, v) = dynamicsymbols("q"), sympy.symbols("q q_dot")
    speed = moving.diff(dynamicsymbols._t)
    timed = energy(moving, speed).subs(t, dynamicsymbols._t)
    make = {
        "functions of time": lambda: eg.Model.from_lagrangian("p", timed, [moving], {moving: tau}, c*speed**2, **known),
        "symbols": lambda: eg.Model.from_lagrangian("p", energy(q, v), [q], [tau], c * v**2, **known),
        "texts": lambda: eg.Model.from_lagrangian("p", FILE[FILE.index("m*l**2") : FILE.index("\n  forces")], ["q"],
                                                  {"q": "tau"}, "c*q_dot**2", **known),
        "file": lambda: load(tmp_path, FILE),
    }  # fmt: skip
    mod = make[way]().compile(target="numpy")
    x, time = [0.4, -1.1], 0.3
    wanted = (0.9 - 1.3 * 9.8 * 0.7 * np.sin(0.4) + 2 * 0.2 * 1.1 - 1.3 * np.cos(time)) / (1.3 * 0.7**2)
    np.testing.assert_allclose(mod.rhs(time, x), [-1.1, wanted], rtol=1e-13)
    assert mod.rhs(time, x, u={"tau": 1.9})[1] - wanted == pytest.approx(1 / (1.3 * 0.7**2))


def test_parameters_are_found_and_values_are_needed() -> None:
    q = dynamicsymbols("q")
    model = eg.Model.from_lagrangian(
        "p", energy(q, q.diff()).subs(t, dynamicsymbols._t), [q], inputs={tau: 0.5}, forces=[tau]
    )
    model.output("speed", l * q.diff())
    model.initial(q="pi/4", q_dot=l)
    assert repr(model) == "<Model p: Lagrangian, 3 parameters, 1 input, 1 output>"
    assert set(map(str, model.derive().parameters)) >= {"m", "l", "g"}
    with pytest.raises(eg.ModelError) as caught:
        model.compile(target="numpy")
    assert {p.path for p in caught.value.problems} == {"parameters.m", "parameters.l", "parameters.g"}


def test_faults_of_a_lagrangian() -> None:
    q, z = dynamicsymbols("q z")
    refuses("EG-TYPE lagrangian.coordinates[1] q(t)**2", eg.Model.from_lagrangian, "p", q, [q, q**2])
    bad = eg.Model.from_lagrangian(
        "p", q.diff() ** 2 + z + q.diff().diff(), [q], forces={z: 1}, constraints=[sympy.gamma(q)]
    )
    with pytest.raises(eg.ModelError) as caught:
        bad.check()
    told = {(p.path, p.message.split(" (")[0]) for p in caught.value.problems}
    assert ("lagrangian.expression", "unknown name 'z'") in told
    assert ("lagrangian.expression", "the acceleration 'q_ddot' cannot be used here") in told
    assert ("lagrangian.forces.z", "no coordinate 'z'") in told
    assert any(path == "lagrangian.constraints[0]" and "gamma" in message for path, message in told)


def test_a_clash_of_names() -> None:
    v = sympy.Symbol("q_dot")
    clash = eg.Model.from_lagrangian("p", v**2, ["q"], inputs={"q_dot": 1})
    refuses("EG-NAME-TAKEN lagrangian.coordinates[0] q_dot", clash.check)
    refuses("EG-MISSING lagrangian.coordinates", lambda: eg.Model.from_lagrangian("p", v**2, []).check())


def test_faults_of_a_file_have_their_lines(tmp_path: Path) -> None:
    bad = FILE.replace("{q: tau}", "[tau, tau]\n  constraints: q").replace("+ m*g", "+ mm*g")
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, bad).check()
    found = [(p.line, p.path.removeprefix("lagrangian.")) for p in caught.value.problems]
    assert found == [(6, "expression"), (7, "forces"), (8, "constraints")]


@pytest.mark.parametrize("text", ["a_dot**4/4 - a**2/2", "-sqrt(1 - a_dot**2)", "sin(a_dot)*a"])
def test_a_lagrangian_that_is_not_quadratic_in_the_velocities_is_named(text: str) -> None:
    with refused("EG-EXPRESSION lagrangian.expression a_dot T"):
        eg.Model.from_lagrangian("powers", text, ["a"]).derive()


def test_what_is_quadratic_linear_or_constant_in_the_velocities_is_taken() -> None:
    text = "(1 + a**2)*a_dot**2/2 + a_dot*b_dot/3 + b_dot**2 + b*a_dot + sin(t)*b_dot - a**2 - b**4"
    M = eg.Model.from_lagrangian("mixed", text, ["a", "b"]).compile(target="numpy").mass_matrix([2.0, 1.0])
    assert M.tolist() == [[5.0, pytest.approx(1 / 3)], [pytest.approx(1 / 3), 2.0]]


# -- rates of inputs --------------------------------------------------------------------------------------------------
EQUATIONS = """\
name: bowl
inputs: {u: {value: 1, unit: m}}
equations:
  coordinates: [x, y]
  velocities: [w, s]
  rates: {x: RATE, y: s + w}
  mass_matrix: [[1, 0], [0, 2]]
  forcing: [0, -19.62]
  constraints: [ROW]
  kinetic_energy: (w**2 + 2*s**2)/2
outputs: {SHOWN}
"""


def bowl(folder: Path, row: str, rate: str, shown: str, by_input: bool) -> Any:
    text = EQUATIONS.replace("RATE", rate).replace("ROW", row).replace("SHOWN", shown)
    if not by_input:
        text = text.replace("inputs: {u: {value: 1, unit: m}}\n", "").replace("u*", "(1 + 0.3*sin(t))*")
    return load(folder, text).compile(target="numpy")


@pytest.mark.parametrize(
    ("row", "rate", "shown", "names"),
    [
        ("y - u*x**2", "w", "", ("u", "u_dot", "u_ddot")),
        ("s - u*w", "w", "", ("u", "u_dot")),
        ("y - x**2", "u*w + w", "", ("u", "u_dot")),
        ("y - u*x**2", "u*w + w", "acc: x_ddot", ("u", "u_dot", "u_ddot")),
        ("", "u*w + w", "acc: x_ddot", ("u", "u_dot")),
        ("", "u*w + w", "speed: x_dot", ("u",)),
    ],
)
def test_given_equations_move_as_with_the_expression_written_in(
    tmp_path: Path, row: str, rate: str, shown: str, names: tuple[str, ...]
) -> None:
    led, written = (bowl(tmp_path, row, rate, shown, by_input) for by_input in (True, False))
    assert led.u_names == names
    start = {"x": 0.5, "w": 0.1}
    ends = [mod.simulate(1.0, start, inputs=given) for mod, given in ((led, {"u": "1 + 0.3*sin(t)"}), (written, {}))]
    assert np.abs(ends[0].x[:, -1] - ends[1].x[:, -1]).max() < 1e-12
    for name in ends[1].names:
        assert np.abs(ends[0][name][[0, -1]] - ends[1][name][[0, -1]]).max() < 1e-10
    assert ends[0].residuals.position < 1e-14


def inputs_of(model: eg.Model) -> Any:
    return model.compile(target="numpy", kernels=["poses"]).u_names


def test_only_what_is_differentiated_gets_rates() -> None:
    th, th_dot, u, k = sympy.symbols("th th_dot u k")
    make = eg.Model.from_lagrangian
    held = make("a", th_dot**2 / 2 - u * th**2, [th], forces=[u], dissipation=u * th_dot**2, inputs={u: 1.0})
    assert inputs_of(held) == ("u",)
    moving = make("b", u**2 * th_dot**2 / 2, [th], inputs={u: 1.0, k: 2.0}, forces=[k])
    assert inputs_of(moving) == ("u", "k", "u_dot")
    m = eg.Model("c", gravity=(0, -10, 0))
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u", unit="mm")
    m.event("near", "s - u")
    assert inputs_of(m) == ("u",)
    m.event("floor", "s - u", restitution=0.5)
    assert inputs_of(m) == ("u", "u_dot")


def test_a_name_that_is_taken_is_reported() -> None:
    m = eg.Model("lift")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u")
    m.parameter("u_ddot", 1.0)
    m.driver("lead", coordinate="s", value="u")
    refuses("EG-NAME-TAKEN parameters.u_ddot u lead", m.check)


REEL = """
name: reel
parameters: {k: 1}
inputs: {l: {value: 1, signal: 1 + k*t**2}}
lagrangian: {coordinates: [th], expression: l**2*th_dot**2/2}
"""


def test_an_expression_over_time_brings_its_rates(tmp_path: Path) -> None:
    """l^2 th' stays; of a signal of the model as of one of the run, which comes first."""
    mod = load(tmp_path, REEL).compile(target="numpy")
    start, tight = {"th_dot": 1.0}, {"rtol": 1e-10, "atol": 1e-12}
    run = mod.simulate(1.0, start, parameters={"k": 3.0}, **tight)
    assert np.abs(run["l"] ** 2 * run["th_dot"] - 1.0).max() < 1e-9
    assert np.abs(run["l_dot"] - 6.0 * run.t).max() < 1e-12
    assert abs(mod.simulate(1.0, start, inputs={"l": "1 + t"}, **tight)["th_dot"][-1] - 0.25) < 1e-9
    assert mod.simulate(1.0, start, inputs={"l": 2.0})["th_dot"][-1] == 1.0
    with refused("EG-UNSUPPORTED inputs.l.signal th_dot l_dot"):
        load(tmp_path, REEL.replace("1 + k*t**2", "1 + th_dot")).check()


@pytest.mark.parametrize(
    ("factor", "jumps"),
    [("where(t > t0, 1.5, 1)", True), ("where(t > t0, 1 + (t - t0), 1)", False), ("1 + max(t - 0.5, 0)", False)],
)
def test_what_jumps_in_time_by_a_condition_is_refused(factor: str, jumps: bool) -> None:
    """Differentiated by time the branch taken is constant, so that the impulse of the jump would be passed over."""
    m = eg.Model("lift", gravity=(0, -9.81, 0))
    m.parameter("t0", 0.3)
    m.prismatic("s", m.ground, m.body("b", mass=1), axis="x")
    m.coupling("led", equation=f"s - 0.1*({factor})")
    if jumps:
        refuses("EG-JUMP constraints.led", m.check)
    else:
        assert m.check().degrees_of_freedom == 0


def test_a_law_without_a_value_at_some_parameters_is_no_jump() -> None:
    """sqrt(l^2 - 10 r^2) is a number at the declared values, not at all that a random point may have."""
    x, y = dynamicsymbols("x y")
    t, r, l, T = dynamicsymbols._t, *sympy.symbols("r l T")
    c = sympy.sqrt(l**2 - 10 * r**2)
    law = sympy.Piecewise((c * t**3 / T**3, t < T), (c * (3 * t - 2 * T) / T, True))
    L = (x.diff(t) ** 2 + y.diff(t) ** 2) / 2
    given = {r: 0.1, l: 0.35, T: 1.0}
    model = eg.Model.from_lagrangian("led", L, [x, y], constraints=[x - y - law], parameters=given)
    assert model.check().degrees_of_freedom == 1
