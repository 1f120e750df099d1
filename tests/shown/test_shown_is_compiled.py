"""Every quantity that is shown, evaluated through SymPy, against the compiled module at random consistent states.

All examples with the method that is chosen for them; every method with one example of each kind: an open chain, a loop
with force elements, rolling (nonholonomic), motion over time, Euler parameters.
"""

from itertools import product
from typing import Any

import numpy as np
import pytest
import sympy as sp
from models import EXAMPLES, MODELS
from shown_numbers import METHODS, evaluate, number, random_state, state_values
from sweeps import part_of

import eomgen as eg

NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
KINDS = ("double_pendulum", "slider_crank", "rolling_disc", "car_axis", "satellite")
OTHERS = [method for method in METHODS if method != "embedding"]
#: Loops and trees, states, motions over time, switched and sampled parts, rotations of every description.
ALWAYS = ("slider_crank", "car_axis", "rolling_disc", "satellite", "hydraulic_boom", "gear_train")
ALWAYS += ("planetary_gear", "flyball_governor", "two_link_manipulator", "wheelset")
MATRICES = ("mass_matrix", "constraint_jacobian", "velocity_transformation", "poses", "body_mass_matrix")
MATRICES += ("body_velocity_transformation",)
CLOSE = 1e-10


def agree(shown: object, wanted: object, size: float = 0.0) -> None:
    """Equal to 1e-10 of the largest entry, or of the size of the terms that they are sums of."""
    shown, wanted = np.asarray(shown, dtype=float), np.asarray(wanted, dtype=float)
    assert shown.shape == wanted.shape
    largest = max(np.abs(wanted).max(initial=0.0), size, 1e-12)
    assert np.abs(shown - wanted).max(initial=0.0) <= CLOSE * largest


class Compared:
    """Equations, their module and one state with its numbers."""

    def __init__(self, name: str, method: str = "auto", seed: int = 7) -> None:
        self.equations = eg.load_example(name).derive(method)
        self.module: Any = self.equations.compile(target="numpy")
        self.x = random_state(self.module, seed)
        if self.module.metadata["constraint_labels"] and self.module.n_q == self.module.n_v:
            q = self.x[: self.module.n_q]  # one more Newton step: gamma may be that of the residual alone
            C = self.module.constraints(q)
            self.x[: len(q)] = q - np.linalg.pinv(self.module.constraint_jacobian(q)[: len(C)]) @ C
        self.values = state_values(self.module, self.x)
        n = self.module.n_q + self.module.n_v
        self.q, self.v = self.x[: self.module.n_q], self.x[self.module.n_q : n]
        self.a = self.module.rhs(0.0, self.x)[self.module.n_q : n]
        self.free = [k for k in self.module.metadata["independent"] if k < self.module.n_v]

    def shown(self, name: str, part: str | None = None) -> Any:
        """The number, vector or matrix of a quantity."""
        found = number(self.equations, name, self.values, part)
        return found if np.ndim(found) < 2 or name in MATRICES else found[:, 0]


def compare_motion(c: Compared) -> None:
    """Energies, the equations of motion and their parts."""
    T, V = c.module.energy(c.x)
    for name, wanted in (("T", T), ("V", V), ("lagrangian", T - V)):
        agree(c.shown(name), wanted, abs(T) + abs(V))
    mass = c.shown("mass_matrix")
    agree(mass, c.module.embedded_mass_matrix(c.q))
    force, Q, Q_v = (c.shown(name) for name in ("force", "generalized_forces", "quadratic_velocity"))
    agree(force, mass @ c.a[c.free], np.abs(mass * c.a[c.free]).max(initial=0.0))
    agree(Q + Q_v, force, np.abs(Q).max(initial=0.0) + np.abs(Q_v).max(initial=0.0))
    parts = c.equations.generalized_forces.parts
    each = [evaluate(*_flat(c.equations.written("generalized_forces", key)), c.values) for key in parts]
    agree(np.sum(each, axis=0) if each else np.zeros(c.module.n_dof), Q)
    agree(c.shown("momenta"), c.module.mass_matrix(c.q) @ c.v)


def _flat(written: tuple[Any, Any]) -> tuple[Any, list[Any]]:
    return written[0], list(written[1])


def compare_constraints(c: Compared) -> None:
    """Constraints, their derivatives, and the dependent velocities."""
    module, scale = c.module, c.module.metadata["length_scale"]
    agree(c.shown("constraints"), module.constraints(c.q), max(1.0, scale))
    C_q = module.constraint_jacobian(c.q)
    agree(c.shown("constraint_jacobian"), C_q)
    agree(c.shown("velocity_constraints"), module.velocity_constraints(c.x), np.abs(C_q * c.v).max(initial=0.0))
    agree(c.shown("gamma"), -C_q @ c.a, np.abs(C_q * c.a).max(initial=0.0))
    B = c.shown("velocity_transformation")
    agree(B @ c.v[c.free] + c.shown("velocity_offset"), c.v)
    agree(B @ c.a[c.free] + c.shown("acceleration_offset"), c.a, np.abs(c.a).max())


def compare_bodies(c: Compared) -> None:
    """Poses, and M = B_b^T M_b B_b where drives have no inertia."""
    poses = c.module.poses(c.q)
    for k, body in enumerate(c.module.body_names):
        agree(c.shown("poses", body), poses[k])
    if c.equations.name != "puma560":  # whose drives have one
        B, M = c.shown("body_velocity_transformation"), c.shown("body_mass_matrix")
        agree(B.T @ M @ B, c.module.embedded_mass_matrix(c.q))


@pytest.mark.parametrize("name", part_of(NAMES, ALWAYS.__contains__))
def test_of_every_example(name: str) -> None:
    c = Compared(name)
    compare_motion(c)
    compare_constraints(c)
    compare_bodies(c)


def often(pair: tuple[str, str]) -> bool:
    return pair[0] == "slider_crank" or pair == ("rolling_disc", "lagrange")


@pytest.mark.parametrize(("name", "method"), part_of(product(KINDS, OTHERS), often))
def test_of_every_method(name: str, method: str) -> None:
    compare_motion(Compared(name, method))


@pytest.mark.parametrize(
    ("name", "place"), [("slider_crank", "rod.tip"), ("slider_crank", "rod"), ("rolling_disc", "disc")]
)
def test_velocities_and_accelerations(name: str, place: str) -> None:
    """Those of outputs."""
    model = eg.load_example(name)
    words = [f"{kind}{a}{rate}" for kind, rate in (("w", ""), ("v", ""), ("w", "_dot"), ("a", "")) for a in "xyz"]
    for word in words:
        model.output(f"{word}_of_it", f"{word}({place})")
    equations = model.derive()
    module: Any = equations.compile(target="numpy")
    x = random_state(module, 5)
    found = dict(zip(module.y_names, module.outputs(0.0, x), strict=True))
    wanted = np.array([found[f"{word}_of_it"] for word in words]).reshape(4, 3)
    for name, (angular, linear) in (("velocities", wanted[:2]), ("accelerations", wanted[2:])):
        shown = number(equations, name, state_values(module, x), place)
        agree(shown[0], angular)
        agree(shown[1], linear)


# -- what single methods have -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disc", "car_axis", "gear_train"])
def test_the_block_system_has_the_compiled_accelerations_and_multipliers(name: str) -> None:
    c = Compared(name, "augmented", 3)
    block = c.equations.block_system
    n = len(block.unknowns)
    flat = evaluate(c.equations.written("block_system")[0], [*block.matrix, *block.right], c.values)
    found = np.linalg.solve(flat[: n * n].reshape(n, n), flat[n * n :])
    np.testing.assert_allclose(found[: c.module.n_v], c.a, rtol=1e-9, atol=1e-9 * np.abs(c.a).max())
    multipliers = c.module.multipliers(0.0, c.x)
    if len(multipliers) == n - c.module.n_v:
        np.testing.assert_allclose(found[c.module.n_v :], multipliers, rtol=1e-7, atol=1e-8 * np.abs(multipliers).max())


@pytest.mark.parametrize("name", part_of(["double_pendulum", "satellite"], "double_pendulum".__eq__))
def test_momenta_and_their_rates_are_those_of_the_canonical_form(name: str) -> None:
    c = Compared(name, "hamilton", 3)
    form = c.module.canonical
    momenta, rates = (number(c.equations, quantity, c.values)[:, 0] for quantity in ("momenta", "momentum_rates"))
    agree(momenta, form.momenta(c.x))
    agree(rates, form.rhs(0.0, form.of(c.x))[c.module.n_q :])


FREE = product(("slider_crank", "rolling_disc", "spatial_four_bar"), ("newton_euler", "amalgamated"))


@pytest.mark.parametrize(("name", "method"), part_of(FREE, lambda pair: pair[0] == "slider_crank"))
def test_free_bodies_hold_at_the_compiled_accelerations(name: str, method: str) -> None:
    """Reactions that balance all bodies exist there, and at no other accelerations."""
    c = Compared(name, method, 3)
    assert misfit(c.equations, c.values) < 1e-10
    wrong = next(key for key in c.values if key.endswith("_ddot"))
    assert misfit(c.equations, c.values | {wrong: c.values[wrong] + 1.0}) > 1e-4


def misfit(equations: Any, values: dict[str, float], shown: Any = None) -> float:
    """What the best reactions leave of all equations of free bodies and joints, beside their largest term."""
    shown, residuals = equations if shown is None else shown, []
    for name in ("free_bodies", "joint_forces"):
        part = getattr(shown, name)
        for key in part:
            named, found = shown.written(name, key)
            rows = found if isinstance(found, list) else [*found.force, *found.moment]
            residuals += [(named, row.lhs - row.rhs) for row in rows if isinstance(row, sp.Equality)]
    parts = {str(symbol) for named, _ in residuals for symbol, _ in named}
    used = {s for named, row in residuals for s in row.free_symbols.union(*(e.free_symbols for _, e in named))}
    unknown = sorted({str(s) for s in used} - set(values) - parts)

    def left(at: dict[str, float]) -> np.ndarray:
        return np.array([evaluate(named, [row], values | at)[0] for named, row in residuals])

    rest = left(dict.fromkeys(unknown, 0.0))
    J = np.array([left(dict.fromkeys(unknown, 0.0) | {name: 1.0}) - rest for name in unknown]).T
    best = np.linalg.lstsq(J, -rest, rcond=None)[0]
    return float(np.abs(J @ best + rest).max() / np.abs(rest).max())


@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
@pytest.mark.parametrize("cut", ["A", "C"])
def test_reactions_balance_a_drive_with_inertia(cut: str, method: str) -> None:
    """A slider-crank with a drive of inertia J at a joint of the tree (A) or at the one that closes the loop (C)."""
    m = eg.Model("crank", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "r": 0.1, "l": 0.35, "J": 0.02}.items():
        m.parameter(name, value)
    a, b = m.body("a", mass=1, com=("r/2", 0, 0), inertia={"zz": 0.01}), m.body("b", mass=0.8, com=("l/2", 0, 0))
    slider, drive = m.body("s", mass=0.5), {"armature": "J"}
    m.revolute("A", m.ground, a, coordinate="theta", **(drive if cut == "A" else {}))
    m.revolute("B", a.at("r", 0, 0), b, coordinate="beta")
    m.revolute("C", b.at("l", 0, 0), slider, **(drive if cut == "C" else {}))
    m.prismatic("D", m.ground, slider, axis="x", coordinate="x")
    m.torque("motor", "A", 0.7)
    m.initial = {"theta": 0.6}
    m.guess = {"beta": -0.8, "x": 0.4}
    equations = m.derive(method)
    module: Any = equations.compile("numpy")
    values = state_values(module, random_state(module, 4))
    assert misfit(equations, values) < 1e-10
    if (cut, method) == ("A", "newton_euler"):  # the accelerations are those with J
        assert misfit(equations, values, equations.subs({"J": 0})) > 1e-4


# -- near a state -----------------------------------------------------------------------------------------------------


NEAR = ("slider_crank", "rolling_disc", "satellite", "cart_pendulum", "half_car")


@pytest.mark.parametrize("name", part_of(NEAR, lambda name: name != "half_car"))
def test_equations_near_a_state_are_those_of_the_module(name: str) -> None:
    c = Compared(name, seed=3)
    near = c.equations.linearize(at={name: name for name in c.module.v_names})  # velocities stay symbols
    wanted = c.module.linearize(c.x)
    assert (near.states, near.inputs) == (wanted.states, c.module.u_names)
    n = len(near.states)
    flat = evaluate(near.intermediates, [*near.A, *near.B], c.values)
    np.testing.assert_allclose(flat[: n * n].reshape(n, n), wanted.A, atol=1e-10 * np.abs(wanted.A).max())
    np.testing.assert_allclose(flat[n * n :].reshape(n, -1), wanted.B, rtol=1e-10, atol=1e-10)


def test_equations_with_nonholonomic_constraints_alone_near_a_state() -> None:
    equations = MODELS["skate"].build().derive()
    place = {"x": 0.1, "y": 0.4, "phi": -0.2}
    near = equations.linearize(at=place)
    wanted = equations.compile(target="numpy").linearize([*place.values(), 0.0, 0.0, 0.0])
    assert near.states == wanted.states
    agree(np.array(near.A, dtype=float), wanted.A)


# -- large loops, shown by their parts --------------------------------------------------------------------------------


LARGE = ("bicycle", "watt_six_bar", "andrews_squeezer", "delta_robot", "double_wishbone", "excavator")


@pytest.mark.parametrize("name", part_of(LARGE, LARGE[:2].__contains__))
def test_parts_of_a_tree_give_the_accelerations_of_the_module(name: str) -> None:
    c = Compared(name, seed=5)
    named, system = c.equations.written("tree_system")
    solved = accelerations(named, system, c.values)
    expected = c.module.rhs(0.0, c.x)[c.module.n_q :]
    if system.zeros:  # where 0 stands for the heading, the others are those of a turned ground
        solved, expected = solved[c.free], expected[c.free]
    np.testing.assert_allclose(solved, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def accelerations(named: Any, system: Any, values: dict[str, float]) -> np.ndarray:
    """Of M_t v' = f_t + C^T lambda and C v' = -gamma."""
    flat = iter(evaluate(named, [x for matrix in system[:4] for x in matrix], values))
    mass, force, jacobian, gamma = (np.array([next(flat) for _ in m]).reshape(m.shape) for m in system[:4])
    n = len(jacobian)
    whole = np.block([[mass, -jacobian.T], [jacobian, np.zeros((n, n))]])
    return np.linalg.lstsq(whole, np.concatenate([force[:, 0], -gamma[:, 0]]), rcond=1e-12)[0][: len(mass)]


@pytest.mark.parametrize(
    "load", ["-where(x_far > 5, 100*(x_far - 5), 0)", "-100*max(x_far - 5, 0)", "-100*abs(x_far - 5)*(x_far > 5)"]
)
def test_what_acts_far_away_is_shown(load: str) -> None:
    """A slide whose place matters beyond 5 m alone is not as one whose place does not matter."""
    m = eg.load_example("watt_six_bar")
    block = m.body("block", mass=1.0)
    m.prismatic("far", m.ground, block, axis="x", coordinate="x_far")
    if "where" in load:
        assert m.derive().tree_system.zeros == ("x_far",)
    m.force("pull", block, value=(load, 0, 0))
    system = m.derive().tree_system
    assert system.zeros == ()
    shown = [x for x in system.force if sp.Symbol("x_far") in x.free_symbols]
    assert [float(x.subs("x_far", place)) for x in shown for place in (0.0, 5.5)] == [0.0, -50.0]
