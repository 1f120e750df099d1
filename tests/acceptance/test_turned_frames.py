"""The same linkage with its bodies' frames and ground turned and shifted, as numbers and as parameters.

Degrees of freedom, rows and accelerations must be those of the plain description; the four-bar's are also known in
closed form (velocity and acceleration loops solved in the test).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg

Vector = tuple[float, float, float]


class Turned:
    """Bodies of a model, each described in a frame of its own; ground's is turned too."""

    def __init__(self, name: str, rng: np.random.Generator | None, only: str = "") -> None:
        self.rng, self.only = rng, only
        self.frames: dict[str, tuple[Any, Any]] = {}
        R, _ = self._frame("ground")
        self.model = eg.Model(name, gravity=tuple(map(float, R.as_matrix() @ [0.0, -9.81, 0.0])))
        self.bodies: dict[str, Any] = {"ground": self.model.ground}

    def _frame(self, body: str) -> tuple[Any, Any]:
        if body not in self.frames:
            still = self.rng is None or (self.only and body != self.only)
            R = Rotation.identity() if still else Rotation.random(random_state=self.rng)
            shift = np.zeros(3) if still else self.rng.uniform(-2, 2, 3)  # type: ignore[union-attr]
            self.frames[body] = R, shift
        return self.frames[body]

    def body(self, name: str, mass: float, com: Vector, inertia: Vector) -> None:
        R, shift = self._frame(name)
        T = R.as_matrix()
        tensor = (T @ np.diag(inertia) @ T.T).tolist()
        self.bodies[name] = self.model.body(name, mass=mass, com=tuple(map(float, T @ com + shift)), inertia=tensor)

    def at(self, body: str, *point: float, rpy: Vector = (0, 0, 0)) -> Any:
        R, shift = self._frame(body)
        turn = R * Rotation.from_euler("xyz", rpy)
        place = R.as_matrix() @ np.array(point or (0.0, 0.0, 0.0)) + shift
        return self.bodies[body].at(*map(float, place), rpy=tuple(map(float, turn.as_euler("xyz"))))


def four_bar(rng: np.random.Generator | None = None, only: str = "") -> Any:
    """docs/mobility.md, ground span 1.2."""
    m = Turned("four_bar", rng, only)
    for name in ("crank", "coupler", "rocker"):
        m.body(name, 1.0, (0.5, 0, 0), (0.01, 0.1, 0.1))
    m.model.revolute("A", m.at("ground"), m.at("crank"), coordinate="theta")
    m.model.revolute("B", m.at("crank", 1, 0, 0), m.at("coupler"), coordinate="bend")
    m.model.revolute("D", m.at("ground", 1.2, 0, 0), m.at("rocker"), coordinate="psi")
    m.model.revolute("C", m.at("coupler", 1, 0, 0), m.at("rocker", 1, 0, 0))
    m.model.initial(theta=1.0, theta_dot=2.0)
    m.model.guess(bend=-1.0, psi=1.0)
    m.model.independent("theta")
    return m.model


def slider_crank(rng: np.random.Generator | None = None, only: str = "") -> Any:
    """The rails close the loop: the slider's joint is cut."""
    m = Turned("slider_crank", rng, only)
    m.body("crank", 1.0, (0.05, 0, 0), (1e-4, 1e-3, 1e-3))
    m.body("rod", 0.8, (0.175, 0, 0), (1e-4, 8e-3, 8e-3))
    m.body("slider", 0.5, (0, 0, 0), (1e-3, 1e-3, 1e-3))
    m.model.revolute("A", m.at("ground"), m.at("crank"), coordinate="theta")
    m.model.revolute("B", m.at("crank", 0.1, 0, 0), m.at("rod"), coordinate="beta")
    m.model.revolute("C", m.at("rod", 0.35, 0, 0), m.at("slider"), coordinate="gamma")
    m.model.prismatic("D", m.at("ground"), m.at("slider"), axis="x")
    m.model.initial(theta=0.3, theta_dot=2.0)
    return m.model


def five_bar_slider(rng: np.random.Generator | None = None, only: str = "") -> Any:
    """Two cranks, two rods and a slider on an inclined guide: two degrees of freedom."""
    m = Turned("five_bar_slider", rng, only)
    for name, length in (("a", 0.4), ("b", 0.9), ("c", 0.7)):
        m.body(name, length, (length / 2, 0, 0), (1e-3, length**3 / 12, length**3 / 12))
    m.body("s", 0.5, (0, 0, 0), (1e-3, 1e-3, 1e-3))
    m.model.revolute("qA", m.at("ground"), m.at("a"), coordinate="qA")
    m.model.revolute("qB", m.at("a", 0.4, 0, 0), m.at("b"), coordinate="qB")
    m.model.prismatic("D", m.at("ground", 1.1, 0, 0, rpy=(0, 0, 0.5)), m.at("s"), axis="x", coordinate="s")
    m.model.revolute("qC", m.at("s"), m.at("c"), coordinate="qC")
    m.model.revolute("close", m.at("b", 0.9, 0, 0), m.at("c", 0.7, 0, 0))
    m.model.initial(qA=1.2, s=0.1, qA_dot=1.0, s_dot=-0.5)
    m.model.guess(qB=-1.2, qC=1.8)
    m.model.independent("qA", "s")
    return m.model


MODELS: dict[str, Callable[..., Any]] = {f.__name__: f for f in (four_bar, slider_crank, five_bar_slider)}


def accelerations(model: Any, target: str = "numpy") -> dict[str, float]:
    mod = model.compile(target=target)
    return dict(zip(mod.x_names, mod.rhs(0.0, mod.x0()), strict=True))


@pytest.mark.parametrize("name", MODELS)
def test_frames_of_bodies_and_ground_do_not_matter(name: str) -> None:
    build, rng = MODELS[name], np.random.default_rng(5)
    plain, report = accelerations(build()), build().check()
    size = max(map(abs, plain.values()))
    for _ in range(6):
        model = build(rng)
        found = model.check()
        assert found.degrees_of_freedom == report.degrees_of_freedom
        assert (found.constraints, found.rank, found.redundant) == (report.constraints, report.rank, report.redundant)
        turned = accelerations(model)
        assert max(abs(turned[k] - plain[k]) for k in plain) <= 1e-11 * size


@pytest.mark.parametrize("name", MODELS)
def test_compiled_modules_agree_too(name: str) -> None:
    plain = accelerations(MODELS[name]())
    turned = accelerations(MODELS[name](np.random.default_rng(8)), "cython")
    size = max(map(abs, plain.values()))
    assert max(abs(turned[k] - plain[k]) for k in plain) <= 1e-11 * size


def test_the_example_of_the_documentation() -> None:
    """Its crank's frame turned by (0.3, 0.4, 0.5) did not close, at other turns it had rows too many."""
    rng = np.random.default_rng(2)
    for _ in range(40):
        report = four_bar(rng, "crank").check()
        assert (report.degrees_of_freedom, report.constraints, report.rank) == (1, 2, 2)


def test_four_bar_against_its_loop_equations() -> None:
    """theta' = 2 given: rates and accelerations from the two loop equations and the power of gravity, by hand."""
    x = accelerations(four_bar(np.random.default_rng(0)))
    mod = four_bar(np.random.default_rng(0)).compile(target="numpy")
    theta, bend, psi = (float(mod.x0()[mod.x_names.index(n)]) for n in ("theta", "bend", "psi"))
    e = [np.exp(1j * a) for a in (theta, theta + bend, psi)]  # crank, coupler, rocker in the plane

    def rates(w: float) -> tuple[float, float]:  # i (w e0 + w1 e1 - w2 e2) = 0
        A = np.array([[e[1].real, -e[2].real], [e[1].imag, -e[2].imag]])
        w1, w2 = np.linalg.solve(A, [-w * e[0].real, -w * e[0].imag])
        return float(w1), float(w2)

    w = 2.0
    w1, w2 = rates(w)
    assert [x["bend"], x["psi"]] == pytest.approx([w1 - w, w2], rel=1e-12)
    A = np.array([[-e[1].imag, e[2].imag], [e[1].real, -e[2].real]])
    c = e[0] * w**2 + e[1] * w1**2 - e[2] * w2**2

    def coefficients(acceleration: float) -> tuple[float, float]:  # i a0 e0 - w^2 e0 + ... = 0
        right = -(1j * acceleration * e[0] - c)
        a1, a2 = np.linalg.solve(A, [right.real, right.imag])
        return float(a1), float(a2)

    k1, k2 = rates(1.0)

    def power(acceleration: float) -> float:  # of inertia less gravity, per unit theta'
        a1, a2 = coefficients(acceleration)
        g, I = 9.81, 0.1
        total = 0.0
        for point, velocity, a, k in (
            (0.5 * e[0], 0.5j * e[0], 0.5 * (1j * acceleration - w**2) * e[0], (acceleration, 1.0)),
            (
                e[0] + 0.5 * e[1],
                1j * e[0] + 0.5j * k1 * e[1],
                (1j * acceleration - w**2) * e[0] + 0.5 * (1j * a1 - w1**2) * e[1],
                (a1, k1),
            ),
            (0.5 * e[2], 0.5j * k2 * e[2], 0.5 * (1j * a2 - w2**2) * e[2], (a2, k2)),
        ):
            assert np.isfinite(point)
            total += ((a + 1j * g) * velocity.conjugate()).real + I * k[0] * k[1]
        return total

    slope = power(1.0) - power(0.0)
    assert x["theta_dot"] == pytest.approx(-power(0.0) / slope, rel=1e-11)


def test_frames_turned_by_parameters() -> None:
    """Rows across the plane are sums of products of parameters, which nothing folds: they vanish identically too."""
    m = eg.Model("four_bar", gravity=(0, -9.81, 0))
    turn = [m.parameter(n, x) for n, x in (("roll", 0.3), ("pitch", 0.4), ("yaw", 0.5))]
    import sympy as sp

    a, b, c = turn
    T = (
        sp.Matrix([[sp.cos(c), -sp.sin(c), 0], [sp.sin(c), sp.cos(c), 0], [0, 0, 1]])
        * sp.Matrix([[sp.cos(b), 0, sp.sin(b)], [0, 1, 0], [-sp.sin(b), 0, sp.cos(b)]])
        * sp.Matrix([[1, 0, 0], [0, sp.cos(a), -sp.sin(a)], [0, sp.sin(a), sp.cos(a)]])
    )
    tensor = (T * sp.diag(0.01, 0.1, 0.1) * T.T).tolist()
    crank = m.body("crank", mass=1, com=tuple(T * sp.Matrix([0.5, 0, 0])), inertia=tensor)
    coupler, rocker = (m.body(n, mass=1, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1)) for n in ("coupler", "rocker"))
    m.revolute("A", m.ground, crank.at(0, 0, 0, rpy=tuple(turn)), coordinate="theta")
    m.revolute("B", crank.at(*(T * sp.Matrix([1, 0, 0])), rpy=tuple(turn)), coupler, coordinate="bend")
    m.revolute("D", m.ground.at(1.2, 0, 0), rocker, coordinate="psi")
    m.revolute("C", coupler.at(1, 0, 0), rocker.at(1, 0, 0))
    m.initial(theta=1.0, theta_dot=2.0)
    m.guess(bend=-1.0, psi=1.0)
    m.independent("theta")
    report = m.check()
    assert (report.degrees_of_freedom, report.constraints, report.rank) == (1, 2, 2)
    mod, plain = m.compile(target="numpy"), accelerations(four_bar())
    for p in ({}, {"roll": -1.0, "pitch": 0.2, "yaw": 2.5}):
        there = mod.bind(p=p)
        found = dict(zip(mod.x_names, there.rhs(0.0, there.x0()), strict=True))
        assert max(abs(found[k] - plain[k]) for k in plain) <= 1e-11 * max(map(abs, plain.values()))


@pytest.mark.parametrize("turned", [False, True])
def test_an_equation_that_holds_identically_takes_no_freedom(turned: bool) -> None:
    """Two links that move in a plane anyway, and an equation that says so; frames of bodies turned, then ground too."""
    rng = np.random.default_rng(4)
    for k in range(10):
        m = Turned("level", rng if turned else None)
        if k < 5:
            m.frames["ground"] = (Rotation.identity(), np.zeros(3))
        for name in "ab":
            m.body(name, 1.0, (0.1, 0, 0), (0.1, 0.1, 0.1))
        m.model.revolute("A", m.at("ground"), m.at("a"))
        m.model.revolute("B", m.at("a", 0.5, 0, 0), m.at("b"))
        R, shift = m.frames["b"]
        m.bodies["b"].marker("tip", at=tuple(map(float, R.as_matrix() @ [0.4, 0, 0] + shift)))
        n = m.frames["ground"][0].as_matrix() @ [0, 0, 1]
        terms = " + ".join(f"({float(x)!r})*{c}(b.tip)" for x, c in zip(n, "xyz", strict=True))
        m.model.coupling("level", equation=f"{terms} - ({float(n @ m.frames['ground'][1])!r})")
        report = m.model.check()
        assert (report.degrees_of_freedom, report.rank) == (2, 0)


@pytest.mark.parametrize("scale", [1e-3, 1e-6])
def test_a_loop_far_smaller_than_its_mechanism_keeps_its_rows_whatever_the_frames(scale: float) -> None:
    """A pantograph of 10 m carries a four-bar up to ten million times smaller."""
    found = []
    for seed in (None, 1, 2, 3):
        m = Turned("small", None if seed is None else np.random.default_rng(seed))
        m.body("arm", 10.0, (5.0, 0, 0), (1, 80, 80))
        for name in ("crank", "coupler", "rocker"):
            m.body(name, scale, (scale / 2, 0, 0), (scale**3, scale**3, scale**3))
        m.frames["arm"] = (m.frames["arm"][0], np.zeros(3)) if seed is None else m.frames["arm"]
        m.model.revolute("swing", m.at("ground"), m.at("arm"), coordinate="phi")
        m.model.revolute("A", m.at("arm", 10, 0, 0), m.at("crank"), coordinate="theta")
        m.model.revolute("B", m.at("crank", scale, 0, 0), m.at("coupler"), coordinate="bend")
        m.model.revolute("D", m.at("arm", 10 + 1.2 * scale, 0, 0), m.at("rocker"), coordinate="psi")
        m.model.revolute("C", m.at("coupler", scale, 0, 0), m.at("rocker", scale, 0, 0))
        m.model.initial(theta=1.0, phi=0.2, theta_dot=2.0)
        m.model.guess(bend=-1.0, psi=1.0)
        report = m.model.check()
        assert (report.degrees_of_freedom, report.rank) == (2, 2)
        found.append(accelerations(m.model))
    size = max(map(abs, found[0].values()))
    # a point of the small loop is known to the rounding of its place in the arm's frame, 12 m from its origin
    limit = max(1e-11, 1e-14 / scale) * 10
    for other in found[1:]:
        assert max(abs(other[k] - found[0][k]) for k in found[0]) <= limit * size
