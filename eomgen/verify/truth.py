"""A state -> the equations of motion there, found again without the derivation.

Of bodies: d'Alembert's principle in Newton's and Euler's equations of every body, with velocities and accelerations
from differences of where the bodies are.  Of a bare Lagrangian: Lagrange's equations by differences of L.  Of given
equations: as they were given.  Constraints: differences of C along the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from ..elements.frames import GROUND
from ..expr.core import Expr
from . import bodies
from .bodies import Pose, Rigid, Twist
from .digits import FIRST, SECOND, Digits, Number, Numbers, array, context, solve

if TYPE_CHECKING:
    from ..codegen.terms import SystemTerms
    from ..reading.derivation import Derivation
    from .random_states import SystemState

Values = dict[str, Number]


class PreciseSystem:
    """A model's expressions in many digits, and its description: what a :class:`Truth` is found from.

    Parameters
    ----------
    terms : SystemTerms
        Of the same equations.
    """

    def __init__(self, equations: Derivation, terms: SystemTerms) -> None:
        self.equations, self.terms = equations, terms
        self.kinematics = equations.kinematics
        self.mechanism = equations.kinematics.mechanism
        self.mp = context()
        self._ready: dict[str, Digits] = {}

    def evaluate(self, name: str, outputs: Callable[[], Sequence[Expr]], values: Mapping[str, Number]) -> Numbers:
        """Values of expressions that are prepared once, under a name."""
        if name not in self._ready:
            self._ready[name] = Digits(self.mp, list(outputs()))
        return self._ready[name](values)

    def exact(self, values: Iterable[float]) -> Numbers:
        """Doubles, exactly as they are."""
        return array([self.mp.mpf(float(x)) for x in values])

    def values(self, case: SystemState) -> Values:
        terms = self.terms
        names = (*terms.q, *terms.v, *terms.a, *terms.p, *terms.u, terms.t)
        return dict(zip(names, self.exact((*case.x, *case.a, *case.p, *case.u, case.t)), strict=True))


class Truth:
    """One state of a model, and the ways that lead through it; every quantity is found when it is first requested."""

    def __init__(self, system: PreciseSystem, case: SystemState) -> None:
        self.system, self.case, self.mp = system, case, system.mp
        self.values = system.values(case)
        self.n = len(system.terms.v)
        self.zero = self.mp.mpf(0)
        self.v = self.of(system.terms.v)

    def of(self, names: Sequence[str], values: Values | None = None) -> Numbers:
        values = self.values if values is None else values
        return array([values[name] for name in names])

    # -- moving the state ---------------------------------------------------------------------------------------------
    def rates(self, values: Values) -> Numbers:
        """q' at some values."""
        terms = self.system.terms
        if not terms.rates:
            return self.of(terms.v[: self.n - terms.n_states], values)
        return self.system.evaluate("rates", lambda: terms.rates, values)

    @cached_property
    def columns(self) -> Numbers:
        """N^T (n_v, n_q): q' of each velocity alone."""
        still = self.values | dict.fromkeys(self.system.terms.v, self.zero)
        base, one = self.rates(still), self.mp.mpf(1)
        return array([self.rates(still | {name: one}) - base for name in self.system.terms.v])

    def moved(self, names: Sequence[str], changes: Numbers) -> Values:
        return dict(zip(names, self.of(names) + changes, strict=True))

    def displaced(self, j: int, step: Number) -> Values:
        return self.values | self.moved(self.system.terms.q, step * self.columns[j])

    def later(self, step: Number, a: Numbers | None = None, frozen: bool = False) -> Values:
        """The state a time later, with accelerations a (0 by default): q + s q' + s^2 q'' / 2, v + s a, t + s.

        ``frozen``: time and inputs stand still.
        """
        terms = self.system.terms
        a = array([self.zero] * self.n) if a is None else a
        moved = self.moved(terms.q, step * self.rates(self.values) + step * step * self._second_rates(a) / 2)
        moved |= self.moved(terms.v, step * a)
        if not frozen:
            moved[terms.t] = self.values[terms.t] + step
            moved |= self._moved_inputs(step)
        return self.values | moved

    def _moved_inputs(self, step: Number) -> Values:
        """Inputs whose rates are inputs too move with them, by Taylor's series up to the last rate."""
        next_of, moved = dict(self.system.terms.input_rates), dict[str, Number]()
        for name in next_of:
            total, factor, rate = self.values[name], self.mp.mpf(1), next_of.get(name)
            for order in count(1):
                if rate is None:
                    break
                factor *= step / order
                total += factor * self.values[rate]
                rate = next_of.get(rate)
            moved[name] = total
        return moved

    def _second_rates(self, a: Numbers) -> Numbers:
        """q'' along q', v' = a."""
        terms = self.system.terms
        if not terms.rates:
            return a[: self.n - terms.n_states]

        def along(s: Number) -> Values:
            moved = self.moved(terms.q, s * self.rates(self.values)) | self.moved(terms.v, s * a)
            return self.values | moved | {terms.t: self.values[terms.t] + s}

        return self.slope(self.rates, along)

    def slope(self, f: Callable[[Values], Numbers], along: Callable[[Number], Values]) -> Numbers:
        h = self.mp.mpf(FIRST)
        result: Numbers = (f(along(h)) - f(along(-h))) / (2 * h)
        return result

    def bend(self, f: Callable[[Values], Numbers], along: Callable[[Number], Values]) -> Numbers:
        """Second difference of a function along a way."""
        h = self.mp.mpf(SECOND)
        result: Numbers = (f(along(h)) - 2 * f(along(self.zero)) + f(along(-h))) / (h * h)
        return result

    # -- bodies -------------------------------------------------------------------------------------------------------
    def poses(self, values: Values) -> list[Pose]:
        return bodies.poses_of(self.system.evaluate("poses", lambda: self.system.terms.poses, values))

    @cached_property
    def here(self) -> list[Pose]:
        return self.poses(self.values)

    @cached_property
    def bodies(self) -> list[Rigid]:
        mechanism = self.system.mechanism
        numbers = self.system.evaluate("described", lambda: bodies.described(mechanism), self.values)
        return bodies.rigid_bodies(numbers, self.here)

    @cached_property
    def virtual(self) -> list[list[Twist]]:
        """Twist of every body in a unit of each velocity: (n_v, n_bodies)."""
        h = self.mp.mpf(FIRST)
        result = []
        for j in range(self.n):
            ahead, behind = self.poses(self.displaced(j, h)), self.poses(self.displaced(j, -h))
            result.append([bodies.difference(*x, h) for x in zip(ahead, behind, self.here, strict=True)])
        return result

    @cached_property
    def twists(self) -> list[Twist]:
        return self._moving()[0]

    def _moving(self, a: Numbers | None = None) -> tuple[list[Twist], list[Twist]]:
        """Twists and their rates, in a motion with accelerations a."""
        h = self.mp.mpf(SECOND)
        ahead, behind = self.poses(self.later(h, a)), self.poses(self.later(-h, a))
        ends = list(zip(ahead, behind, self.here, strict=True))
        return [bodies.difference(*x, h) for x in ends], [bodies.second_difference(*x, h) for x in ends]

    def body_rates(self, a: Numbers | None = None) -> list[Twist]:
        return self._moving(a)[1]

    # -- forces -------------------------------------------------------------------------------------------------------
    @cached_property
    def gravity(self) -> Numbers:
        return self.system.evaluate("gravity", lambda: self.system.mechanism.gravity, self.values)

    def measured(self, values: Values) -> Numbers:
        """Coordinates of cut joints."""
        terms = self.system.terms
        n = terms.sizes.n_loop_coordinates
        return self.system.evaluate("measured", lambda: terms.loop_coordinates[:n], values)

    @cached_property
    def measured_slopes(self) -> Numbers:
        """dy of the coordinates of cut joints in a unit of each velocity: (n_v, n_loop_coordinates)."""
        return array([self.slope(self.measured, partial(self.displaced, j)) for j in range(self.n)])

    def coordinate_slopes(self, name: str) -> Numbers:
        """dy/dv' of a joint's coordinate, of the tree or cut."""
        freedoms, cut = self.system.kinematics.velocity_labels, self.system.kinematics.loop_coordinates.names
        if name in freedoms:
            return array([self.mp.mpf(j == freedoms.index(name)) for j in range(self.n)])
        return self.measured_slopes[:, cut.index(name)]

    def marker_loads(self, remainder: bool = False) -> list[tuple[int, Numbers, Numbers, Numbers]]:
        """Body, arm from its origin, force and torque of every load on a body, ground axes."""
        loads = [
            load
            for terms in self.system.kinematics.forces
            for load in (terms.marker_remainder if remainder else terms.marker_loads)
            if load.marker.body != GROUND
        ]
        flat = self.system.evaluate(
            f"loads {remainder}",
            lambda: [x for load in loads for x in (*load.marker.frame.position, *load.force, *load.torque)],
            self.values,
        )
        return [
            (load.marker.body, self.here[load.marker.body].rotation @ arm, force, torque)
            for load, (arm, force, torque) in zip(loads, flat.reshape(-1, 3, 3), strict=True)
        ]

    def coordinate_loads(self, remainder: bool = False) -> list[tuple[str, Number]]:
        loads = [
            load
            for terms in self.system.kinematics.forces
            for load in (terms.coordinate_remainder if remainder else terms.coordinate_loads)
        ]
        flat = self.system.evaluate(f"along {remainder}", lambda: [load.value for load in loads], self.values)
        return [(load.coordinate, x) for load, x in zip(loads, flat, strict=True)]

    def along(self, force: Numbers, torque: Numbers, body: int, arm: Numbers) -> Numbers:
        """The power (n_v,) of a wrench at a point of a body in a unit of each velocity."""
        twists = (w[body] for w in self.virtual)
        return array([force @ w.at(arm) + torque @ w.angular if w.moves else self.zero for w in twists])

    def applied(self, remainder: bool = False) -> Numbers:
        """Generalized forces of the force elements, by virtual power; those without a potential only if asked."""
        total = array([self.zero] * self.n)
        for body, arm, force, torque in self.marker_loads(remainder):
            total = total + self.along(force, torque, body, arm)
        for name, value in self.coordinate_loads(remainder):
            total = total + value * self.coordinate_slopes(name)
        return total

    @cached_property
    def drives(self) -> list[tuple[str, Number]]:
        """Inertias of drives, by the coordinate they turn with."""
        specs = [s for s in self.system.mechanism.joints if s.armature is not None]
        flat = self.system.evaluate(
            "drives", lambda: [s.armature for s in specs if s.armature is not None], self.values
        )
        return [(s.coordinates[0], x) for s, x in zip(specs, flat, strict=True)]

    # -- equations of motion of the tree ------------------------------------------------------------------------------
    @cached_property
    def mass_matrix(self) -> Numbers:
        mechanism = self.system.mechanism
        if mechanism.lagrangian is not None:
            return self._lagrangian_mass()
        if mechanism.given is not None:
            lower = mechanism.given.mass_matrix
            flat = self.system.evaluate("given mass", lambda: [x for row in lower for x in row], self.values)
            return array([[flat[max(i, j) * self.n + min(i, j)] for j in range(self.n)] for i in range(self.n)])
        M = array([[self.zero] * self.n] * self.n)
        for i in range(self.n):
            for j in range(i + 1):
                pairs = zip(self.bodies, self.virtual[i], self.virtual[j], strict=True)
                M[i, j] = M[j, i] = sum((b.product(w, z) for b, w, z in pairs if w.moves and z.moves), self.zero)
        for name, inertia in self.drives:
            y = self.coordinate_slopes(name)
            M = M + inertia * y[:, None] * y
        for k in range(self.n - len(mechanism.states), self.n):
            M[k, k] = self.mp.mpf(1)
        return M

    @cached_property
    def bias(self) -> Numbers:
        """h of the tree: inertia forces at v' = 0, less gravity, force elements and inputs."""
        mechanism = self.system.mechanism
        if mechanism.lagrangian is not None:
            return self._lagrangian_bias()
        if mechanism.given is not None:
            forcing = mechanism.given.forcing
            return -self.system.evaluate("given forcing", lambda: forcing, self.values)
        total = -self.applied()
        for k, (body, rate, twist) in enumerate(zip(self.bodies, self.body_rates(), self.twists, strict=True)):
            force, moment = body.needed(rate, twist.angular)
            total = total + self.along(force - body.mass * self.gravity, moment, k, body.arm)
        for name, inertia in self.drives:
            if name in self.system.kinematics.velocity_labels:
                continue  # its y'' is that velocity's own acceleration
            k = self.system.kinematics.loop_coordinates.names.index(name)
            total = total + inertia * self.bend(self.measured, self.later)[k] * self.coordinate_slopes(name)
        flow = self.system.evaluate("states", lambda: self.system.kinematics.state_rates, self.values)
        total[self.n - len(flow) :] = -flow
        return total

    # -- a bare Lagrangian --------------------------------------------------------------------------------------------
    def _momentum(self, values: Values) -> Numbers:
        """dL/dv by central differences; L may be of any form."""
        bare, h = self.system.mechanism.lagrangian, self.mp.mpf(SECOND)
        assert bare is not None
        return array([self._slope("L", bare.expression, name, h, values) for name in self.system.terms.v])

    def _slope(self, label: str, expression: Expr, name: str, h: Number, values: Values) -> Number:
        """Central difference by one symbol."""
        up, down = (
            self.system.evaluate(label, lambda: [expression], values | {name: values[name] + s})[0] for s in (h, -h)
        )
        return (up - down) / (2 * h)

    def _lagrangian_mass(self) -> Numbers:
        h = self.mp.mpf(SECOND)
        columns = []
        for name in self.system.terms.v:
            up, down = (self._momentum(self.values | {name: self.values[name] + s}) for s in (h, -h))
            columns.append((up - down) / (2 * h))
        return array(columns).T

    def _lagrangian_bias(self) -> Numbers:
        bare, h, terms = self.system.mechanism.lagrangian, self.mp.mpf(SECOND), self.system.terms
        assert bare is not None
        drift = (self._momentum(self.later(h)) - self._momentum(self.later(-h))) / (2 * h)
        pull = array([self._slope("L", bare.expression, name, h, self.values) for name in terms.q])
        drag = array([self._slope("D", bare.dissipation, name, h, self.values) for name in terms.v])
        return array(drift - pull - self.system.evaluate("Q", lambda: bare.forces, self.values) + drag)

    # -- constraints --------------------------------------------------------------------------------------------------
    def holonomic(self, values: Values) -> Numbers:
        return self.system.evaluate("constraints", lambda: self.system.terms.constraints, values)

    def rate_rows(self, values: Values) -> Numbers:
        """The nonholonomic rows A v + b."""
        terms = self.system.terms
        return self.system.evaluate(
            "velocity rows", lambda: terms.velocity_constraints[len(terms.constraints) :], values
        )

    @cached_property
    def constraint_jacobian(self) -> Numbers:
        """C_q N (n_c, n_v) by differences of C, and A of nonholonomic rows, by the linearity of A v + b."""
        one, terms = self.mp.mpf(1), self.system.terms
        still = self.values | dict.fromkeys(terms.v, self.zero)
        base = self.rate_rows(still)
        columns = [
            [*self.slope(self.holonomic, partial(self.displaced, j)), *(self.rate_rows(still | {name: one}) - base)]
            for j, name in enumerate(terms.v)
        ]
        return array(columns).reshape(self.n, terms.n_c).T

    @cached_property
    def velocity_rows(self) -> Numbers:
        """C' along the motion."""
        return array([*self.slope(self.holonomic, self.later), *self.rate_rows(self.values)])

    @cached_property
    def gamma(self) -> Numbers:
        """C'' at v' = 0, along the motion."""
        return array([*self.bend(self.holonomic, self.later), *self.slope(self.rate_rows, self.later)])

    def solve(self, rows: Sequence[int]) -> tuple[Numbers, Numbers]:
        """Accelerations and multipliers with the rows given.

        Raises
        ------
        ZeroDivisionError
            The matrix is singular.
        """
        rows = list(rows)
        return solve_constrained(self.mass_matrix, self.constraint_jacobian[rows], self.bias, self.gamma[rows])


def solve_constrained(M: Numbers, C: Numbers, h: Numbers, gamma: Numbers) -> tuple[Numbers, Numbers]:
    """Accelerations and multipliers: [M C^T; C 0] [a; l] = -[h; gamma].

    Raises
    ------
    ZeroDivisionError
        The matrix is singular.
    """
    z = solve(np.block([[M, C.T], [C, np.zeros((len(C), len(C)), dtype=object)]]), -np.concatenate([h, gamma]))
    return z[: len(h)], z[len(h) :]
