"""A state -> the equations of motion there, found again without the derivation.

Of bodies: d'Alembert's principle in Newton's and Euler's equations of every body, with velocities and accelerations
from differences of where the bodies are.  Of a bare Lagrangian: Lagrange's equations by differences of L.  Of given
equations: as they were given.  Constraints: differences of C along the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

from ..elements.frames import GROUND
from . import bodies
from .bodies import Matrix, Pose, Rigid, Twist
from .digits import FIRST, SECOND, Number, Numbers, solve
from .precise_states import PreciseState, PreciseSystem, Values

__all__ = ["PreciseState", "PreciseSystem", "Truth", "Values"]


class Truth(PreciseState):
    """One state of a model; every quantity is found when it is first asked for."""

    # -- bodies -------------------------------------------------------------------------------------------------------
    def poses(self, values: Values) -> list[Pose]:
        """Where the bodies are."""
        return bodies.poses_of(self.system.evaluate("poses", lambda: self.system.terms.poses, values))

    @cached_property
    def here(self) -> list[Pose]:
        """Where the bodies are at the case."""
        return self.poses(self.values)

    @cached_property
    def bodies(self) -> list[Rigid]:
        """The bodies as they were described, at the case."""
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
        """Twists of the bodies in the motion."""
        return self._moving()[0]

    def _moving(self, a: Sequence[Number] | None = None) -> tuple[list[Twist], list[Twist]]:
        """Twists and their rates, in a motion with accelerations a."""
        h = self.mp.mpf(SECOND)
        ahead, behind = self.poses(self.later(h, a)), self.poses(self.later(-h, a))
        ends = list(zip(ahead, behind, self.here, strict=True))
        return [bodies.difference(*x, h) for x in ends], [bodies.second_difference(*x, h) for x in ends]

    def body_rates(self, a: Sequence[Number]) -> list[Twist]:
        """Angular accelerations and accelerations of the origins."""
        return self._moving(a)[1]

    # -- forces -------------------------------------------------------------------------------------------------------
    @cached_property
    def gravity(self) -> Numbers:
        """Acceleration of gravity, ground axes."""
        return self.system.evaluate("gravity", lambda: self.system.mechanism.gravity, self.values)

    def measured(self, values: Values) -> Numbers:
        """Coordinates of cut joints."""
        terms = self.system.terms
        n = terms.sizes.n_loop_coordinates
        return self.system.evaluate("measured", lambda: terms.loop_coordinates[:n], values)

    @cached_property
    def measured_slopes(self) -> list[Numbers]:
        """dy of the coordinates of cut joints in a unit of each velocity: (n_v, n_loop_coordinates)."""
        return [self.slope(self.measured, partial(self.displaced, j)) for j in range(self.n)]

    def coordinate_slopes(self, name: str) -> Numbers:
        """dy/dv' of a joint's coordinate, of the tree or cut."""
        freedoms, cut = self.system.kinematics.velocity_labels, self.system.kinematics.loop_coordinates.names
        if name in freedoms:
            k = freedoms.index(name)
            return [self.mp.mpf(j == k) for j in range(self.n)]
        k = cut.index(name)
        return [row[k] for row in self.measured_slopes]

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
        result = []
        for k, load in enumerate(loads):
            body, nine = load.marker.body, flat[9 * k : 9 * k + 9]
            result.append((body, bodies.times(self.here[body].rotation, nine[:3]), nine[3:6], nine[6:9]))
        return result

    def coordinate_loads(self, remainder: bool = False) -> list[tuple[str, Number]]:
        """Generalized forces along joint coordinates."""
        loads = [
            load
            for terms in self.system.kinematics.forces
            for load in (terms.coordinate_remainder if remainder else terms.coordinate_loads)
        ]
        flat = self.system.evaluate(f"along {remainder}", lambda: [load.value for load in loads], self.values)
        return [(load.coordinate, x) for load, x in zip(loads, flat, strict=True)]

    def applied(self, remainder: bool = False) -> Numbers:
        """Generalized forces of the force elements, by virtual power; those without a potential only if asked."""
        total = [self.zero] * self.n
        for body, arm, force, torque in self.marker_loads(remainder):
            for j in range(self.n):
                w = self.virtual[j][body]
                total[j] += bodies.dot(force, w.at(arm)) + bodies.dot(torque, w.angular)
        for name, value in self.coordinate_loads(remainder):
            total = [f + value * y for f, y in zip(total, self.coordinate_slopes(name), strict=True)]
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
    def mass_matrix(self) -> Matrix:
        """M of the tree."""
        mechanism = self.system.mechanism
        if mechanism.lagrangian is not None:
            return self._lagrangian_mass()
        if mechanism.given is not None:
            lower = mechanism.given.mass_matrix
            flat = self.system.evaluate("given mass", lambda: [x for row in lower for x in row], self.values)
            return [[flat[max(i, j) * self.n + min(i, j)] for j in range(self.n)] for i in range(self.n)]
        M = [[self.zero] * self.n for _ in range(self.n)]
        for i in range(self.n):
            for j in range(i + 1):
                pairs = zip(self.bodies, self.virtual[i], self.virtual[j], strict=True)
                M[i][j] = M[j][i] = sum((b.product(w, z) for b, w, z in pairs if w.moves and z.moves), self.zero)
        for name, inertia in self.drives:
            y = self.coordinate_slopes(name)
            M = [[x + inertia * y[i] * y[j] for j, x in enumerate(row)] for i, row in enumerate(M)]
        for k in range(self.n - len(mechanism.states), self.n):
            M[k][k] = self.mp.mpf(1)
        return M

    @cached_property
    def bias(self) -> Numbers:
        """h of the tree: inertia forces at v' = 0, less gravity, force elements and inputs."""
        mechanism = self.system.mechanism
        if mechanism.lagrangian is not None:
            return self._lagrangian_bias()
        if mechanism.given is not None:
            forcing = mechanism.given.forcing
            return [-x for x in self.system.evaluate("given forcing", lambda: forcing, self.values)]
        rates, total = self.body_rates([self.zero] * self.n), [-f for f in self.applied()]
        for j in range(self.n):
            for body, w, rate, twist in zip(self.bodies, self.virtual[j], rates, self.twists, strict=True):
                if w.moves:
                    weight = body.mass * bodies.dot(self.gravity, w.at(body.arm))
                    total[j] += body.power(w, rate, twist.angular) - weight
        for name, inertia in self.drives:
            if name in self.system.kinematics.velocity_labels:
                continue  # its y'' is that velocity's own acceleration
            k = self.system.kinematics.loop_coordinates.names.index(name)
            bend = self.bend(self.measured, self.later)[k]
            total = [f + inertia * bend * y for f, y in zip(total, self.coordinate_slopes(name), strict=True)]
        flow = self.system.evaluate("states", lambda: self.system.kinematics.state_rates, self.values)
        return [*total[: self.n - len(flow)], *(-s for s in flow)]

    def inverse_dynamics(self, a: Sequence[Number]) -> Numbers:
        """M a + h."""
        return [h + sum((m * x for m, x in zip(row, a, strict=True)), self.zero)
                for row, h in zip(self.mass_matrix, self.bias, strict=True)]  # fmt: skip

    # -- a bare Lagrangian --------------------------------------------------------------------------------------------
    def _lagrange(self, values: Values) -> Number:
        bare = self.system.mechanism.lagrangian
        assert bare is not None
        return self.system.evaluate("L", lambda: [bare.expression], values)[0]

    def _momentum(self, values: Values) -> Numbers:
        """dL/dv by central differences; L may be of any form."""
        h = self.mp.mpf(SECOND)
        up = [self._lagrange(values | {name: values[name] + h}) for name in self.system.terms.v]
        down = [self._lagrange(values | {name: values[name] - h}) for name in self.system.terms.v]
        return [(x - y) / (2 * h) for x, y in zip(up, down, strict=True)]

    def _lagrangian_mass(self) -> Matrix:
        h = self.mp.mpf(SECOND)
        columns = []
        for name in self.system.terms.v:
            ends = [self._momentum(self.values | {name: self.values[name] + s}) for s in (h, -h)]
            columns.append([(x - y) / (2 * h) for x, y in zip(*ends, strict=True)])
        return [list(row) for row in zip(*columns, strict=True)]

    def _lagrangian_bias(self) -> Numbers:
        bare, h = self.system.mechanism.lagrangian, self.mp.mpf(SECOND)
        assert bare is not None
        ahead, behind = (self._momentum(self.later(s)) for s in (h, -h))
        drift = [(x - y) / (2 * h) for x, y in zip(ahead, behind, strict=True)]
        forces = self.system.evaluate("Q", lambda: bare.forces, self.values)
        total = []
        for j, (name, rate) in enumerate(zip(self.system.terms.q, self.system.terms.v, strict=True)):
            ends = [self._lagrange(self.values | {name: self.values[name] + s}) for s in (h, -h)]
            moved = [self.values | {rate: self.values[rate] + s} for s in (h, -h)]
            drag = [self.system.evaluate("D", lambda: [bare.dissipation], values)[0] for values in moved]
            total.append(drift[j] - (ends[0] - ends[1]) / (2 * h) - forces[j] + (drag[0] - drag[1]) / (2 * h))
        return total

    # -- constraints --------------------------------------------------------------------------------------------------
    def holonomic(self, values: Values) -> Numbers:
        """C."""
        return self.system.evaluate("constraints", lambda: self.system.terms.constraints, values)

    def rate_rows(self, values: Values) -> Numbers:
        """The nonholonomic rows A v + b."""
        terms = self.system.terms
        return self.system.evaluate(
            "velocity rows", lambda: terms.velocity_constraints[len(terms.constraints) :], values
        )

    @cached_property
    def constraint_jacobian(self) -> Matrix:
        """C_q N by differences of C, and A of nonholonomic rows, by the linearity of A v + b."""
        one, terms = self.mp.mpf(1), self.system.terms
        still = self.values | dict.fromkeys(terms.v, self.zero)
        base = self.rate_rows(still)
        columns = []
        for j, name in enumerate(terms.v):
            own = self.slope(self.holonomic, partial(self.displaced, j))
            columns.append([*own, *bodies.sub(self.rate_rows(still | {name: one}), base)])
        return [list(row) for row in zip(*columns, strict=True)] if columns else []

    @cached_property
    def velocity_rows(self) -> Numbers:
        """C' along the motion."""
        return [*self.slope(self.holonomic, self.later), *self.rate_rows(self.values)]

    @cached_property
    def gamma(self) -> Numbers:
        """C'' at v' = 0, along the motion."""
        return [*self.bend(self.holonomic, self.later), *self.slope(self.rate_rows, self.later)]

    def solve(self, rows: Sequence[int]) -> tuple[Numbers, Numbers]:
        """Accelerations and multipliers: [M C^T; C 0] [a; l] = -[h; gamma] with the rows given.

        Raises
        ------
        ZeroDivisionError
            The matrix is singular.
        """
        C, n = [self.constraint_jacobian[i] for i in rows], self.n
        matrix = [[*self.mass_matrix[i], *(row[i] for row in C)] for i in range(n)]
        matrix += [[*row, *[self.zero] * len(C)] for row in C]
        right = [[-h] for h in self.bias] + [[-self.gamma[i]] for i in rows]
        z = [x[0] for x in solve(matrix, right)]
        return z[:n], z[n:]
