"""Stage verification, check bodies: generated code against Newton's and Euler's equations of every body.

What is expected comes from :mod:`.truth`, which shares no formula with the derivation but where the bodies are and what
the force elements exert.
"""

from __future__ import annotations

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import EPS, TINY
from . import bodies
from .bench import Bench, numbers
from .comparison import Comparison, pairs, size_of
from .digits import Number
from .finding import Finding
from .rounding_sizes import FOLDED, UNIT
from .truth import Truth


def check(bench: Bench) -> list[Finding]:
    """Equations of the tree, accelerations, energies, momenta and power."""
    found = [_tree(bench, name) for name in ("mass_matrix", "bias", "inverse_dynamics")]
    found += [_accelerations(bench), _energy(bench), _momentum(bench), _power(bench)]
    return found


def source(bench: Bench) -> str:
    """What the equations are judged by."""
    if bench.mechanism.lagrangian is not None:
        return "Lagrange's equations by differences of L"
    return "equations as they were given" if bench.mechanism.given is not None else "free bodies"


def _inertia_sizes(truth: Truth) -> Array:
    """Sizes (n_v,) of the terms that the bias is a sum of, which may cancel: bodies' inertia forces, gravity, loads."""
    if truth.system.mechanism.bare:
        return np.zeros(truth.n)

    def norm(vector: list[Number]) -> float:
        return float(truth.mp.sqrt(bodies.dot(vector, vector)))

    rates, sizes = truth.body_rates([truth.zero] * truth.n), np.abs(numbers(truth.applied()))
    for j in range(truth.n):
        for body, w, rate, twist in zip(truth.bodies, truth.virtual[j], rates, truth.twists, strict=True):
            turning, inertia = norm(twist.angular) ** 2, max(norm(row) for row in body.inertia)
            a = norm(rate.at(body.arm)) + turning * norm(body.arm) + norm(truth.gravity)
            moment = inertia * (norm(rate.angular) + turning)
            sizes[j] += float(body.mass) * a * norm(w.at(body.arm)) + moment * norm(w.angular)
    return sizes


def _tree(bench: Bench, name: str) -> Finding:
    found, layout = Comparison(f"{name}: {source(bench)}"), bench.layout
    labels = pairs(layout.v, layout.v) if name == "mass_matrix" else list(layout.v)
    for k, truth in enumerate(bench.truths):
        actual = bench.call(name, truth.case).ravel()
        if name == "mass_matrix":
            expected = numbers([x for row in truth.mass_matrix for x in row])
        elif name == "bias":
            expected = numbers(truth.bias)
        else:
            expected = numbers(truth.inverse_dynamics([truth.mp.mpf(float(x)) for x in truth.case.a]))
        if name in bench.graph_kernels:
            bound = bench.bounds(name, bench.graph_kernels[name])[1][:, k]
        else:
            bound = layout.n_v * bench.bounds("inverse_dynamics", lambda: bench.terms.inverse_dynamics)[1][:, k].max()
        size = size_of(expected)
        if name == "bias":
            size = max(size, size_of(_inertia_sizes(truth)))
        floor = np.full(len(expected), FOLDED * size)
        if name == "mass_matrix":
            d = np.sqrt(np.maximum(np.diag(expected.reshape(layout.n_v, layout.n_v)), 0.0))
            floor = FOLDED * np.outer(d, d).ravel() + 4.0 * EPS * size
        found.add(k, actual - expected, bound + UNIT * np.abs(expected) + floor, size, labels)
    return found.finding()


def true_accelerations(bench: Bench, k: int) -> tuple[Array, Array, float]:
    """v' at a state in many digits, of M a + h + C_q^T l = 0 and C_q a + gamma = 0; what rounding allows, and the size.

    Raises
    ------
    ZeroDivisionError
        The system is singular.
    """
    truth = bench.truths[k]
    a, multipliers = (numbers(x) for x in truth.solve(list(bench.layout.rows)))
    mass = np.diag(numbers([x for row in truth.mass_matrix for x in row]).reshape(len(a), len(a)))
    own = np.divide(_inertia_sizes(truth), mass, out=np.zeros_like(mass), where=mass > 0.0)
    limit = bench.acceleration_limit(k, a, multipliers) + FOLDED * (size_of(a) + own)
    return a, limit, max(size_of(a), size_of(own))


def _accelerations(bench: Bench) -> Finding:
    found, n_q = Comparison(f"accelerations: {source(bench)}"), bench.module.n_q
    for k, truth in enumerate(bench.truths):
        try:
            a, limit, size = true_accelerations(bench, k)
        except ZeroDivisionError:
            return Finding.skipped(found.check, "the system of accelerations and multipliers is singular")
        found.add(k, bench.rhs(truth.case)[n_q:] - a, limit, size, [f"{n}'" for n in bench.layout.v])
    return found.finding()


def kinetic(truth: Truth) -> Number:
    """T of the bodies and the rotors of drives."""
    total = sum((b.product(w, w) for b, w in zip(truth.bodies, truth.twists, strict=True)), truth.zero)
    for name, inertia in truth.drives:
        v = [truth.values[n] for n in truth.system.terms.v]
        rate = sum((y * x for y, x in zip(truth.coordinate_slopes(name), v, strict=True)), truth.zero)
        total += inertia * rate * rate
    return total / 2


def potential(truth: Truth, poses: list[bodies.Pose], values: dict[str, Number]) -> Number:
    """V of gravity and of the force elements, with bodies at some poses."""
    total = truth.zero
    for body, pose, here in zip(truth.bodies, poses, truth.here, strict=True):
        own = bodies.times(bodies.transpose(here.rotation), body.arm)
        centre = bodies.add(pose.position, bodies.times(pose.rotation, own))
        total -= body.mass * bodies.dot(truth.gravity, centre)
    parts = [terms.potential for terms in truth.system.kinematics.forces if terms.potential is not None]
    return total + sum(truth.system.evaluate("potentials", lambda: parts, values), truth.zero)


def _energy(bench: Bench) -> Finding:
    check = "energy: of the bodies"
    if bench.mechanism.bare or "energy" not in bench.graph_kernels:
        return Finding.skipped(check, "there are no bodies; T and V are those of the given equations")
    found = Comparison(check)
    bounds = bench.bounds("energy", bench.graph_kernels["energy"])[1]
    for k, truth in enumerate(bench.truths):
        expected = numbers([kinetic(truth), potential(truth, truth.here, truth.values)])
        actual = bench.call("energy", truth.case)
        limit = bounds[:, k] + UNIT * np.abs(expected) + FOLDED * size_of(expected)
        found.add(k, actual - expected, limit, size_of(expected), bench.labels("energy"))
    return found.finding()


def _momentum(bench: Bench) -> Finding:
    """Linear and angular momentum, and that external forces are what changes them."""
    check = "momentum: of the bodies"
    if "centroidal" not in bench.graph_kernels:
        return Finding.skipped(check, "no body has a mass")
    found, n = Comparison(check), 3 + 3 * bench.layout.n_v
    bounds = bench.bounds("centroidal", bench.graph_kernels["centroidal"])[1]
    for k, truth in enumerate(bench.truths):
        expected = numbers([*_centre(truth), *_momenta(truth)])
        every = bench.call("centroidal", truth.case)
        actual, limit = (np.concatenate([y[:3], y[n : n + 6]]) for y in (every, bounds[:, k]))
        labels = [f"{what} {axis}" for what in ("centre", "linear", "angular") for axis in "xyz"]
        size = size_of(expected)
        found.add(k, actual - expected, limit + UNIT * np.abs(expected) + FOLDED * size, size, labels)
    return found.finding()


def _centre(truth: Truth) -> list[Number]:
    mass = sum((b.mass for b in truth.bodies), truth.zero)
    total = [truth.zero] * 3
    for body, pose in zip(truth.bodies, truth.here, strict=True):
        total = bodies.add(total, bodies.scale(body.mass / mass, body.centre(pose)))
    return total


def _momenta(truth: Truth) -> list[Number]:
    centre, linear, angular = _centre(truth), [truth.zero] * 3, [truth.zero] * 3
    for body, pose, w in zip(truth.bodies, truth.here, truth.twists, strict=True):
        own = bodies.scale(body.mass, w.at(body.arm))
        linear = bodies.add(linear, own)
        spin = bodies.times(body.inertia, w.angular)
        angular = bodies.add(angular, bodies.add(spin, bodies.cross(bodies.sub(body.centre(pose), centre), own)))
    return [*linear, *angular]


def _power(bench: Bench) -> Finding:
    """dE/dt along the motion, time and inputs held, against the power of forces without a potential and of drivers.

    E is the sum that the module reports, differentiated along x' = rhs in many digits.  The reactions of rows
    C' = C_q v + C_t do the power l . C_t.
    """
    check = "power: rate of energy, forces and drivers"
    if bench.mechanism.bare or "energy" not in bench.graph_kernels:
        return Finding.skipped(check, "there are no bodies, so it is not known which forces have a potential")
    found, layout = Comparison(check), bench.layout
    for k, truth in enumerate(bench.truths):
        a = bench.rhs(truth.case)[bench.module.n_q :]
        try:
            exact, multipliers = truth.solve(list(layout.rows))
        except ZeroDivisionError:
            return Finding.skipped(check, "the system of accelerations and multipliers is singular")
        rate = _energy_rate(bench, truth, a)
        v = [truth.values[name] for name in bench.terms.v]
        parts = [f * x for f, x in zip(truth.applied(remainder=True), v, strict=True)]
        C, rows = truth.constraint_jacobian, truth.velocity_rows
        for row, l in zip(layout.rows, multipliers, strict=True):
            parts.append(-l * sum((c * x for c, x in zip(C[row], v, strict=True)), truth.zero))  # C_q v = -C_t
        power = sum(parts, truth.zero)
        momentum = np.abs(
            numbers([sum((m * x for m, x in zip(row, v, strict=True)), truth.zero) for row in truth.mass_matrix])
        )
        slack = bench.acceleration_limit(k, numbers(exact), numbers(multipliers))
        gap = np.abs(numbers(rows))[layout.rows] @ np.abs(numbers(multipliers)) if len(layout.rows) else 0.0
        limit = float(momentum @ slack) + float(gap) + UNIT * float(np.abs(numbers(parts)).sum())
        size = max(float(np.abs(numbers(parts)).max(initial=0.0)), float(np.abs(a) @ momentum), TINY)
        found.add(k, [float(rate - power)], [limit], size)
    return found.finding()


def _energy_rate(bench: Bench, truth: Truth, a: Array) -> Number:
    """d(T + V)/dt along q' = N v, v' = a at a held time."""
    energies, many = bench.graph_kernels["energy"], [truth.mp.mpf(float(x)) for x in a]
    return truth.slope(
        lambda values: [sum(bench.system.evaluate("kernel energy", energies, values), truth.zero)],
        lambda s: truth.later(s, many, frozen=True),
    )[0]
