"""Every target gives the numbers of every other: C, CasADi, JAX and device code beside NumPy, model by model.

Derivatives too: those that the libraries take of their functions are the module's own.
"""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import jax
import models
import numpy as np
import pytest
from analysed import compiled
from command import run
from host_device import HostDevice
from refusals import refuses
from sweeps import OF_ALL_KINDS, part_of

import eomgen as eg

EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
#: A tree, a loop, redundant rows, rolling, first-order states, Euler parameters, what switches, a law of time.
CHOSEN = (
    "double_pendulum", "slider_crank", "three_cranks", "rolling_disc", "hydraulic_boom", "satellite", "gait_leg",
    "car_axis",
)  # fmt: skip
#: Of these CasADi and JAX are tried always, whose functions take longer to make.
TRACED = ("double_pendulum", "slider_crank", "rolling_disc", "hydraulic_boom", "satellite")
COMPILED = ("slider_crank", "gait_leg")  #: others as recorded, in test_golden
ON_DEVICE = ("double_pendulum", "slider_crank", "hydraulic_boom")
NAMES = sorted({*EXAMPLES, *CHOSEN})
EARLY = 1e-4  #: a time (s) that driven mechanisms reach from their start
CLOSE = 1e-12  #: of the largest entry
#: Calls of a module at (t, x), (q, t), (x, t) and with accelerations; a module adds masses of first-order states apart.
OF_STATES = {"rhs": "tx", "outputs": "tx", "project": "x", "energy": "x", "poses": "q"}
OF_MOTIONS = {
    "bias": "tx", "mass_matrix": "q", "inverse_dynamics": "qva", "constraints": "q rows",
    "velocity_constraints": "x rows", "constraint_jacobian": "q rows",
}  # fmt: skip


@cache
def derived(name: str) -> Any:
    return models.build(name).derive()


@cache
def judge(name: str) -> Any:
    return derived(name).compile(target="numpy")


def state_of(module: Any, seed: int = 3) -> np.ndarray:
    """A state near the start, a little off the constraints too."""
    random = np.random.default_rng(seed)
    x = module.project(module.x0() + 0.01 * random.normal(size=module.n_x), t=EARLY)
    return x + 1e-7 * random.normal(size=x.size)


def called(module: Any, name: str, x: np.ndarray, a: np.ndarray) -> np.ndarray:
    """One function of a module."""
    how, q, v = (OF_STATES | OF_MOTIONS)[name], x[: module.n_q], x[module.n_q : module.n_q + module.n_v]
    call = getattr(module, name)
    rows = {"rows": "all"} if "rows" in how else {}
    if how == "tx":
        return np.array(call(EARLY, x))
    given = (q, v, a) if how == "qva" else (q if how[0] == "q" else x,)
    return np.array(call(*given, t=EARLY, **rows))


def expected(name: str, x: np.ndarray, a: np.ndarray) -> dict[str, np.ndarray]:
    module = judge(name)
    wanted = [*OF_STATES, *(OF_MOTIONS if module.n_x == module.n_q + module.n_v else ())]
    if not module.n_c:
        wanted = [n for n in wanted if "constraint" not in n]
    if not module.y_names:
        wanted.remove("outputs")
    return {n: called(module, n, x, a) for n in wanted}


def assert_close(found: Any, wanted: np.ndarray, name: str, limit: float = CLOSE) -> None:
    scale = max(1.0, np.abs(wanted).max(initial=0.0))
    found = np.asarray(found, dtype=float).reshape(wanted.shape)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=limit * scale, err_msg=name)


def case(name: str) -> tuple[np.ndarray, np.ndarray]:
    module = judge(name)
    return state_of(module), np.random.default_rng(4).normal(size=module.n_v)


@pytest.mark.parametrize("name", part_of(NAMES, COMPILED.__contains__))
def test_c_equals_numpy(name: str) -> None:
    """All functions and the Jacobian, of one state and of several."""
    x, a = case(name)
    wanted = expected(name, x, a)
    in_c = compiled(name, "cython")
    for call, numbers in wanted.items():
        assert_close(called(in_c, call, x, a), numbers, call, 1e-10)
    closed = judge(name).project(x, t=EARLY)
    assert_close(in_c.jacobian(EARLY, closed), judge(name).jacobian(EARLY, closed), "jacobian", 1e-9)
    many = np.stack([x, closed], axis=-1)
    np.testing.assert_array_equal(in_c.rhs(EARLY, many)[:, 0], in_c.rhs(EARLY, x))


def traced(functions: Any, name: str, x: Any, a: Any) -> dict[str, Any]:
    """The functions of a library that the judge has too."""
    module = judge(name)
    n_q, n_v = module.n_q, module.n_v
    found = {}
    for call in expected(name, x, a):
        how = (OF_STATES | OF_MOTIONS)[call]
        given = {"tx": (x,), "x": (x,), "q": (x[:n_q],), "qva": (x[:n_q], x[n_q : n_q + n_v], a)}[how.split()[0]]
        if hasattr(functions, call):
            found[call] = getattr(functions, call)(EARLY, *given, module.u, module.p)
    return found


def slopes_of(module: Any, x: np.ndarray) -> list[np.ndarray]:
    """The module's derivatives of rhs by x, u and p."""
    by_u = module.input_jacobian(EARLY, x) if module.n_u else np.zeros((module.n_x, 0))
    by_p = module.parameter_jacobian(EARLY, x) if module.n_p else np.zeros((module.n_x, 0))
    return [module.jacobian(EARLY, x), by_u, by_p]


@pytest.mark.parametrize("name", part_of(NAMES, TRACED.__contains__))
def test_casadi_equals_numpy(name: str) -> None:
    """Every function, and the derivatives of rhs by x, u and p."""
    functions, module = derived(name).to_casadi(), judge(name)
    x, a = case(name)
    wanted, found = expected(name, x, a), traced(functions, name, x, a)
    assert {"rhs", "project", "energy", "poses"} <= set(found)
    for call, result in found.items():
        assert_close(result, wanted[call], call)
    x = module.project(x, t=EARLY)
    symbols = [ca.SX.sym(label, n) for label, n in (("x", module.n_x), ("u", module.n_u), ("p", module.n_p))]
    slopes = ca.Function("f", symbols, [ca.jacobian(functions.rhs(EARLY, *symbols), s) for s in symbols])
    for result, numbers in zip(slopes(x, module.u, module.p), slopes_of(module, x), strict=True):
        assert_close(result, numbers, "derivatives", 1e-8)


@pytest.mark.parametrize("name", part_of(NAMES, TRACED.__contains__))
def test_jax_equals_numpy(name: str) -> None:
    """Every function, and the derivative of rhs along a direction of x, u and p at once; XLA compiles nothing here."""
    functions, module = derived(name).to_jax(), judge(name)
    x, a = case(name)
    wanted, random = expected(name, x, a), np.random.default_rng(4)
    with jax.disable_jit():
        for call, result in traced(functions, name, x, a).items():
            assert_close(result, wanted[call], call)
        at = (module.project(x, t=EARLY), np.array(module.u), np.array(module.p))
        ways = tuple(random.normal(size=part.size) for part in at)
        _, found = jax.jvp(lambda *at: functions.rhs(EARLY, *at), at, ways)
    slopes = zip(slopes_of(module, at[0]), ways, strict=True)
    assert_close(found, np.asarray(sum(slope @ way for slope, way in slopes)), "derivative", 1e-8)


@pytest.mark.parametrize("name", part_of(NAMES, ON_DEVICE.__contains__))
def test_device_code_equals_numpy(name: str, tmp_path: Path) -> None:
    """Compiled for the host: functions of columns of states, each with parameters, inputs and a time of its own."""
    module, model = judge(name), derived(name).to_cuda(HostDevice(tmp_path))
    states = [case(name)[0], state_of(module, 7), module.project(module.x0(), t=EARLY)]
    x, a = np.array(states).T, case(name)[1]
    for call in expected(name, states[0], a):
        how, n_q, n_v = (OF_STATES | OF_MOTIONS)[call], module.n_q, module.n_v
        if how == "qva":
            found = model.inverse_dynamics(x[:n_q], x[n_q : n_q + n_v], np.repeat(a[:, None], 3, axis=1), t=EARLY)
        else:
            given = x[:n_q] if how[0] == "q" else x
            found = getattr(model, call)(EARLY, given) if how == "tx" else getattr(model, call)(given, t=EARLY)
        for k, state in enumerate(states):
            assert_close(found[..., k], called(module, call, state, a), call)
    jacobian = model.jacobian(EARLY, x)
    assert_close(jacobian[..., 2], module.jacobian(EARLY, states[2]), "jacobian", 1e-10)
    if module.n_p:
        p = np.repeat(np.array(module.p)[:, None], 3, axis=1) * [1.0, 1.001, 0.999]
        found = model.rhs(EARLY, x, p)
        for k, state in enumerate(states):
            assert_close(found[:, k], module.rhs(EARLY, state, p=p[:, k]), "parameters")


@pytest.mark.parametrize("target", ["casadi", "jax", "cuda"])
def test_what_a_target_cannot_have_is_refused_by_name(target: str, tmp_path: Path) -> None:
    def convert(model: eg.Model, method: str = "auto") -> Any:
        equations = model.derive(method)
        return equations.to_cuda(HostDevice(tmp_path)) if target == "cuda" else getattr(equations, f"to_{target}")()

    (tmp_path / "push.c").write_text("double push(double x) { return -x; }\n")
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    m.native("push", tmp_path / "push.c")
    m.torque("pushed", "d", "push(x)")
    refuses(f"EG-UNSUPPORTED {target} C", convert, m)
    touching = eg.Model("touching")
    ball = touching.body("ball", mass=1.0, inertia={"zz": 0.1})
    touching.planar("j", touching.ground, ball)
    circle = {"shape": "circle", "on": ball, "radius": 0.1}
    touching.contacts("floor", circle, {"shape": "half_plane", "on": touching.ground}, {"stiffness": 1e3})
    refuses("EG-UNSUPPORTED contacts", convert, touching)
    if target != "cuda":
        refuses("EG-UNSUPPORTED augmented", lambda: convert(models.build("slider_crank"), "augmented"))


def test_an_unknown_target_is_refused_with_those_there_are() -> None:
    refuses("EG-NAME-UNKNOWN fortran", lambda: derived("double_pendulum").compile(target="fortran"))
    refuses("EG-UNSUPPORTED module", lambda: derived("double_pendulum").compile(target="c"))


def test_examples_of_all_kinds_have_every_kind() -> None:
    """What stands in the files: types, shapes, descriptions of rotations, functions in expressions, sections."""

    def kinds(names: Any) -> set[str]:
        text = "".join((models.EXAMPLES / f"{name}.yaml").read_text() for name in names)
        found = re.findall(r"\b(?:type|shape|rotation):\s*(\w+)", text)
        found += re.findall(r"\b([a-z]+[0-9]?)\(", text)
        return {*found, *re.findall(r"^(\w+):", text, re.MULTILINE)}

    assert len(kinds(EXAMPLES)) > 50
    assert kinds(EXAMPLES) - kinds(OF_ALL_KINDS) == set()


# -- casADi and JAX ----------------------------------------------------------------------------------------------------
LOOPS = pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", pytest.param("stewart_platform", marks=pytest.mark.thorough)]
)


@LOOPS
def test_a_state_off_the_loops_comes_to_the_modules_state(name: str) -> None:
    """The steps of the projection are the module's own, so that both come to the same one of all closed states."""
    equations = derived(name)
    module, functions = equations.compile(target="numpy"), equations.to_casadi()
    random = np.random.default_rng(5)
    for size in (0.003, 0.03):
        x = module.x0() + size * random.normal(size=module.n_x)
        expected = module.project(x), module.rhs(0.0, x)
        for name_of, wanted in zip(("project", "rhs"), expected, strict=True):
            found = np.asarray(getattr(functions, name_of)(0.0, x, module.u, module.p)).ravel()
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-11 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("name", ["double_pendulum", pytest.param("slider_crank", marks=pytest.mark.thorough)])
def test_jax_differentiates_closed_loops_too(name: str) -> None:
    equations = derived(name)
    module, functions = equations.compile(target="numpy"), equations.to_jax()
    x = module.project(state_of(module))
    found = jax.jit(jax.jacfwd(functions.rhs, argnums=1))(0.0, x, module.u, module.p)
    expected = module.jacobian(0.0, x)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    back = jax.jit(jax.grad(lambda x: functions.rhs(0.0, x, module.u, module.p)[-1]))(x)
    np.testing.assert_allclose(back, expected[-1], rtol=0.0, atol=1e-9 * np.abs(expected).max())


@LOOPS
def test_minimal_form_of_loops(name: str) -> None:
    """z of the degrees of freedom gives the whole state and its rates."""
    equations = derived(name)
    module, functions = equations.compile(target="numpy"), equations.to_casadi()
    x = module.project(state_of(module))
    q, v = x[: module.n_q], x[module.n_q :]
    places = list(module.metadata["independent"])
    z = np.concatenate([q[places], v[places]])
    guess = q + 0.01 * np.random.default_rng(2).normal(size=q.size)
    found = np.asarray(functions.full_state(0.0, z, guess, module.u, module.p)).ravel()
    np.testing.assert_allclose(found, x, atol=1e-10 * max(1.0, np.abs(x).max()))
    rates = np.asarray(functions.minimal_rhs(0.0, z, guess, module.u, module.p)).ravel()
    expected = np.concatenate([v[places], module.rhs(0.0, x)[module.n_q :][places]])
    np.testing.assert_allclose(rates, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("library", ["casadi", "jax"])
@pytest.mark.parametrize("blades", [1, 2])
def test_rows_of_velocities_alone(blades: int, library: str) -> None:
    """No row holds a position; the states of a sleigh and of one that pulls another."""
    m = eg.Model("sleigh")
    body = m.body("b", mass=2.0, com=(0.25, 0, 0), inertia={"zz": 0.3})
    m.planar("J", m.ground, body)
    m.knife_edge("k", body)
    if blades == 2:
        pulled = m.body("c", mass=1.0, inertia={"zz": 0.1})
        m.revolute("R", body.at(0.5, 0, 0), pulled)
        m.knife_edge("l", pulled)
    m.output("a", "ax(b)")
    module, functions = m.compile(target="numpy"), getattr(m.derive(), f"to_{library}")()
    x = module.project(0.1 * np.arange(module.n_x)) + 0.01
    for name in ("rhs", "project", "outputs"):
        with jax.disable_jit():
            found = np.asarray(getattr(functions, name)(0.0, x, module.u, module.p)).ravel()
        expected = module.project(x) if name == "project" else getattr(module, name)(0.0, x)
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("library", ["casadi", "jax"])
@pytest.mark.parametrize("n", [29, 30])
def test_given_rates_of_large_equations(n: int, library: str) -> None:
    """q' is what was given, not the velocities, also where the mass matrix is solved by the library."""
    q, v = [f"q{i}" for i in range(n)], [f"u{i}" for i in range(30)]
    mass = [[3.0 if i == j else "0.3*cos(q0)" if abs(i - j) == 1 else 0 for j in range(30)] for i in range(30)]
    rates = {a: f"(1.5 + sin({a}))*u{i}" for i, a in enumerate(q)}
    forcing = [f"-u{i}" for i in range(30)]
    model = eg.Model.from_equations("large", q, velocities=v, rates=rates, mass_matrix=mass, forcing=forcing)
    functions = getattr(model.derive(), f"to_{library}")()
    x = np.random.default_rng(1).uniform(-1.0, 1.0, n + 30)
    with jax.disable_jit():
        found = np.asarray(functions.rhs(0.0, x, np.zeros(0), np.zeros(0))).ravel()
    M = 3.0 * np.eye(30) + 0.3 * np.cos(x[0]) * (np.eye(30, k=1) + np.eye(30, k=-1))
    expected = np.r_[(1.5 + np.sin(x[:n])) * x[n : 2 * n], np.linalg.solve(M, -x[n:])]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_state_far_from_the_loops_is_no_number() -> None:
    equations = derived("slider_crank")
    functions = equations.to_casadi()
    x = np.array(functions.x0)
    x[0] += 1.5
    x[2] += 5.0
    assert np.isnan(np.asarray(functions.rhs(0.0, x, functions.u_values, functions.p_values))).all()


PROGRAM = """
import sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import {name} as model
x_dot = model.rhs(0.0, model.x0, model.u_values, model.p_values)
print(float(x_dot[3]))
"""


@pytest.mark.parametrize("target", ["casadi", "jax"])
def test_a_package_needs_the_library_alone(target: str, tmp_path: Path) -> None:
    words = ("generate", models.EXAMPLES / "double_pendulum.yaml", "--out", tmp_path, "--target", target)
    assert run(*words).code == 0
    folder = tmp_path / "double_pendulum"
    program = [sys.executable, "-c", PROGRAM.format(name=folder.name)]
    done = subprocess.run(program, cwd=tmp_path, check=True, capture_output=True, text=True)
    functions = derived("double_pendulum").to_casadi()
    expected = functions.rhs(0.0, functions.x0, functions.u_values, functions.p_values)[3]
    assert float(done.stdout) == pytest.approx(float(expected), rel=1e-12)
    assert "model.rhs" in (folder / "README.md").read_text()


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    m = models.build("pendulum")
    m.parameter("unused", 1.0)
    refuses("EG-PACKAGE-MISSING casadi>=3.6.5", lambda: m.derive().to_casadi())


@pytest.mark.parametrize("library", ["casadi", "jax"])
def test_x0_is_the_start_of_the_model(library: str, tmp_path: Path) -> None:
    """A tree whose rates are declared in part, with a first-order state."""
    m = eg.Model("crane", gravity=(0, -9.81, 0))
    trolley = m.body("trolley", mass=10.0)
    m.prismatic("rail", m.ground, trolley, axis="x", coordinate="s")
    m.revolute("hook", trolley, m.body("load", mass=2.0, com=(0, -1, 0), inertia={"zz": 0.1}), coordinate="swing")
    m.state("pressure", "-pressure", initial=7e4)
    m.initial(s=0.2, s_dot=0.1)
    equations = m.derive()
    start = equations.compile(target="numpy").x0()
    functions = getattr(equations, f"to_{library}")()
    np.testing.assert_allclose(np.asarray(functions.x0, dtype=float).ravel(), start, rtol=1e-12, atol=1e-12)
    m.save(tmp_path / "model.yaml")
    assert run("generate", tmp_path / "model.yaml", "--out", tmp_path, "--target", library).code == 0
    package = tmp_path / "crane"
    line = next(text for text in (package / "__init__.py").read_text().splitlines() if text.startswith("x0 ="))
    assert repr(float(start[0])) in line
