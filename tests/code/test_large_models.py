"""C of large models: loops over alike bodies, alike limbs side by side, shapes in contact, closed chains, beside NumPy.

NumPy's text has one statement for each operation; text in C that goes through alike parts has to give its numbers, and
to grow less than the model.
"""

import math
import re
from collections.abc import Callable
from functools import cache
from math import ulp
from pathlib import Path
from typing import Any

import jax
import judges
import models
import numpy as np
import pytest
from command import run
from models import IN_C
from mpmath import mp, mpf
from scipy.integrate import quad
from sweeps import part_of

import eomgen as eg
from benchmarks.models.linkages import closed_chain, four_bars

KERNELS = ["rhs", "bias", "inverse_dynamics", "energy", "poses", "jacobian"]


def planar_chain(n: int) -> eg.Model:
    m = eg.Model("planar_chain", gravity=(1.0, "-g", 0))
    for name, value in (("g", 9.81), ("m", 0.7), ("l", 0.3)):
        m.parameter(name, value)
    last: Any = m.ground
    for k in range(n):
        link = m.body(f"b{k}", mass="m", com=("l/2", 0, 0), inertia=(0.002, 0.003, f"m*l**2/{14 + k % 7}"))
        m.revolute(f"j{k}", last, link)
        last = link.at("l", 0, 0)
    return m


def numbers_chain(n: int) -> eg.Model:
    """Hinges across each other, springs on every third joint, a force at the tip."""
    m = eg.Model("numbers_chain", gravity=(0.3, -9.0, 2.0))
    m.input("u", 0.4)
    last: Any = m.ground
    for k in range(n):
        link = m.body(f"b{k}", mass=1.0 + 0.01 * k, com=(0.05, 0.01, 0), inertia=(2e-3, 1e-3, 1.5e-3))
        m.revolute(f"j{k}", last, link, axis="zy"[k % 2])
        if k % 3 == 0:
            m.torsional_spring(f"s{k}", f"j{k}", stiffness=3.0 + k)
            m.torque(f"d{k}", f"j{k}", f"u - 0.2*j{k}_dot")
        last = link.at(0.1, 0, 0)
    m.force("tip", last, (1, "2*u", "sin(t)"))
    return m


def slides(n: int) -> eg.Model:
    """Slides and hinges in turn, on turned axes, two on every body."""
    m = eg.Model("slides", gravity=(0, 0, -9.81))
    m.parameter("c", 0.3)
    bodies: list[Any] = []
    for k in range(n):
        tensor = {"xx": 0.03, "yy": 0.02, "zz": 0.025, "xy": 0.002}
        body = m.body(f"b{k}", mass=1.2, com=(0, 0.1, "c/5"), inertia=tensor)
        outer = (bodies[(k - 1) // 2] if k else m.ground).at(0.1, 0.2, 0, rpy=(0.3, -0.2, 0.1 * (k % 2)))
        joint = m.prismatic if k % 2 else m.revolute
        joint(f"j{k}", outer, body, axis=(0.6, 0.0, 0.8))
        if k % 4 == 0:
            m.damper(f"d{k}", m.ground, body, damping=0.5 + 0.1 * k)
        bodies.append(body)
    return m


def afloat(n: int) -> eg.Model:
    """Three equal arms on a body that floats, in Euler parameters."""
    m = eg.Model("afloat", gravity=(0, 0, -9.81))
    base = m.body("base", mass=5.0, inertia=(0.4, 0.5, 0.6))
    m.free("root", m.ground, base, rotation="euler_parameters")
    for arm in range(3):
        last: Any = base.at(0.2 * arm, 0.1, 0, rpy=(0, 0, 2.0 * arm))
        for k in range(n // 3):
            link = m.body(f"a{arm}_{k}", mass=1.0, com=(0.1, 0, 0.02), inertia=(0.01, 0.02, 0.03))
            if k == 1:
                m.spherical(f"j{arm}_{k}", last, link, rotation="euler_parameters")
            else:
                m.revolute(f"j{arm}_{k}", last, link, axis="xyz"[k % 3])
            last = link.at(0.3, 0, 0)
    return m


def branched(n: int) -> eg.Model:
    """Another chain hangs on the tenth link of a chain, and reads what loops hand on there."""
    m = eg.Model("branched", gravity=(0, -9.81, 0))
    links: list[Any] = []
    for name, mass, com in (("a", 1.0, (0.05, 0, 0)), ("b", 0.5, (0.05, 0.01, 0))):
        last: Any = links[10].at(0.1, 0, 0) if links else m.ground
        for k in range(n // 2):
            link = m.body(f"{name}{k}", mass=mass, com=com, inertia=(1e-3, 1.2e-3, 1.5e-3))
            m.revolute(f"j{name}{k}", last, link)
            links.append(link)
            last = link.at(0.1, 2 * com[1], 0)
    return m


def two_arms(n: int) -> eg.Model:
    """Two arms of n links of a body that slides and turns; they mirror each other, but for one mass."""
    m = eg.Model("two_arms", gravity=(0.0, 0.3, -9.81))
    m.body("trunk", mass=8.0, inertia={"xx": 0.4, "yy": 0.3, "zz": 0.5, "xy": 0.01, "xz": 0.02, "yz": -0.03})
    m.revolute("turn", "ground", "trunk", axis=(0.4, 0.0, 0.9))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        before = "trunk"
        for k in range(n):
            name, heavy = f"{side}{k}", 1.0 + 0.2 * (side == "right" and k == 1)
            tensor = {"xx": 0.03, "yy": 0.03, "zz": 0.04, "xy": 0.002 * sign, "xz": 0.001, "yz": -0.003 * sign}
            m.body(name, mass=heavy * (1.5 - 0.3 * k), com=(0.03, 0.2 * sign, 0.05), inertia=tensor)
            axis = ((1.0, 0.0, 0.0), (0.0, 0.6 * sign, 0.8), (0.0, 0.0, 1.0))[k % 3]
            m.revolute(f"{name}_angle", {"body": before, "at": (0.0, 0.3 * sign, 0.1 * k)}, name, axis=axis)
            m.torque(f"{name}_motor", f"{name}_angle", m.input(f"tau_{name}", 0.1 * k))
            before = name
    return m


def touching(n: int) -> eg.Model:
    """A hanging chain whose links are discs that meet each other and the floor."""
    m = planar_chain(n)
    discs = {"shape": "circle", "on": [m.bodies[f"b{k}"] for k in range(n)], "radius": 0.2}
    law = {"stiffness": 300.0, "dissipation": "0.2*m", "friction": 0.3, "smoothing": 0.1}
    m.contacts("floor", discs, {"shape": "half_plane", "on": m.ground.at(0, -0.4, 0)}, law)
    m.contacts("among", discs, law=law)
    return m


TREES: dict[str, tuple[Callable[[int], eg.Model], int, str]] = {
    "planar chain": (planar_chain, 60, "recursive"), "numbers": (numbers_chain, 45, "recursive"),
    "slides": (slides, 40, "recursive"), "afloat": (afloat, 39, "recursive"), "branched": (branched, 60, "auto"),
    "two arms": (two_arms, 3, "embedding"), "touching": (touching, 12, "auto"),
}  # fmt: skip


def agree(found: Any, wanted: Any, size: float, name: str) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0, atol=size * max(1.0, np.abs(wanted).max()), err_msg=name)


@pytest.mark.parametrize("name", part_of(TREES, lambda name: name in ("planar chain", "touching")))
def test_trees_in_c_equal_numpy(name: str) -> None:
    make, n, method = TREES[name]
    equations = make(n).derive(method)
    kernels = ["rhs", "jacobian"] if name == "touching" else KERNELS
    in_c, judge = equations.compile(kernels=kernels, optimize=0), equations.compile(target="numpy", kernels=kernels)
    rng = np.random.default_rng(5)
    q, v, a = (rng.uniform(-0.6, 0.6, size) for size in (judge.n_q, judge.n_v, judge.n_v))
    for i, _ in judge.metadata["quaternion_slots"]:
        q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
    x = np.concatenate([q, v])
    agree(in_c.rhs(0.2, x), judge.rhs(0.2, x), 1e-9, "rhs")
    agree(in_c.jacobian(0.2, x), judge.jacobian(0.2, x), 1e-8, "jacobian")
    if kernels is KERNELS:
        agree(in_c.bias(0.2, x), judge.bias(0.2, x), 1e-12, "bias")
        agree(in_c.inverse_dynamics(q, v, a), judge.inverse_dynamics(q, v, a), 1e-12, "inverse_dynamics")
        agree(in_c.energy(x), judge.energy(x), 1e-12, "energy")
        agree(in_c.poses(q), judge.poses(q), 1e-13, "poses")


JUDGED = ["mass_matrix", "bias", "constraints", "constraint_jacobian", "velocity_constraints", "project"]


def led(m: eg.Model, joint: str) -> eg.Model:
    m.torque("drive", joint, m.input("tau", 0.3))
    return m


LOOPS: dict[str, Callable[[], eg.Model]] = {
    "planar": lambda: led(closed_chain(18, True, False), "j0"), "bars": lambda: led(four_bars(6), "A0"),
    "spatial": lambda: led(closed_chain(15, True, True), "j0"),
    "stewart_platform": lambda: models.build("stewart_platform"), "excavator": lambda: models.build("excavator"),
}  # fmt: skip


@pytest.mark.parametrize("name", part_of(LOOPS, lambda name: name == "bars"))
def test_loops_in_c_equal_multipliers(name: str) -> None:
    """On the constraints and off them, beside Newton's steps and a solve with multipliers."""
    judge = LOOPS[name]().compile(target="numpy", kernels=JUDGED)
    in_c = LOOPS[name]().compile(kernels=["rhs", "project", "jacobian"], optimize=0)
    rng = np.random.default_rng(3)
    start = judge.x0()
    for far in (0.0, 1e-3):
        x = start + far * rng.uniform(-1.0, 1.0, judge.n_x)
        x[judge.n_q :] += 0.1 * rng.uniform(-1.0, 1.0, judge.n_v)
        closed = judges.closed(judge, x)
        agree(in_c.project(x), closed, 1e-9, "project")
        agree(in_c.rhs(0.3, x)[judge.n_q :], judges.solved(judge, closed, 0.3)[0], 1e-8, "rhs")
    J, d = in_c.jacobian(0.3, closed), rng.normal(size=judge.n_x)
    agree(J @ d, judges.central(lambda h: in_c.rhs(0.3, closed + h * d), 1e-5), 1e-6, "jacobian")


# How long the text is, apart from tables of numbers and the model's own description.


def length(model: eg.Model, folder: Path) -> int:
    folder.mkdir()
    model.save(folder / "model.yaml")
    assert run("generate", folder / "model.yaml", "--out", folder, "--target", "c").code == 0
    text = "".join(file.read_text() for file in (folder / model.name).glob(f"{model.name}*.c"))
    tables = r"(static )?const \w+ \*?\w+\[\d*\](\[\d+\])? = \{.*?\n\};|metadata_texts\[\] = \{.*?\n\};"
    return len(re.sub(f"(?s){tables}", "", text))


@pytest.mark.thorough
def test_text_grows_less_than_a_tree(tmp_path: Path) -> None:
    small, big = (length(planar_chain(n), tmp_path / str(n)) for n in (100, 200))
    assert big < 1.7 * small


def test_text_of_contacts_does_not_grow_with_the_shapes(tmp_path: Path) -> None:
    """Of two bodies with many shapes each."""

    def rows(count: int) -> eg.Model:
        m = eg.Model("rows", gravity=(0, -9.81, 0))
        groups = []
        for i in range(2):
            body = m.body(f"b{i}", mass=1.0, inertia={"zz": 0.01})
            m.planar(f"j{i}", m.ground, body)
            on = [body.at(0.1 * k, 0.01 * k * k, 0) for k in range(count)]
            groups.append([{"shape": "circle", "on": on, "radius": 0.06}])
        m.contacts("touch", *groups, {"stiffness": 1e3})
        return m

    few, many = (length(rows(count), tmp_path / str(count)) for count in (10, 40))
    assert many < 1.1 * few


# -- what operations become in C, in vectors of C, in NumPy, CasADi and JAX, and as Taylor series ----------------------
EXPRESSIONS: dict[str, Callable[[float, float], float]] = {
    "atan2(a, b)": math.atan2,
    "hypot(a, 2*b)": lambda a, b: math.hypot(a, 2 * b),
    "where(a < b, a, 2*b)": lambda a, b: a if a < b else 2 * b,
    "where(a <= b and b > 0, 1, -1)": lambda a, b: 1.0 if a <= b and b > 0 else -1.0,
    "where(a > b or not b > 0, a, 3*b)": lambda a, b: a if a > b or not b > 0 else 3 * b,
    "where(a > 0, log(a), 7)": lambda a, b: math.log(a) if a > 0 else 7.0,  # a branch not taken is no error
    "a + 1 if a >= b else 2*b": lambda a, b: a + 1 if a >= b else 2 * b,
    "min(a, b) - 3*max(a, b)": lambda a, b: min(a, b) - 3 * max(a, b),
    "abs(a) + sign(b)": lambda a, b: abs(a) + (b > 0) - (b < 0),
    "a**3 - (4 + b)**1.5": lambda a, b: a**3 - (4 + b) ** 1.5,
    "a**2*b**-2": lambda a, b: math.inf if b == 0 else a**2 / b**2,
    "sin(a)*cos(b) + tan(a/2)": lambda a, b: math.sin(a) * math.cos(b) + math.tan(a / 2),
    "exp(a) - log(4 + b)": lambda a, b: math.exp(a) - math.log(4 + b),
    "asin(a/3) + acos(b/3) + atan(a)": lambda a, b: math.asin(a / 3) + math.acos(b / 3) + math.atan(a),
    "sinh(a) - cosh(b) + tanh(a)": lambda a, b: math.sinh(a) - math.cosh(b) + math.tanh(a),
    "asinh(a) - acosh(4 + b) + atanh(a/4)": lambda a, b: math.asinh(a) - math.acosh(4 + b) + math.atanh(a / 4),
    "sqrt(10 + a*b)/(5 - b)": lambda a, b: math.sqrt(10 + a * b) / (5 - b),
    "-a - (b - a)": lambda a, b: -a - (b - a),
}
GRID = [0.4, -0.4, 0.9, 1.0, -1.0, 2.5, -3.0]
STATES = np.array([(a, b) for a in GRID for b in GRID]).T


@cache
def described() -> eg.Model:
    m = eg.Model("operations")
    for name in "ab":
        m.prismatic(f"J{name}", m.ground, m.body(f"body_{name}", mass=1.0), axis="x", coordinate=name)
    for k, text in enumerate(EXPRESSIONS):
        m.output(f"y{k}", text)
    return m


@cache
def evaluated(target: str) -> np.ndarray:
    """All outputs at all states."""
    x = np.vstack([STATES, np.zeros_like(STATES)])
    if target == "casadi":
        functions = described().derive().to_casadi()
        return np.array([np.asarray(functions.outputs(0.0, column, [], [])).ravel() for column in x.T]).T
    if target == "jax":
        functions = described().derive().to_jax()
        many = jax.jit(jax.vmap(functions.outputs, in_axes=(None, 1, None, None), out_axes=1))
        return np.asarray(many(0.0, x, np.zeros(0), np.zeros(0)))
    in_c = target.startswith("cython")
    options = {"optimize": 0, "kernels": ["rhs", "outputs"]} if in_c else {}
    module = described().compile(target="cython" if in_c else target, **options)
    single = np.array([module.outputs(0.0, column) for column in x.T]).T
    np.testing.assert_array_equal(module.outputs(0.0, x), single)
    return single


@pytest.mark.parametrize("target", ["numpy", "cython", "casadi", "jax"])
@pytest.mark.parametrize("text", EXPRESSIONS)
def test_operations_mean_what_python_means(text: str, target: str) -> None:
    expected = [EXPRESSIONS[text](a, b) for a, b in STATES.T]
    found = evaluated(target)[list(EXPRESSIONS).index(text)]
    np.testing.assert_allclose(found, expected, rtol=4e-14, atol=4e-15)


# Taylor's method integrates each force to the last digits in long steps: a wrong coefficient shows in either.

FORCES: dict[str, tuple[str, Callable[[Any, Any], Any]]] = {
    "square": ("(1 + t)*(1 + t)", lambda m, t: (1 + t) ** 2),
    "products": ("t*sin(t)*exp(-t)", lambda m, t: t * m.sin(t) * m.exp(-t)),
    "reciprocal": ("1/(2 + t*t)", lambda m, t: 1 / (2 + t * t)),
    "quotient": ("sin(t)/(2 + t)", lambda m, t: m.sin(t) / (2 + t)),
    "root": ("sqrt(1 + t*t)", lambda m, t: m.sqrt(1 + t * t)),
    "real power": ("(2 + t)**1.7", lambda m, t: (2 + t) ** 1.7),
    "exp of sin": ("exp(sin(2*t))", lambda m, t: m.exp(m.sin(2 * t))),
    "log": ("log(2 + t*t)", lambda m, t: m.log(2 + t * t)),
    "cos": ("cos(t*t)", lambda m, t: m.cos(t * t)),
    "tan": ("tan(t/2)", lambda m, t: m.tan(t / 2)),
    "tanh": ("tanh(2*t)", lambda m, t: m.tanh(2 * t)),
    "sinh, cosh": ("sinh(t)/cosh(t/2)", lambda m, t: m.sinh(t) / m.cosh(t / 2)),
    "asin": ("asin(0.5*t)", lambda m, t: m.asin(0.5 * t)),
    "acos": ("acos(0.5*t)", lambda m, t: m.acos(0.5 * t)),
    "atan": ("atan(t*(1 + t))", lambda m, t: m.atan(t * (1 + t))),
    "atan2": ("atan2(sin(t), 2 + t)", lambda m, t: m.atan2(m.sin(t), 2 + t)),
    "hypot": ("hypot(sin(t), 2 - t)", lambda m, t: m.hypot(m.sin(t), 2 - t)),
    "hypot, one fixed": ("hypot(3, t)", lambda m, t: m.hypot(3, t)),
    "asinh, atanh": ("asinh(2*t) - atanh(t/2)", lambda m, t: m.asinh(2 * t) - m.atanh(t / 2)),
    "acosh": ("acosh(2 + t*t)", lambda m, t: m.acosh(2 + t * t)),
    "atan2, one fixed": ("atan2(1, 2 + t)", lambda m, t: m.atan2(1, 2 + t)),
}
END, FEW = 0.8, 12


@cache
def by_series() -> Any:
    m = eg.Model("pushed")
    for k, (text, _) in enumerate(FORCES.values()):
        m.prismatic(f"J{k}", m.ground, m.body(f"body{k}", mass=1.0), axis="x", coordinate=f"q{k}")
        m.torque(f"F{k}", f"J{k}", text)
    module = m.compile(**IN_C | {"kernels": ["rhs", "project"]})
    solver = module.Taylor(module.rhs, 0.0, np.zeros(module.n_x), END, rtol=1e-12, atol=1e-13)
    for _ in range(FEW):  # with a wrong coefficient they become ever shorter
        if solver.status == "running":
            solver.step()
    return solver.t, dict(zip(module.x_names, solver.y, strict=True))


@pytest.mark.parametrize("name", FORCES)
def test_series_integrate_every_operation(name: str) -> None:
    (end, x), force = by_series(), FORCES[name][1]
    expected = quad(lambda t: float(force(math, t)), 0.0, END, epsabs=1e-13, epsrel=1e-13)[0]
    assert end == END
    assert x[f"q{list(FORCES).index(name)}_dot"] == pytest.approx(expected, rel=1e-11, abs=1e-12)


# Sine and cosine of generated code.

NEAR = 1.0e6


def angles() -> np.ndarray:
    """Dense, near multiples of pi/2 and pi/4, tiny, large within the bound of the reduction."""
    rng = np.random.default_rng(5)
    with mp.workdps(40):
        multiples = np.array([float(int(k) * mp.pi / 2) for k in rng.integers(1, 636_000, 300)])
        small = np.array([float(k * mp.pi / 4) for k in range(1, 50)])
    near = [np.nextafter(m, to) for m in (multiples, small) for to in (-np.inf, np.inf)]
    powers = 10.0 ** rng.uniform(-320.0, 6.0, 400)
    edges = [0.0, 5e-324, 2.2e-308, 1e-8, np.pi / 4, np.pi, NEAR, np.nextafter(NEAR, 0.0)]
    ranges = [rng.uniform(-b, b, 700) for b in (1.0, 8.0, 100.0, NEAR)]
    return np.concatenate([*ranges, multiples, small, *near, powers, edges])


def errors(values: np.ndarray, given: np.ndarray, function: Callable[[Any], Any]) -> np.ndarray:
    """Distances from the true values in units in the last place of these."""
    found = []
    with mp.workdps(50):
        for value, angle in zip(values.tolist(), given.tolist(), strict=True):
            true = function(mpf(angle))
            found.append(float(abs(mpf(value) - true) / mpf(ulp(float(true)))))
    return np.array(found)


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.thorough)], ids=["plain", "native"])
def trigonometry(request: pytest.FixtureRequest) -> Callable[[np.ndarray], np.ndarray]:
    m = eg.Model("trigonometry")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="a")
    for name in ("sin", "cos"):
        m.state(name[0], f"{name}(a)")
    module = m.compile(kernels=["rhs"], native=request.param)

    def both(given: np.ndarray) -> np.ndarray:
        x = np.vstack([given, np.zeros((3, given.size))])
        single = np.array([module.rhs(0.0, np.ascontiguousarray(column)) for column in x.T]).T[2:]
        places = [module.x_names.index(name) - 2 for name in "sc"]
        many = module.rhs(0.0, np.repeat(x, 2, axis=1))[2:, ::2]  # in vectors, beside other neighbours
        np.testing.assert_array_equal(many[places], single[places])
        return single[places]

    return both


def test_sine_and_cosine_are_within_two_units_in_the_last_place(trigonometry: Callable[..., np.ndarray]) -> None:
    given = angles()
    found = trigonometry(given)
    for values, function in zip(found, (mp.sin, mp.cos), strict=True):
        off = errors(values, given, function)
        assert off.max() < 1.8, (off.max(), given[off.argmax()])
        assert off.mean() < 0.3
    assert np.abs(found).max() <= 1.0
    mirrored = trigonometry(-given)
    np.testing.assert_array_equal(mirrored, [-found[0], found[1]])


def test_far_angles_are_those_of_the_c_library(trigonometry: Callable[..., np.ndarray]) -> None:
    far = np.array([NEAR * 1.01, -2e6, 1e22, -1.7e308, 2.0**53, 3e15, 1e9, 4e6])
    for values, function in zip(trigonometry(far), (mp.sin, mp.cos), strict=True):
        assert errors(values, far, function).max() < 1.0
