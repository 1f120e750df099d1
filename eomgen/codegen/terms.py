"""Kinematics, Mobility and TreeEquations -> SystemTerms: all expressions that functions are generated from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial

from ..base.kernel_table import Sizes
from ..base.operations import operations_with
from ..base.texts import acceleration_name
from ..contact.pairs import pair_call
from ..elements.forces.force import where
from ..errors import UsageError
from ..expr.core import Expr, reachable, substitute
from ..expr.notation import rate_of
from ..expr.tensors import combined, total
from ..mechanics import Kinematics
from ..mechanics.closing import shortest_gamma, shortest_rows
from ..mechanics.constraint_functions import row_groups, row_scales
from ..mechanics.kinematics import ForceTerms
from ..mechanics.methods.embedding import can_differentiate
from ..mechanics.methods.recursions import ConstraintRow, TreeMotion
from ..mechanics.methods.tree_equations import TreeEquations
from ..mechanics.mobility import Mobility
from ..mechanics.wrenches import find_wrenches, mass_parents, motion_axes, near_pairs
from .linear_algebra import has_long_paths

Row = tuple[Expr, ...]
LARGEST = 1e300  #: size of a load that still counts as a number


class SystemTerms:
    """A mechanism's equations as expressions of one graph, with the names of their symbols.

    n is the number of velocities, m the number of constraint rows, redundant ones included.  There are as many
    coordinates, with q' = v, but for Euler parameters, where q' = N(q) v.  First-order states are the last of the
    velocities, of unit inertia, and no coordinate's rates.  Quantities at acceleration level use the symbols `a`,
    multipliers do not appear in any expression.

    Where paths to ground are long the mass matrix of a recursive form is made column by column; with loops only in C.
    """

    def __init__(
        self, kinematics: Kinematics, mobility: Mobility, equations: TreeEquations, *, in_c: bool = True
    ) -> None:
        k, c, loop, mechanism = kinematics, kinematics.constraints, kinematics.loop_coordinates, kinematics.mechanism
        #: (n_witnesses,) of q: the lists of pairs of shapes that are near each other
        self.near_pairs: Row = tuple(near_pairs(k))
        states = k.state_names
        recursive = equations.accelerations or (c.labels and equations.constrained and in_c and not states)
        by_columns = recursive and has_long_paths(k.parent)
        self.kinematics = k
        self.graph = k.graph
        self.t = "t"  #: symbol of time
        self.q = k.names  #: coordinates
        self.v = k.velocity_names
        self.a = tuple(map(acceleration_name, k.velocity_names))
        self.multipliers = tuple(f"lambda[{i}]" for i in range(len(c.labels)))
        self.u, self.p = k.input_names, k.parameter_names
        #: (n, n) of q; none where it is made column by column from the inverse dynamics
        self.mass_matrix: tuple[Row, ...] = () if by_columns else equations.mass_matrix
        self.bias = equations.bias  #: (n,) h of (q, v): M a + h = 0 for a tree
        self.inverse_dynamics = equations.inverse_dynamics  #: (n,) M a + h of (q, v, a)
        self.kinetic, self.potential = equations.kinetic_energy, equations.potential_energy
        self.constraints = c.values  #: (m_h,) C of q and t, the holonomic rows, which come first
        #: (m, n) C_q: dC/dq N, and A of the nonholonomic rows A v + b = 0
        self.constraint_jacobian: tuple[Row, ...] = shortest_rows(k)
        self.constraint_rate = c.time_derivative  #: (m,) C_t, the partial derivative by t; b of the nonholonomic rows
        self.velocity_constraints = c.velocity  #: (m,) C_q v + C_t
        self.gamma: Row = shortest_gamma(k)  #: (m,) of (q, v): C'' = C_q a + gamma
        self.poses = _poses(k)  #: homogeneous matrices body -> ground, row-major
        self.outputs = resolved([o.expression for o in mechanism.outputs], k, equations)  #: (n_y,) of (q, v, a)
        #: y, y' and y'' of the coordinates of cut joints, of (q, v, a)
        self.loop_coordinates = (*loop.values, *loop.rates, *loop.accelerations)
        self.loop_coordinate_jacobian: tuple[Row, ...] = loop.jacobian  #: dy/dq
        self.alignment = c.aligned  #: of q: positive unless an axis of a cut joint is flipped
        size = {"length": k.length_scale, "angle": k.graph.one}
        #: (n,) typical size of each coordinate, of parameters only
        self.coordinate_scales: Row = tuple(size[kind] for kind in k.velocity_kinds)
        self.constraint_scales = row_scales(k)  #: (m,) typical size of each row's residual, of parameters only
        self.row_groups = row_groups(k)  #: per row which it is compared with, as the rows of the kinematics; none: all
        self.n_dof = mobility.n_dof  #: degrees of freedom; n - n_dof is the rank of C_q
        #: n_dof indices into v: independent velocities, in the order of v_i
        self.preferred: tuple[int, ...] = independent_places(k, mobility)
        self.parent: tuple[int, ...] = mass_parents(k)
        self.centroidal = _centroidal(k)  #: (18 + 3n,) or none without mass
        self.quaternion_slots = k.quaternion_slots  #: where Euler parameters start in q, their angular velocity in v
        #: whether q' = N(q, t) v + b(q, t) is given; then n_q and n have nothing to do with each other
        self.general_rates = k.general_rates
        #: q' where there are Euler parameters or states, or where it is given
        self.rates: Row = k.rates if k.quaternion_slots or k.general_rates else ()
        self.coordinate_slopes = c.slopes  #: with ``general_rates``: (m_h, n_q) dC/dq
        self.finite_forces: Row = tuple(flag for _, flag in flag_forces(k))
        #: how long a step may be that passes over no contact; penetration, thickness and numbers of the deepest shapes
        self.meeting_times = tuple(_meeting_times(k))
        #: (6 n,) of q, with near pairs: the twist that each velocity causes, at the origin
        self.motion_axes: Row = tuple(motion_axes(k)) if self.near_pairs else ()
        self.accelerations = equations.accelerations  #: (n,) with M a + h = 0, of a method that has it without M
        self.pivots = equations.pivots  #: (n,) of q, with ``accelerations``: positive where M is positive definite
        self.wrenches = find_wrenches(k)  #: what joints exert, formed when it is read
        self.system = equations.system  #: of a method that solves it for the accelerations
        self.turned = equations.turned  #: the tree's system in other velocities, in which it is solved; else None
        #: constraint rows -> a, by articulated bodies; else None
        self.constrained: Callable[..., TreeMotion] | None = equations.constrained if c.labels else None
        self.differentiable = not states and can_differentiate(k)  #: whether ForceSlopes holds
        self.events = resolved([e.expression for e in mechanism.events], k, equations)
        self.resets = resolved([x for _, _, x in resets(k)], k, equations)  #: new values of states after events
        #: of each closed row of constraints that close and open, its error and its rate
        self.held_errors = resolved(list(k.held_errors), k, equations)
        self.canonical = equations.canonical  #: (2n,) of (q, v), by method hamilton: momenta and their rates
        self.projects = c.stabilised is None  #: whether rhs takes the projected state; not with Baumgarte's method
        self.n_states = 0
        if states:
            self._append_states(states, k.state_rates)

    def _append_states(self, names: Sequence[str], rates: Sequence[Expr]) -> None:
        """First-order states of these names and rates (n_s,), of (t, q, v, s, u)."""
        graph, n, count = self.graph, self.n_v, len(names)
        zeros, ones = (graph.zero,) * count, (graph.one,) * count
        self.rates = self.q_dot
        accelerations = tuple(map(acceleration_name, names))
        pairs = list(zip(map(graph.symbol, accelerations), rates, strict=True))
        opposed, left = tuple(-f for f in graph.marked(rates)), tuple(a - f for a, f in graph.marked(pairs))
        if self.mass_matrix or not n:
            unit = ((*[graph.zero] * (n + k), graph.one, *zeros[k + 1 :]) for k in range(count))
            self.mass_matrix = (*((*row, *zeros) for row in self.mass_matrix), *unit)
        if self.centroidal:  # centre (3), its Jacobian (3, n), what follows
            columns = [(*self.centroidal[3 + k * n : 3 + (k + 1) * n], *zeros) for k in range(3)]
            self.centroidal = (*self.centroidal[:3], *sum(columns, ()), *self.centroidal[3 + 3 * n :])
        self.v, self.a = (*self.v, *names), (*self.a, *accelerations)
        self.bias, self.inverse_dynamics = (*self.bias, *opposed), (*self.inverse_dynamics, *left)
        self.constraint_jacobian = tuple((*row, *zeros) for row in self.constraint_jacobian)
        self.loop_coordinate_jacobian = tuple((*row, *zeros) for row in self.loop_coordinate_jacobian)
        self.coordinate_scales = (*self.coordinate_scales, *ones)
        self.n_dof, self.n_states = self.n_dof + count, count
        self.preferred, self.parent = (*self.preferred, *range(n, n + count)), (*self.parent, *[-1] * count)
        self.motion_axes = (*self.motion_axes, *zeros * 6) if self.motion_axes else ()
        self.turned = None
        if self.accelerations is not None:
            self.accelerations, self.pivots = (*self.accelerations, *rates), (*self.pivots, *ones)
        if self.system is not None:  # of which the rates of the states are no unknowns
            self.system = replace(self.system, accelerations=(*self.system.accelerations, *rates))
        if self.constrained is not None:
            self.constrained = partial(_constrained, self.constrained, n, tuple(rates))

    @property
    def n_v(self) -> int:
        """Number of velocities."""
        return len(self.v)

    @property
    def n_c(self) -> int:
        """Number of constraint rows, redundant and nonholonomic ones included."""
        return len(self.constraint_jacobian)

    @cached_property
    def coordinate_of(self) -> tuple[int, ...]:
        """Per velocity the coordinate whose rate it is, -1 for angular velocities of spherical joints and states."""
        return (*self.kinematics.coordinate_of, *[-1] * self.n_states)

    @property
    def q_dot(self) -> Row:
        """q', of (t, q, v)."""
        return self.rates or tuple(map(self.graph.symbol, self.v[: self.n_v - self.n_states]))

    @property
    def has_minimal_form(self) -> bool:
        """Whether positions follow from those of the independent velocities."""
        coordinates = self.coordinate_of
        return (
            not self.general_rates
            and self.n_c == len(self.constraints)
            and all(coordinates[k] >= 0 for k in self.preferred if k < self.n_v - self.n_states)
        )

    @property
    def by_columns(self) -> bool:
        """Whether the mass matrix is not written out: entries would be many, and little needs them."""
        return (self.accelerations or self.constrained) is not None and self.n_v > 0 and not self.mass_matrix

    @cached_property
    def sizes(self) -> Sizes:
        """The sizes that shapes of functions are made of."""
        impacts = any(e.restitution is not None for e in self.kinematics.mechanism.events)
        ruled = not self.general_rates and (impacts or bool(self.resets and self.n_c))
        n_held = len(self.held_errors)
        return Sizes(
            n_q=len(self.q),
            n_v=self.n_v,
            n_x=len(self.q) + self.n_v,
            n_u=len(self.u),
            n_p=len(self.p),
            n_y=len(self.outputs),
            n_c=self.n_c,
            n_h=len(self.constraints),
            n_dof=self.n_dof,
            n_bodies=len(self.poses) // 16,
            n_loop_coordinates=len(self.loop_coordinate_jacobian),
            n_alignments=len(self.alignment),
            n_com=3 if self.centroidal else 0,
            n_finite_forces=len(self.finite_forces),
            n_coordinate_slopes=len(self.coordinate_slopes),
            n_wrenches=self.wrenches.needed_size if self.wrenches else 0,
            n_wrench_geometry=self.wrenches.size if self.wrenches else 0,
            n_momenta=len(self.canonical) // 2,
            n_events=len(self.events),
            n_resets=len(self.resets),
            n_held=n_held,
            # of models whose events change velocities that impulses or constraints rule
            n_strike=2 * self.n_v + self.n_c + len(self.events) + n_held // 2 if ruled else 0,
            n_states=self.n_states,
            n_witnesses=len(self.near_pairs),
            n_dae=len(self.q) + self.n_v + self.n_c + len(self.constraints),
        )

    @property
    def input_rates(self) -> list[tuple[str, str]]:
        """Inputs with the input that is their rate."""
        return [(name, rate_of(name)) for name in self.u if rate_of(name) in self.u]

    def symbols(self, names: Sequence[str]) -> list[Expr]:
        """Symbols by their names."""
        return list(map(self.graph.symbol, names))

    @cached_property
    def ports(self) -> Mapping[str, tuple[str, ...]]:
        """Names of symbols by the name of the port."""
        independent, coordinate_of = self.preferred, self.coordinate_of
        corrections = tuple(f"correction[{i}]" for i in range(len(self.constraints)))
        changed = {"dq": self.q, "dv": self.v, "du": self.u, "dp": self.p, "da": self.a}
        rates = {"q_rate": self.q, "multiplier_rates": self.multipliers, "correction_rates": corrections}
        return {
            "q": self.q,
            "v": self.v,
            "a": self.a,
            "q_i": tuple(self.q[coordinate_of[i]] for i in independent if i < self.n_v - self.n_states),
            "v_i": tuple(self.v[i] for i in independent),
            "a_i": tuple(self.a[i] for i in independent),
            "q_guess": tuple(f"guess({q})" for q in self.q),
            "multipliers": self.multipliers,
            "z": self.system.unknowns if self.system else (),
            "corrections": corrections,
            "cj": ("cj",),
            "impulses": tuple(f"impulse[{i}]" for i in range(len(self.events))),
            "held_impulses": tuple(f"held_impulse[{i}]" for i in range(len(self.held_errors) // 2)),
            **{port: tuple(f"d({name})" for name in names) for port, names in changed.items()},
            **{port: tuple(f"rate({name})" for name in names) for port, names in rates.items()},
        }

    def _with_multipliers(self, forces: Sequence[Expr]) -> list[Expr]:
        forces = list(forces)
        for row, l in zip(self.constraint_jacobian, map(self.graph.symbol, self.multipliers), strict=True):
            forces = [r + c * l for r, c in zip(forces, row, strict=True)]
        return forces

    @cached_property
    def constraint_forces(self) -> list[Expr]:
        """C_q^T l (n,)."""
        return self._with_multipliers([self.graph.zero] * self.n_v)

    @cached_property
    def force_residual(self) -> list[Expr]:
        """r1 = M a + h + C_q^T l (n,)"""
        return self._with_multipliers(self.inverse_dynamics)

    @cached_property
    def acceleration_residual(self) -> list[Expr]:
        """r2 = C_q a + gamma (m,)"""
        a = self.symbols(self.a)
        return [combined(r, row, a) for row, r in zip(self.constraint_jacobian, self.gamma, strict=True)]


def _constrained(
    solve: Callable[..., TreeMotion],
    n: int,
    rates: Sequence[Expr],
    rows: Sequence[ConstraintRow] = (),
    term: float = 0.0,
    loaded: bool = True,
    forces: Sequence[Expr] | None = None,
) -> TreeMotion:
    """The accelerations by articulated bodies and the rates of the states, which no constraint holds."""
    moving = [replace(row, entries={k: x for k, x in row.entries.items() if k < n}) for row in rows]
    result = solve(moving, term, loaded=loaded, forces=None if forces is None else forces[:n])
    graph = rates[0].graph
    unloaded = [graph.zero] * len(rates) if forces is None else forces[n:]
    return result._replace(
        accelerations=(*result.accelerations, *(rates if loaded else unloaded)),
        pivots=(*result.pivots, *(graph.one,) * len(rates)),
    )


def independent_places(kinematics: Kinematics, mobility: Mobility) -> tuple[int, ...]:
    """Places of the independent velocities."""
    return tuple(kinematics.velocity_labels.index(n) for n in mobility.independent)


def flag_forces(kinematics: Kinematics) -> list[tuple[str, Expr]]:
    """Names of the elements whose loads need not be finite, and flags of (t, q, v, u): 1 where they are, else 0."""
    result = []
    for terms in kinematics.forces:
        size = _size(terms)
        if size is not None:
            finite = size.graph.apply("lt", size, LARGEST)  # false for what is not a number
            result.append((terms.force.name, finite))
    return result


def _size(terms: ForceTerms) -> Expr | None:
    """Sum of the sizes of all entries, None if it is finite wherever the state is."""
    entries: list[Expr] = []
    for load in terms.marker_loads:
        entries += [*load.force, *load.torque]
    entries += [load.value for load in terms.coordinate_loads]
    if not entries:
        return None
    graph = entries[0].graph
    fragile = operations_with(lambda row: row.fragile)
    operations = {str(graph.nodes[i][0]) for i in reachable(graph, [e.id for e in entries])}
    if operations.isdisjoint(fragile) and not any(pair_call(graph, operation) for operation in operations):
        return None
    return total(graph.apply("abs", entry) for entry in entries)


def resets(kinematics: Kinematics) -> list[tuple[int, int, Expr]]:
    """Event, state and its new value, of all resets."""
    names = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    places = {name: k for k, name in enumerate(names)}
    result: list[tuple[int, int, Expr]] = []
    for i, event in enumerate(kinematics.mechanism.events):
        for name, value in (dict(event.reset) | dict(kinematics.velocities_after.get(event.name, ()))).items():
            if name not in places:
                raise UsageError(
                    f"events.{event.name}.reset: {name!r} belongs to a joint that is cut and follows from the others; "
                    f"reset {', '.join(places)}",
                    code="EG-EVENT",
                )
            result.append((i, places[name], value))
    return result


def resolved(unresolved: Sequence[Expr], kinematics: Kinematics, equations: TreeEquations) -> Row:
    """Expressions in terms of the tree's q, v, a."""
    expressions = kinematics.resolve(unresolved)
    graph = kinematics.graph
    energies = {
        graph.symbol("kinetic_energy()"): equations.kinetic_energy,
        graph.symbol("potential_energy()"): equations.potential_energy,
        graph.symbol("total_energy()"): equations.kinetic_energy + equations.potential_energy,
    }
    source = kinematics.mechanism.given
    if source is not None and source.multipliers:
        from .reactions import multiplier_values

        energies |= multiplier_values(source.multipliers, kinematics, equations)
    return tuple(substitute(expressions, energies))


def _meeting_times(kinematics: Kinematics) -> list[Expr]:
    """How long a step may be that passes over no contact, and the deepest two shapes, if there are such contacts."""
    total: list[Expr] = []
    start = 0
    for force in kinematics.mechanism.forces:
        shapes = force.met_shapes()
        if not shapes:
            continue
        time, depth, thickness, *pair = force.meeting(kinematics.motion)
        mine = [time, depth, thickness, *(start + number for number in pair)]
        start += len(shapes)
        if total:
            deeper = time.graph.apply("lt", total[1], depth)
            rest = [where(deeper, new, old) for new, old in zip(mine[1:], total[1:], strict=True)]
            mine = [time.graph.apply("min", total[0], time), *rest]
        total = mine
    return kinematics.resolve(total)


def _centroidal(kinematics: Kinematics) -> Row:
    """Centre of mass, its Jacobian, momenta and inertia of a mechanism that has mass, ground axes."""
    total = kinematics.motion.momentum
    if total.mass.is_zero:
        return ()
    rows = [*total.jacobian(len(kinematics.v)), total.linear, total.angular, *total.inertia]
    return (*total.centre, *(x for row in rows for x in row))


def _poses(kinematics: Kinematics) -> Row:
    """Body frames in ground axes as 4 x 4 matrices, row by row, in the order the bodies were declared."""
    graph = kinematics.graph
    entries: list[Expr] = []
    for k in range(len(kinematics.mechanism.bodies)):
        pose = kinematics.poses.marker(kinematics.motion.body(k))
        for row, x in zip(pose.rotation, pose.position, strict=True):
            entries += [*row, x]
        entries += [graph.zero, graph.zero, graph.zero, graph.one]
    return tuple(entries)
