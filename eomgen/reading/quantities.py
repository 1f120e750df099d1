"""Kinematics, Mobility, TreeEquations -> each quantity of the equations as expressions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

from ..elements.frames import GROUND, Frame, Marker
from ..errors import UnavailableError
from ..expr import vectors as vec
from ..expr.core import Expr, substitute, symbols_of
from ..expr.differentiate import gradient, jacobian, vjp
from ..expr.evaluate import evaluate
from ..expr.schedule import count
from ..expr.tensors import solve_symmetric
from ..expr.vectors import Vec3
from ..mechanics import Kinematics
from ..mechanics.methods import METHODS
from ..mechanics.methods.reduction import LoopNames, VelocityTransformation, transform_velocities
from ..mechanics.methods.tree_equations import TreeEquations
from ..mechanics.mobility import Mobility
from ..mechanics.wrenches import potential_energy, virtual_power
from ..model.equations import differentiate
from .symbols import momentum_names, multiplier_names, twist_rate_names, wrench_names

# -- generalized forces ------------------------------------------------------------------------------------------------

# Q of a force element is found by virtual power, Q = sum F . dv/dv_j; where the element has a potential V, also as
# -dV/dq and the virtual power of the rest.  Of the two, the one with fewer operations is taken.


GRAVITY = "gravity"  #: name of the entry of gravity


def forces_by_element(kinematics: Kinematics) -> dict[str, list[Expr]]:
    """Generalized forces (n_v,) on the tree, by the name of the force element; of gravity where there is any.

    An element that is itself called ``gravity`` keeps its name; gravity is ``gravity_field`` then.  A bare Lagrangian
    has the entries ``potential`` (-dV/dq), ``forces`` and ``dissipation``, those of them that do not vanish.
    """
    if kinematics.mechanism.lagrangian is not None:
        return _of_lagrangian(kinematics)
    result: dict[str, list[Expr]] = {}
    names = {terms.force.name for terms in kinematics.forces}
    if not all(x.is_zero for x in kinematics.mechanism.gravity):
        height = potential_energy(replace(kinematics, forces=()))
        result[GRAVITY if GRAVITY not in names else f"{GRAVITY}_field"] = _downhill(kinematics, height)
    for terms in kinematics.forces:
        force = virtual_power(kinematics, (*terms.marker_loads, *terms.coordinate_loads))
        if terms.potential is not None:
            rest = virtual_power(kinematics, (*terms.marker_remainder, *terms.coordinate_remainder))
            slope = _downhill(kinematics, terms.potential)
            other = [a + b for a, b in zip(slope, rest, strict=True)]
            force = min(other, force, key=lambda forces: count(forces).total)
        result[terms.force.name] = force
    return result


def _of_lagrangian(kinematics: Kinematics) -> dict[str, list[Expr]]:
    bare, equations = kinematics.mechanism.lagrangian, kinematics.mechanism.given
    assert bare is not None
    assert equations is not None
    drag = gradient(bare.dissipation, list(kinematics.v))
    result = {
        "potential": _downhill(kinematics, equations.potential_energy),
        "forces": list(bare.forces),
        "dissipation": [-d for d in drag],
    }
    return {name: force for name, force in result.items() if not all(x.is_zero for x in force)}


def _downhill(kinematics: Kinematics, potential: Expr) -> list[Expr]:
    """-dV/dq along the velocities: -N^T dV/dq where q' = N v."""
    slope = [-x for x in gradient(potential, list(kinematics.q))]
    if kinematics.rates == kinematics.v:
        return slope
    return vjp(list(kinematics.rates), slope, list(kinematics.v))


def without_forces(kinematics: Kinematics) -> Kinematics:
    """The same motion with no gravity and no force element; of a bare Lagrangian, the equations of L without V."""
    mechanism, graph = kinematics.mechanism, kinematics.graph
    bare, equations = mechanism.lagrangian, mechanism.given
    if bare is not None and equations is not None:
        still = tuple(graph.zero for _ in bare.forces)
        moving = bare.expression + equations.potential_energy
        equations = differentiate(
            graph, replace(bare, expression=moving, forces=still, dissipation=graph.zero), kinematics.time_direction
        )
    forced = replace(mechanism, gravity=vec.zero(graph), forces=(), given=equations)
    return replace(kinematics, mechanism=forced, forces=())


# -- entries of rotations ----------------------------------------------------------------------------------------------


FEW = 600  #: operations up to which expressions are shorter to read without these names


def name_rotations(kinematics: Kinematics, expressions: Sequence[Expr]) -> tuple[list[Expr], list[tuple[str, Expr]]]:
    """Expressions in which nodes of one function are one, and names that stand in long ones for rotations.

    The rotation of a joint in Euler parameters is R; of several joints, R_<joint>.
    """
    turning = [
        (kinematics.mechanism.joints[branch.joint].name, link.joint_rotation)
        for branch, link in zip(kinematics.topology.branches, kinematics.links, strict=True)
        if kinematics.mechanism.joints[branch.joint].joint.quaternion_slots
    ]
    stems = [f"R_{joint}_" if len(turning) > 1 else "R_" for joint, _ in turning]
    entries = [
        (f"{stem}{i + 1}{j + 1}", rotation[i][j])
        for stem, (_, rotation) in zip(stems, turning, strict=True)
        for i in range(3)
        for j in range(3)
    ]
    values = [x for _, x in entries]
    from ..expr.simplify import joined_nodes  # nothing is simplified until equations are read

    joined, _ = joined_nodes([*expressions, *values], (), kinematics.euler_parameters)
    whole, values = joined[: len(expressions)], joined[len(expressions) :]
    if not entries:
        return whole, []
    from ..expr.sympy_bridge import inlined_size

    if inlined_size(whole) <= FEW:
        return whole, []
    taken = symbols_of(whole)
    graph = whole[0].graph
    named = {x: name for (name, _), x in zip(entries, values, strict=True) if len(x.node) > 2 and name not in taken}
    result = substitute(whole, {x: graph.symbol(name) for x, name in named.items()})
    used = symbols_of(result)
    return result, [(name, x) for x, name in named.items() if name in used]


# -- expressions in SymPy ----------------------------------------------------------------------------------------------

# Everything that a user reads as SymPy comes through ``Readable.in_sympy``.


READABLE = 400  #: operations an expression, on average, up to which expressions are written out
LONGEST = 5_000  #: operations of all of them together


class Formed(NamedTuple):
    """Expressions of a quantity, None or names that stand in them with values, in order, and what else is known."""

    flat: Sequence[Expr]
    named: Sequence[tuple[str, Expr]] | None = None
    extra: Any = None


class Written(NamedTuple):
    """SymPy expressions, with the named parts that they use, each after those that it uses."""

    intermediates: list[tuple[Any, Any]]
    expressions: list[Any]


def is_short(expressions: Sequence[Expr]) -> bool:
    """Whether expressions are written out whole."""
    from ..expr.sympy_bridge import inlined_size

    several = {x.id: x for x in expressions if x.value is None}
    return inlined_size(expressions) <= min(READABLE * len(several), LONGEST)


def needed(named: Sequence[tuple[Any, Any]], value: Any) -> list[tuple[Any, Any]]:
    """The named parts that a value uses, and those that these use."""
    wanted = set(value.free_symbols)
    result = []
    for symbol, expression in reversed(list(named)):
        if symbol in wanted:
            result.append((symbol, expression))
            wanted |= expression.free_symbols
    return result[::-1]


def with_derivatives(expression: Any) -> Any:
    """With sqrt(x^2) for |x|: SymPy takes names for complex numbers, of which |x| has no derivative."""
    import sympy

    if not expression.has(sympy.Abs):
        return expression
    return expression.replace(sympy.Abs, lambda x: sympy.sqrt(x**2))


# -- quantities --------------------------------------------------------------------------------------------------------

# What is of the size of the degrees of freedom is embedded with B of v = B v_i + b (Shabana, Computational Dynamics,
# sec. 5.7): M = B^T M_t B, Q = B^T Q_t, Q_v = B^T (Q_v,t - M_t a), so that M v_i' = Q_v + Q.


Row = tuple[Expr, ...]
Rows = tuple[Row, ...]


def require_bodies(kinematics: Kinematics) -> None:
    """Raise if the model has no bodies."""
    if kinematics.mechanism.bare:
        kind = "a Lagrangian" if kinematics.mechanism.lagrangian is not None else "given equations"
        raise UnavailableError(
            f"there are no bodies: the model is {kind}; describe it by bodies and joints to have their motion"
        )


class SpatialMotion(NamedTuple):
    """Velocity or acceleration of a body or marker in ground axes; of equations SymPy columns (3, 1).

    Attributes
    ----------
    angular : sympy.Matrix
        Angular velocity (rad/s) or acceleration (rad/s^2).
    linear : sympy.Matrix
        Of the origin of the body or marker (m/s, m/s^2).
    center_of_mass : sympy.Matrix
        Of the centre of mass of the body (m/s, m/s^2).
    """

    angular: Any
    linear: Any
    center_of_mass: Any


class BlockSystem(NamedTuple):
    """A linear system of a method: ``matrix * unknowns = right``; of equations SymPy matrices.

    Attributes
    ----------
    matrix : sympy.Matrix
        (n, n)
    unknowns : sympy.Matrix
        (n, 1), accelerations, reactions and multipliers.
    right : sympy.Matrix
        (n, 1)
    """

    matrix: Any
    unknowns: Any
    right: Any


class Quantities:
    """Every quantity of one derivation, in a graph of its own, each formed when first used."""

    def __init__(self, kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> None:
        self.kinematics, self.mobility, self.tree = kinematics, mobility, tree
        self.graph = kinematics.graph

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Numbers of parameters, inputs and t by which pivots are judged; made up where a parameter has none."""
        m = self.kinematics.mechanism
        values = {p.name: 1.0 + 0.1 * k if p.value is None else p.value for k, p in enumerate(m.parameters)}
        return values | {u.name: u.value for u in m.inputs} | {"t": 0.0}

    @property
    def numbers_elsewhere(self) -> dict[str, float]:
        """The same with a position that is not the reference, where coordinates may be singular."""
        places = enumerate(zip(self.kinematics.names, self.mobility.q_reference, strict=True))
        return self.numbers | {name: x + 0.3 + 0.1 * k for k, (name, x) in places}

    # -- energies ---------------------------------------------------------------------------------------------------
    def _require_energy(self, what: str, keys: tuple[str, ...]) -> None:
        """Refuse energies of given equations of which none of the keys was given."""
        written = self.kinematics.mechanism.written
        if written is not None and all(getattr(written, key).is_zero for key in keys):
            raise UnavailableError(
                f"{what} is not known: the equations are given without {keys[0]}; give equations.{keys[0]}"
            )

    @property
    def T(self) -> Expr:
        """T (J)."""
        self._require_energy("T", ("kinetic_energy",))
        return self.tree.kinetic_energy

    @property
    def V(self) -> Expr:
        """V of gravity and springs (J); of given equations with kinetic energy alone 0, as it is compiled."""
        self._require_energy("V", ("potential_energy", "kinetic_energy"))
        return self.tree.potential_energy

    @property
    def lagrangian(self) -> Expr:
        """L = T - V; of a bare Lagrangian what was given."""
        self._require_energy("the Lagrangian", ("kinetic_energy",))
        bare = self.kinematics.mechanism.lagrangian
        return bare.expression if bare is not None else self.T - self.V

    @cached_property
    def momenta(self) -> Row:
        """p = dL/dv (n_v,)."""
        self._require_energy("the momentum", ("kinetic_energy",))
        return tuple(gradient(self.lagrangian, list(self.kinematics.v)))

    # -- equations of motion ------------------------------------------------------------------------------------------
    @cached_property
    def equations(self) -> TreeEquations:
        """M and h of the tree as they are read: by the embedding technique, which forms them shortest.

        They are the same functions by every method; what else a method has is taken from its own equations.
        """
        return self.tree if self.kinematics.mechanism.bare else METHODS["embedding"](self.kinematics)

    @cached_property
    def transformation(self) -> VelocityTransformation:
        """v = B v_i + b, v' = B v_i' + a."""
        return transform_velocities(self.kinematics, self.mobility, self.numbers)

    @cached_property
    def motion(self) -> tuple[list[Expr], list[tuple[str, Expr]]]:
        """M row by row and M v_i'; names for rotations or for what loops give that stand in long ones, with values."""
        whole = [*(x for row in self.mass_matrix for x in row), *self.force]
        whole, rotations = name_rotations(self.kinematics, whole)
        if not self._embeds or is_short(whole):
            return whole, rotations
        names = LoopNames(self.kinematics, self.mobility.independent)  # of entries of B and a, as the book writes it
        B = transform_velocities(self.kinematics, self.mobility, self.numbers, names)
        mass, right = self.equations.mass_matrix, [-h for h in self.equations.bias]
        return [*(x for row in B.mass_matrix(mass) for x in row), *B.force(mass, right)], names.parts

    @cached_property
    def mass_matrix(self) -> Rows:
        """M (n_dof, n_dof)."""
        mass = self.equations.mass_matrix
        return self.transformation.mass_matrix(mass) if self._embeds else mass

    @cached_property
    def force(self) -> Row:
        """M v_i' (n_dof,), quadratic velocity terms and generalized forces."""
        return self.embedded_force([-h for h in self.equations.bias])

    @property
    def _embeds(self) -> bool:
        return self.mobility.n_dof != len(self.kinematics.v)

    def embedded_force(self, right: Sequence[Expr]) -> Row:
        """B^T (Q - M a) of forces Q on the tree."""
        return self.transformation.force(self.equations.mass_matrix, right) if self._embeds else tuple(right)

    def along_independent(self, row: Sequence[Expr]) -> Row:
        """B^T x: derivatives by the velocities of the tree -> by the independent ones."""
        return self.transformation.project(row) if self._embeds else tuple(row)

    def _require_separate(self, what: str) -> None:
        if self.kinematics.mechanism.written is not None:
            raise UnavailableError(
                f"{what} are not known separately: for equations of your own only their sum is, force"
            )

    @cached_property
    def tree_quadratic_velocity(self) -> Row:
        """Q_v on the tree (n_v,): what is left of -h without gravity and force elements."""
        self._require_separate("quadratic velocity terms")
        method = "embedding" if self.kinematics.mechanism.lagrangian is None else "lagrange"
        return tuple(-h for h in METHODS[method](without_forces(self.kinematics)).bias)

    @cached_property
    def quadratic_velocity(self) -> Row:
        """Q_v (n_dof,): Coriolis, centrifugal and gyroscopic terms, and what prescribed motions ask for."""
        return self.embedded_force(self.tree_quadratic_velocity)

    @cached_property
    def forces(self) -> dict[str, Row]:
        """Generalized forces (n_dof,) by force element."""
        self._require_separate("generalized forces")
        return {name: self.along_independent(force) for name, force in forces_by_element(self.kinematics).items()}

    @cached_property
    def total_force(self) -> Row:
        """Generalized forces (n_dof,) of all elements."""
        total = [self.graph.zero] * self.mobility.n_dof
        for force in self.forces.values():
            total = [a + b for a, b in zip(total, force, strict=True)]
        return tuple(total)

    @property
    def sampled_values(self) -> Row:
        """What sampled states become."""
        return tuple(x for _, x in self.kinematics.sampled)

    # -- constraints --------------------------------------------------------------------------------------------------
    @property
    def rows(self) -> tuple[int, ...]:
        """The constraint equations that count; redundant ones are left out."""
        return self.mobility.independent_rows

    @property
    def constraints(self) -> Row:
        """C(q, t) of the holonomic equations (m)."""
        c = self.kinematics.constraints
        return tuple(c.values[i] for i in self.rows if i < len(c.values))

    @property
    def constraint_jacobian(self) -> Rows:
        """C_q (n_c, n_v), nonholonomic equations last."""
        return tuple(self.kinematics.constraints.jacobian[i] for i in self.rows)

    @property
    def velocity_constraints(self) -> Row:
        """C' = C_q v + C_t (n_c,)."""
        return tuple(self.kinematics.constraints.velocity[i] for i in self.rows)

    @property
    def gamma(self) -> Row:
        """gamma of C'' = C_q v' + gamma (n_c,)."""
        return tuple(self.kinematics.constraints.gamma[i] for i in self.rows)

    # -- motion of bodies and markers ---------------------------------------------------------------------------------
    @cached_property
    def markers(self) -> dict[str, Marker]:
        """Bodies by name, at their origins, and named markers as ``rod.tip``."""
        mechanism = self.kinematics.mechanism
        bodies = {body.name: self.kinematics.motion.body(k) for k, body in enumerate(mechanism.bodies)}
        return bodies | {marker.label: marker for marker in mechanism.presentation.named_markers}

    def pose(self, name: str) -> Rows:
        """Placement of a body or marker in ground axes (4, 4)."""
        frame = self.kinematics.poses.marker(self.markers[name])
        o, i = self.graph.zero, self.graph.one
        rows = zip(frame.rotation, frame.position, strict=True)
        return (*((*row, x) for row, x in rows), (o, o, o, i))

    def velocity(self, name: str) -> SpatialMotion:
        """Velocity of a body or marker, ground axes."""
        marker = self.markers[name]
        angular = self.kinematics.motion.angular_velocity(marker)
        return SpatialMotion(angular, self._velocity(marker), self._velocity(self._centre(marker)))

    def acceleration(self, name: str) -> SpatialMotion:
        """Acceleration of a body or marker, ground axes."""
        marker = self.markers[name]
        turning = self.kinematics.motion.turning_of(marker, own_axes=False, rate=True)
        linear, centre = (self._rate(self._velocity(m)) for m in (marker, self._centre(marker)))
        return SpatialMotion(turning, linear, centre)

    def _velocity(self, marker: Marker) -> Vec3:
        """Velocity of a marker's origin: the rate of its position or, where that is longer, from the body's twist."""
        motion = self.kinematics.motion
        return min(self._rate(motion.position(marker)), motion.velocity(marker), key=lambda x: count(x).total)

    def _rate(self, values: Vec3) -> Vec3:
        x, y, z = self.kinematics.total_derivative(values)
        return x, y, z

    def _centre(self, marker: Marker) -> Marker:
        """The centre of mass of the marker's body."""
        if marker.body == GROUND:
            return marker
        body = self.kinematics.mechanism.bodies[marker.body]
        return Marker(marker.body, Frame(vec.identity(self.graph), body.com), body.name)

    @property
    def loop_coordinates(self) -> dict[str, Expr]:
        """Coordinates of cut joints as functions of the tree's."""
        loop = self.kinematics.loop_coordinates
        return dict(zip(loop.names, loop.values, strict=True))

    # -- of single methods --------------------------------------------------------------------------------------------
    def require_method(self, what: str, *methods: str) -> None:
        """Refuse a quantity of other methods, which the message lists."""
        if self.tree.method not in methods:
            have = " or ".join(repr(name) for name in methods)
            raise UnavailableError(f"method {self.tree.method!r} has no {what}; derive the model with method={have}")

    @property
    def gibbs_function(self) -> Expr:
        """S = v' . M v' / 2 - Q_v . v' on the tree, the energy of acceleration less what has no accelerations."""
        self.require_method("function of Gibbs and Appell", "gibbs_appell")
        a, mass = self.kinematics.a, self.equations.mass_matrix
        total = self.graph.zero
        for i, x in enumerate(a):
            row = 0.5 * mass[i][i] * x - self.tree_quadratic_velocity[i]
            for j in range(i):
                row = row + mass[i][j] * a[j]
            total = total + row * x
        return total

    @property
    def hamiltonian(self) -> Expr:
        """H = (p - b) . M^-1 (p - b) / 2 - T_0 + V with T = v . M v / 2 + b . v + T_0 (Goldstein, sec. 8.1)."""
        self.require_method("Hamiltonian", "hamilton")
        kinematics, tree, graph = self.kinematics, self.tree, self.graph
        names = momentum_names(kinematics)
        momenta = [graph.symbol(name) for name in names]
        still = dict.fromkeys(kinematics.v, graph.zero)
        *linear, at_rest = substitute([*self.momenta, tree.kinetic_energy], still)
        moved = [p - b for p, b in zip(momenta, linear, strict=True)]
        total = graph.zero
        for x, rate in zip(moved, solve_symmetric(self.equations.mass_matrix, moved), strict=True):
            total = total + x * rate
        result = 0.5 * total - at_rest + tree.potential_energy
        if not math.isfinite(float(evaluate([result], self.numbers_elsewhere | dict.fromkeys(names, 1.0))[0])):
            raise UnavailableError(
                "the mass matrix of the spanning tree has no inverse, so that H is no function of the momenta; give "
                "every body a mass and an inertia"
            )
        return result

    @property
    def momentum_rates(self) -> Row:
        """p' = -dH/dq + Q (n_v,) in terms of q and v, without the forces of constraints."""
        self.require_method("rates of momenta", "hamilton")
        return self.tree.canonical[len(self.kinematics.v) :]

    @property
    def block_system(self) -> BlockSystem:
        """The system that the method solves for accelerations and reactions.

        ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma], redundant constraints left out.
        """
        self.require_method("block system", "augmented", "newton_euler", "amalgamated")
        kinematics, system, zero = self.kinematics, self.tree.system, self.graph.zero
        if self.tree.method == "augmented" or system is None:
            C, equations = self.constraint_jacobian, self.equations
            upper = [(*row, *(line[i] for line in C)) for i, row in enumerate(equations.mass_matrix)]
            lower = [(*line, *(zero for _ in C)) for line in C]
            unknowns = (*(str(a.node[1]) for a in kinematics.a), *multiplier_names(kinematics, len(self.rows)))
            return BlockSystem((*upper, *lower), unknowns, (*(-h for h in equations.bias), *(-g for g in self.gamma)))
        rows = [[zero] * len(system.unknowns) for _ in system.right]
        for (i, j), entry in zip(system.places, system.entries, strict=True):
            rows[i][j] = entry
        return BlockSystem(tuple(map(tuple, rows)), self._unknown_names(len(system.unknowns)), system.right)

    def _unknown_names(self, count: int) -> tuple[str, ...]:
        """Names of the unknowns of newton_euler and amalgamated, in the order of the system.

        Of each body ``rod_alpha_x`` .. and ``rod_a_x`` .., the rates of its twist in the axes of its joint, gravity
        subtracted; of amalgamated also the accelerations of the joint; of its joint ``A_M_x`` .. and ``A_F_x`` .., the
        wrench on the body at the joint; then the multipliers.
        """
        kinematics = self.kinematics
        names: list[str] = []
        for link, branch in zip(kinematics.links, kinematics.topology.branches, strict=True):
            rates = [str(kinematics.a[link.first + c].node[1]) for c in range(len(link.columns))]
            names += twist_rate_names(kinematics, link.name)
            names += rates if self.tree.method == "amalgamated" else []
            names += wrench_names(kinematics, kinematics.mechanism.joints[branch.joint].name)
        return (*names, *multiplier_names(kinematics, count - len(names)))

    @property
    def body_velocity_transformation(self) -> Rows:
        """B_b (6 n_b, n_dof) of M = B_b^T M_b B_b (Shabana, sec. 5.7).

        The six velocities of a body are that of its centre of mass in ground axes, then its angular velocity in body
        axes.
        """
        require_bodies(self.kinematics)
        motion, v = self.kinematics.motion, list(self.kinematics.v)
        velocities: list[Expr] = []
        for body in self.kinematics.mechanism.bodies:
            velocities += self.velocity(body.name).center_of_mass
            velocities += motion.turning_of(self.markers[body.name], own_axes=True, rate=False)
        entries = jacobian(velocities, v)
        rows = [[entries.get((i, j), self.graph.zero) for j in range(len(v))] for i in range(len(velocities))]
        return tuple(self.along_independent(row) for row in rows)

    @property
    def body_mass_matrix(self) -> Rows:
        """M_b (6 n_b, 6 n_b), mass and inertia body by body."""
        require_bodies(self.kinematics)
        bodies = self.kinematics.mechanism.bodies
        mass = [[self.graph.zero] * (6 * len(bodies)) for _ in range(6 * len(bodies))]
        for k, body in enumerate(bodies):
            for i in range(3):
                mass[6 * k + i][6 * k + i] = body.mass
                mass[6 * k + 3 + i][6 * k + 3 : 6 * k + 6] = body.inertia[i]
        return tuple(map(tuple, mass))
