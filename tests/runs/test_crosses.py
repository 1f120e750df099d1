"""Crosses: every call that reads inputs over time, with inputs of every kind, in mechanisms of every kind.

Wrong results without a word sat where two features meet that are each right alone.  The cells cover all pairs of
{mechanism, kind of input, call}; the outputs of every cell are a position, a velocity, an acceleration, a reaction, the
input and a parameter.  Each is judged by SciPy's DOP853 on ``rhs`` with the input as a function of Python, begun anew
where the input jumps, and by the acceleration that Newton's laws give there by hand, or is refused by the name that the
table of refusals has.
"""

import ctypes
import sys
import warnings
from collections.abc import Callable
from functools import cache, partial
from importlib.util import module_from_spec, spec_from_file_location
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from packages import built
from refusals import refused
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.interpolate import CubicSpline

import eomgen as eg
from eomgen.api.generation import generate

END = 0.29
TIMES = np.array([0.003, 0.115, 0.19, END])  # no corner of an input and no sample among them
PLACES, VALUES = [0.0, 0.05, 0.11, 0.21, 1.0], [1.0, -2.0, 3.0, 5.0, 7.0]


class Wave:
    """An input that knows its rates."""

    def __init__(self, order: int = 0) -> None:
        self.order = order

    def __call__(self, t: float) -> float:
        return float(3.0**self.order * np.sin(3.0 * t + self.order * np.pi / 2) + (self.order == 0))

    def derivative(self) -> "Wave":
        return Wave(self.order + 1)


def piecewise(t: float, kind: str) -> float:
    """A table read by another program than eomgen."""
    if kind == "held":
        return VALUES[max(0, int(np.searchsorted(PLACES, t, side="right")) - 1)]
    return float(np.interp(t, PLACES, VALUES))


#: Kind of input -> what a run is given, and the same as a function of time and state.
KINDS: dict[str, tuple[Any, Callable[[float, np.ndarray], float]]] = {
    "number": (1.5, lambda t, x: 1.5),
    "held": (eg.Signal(PLACES, VALUES, "zero-order"), lambda t, x: piecewise(t, "held")),
    "linear": ((PLACES, VALUES), lambda t, x: piecewise(t, "linear")),
    "cubic": (eg.Signal(PLACES, VALUES, "cubic"), lambda t, x: float(CubicSpline(PLACES, VALUES)(t))),
    "text": ("1 + sin(3*t)*k", lambda t, x: 1.0 + np.sin(3.0 * t) * 2.0),
    "function": (lambda t, x: np.cos(4.0 * t) - 0.2 * x[0], lambda t, x: np.cos(4.0 * t) - 0.2 * x[0]),
    "object": (Wave(), lambda t, x: Wave()(t)),
}


def finished(m: eg.Model, coordinate: str, joint: str) -> eg.Model:
    """With an output of every kind; the reaction where the joint has one."""
    m.output("position", coordinate)
    m.output("velocity", f"{coordinate}_dot")
    m.output("acceleration", f"{coordinate}_ddot")
    if joint:
        m.output("reaction", f"reaction({joint}).y")
    m.output("input", "2*u + 0.1*k")
    m.output("parameter", f"k*{coordinate}")
    m.output("clearance", f"{coordinate} + 100")
    return m


def started(name: str, gravity: Any = (0, -9.81, 0)) -> tuple[eg.Model, Any]:
    m = eg.Model(name, gravity=gravity)
    m.parameter("k", 2.0)
    return m, m.input("u")


def tree() -> eg.Model:
    m, u = started("tree")
    rod = m.body("rod", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, rod, coordinate="q")
    m.torque("motor", "A", u - 0.1 * m.parameter("c", 1.0))
    m.initial(q=0.3)
    return finished(m, "q", "A")


def loops(name: str = "loops", rods: int = 1) -> eg.Model:
    """A parallelogram of equal cranks; with a second rod one of its loops is redundant."""
    m, u = started(name)
    cranks = [m.body(f"crank{i}", mass=1, com=(0.1, 0, 0), inertia={"zz": 0.1}) for i in range(2 + (rods > 1))]
    rod = m.body("rod", mass=0.5, com=(0.25, 0, 0), inertia={"zz": 0.02})
    for i, crank in enumerate(cranks):
        place = (0.5, 0.25)[i - 1] if i else 0.0
        m.revolute(f"A{i}", m.ground.at(place, 0, 0), crank, **({"coordinate": "q"} if i == 0 else {}))
        m.revolute(f"B{i}", crank.at(0.2, 0, 0), rod.at(place, 0, 0))
    m.torque("motor", "A0", u)
    m.initial(q=0.7)
    m.guess(A1=0.7, B0=-0.7)  # the crossed quadrilateral closes too
    m.independent("q")
    return finished(m, "q", "A0" if rods == 1 else "")


def nonholonomic() -> eg.Model:
    m, u = started("nonholonomic", (0, 0, 0))
    blade = m.body("blade", mass=1, com=(0.1, 0, 0), inertia={"zz": 0.1})
    m.planar("J", m.ground, blade, coordinates=["q", "y", "phi"])
    m.coupling("edge", equation="q_dot*sin(phi) - y_dot*cos(phi)")
    m.force("push", blade, (u, 0, 0))
    m.initial(phi=0.4, phi_dot=1.0, q_dot=0.5)
    return finished(m, "q", "")


def states() -> eg.Model:
    m, u = started("states", (0, 0, 0))
    cart = m.body("cart", mass=2)
    m.prismatic("J", m.ground, cart, axis="x", coordinate="q")
    f = m.state("f", "(u - f)/0.05", initial=0.2)
    m.actuator("push", "J", value=f + u / 4)
    return finished(m, "q", "J")


def sampled() -> eg.Model:
    m, u = started("sampled", (0, 0, 0))
    cart = m.body("cart", mass=2)
    m.prismatic("J", m.ground, cart, axis="x", coordinate="q")
    m.actuator("push", "J", value=m.sampled("f", "u - 3*q", period=0.02) + u / 4)
    return finished(m, "q", "J")


def switched() -> eg.Model:
    m, u = started("switched", (0, 0, 0))
    first, second = (m.body(name, mass=1, inertia={"zz": 0.5}) for name in ("first", "second"))
    m.revolute("A", m.ground, first, coordinate="q")
    m.revolute("B", m.ground, second)
    m.torque("motor", "A", u)
    m.coupling("clutch", equation="q_dot - B_dot", closes="0.04 - t", opens="0.15 - t")
    m.initial(q_dot=1.0)
    return finished(m, "q", "")


def contacts() -> eg.Model:
    m, u = started("contacts")
    ball = m.body("ball", mass=1, inertia={"zz": 0.004})
    m.planar("J", m.ground, ball, coordinates=["q", "y", "phi"])
    law = {"stiffness": 1e4, "dissipation": 0.5, "friction": 0.4, "smoothing": 1e-2}
    shapes = {"shape": "circle", "on": ball, "radius": 0.1}, {"shape": "half_plane", "on": m.ground}
    m.contacts("floor", *shapes, law)
    m.force("push", ball, (u, 0, 0))
    m.initial(y=0.0995)
    return finished(m, "q", "")


def driven() -> eg.Model:
    """The length of a swinging rope is the input."""
    m, _ = started("driven")
    mass = m.body("mass", mass=1)
    m.revolute("A", m.ground, m.body("arm", mass=0), coordinate="q")
    m.prismatic("B", m.bodies["arm"], mass, axis="x", coordinate="s")
    m.driver("rope", "s", "2 + u/10")
    m.initial(q=0.3)
    return finished(m, "q", "A")


def massless() -> eg.Model:
    m, u = started("massless")
    rod, tip = m.body("rod", mass=0), m.body("tip", mass=0.5)
    m.revolute("A", m.ground, rod, coordinate="q")
    m.weld("W", rod.at(0.4, 0, 0), tip)
    m.torque("motor", "A", u)
    return finished(m, "q", "A")


def fixed() -> eg.Model:
    """Without freedoms: a motion in time, and an input that loads it."""
    m, u = started("fixed")
    rod = m.body("rod", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, rod, coordinate="q")
    m.driver("drive", "q", "0.3 + t + t**2")
    m.torque("motor", "A", u)
    return finished(m, "q", "A")


MECHANISMS: dict[str, Callable[[], eg.Model]] = {
    "tree": tree, "loops": loops, "redundant": partial(loops, "redundant", 2), "nonholonomic": nonholonomic,
    "states": states, "sampled": sampled, "switched": switched, "contacts": contacts, "driven": driven,
    "massless": massless, "fixed": fixed,
}  # fmt: skip


def touching(v: np.ndarray, depth: float) -> tuple[float, float]:
    """Hunt and Crossley's normal force and friction of the ball on the floor; v is its velocity (x, y, turn)."""
    normal = 1e4 * max(depth, 0.0) ** 1.5 * max(0.0, 1.0 - 0.5 * v[1])
    slip = v[0] + v[2] * (0.1 - depth / 2)  # in the middle of the overlap
    return normal, -0.4 * normal * slip / np.hypot(slip, 1e-2)


def blade_acceleration(u: float, x: dict[str, float]) -> float:
    """Newton and Euler with the force across the blade: m a = f + l n, n = (sin, -cos); n . v' = -n' . v."""
    s, c, w = np.sin(x["phi"]), np.cos(x["phi"]), x["phi_dot"]
    K = np.array([
        [1.0, 0.0, -0.1 * s, s],
        [0.0, 1.0, 0.1 * c, -c],
        [-0.1 * s, 0.1 * c, 0.11, 0.0],
        [s, -c, 0.0, 0.0],
    ])  # fmt: skip
    right = [u + 0.1 * w**2 * c, 0.1 * w**2 * s, 0.0, -w * (c * x["q_dot"] + s * x["y_dot"])]
    return float(np.linalg.solve(K, right)[0])


#: q'' by hand, of time, the input with its rates, and the state by names.
ACCELERATIONS: dict[str, Callable[[float, np.ndarray, dict[str, float]], float]] = {
    "tree": lambda t, u, x: (u[0] - 0.1 - 9.81 * 0.5 * np.cos(x["q"])) / 0.35,
    "loops": lambda t, u, x: (u[0] - 9.81 * 0.3 * np.cos(x["q"])) / 0.24,
    "redundant": lambda t, u, x: (u[0] - 9.81 * 0.4 * np.cos(x["q"])) / 0.35,
    "nonholonomic": lambda t, u, x: blade_acceleration(u[0], x),
    "states": lambda t, u, x: (x["f"] + u[0] / 4) / 2,
    "sampled": lambda t, u, x: (x["f"] + u[0] / 4) / 2,
    "switched": lambda t, u, x: u[0] / (1.0 if x["clutch_closed"] else 0.5),
    "contacts": lambda t, u, x: u[0] + touching(np.array([x["q_dot"], x["y_dot"], x["phi_dot"]]), 0.1 - x["y"])[1],
    "driven": lambda t, u, x: -(9.81 * np.cos(x["q"]) + 2 * u[1] / 10 * x["q_dot"]) / (2 + u[0] / 10),
    "massless": lambda t, u, x: (u[0] - 0.5 * 9.81 * 0.4 * np.cos(x["q"])) / 0.08,
    "fixed": lambda t, u, x: 2.0,
}


@cache
def module(mechanism: str) -> Any:
    return MECHANISMS[mechanism]().compile(target="numpy")


@cache
def symbolic(mechanism: str) -> Any:
    return MECHANISMS[mechanism]().derive().to_casadi()


class Reference:
    """A run by SciPy and by what this file knows of the mechanism."""

    def __init__(self, mechanism: str, kind: str, k: float = 2.0) -> None:
        self.mechanism, self.kind, self.mod, self.k = mechanism, kind, module(mechanism), k
        function = KINDS[kind][1]
        self.u = (lambda t, x: 1.0 + np.sin(3.0 * t) * k) if kind == "text" else function
        self.corners = [0.0, *[t for t in PLACES[1:4] if kind in ("held", "linear", "cubic") and t < END], END]
        self.x = self._states()

    def given(self, t: float, x: np.ndarray) -> np.ndarray:
        """All inputs of a call: the input and the rates that the mechanism takes."""
        u = self.u
        if self.mechanism != "driven":
            return np.array([u(t, x)])
        rates = {
            "number": lambda order: 0.0,
            "linear": lambda order: 0.0,
            "cubic": lambda order: float(CubicSpline(PLACES, VALUES)(t, order)),
            "text": lambda order: self.k * (Wave(order)(t)),
            "object": lambda order: Wave(order)(t),
        }[self.kind]
        return np.array([u(t, x), rates(1), rates(2)])

    def rhs(self, t: float, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.mod.rhs(t, x, p={"k": self.k}, u=self.given(t, x)))

    def _states(self) -> np.ndarray:
        x = self.mod.x0()
        if self.mechanism == "switched":
            return self._clutch()
        if self.mechanism == "fixed":
            return np.array([[0.3 + t + t**2, 1 + 2 * t] for t in TIMES]).T
        samples = [0.02 * k for k in range(15)] if self.mechanism == "sampled" else []
        corners = sorted({*self.corners, *samples})
        found: dict[float, np.ndarray] = {}
        for start, end in pairwise(corners):
            if start in samples:
                x = self._sample(start, x)
            inside = [t for t in TIMES if start <= t <= end]
            middle = partial(self._within, start, end)
            run = solve_ivp(middle, (start, end), x, "DOP853", sorted({*inside, end}), rtol=1e-10, atol=1e-12)
            found |= dict(zip(inside, run.y.T, strict=False))
            x = run.y[:, -1]
        return np.array([self.mod.project(found[t], t=t, u=self.given(t, found[t])) for t in TIMES]).T

    def _within(self, start: float, end: float, t: float, x: np.ndarray) -> np.ndarray:
        """x' inside a part, so that the value of a jump is that of the part."""
        return self.rhs(min(max(t, start + 1e-12), end - 1e-12), x)

    def _sample(self, t: float, x: np.ndarray) -> np.ndarray:
        place = self.mod.x_names.index("f")
        new = x.copy()
        new[place] = self.u(t + 1e-12, x) - 3.0 * x[0]
        return new

    def _clutch(self) -> np.ndarray:
        """Two equal rotors in closed equations; the motion of the second begins at rest."""
        corners = sorted({*self.corners, 0.04, 0.15})
        x, found = np.array([0.0, 0.0, 1.0, 0.0]), {}
        for start, end in pairwise(corners):
            closed = 0.04 <= start < 0.15
            if start == 0.04:
                x[2:] = x[2:].mean()

            def rhs(t: float, y: np.ndarray, part: tuple[float, float, bool] = (start, end, closed)) -> np.ndarray:
                torque = self.u(min(max(t, part[0] + 1e-12), part[1] - 1e-12), y)
                shares = (0.5, 0.5) if part[2] else (1.0, 0.0)
                return np.array([y[2], y[3], torque * shares[0] / 0.5, torque * shares[1] / 0.5])

            inside = [t for t in TIMES if start <= t <= end]
            run = solve_ivp(rhs, (start, end), x, "DOP853", sorted({*inside, end}), rtol=1e-10, atol=1e-12)
            found |= dict(zip(inside, run.y.T, strict=False))
            x = run.y[:, -1].copy()
        return np.array([[*found[t], 0.04 <= t < 0.15] for t in TIMES], dtype=float).T

    def acceleration(self, t: float, x: np.ndarray, u: np.ndarray | None = None) -> float:
        """q'' by hand."""
        given = self.given(t, x) if u is None else u
        return ACCELERATIONS[self.mechanism](t, given, dict(zip(self.mod.x_names, x, strict=True)))

    def outputs(self) -> np.ndarray:
        """Those of the module where no formula is known: the reaction alone."""
        q, v = (self.x[self.mod.x_names.index(name)] for name in ("q", "q_dot"))
        states = [(t, x) for t, x in zip(TIMES, self.x.T, strict=True)]
        found = {
            "position": q,
            "velocity": v,
            "acceleration": np.array([self.acceleration(t, x) for t, x in states]),
            "input": np.array([2 * self.given(t, x)[0] + 0.1 * self.k for t, x in states]),
            "parameter": self.k * q,
            "clearance": q + 100,
        }
        if "reaction" in self.mod.y_names:
            row = self.mod.y_names.index("reaction")
            values = [self.mod.outputs(t, x, p={"k": self.k}, u=self.given(t, x))[row] for t, x in states]
            found["reaction"] = np.array(values)
        return np.array([found[name] for name in self.mod.y_names])


#: Mechanisms with gravity, and those with a force from outside along x, by the input and the state.
WEIGHED = ("tree", "loops", "redundant", "contacts", "driven", "massless", "fixed")
PUSHED: dict[str, Callable[[float, dict[str, float]], float]] = {
    "states": lambda u, x: x["f"] + u / 4,
    "sampled": lambda u, x: x["f"] + u / 4,
}
FOLDERS: list[Path] = []
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def columns(run: Any, names: tuple[str, ...]) -> np.ndarray:
    return np.array([run[name] for name in names])


def simulated(mod: Any, u: Any, reference: Reference, method: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    options = TIGHT if method != "Radau" else {"rtol": 1e-8, "atol": 1e-10}
    run = mod.simulate(END, inputs={"u": u}, t_eval=TIMES, method=method, **options)
    return run.x, columns(run, mod.y_names)


def sensitivities(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """The run and its derivatives by the parameter k, against differences of references."""
    found = mod.sensitivities(["k"], END, inputs={"u": u}, t_eval=TIMES)
    low, high = (Reference(reference.mechanism, reference.kind, 2.0 + h) for h in (-1e-4, 1e-4))
    slopes = (high.outputs() - low.outputs()) / 2e-4
    np.testing.assert_allclose(found.dy[:, 0], slopes, atol=2e-5 * max(1.0, np.abs(slopes).max()))
    return found.trajectory.x, columns(found.trajectory, mod.y_names)


def ensemble(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    runs = mod.simulate_many(END, parameters={"k": [2.0, 2.5]}, inputs={"u": u}, t_eval=TIMES, **TIGHT)
    one = runs.trajectory(0).at(TIMES)
    np.testing.assert_allclose(runs.samples[: mod.n_q, :, 0], one.x[: mod.n_q], atol=1e-6)
    return one.x, columns(one, mod.y_names)


def differential_algebraic(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    warnings.filterwarnings("ignore", "IDA steps over contacts")  # which it does not here
    run = mod.dae.solve(END, inputs={"u": u}, t_eval=TIMES, rtol=1e-9, atol=1e-11)
    return run.x, columns(run, mod.y_names)


def impacts(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """A gap that stays open changes nothing."""
    run = mod.simulate_impacts(END, {"clearance": 0.5}, inputs={"u": u}, **TIGHT).at(TIMES)
    return run.x, columns(run, mod.y_names)


def fit(mod: Any, u: Any, reference: Reference) -> None:
    """The parameter k is found again from the output that it scales; the data begin where the run does."""
    start = 2.0 * mod.x0()[0]
    data = {"t": [0.0, *TIMES], "parameter": [start, *reference.outputs()[mod.y_names.index("parameter")]]}
    found = mod.fit(data, {"k": 1.8}, inputs={"u": u})
    assert found.values["k"] == pytest.approx(2.0, abs=1e-5)


def linearize(mod: Any, u: Any, reference: Reference) -> None:
    """A, B and D are the slopes of q'' by hand and of the outputs; one formula is asked along x alone."""
    t, x = TIMES[1], reference.x[:, 1]
    given = reference.given(t, x)
    line = mod.linearize(x, t, u=given, form="full")
    row, h = mod.x_names.index("q_dot"), np.array([1e-3, *np.zeros(len(given) - 1)])
    low, high = (reference.acceleration(t, x, given + s * h) for s in (-1, 1))
    assert line.B[row, 0] == pytest.approx((high - low) / 2e-3, abs=1e-8 * max(1.0, abs(high)))
    along = reference.rhs(t, x) * (reference.mechanism != "fixed")  # which stays on the constraints
    low, high = (reference.acceleration(t, x + s * 1e-5 * along, given) for s in (-1, 1))
    assert line.A[row] @ along == pytest.approx((high - low) / 2e-5, abs=1e-5 * max(1.0, np.abs(line.A[row]).max()))
    if reference.mechanism != "driven":  # there D is that of states which do not follow the input
        place = {name: k for k, name in enumerate(mod.y_names)}
        assert line.D[place["input"], 0] == pytest.approx(2.0, abs=1e-12)
        assert line.D[place["acceleration"], 0] == pytest.approx(line.B[row, 0], abs=1e-9)


def again(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """States between the steps of a run, which are asked for afterwards."""
    run = mod.simulate(END, inputs={"u": u}, **TIGHT).at(TIMES)
    return run.x, columns(run, mod.y_names)


def minimal(mod: Any, u: Any, reference: Reference) -> None:
    """The minimal form's q'' at states of the reference is that of the formula."""
    small = mod.minimal
    for t, x in zip(TIMES, reference.x.T, strict=True):
        given = reference.given(t, x)
        small.reset(x[: mod.n_q])
        rates = small.rhs(t, x[[mod.x_names.index(name) for name in small.x_names]], u=given)
        for name, rate in zip(small.x_names, rates, strict=True):
            if name in ("q", "q_dot"):
                expected = x[mod.x_names.index("q_dot")] if name == "q" else reference.acceleration(t, x)
                assert rate == pytest.approx(expected, abs=1e-8 * max(1.0, abs(expected)))
        assert "q_dot" in small.x_names or not mod.n_dof


def reactions(mod: Any, u: Any, reference: Reference) -> None:
    """Those on ground are what moves all masses, beside their weight and what else acts from outside."""
    masses = np.array([*mod.standard_parameters().values()]).reshape(-1, 10)[:, 0].sum()
    ground = [k for k, name in enumerate(mod.joint_names) if name[0] in "AJ"]
    for t, x in zip(TIMES, reference.x.T, strict=True):
        given = reference.given(t, x)
        ahead, behind = (mod.momentum(x + s * reference.rhs(t, x))[:3] for s in (1e-5, -1e-5))
        rate = (ahead - behind) / 2e-5
        force = mod.reactions(t, x, u=given)[ground, :3].sum(axis=0)
        weight = masses * np.array([0.0, 9.81 * (reference.mechanism in WEIGHED), 0.0])
        if reference.mechanism in ("nonholonomic", "contacts"):  # its joint leaves the plane free
            assert np.abs(force[:2]).max() <= 1e-12
            continue
        pushed = PUSHED.get(reference.mechanism, lambda u, x: 0.0)(given[0], dict(zip(mod.x_names, x, strict=True)))
        expected = rate + weight - [pushed, 0.0, 0.0]
        np.testing.assert_allclose(force, expected, atol=1e-6 * max(10.0, np.abs(force).max()))


@pytest.fixture(scope="module", autouse=True)
def _folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    FOLDERS.append(tmp_path_factory.mktemp("packages"))


@cache
def package(mechanism: str) -> Any:
    """An exported package, imported from its folder."""
    name = f"crossed_{mechanism}"
    root = built(generate(MECHANISMS[mechanism](), FOLDERS[-1]))
    spec = spec_from_file_location(name, root / "__init__.py", submodule_search_locations=[str(root)])
    assert spec is not None
    assert spec.loader is not None
    found = sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def exported(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    return simulated(package(reference.mechanism), u, reference)


def equilibrium(mod: Any, u: Any, reference: Reference) -> None:
    """Where q'' by hand vanishes; what a driver holds stays there."""
    given = reference.given(0.0, mod.x0())
    x = np.asarray(mod.equilibrium(u=given).x)
    if reference.mechanism == "fixed":
        assert x[0] == pytest.approx(0.3, abs=1e-12)
        return
    assert reference.acceleration(0.0, x, given) == pytest.approx(0.0, abs=1e-7)


def in_casadi(mod: Any, u: Any, reference: Reference) -> None:
    """q'' of the functions of CasADi."""
    functions = symbolic(reference.mechanism)
    for t, x in zip(TIMES, reference.x.T, strict=True):
        given = reference.given(t, x)
        rate = float(functions.rhs(t, x, given, functions.p_values)[mod.x_names.index("q_dot")])
        assert rate == pytest.approx(reference.acceleration(t, x), rel=1e-8, abs=1e-8)


@cache
def stepped(mechanism: str) -> Any:
    """A module with a rigid contact, of a disc with a floor that it does not come to."""
    m = MECHANISMS[mechanism]()
    if mechanism != "contacts":
        disc = {"shape": "circle", "on": next(iter(m.bodies.values())), "radius": 0.01}
        m.contacts("far", disc, {"shape": "half_plane", "on": m.ground.at(0, -100, 0)}, {"normal_law": "rigid"})
    return m.compile(target="numpy")


def rigid(mod: Any, u: Any, reference: Reference) -> tuple[np.ndarray, np.ndarray] | None:
    """Time stepping by impulses; the ball, pushed along a floor that is rigid then, rolls: q'' = u / 1.4."""
    run = stepped(reference.mechanism).simulate(END, inputs={"u": u}, t_eval=TIMES, method="moreau", step=5e-4)
    if reference.mechanism != "contacts":
        return run.x, columns(run, mod.y_names)
    t = np.linspace(0.0, END, 20001)
    rate = cumulative_trapezoid([reference.u(s, np.zeros(6)) / 1.4 for s in t], t, initial=0.0)
    np.testing.assert_allclose(run["q_dot"][1:], np.interp(TIMES[1:], t, rate), atol=1e-3)
    np.testing.assert_allclose(run["phi_dot"][1:], -10.0 * run["q_dot"][1:], atol=1e-6)
    np.testing.assert_allclose(run["y"][1:], 0.1, atol=1e-9)
    return None


@cache
def unit(mechanism: str) -> tuple[Any, dict[str, int]]:
    """An instance of a functional mock-up unit for model exchange, and the references of its variables."""
    path = MECHANISMS[mechanism]().derive().write_fmu(FOLDERS[-1] / f"{mechanism}.fmu")
    folder = extract(str(path))
    description = read_model_description(folder)
    found = FMU2Model(guid=description.guid, unzipDirectory=folder, modelIdentifier=mechanism, instanceName="i")
    found.instantiate()
    found.setupExperiment(startTime=0.0)
    found.enterInitializationMode()
    found.exitInitializationMode()
    found.enterContinuousTimeMode()
    return found, {v.name: v.valueReference for v in description.modelVariables}


def functional_mockup_unit(mod: Any, u: Any, reference: Reference) -> None:
    """q'' and the outputs of a unit whose master sets time, states and inputs."""
    instance, at = unit(reference.mechanism)
    y = reference.outputs().T
    for t, x, expected in zip(TIMES, reference.x.T, y, strict=True):
        instance.setTime(t)
        instance.setContinuousStates((ctypes.c_double * len(x))(*x), len(x))
        instance.setReal([at[name] for name in mod.u_names], reference.given(t, x).tolist())
        rate = instance.getReal([at["der(q_dot)"]])[0]
        assert rate == pytest.approx(reference.acceleration(t, x), rel=1e-8, abs=1e-8)
        np.testing.assert_allclose(instance.getReal([at[name] for name in mod.y_names]), expected, rtol=1e-8, atol=1e-8)


CALLS: dict[str, Callable[..., tuple[np.ndarray, np.ndarray] | None]] = {
    "simulate": simulated, "Radau": partial(simulated, method="Radau"), "BDF": partial(simulated, method="BDF"),
    "sensitivities": sensitivities, "ensemble": ensemble, "dae": differential_algebraic, "impacts": impacts, "fit": fit,
    "linearize": linearize, "again": again, "minimal": minimal, "reactions": reactions, "equilibrium": equilibrium,
    "package": exported, "casadi": in_casadi, "rigid": rigid, "fmu": functional_mockup_unit,
}  # fmt: skip
CELLS = [(m, list(KINDS)[(i + j) % len(KINDS)], c) for i, m in enumerate(MECHANISMS) for j, c in enumerate(CALLS)]
#: Cells that are refused -> what the error must tell.
REFUSED: dict[tuple[str, str], str] = {
    ("function", "ensemble"): "EG-TYPE number",
    ("object", "ensemble"): "EG-TYPE number",
    ("function", "sensitivities"): "EG-UNSUPPORTED derivatives",
    ("function", "fit"): "EG-UNSUPPORTED derivatives",
    ("nonholonomic", "minimal"): "EG-UNSUPPORTED minimal form",
    ("sampled", "linearize"): "EG-UNAVAILABLE sampled",
    ("fixed", "impacts"): "EG-UNSUPPORTED freedom",
    ("sampled", "rigid"): "EG-UNSUPPORTED events moreau",
    ("switched", "rigid"): "EG-UNSUPPORTED events moreau",
    ("text", "package"): "EG-PACKAGE-MISSING eomgen",
    ("contacts", "casadi"): "EG-UNSUPPORTED contacts",
    ("states", "equilibrium"): "EG-NO-EQUILIBRIUM equilibrium",
    ("switched", "equilibrium"): "EG-NO-EQUILIBRIUM equilibrium",
    ("contacts", "equilibrium"): "EG-NO-EQUILIBRIUM equilibrium",
    ("sampled", "equilibrium"): "EG-UNAVAILABLE sampled",
    ("driven", "held"): "EG-JUMP jumps",
    ("driven", "linear"): "EG-JUMP jumps",
    ("driven", "function"): "needs its rate u_dot",
}
#: Calls at one state, which take values of inputs.
AT_ONE_STATE = ("linearize", "minimal", "reactions", "equilibrium", "casadi", "fmu")
#: Dear ones: stiff contacts in Python, and builds in C.
THOROUGH = {("contacts", call) for call in ("fit", "sensitivities", "ensemble", "Radau", "BDF", "package")}
THOROUGH |= {(mechanism, "fmu") for mechanism in MECHANISMS if mechanism != "driven"}
MARKED = [
    pytest.param(*cell, id="-".join(cell), marks=[pytest.mark.thorough] if (cell[0], cell[2]) in THOROUGH else [])
    for cell in CELLS
]


@pytest.mark.parametrize(("mechanism", "kind", "call"), MARKED)
def test_cells(mechanism: str, kind: str, call: str) -> None:
    mod = module(mechanism)
    pairs = [(kind, call), (mechanism, call), (mechanism, kind)]
    if call in AT_ONE_STATE and mechanism == "driven":  # whatever they follow
        kind, pairs = "text", []
    demand = next((REFUSED[pair] for pair in pairs if pair in REFUSED), "")
    if demand:
        errors = package(mechanism).EomgenError if call == "package" else eg.EomgenError
        with refused(demand, errors):
            CALLS[call](mod, KINDS[kind][0], Reference(mechanism, "number"))
        return
    reference = Reference(mechanism, kind)
    found = CALLS[call](mod, KINDS[kind][0], reference)
    if found is None:
        return
    x, y = found
    limit = {"dae": 1e-5, "BDF": 1e-5, "Radau": 1e-5, "rigid": 2e-5}.get(call, 2e-7)
    n = mod.n_q + mod.n_v
    np.testing.assert_allclose(x[:n], reference.x[:n], atol=limit * max(1.0, np.abs(x).max()))
    np.testing.assert_allclose(y, reference.outputs(), atol=30 * limit * max(1.0, np.abs(y).max()))


@pytest.mark.parametrize("k", [1, 5, 10])
def test_a_sample_takes_what_an_input_is_before_it_jumps(k: int) -> None:
    """Whatever the rounding of the two times."""
    jump = 0.02 * k
    u = eg.Signal([0.0, jump, 1.0], [1.0, 3.0, 5.0], "zero-order")
    run = module("sampled").simulate(END, inputs={"u": u}, t_eval=[jump - 0.005, jump + 0.005], **TIGHT)
    assert run["f"][1] + 3.0 * run["q"][1] == pytest.approx(1.0, abs=0.05)
