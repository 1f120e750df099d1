"""All expressions and names that functions are generated from: SystemTerms, and the symbols of each port."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from ..equations.articulated import ConstraintRow, TreeMotion
from ..equations.tree_equations import LinearSystem
from ..equations.tree_slopes import ForceSlopes
from ..errors import UsageError
from ..graph.core import Expr, Graph
from ..kinematics.link_axes import Turned
from ..kinematics.state import acceleration_name
from ..kinematics.wrenches import JointWrenches
from ..records import dataclass

Row = tuple[Expr, ...]


@dataclass(frozen=True)
class SystemTerms:
    """A mechanism's equations as expressions of one graph, with the names of their symbols.

    n is the number of velocities, m the number of constraint rows, redundant ones included.  There are as many
    coordinates, with q' = v, but for Euler parameters, where q' = N(q) v.  Quantities at acceleration level use the
    symbols `a`, multipliers do not appear in any expression.
    """

    graph: Graph
    t: str  #: symbol of time
    q: tuple[str, ...]  #: n coordinates, and one more for each ball
    v: tuple[str, ...]  #: n velocities
    a: tuple[str, ...]  #: n accelerations
    multipliers: tuple[str, ...]  #: m names for the multipliers, one per row
    u: tuple[str, ...]  #: inputs
    p: tuple[str, ...]  #: parameters

    mass_matrix: tuple[Row, ...]  #: (n, n) of q; none where it is made column by column from the inverse dynamics
    bias: Row  #: (n,) h of (q, v): M a + h = 0 for a tree
    inverse_dynamics: Row  #: (n,) M a + h of (q, v, a)
    kinetic: Expr  #: T of (q, v)
    potential: Expr  #: V of q

    constraints: Row  #: (m_h,) C of q and t, the holonomic rows, which come first
    constraint_jacobian: tuple[Row, ...]  #: (m, n) C_q: dC/dq N, and A of the nonholonomic rows A v + b = 0
    constraint_rate: Row  #: (m,) C_t, the partial derivative by t; b of the nonholonomic rows
    velocity_constraints: Row  #: (m,) C_q v + C_t
    gamma: Row  #: (m,) of (q, v): C'' = C_q a + gamma

    poses: Row  #: (16 * bodies,) homogeneous matrices body -> ground, row-major
    outputs: Row  #: (n_y,) of (q, v, a)
    loop_coordinates: Row  #: (3 n_loop_coordinates,) y, y' and y'' of the coordinates of cut joints, of (q, v, a)
    loop_coordinate_jacobian: tuple[Row, ...]  #: (n_loop_coordinates, n) dy/dq
    alignment: Row  #: (n_alignments,) of q: positive unless an axis of a cut joint is flipped

    coordinate_scales: Row  #: (n,) typical size of each coordinate, of parameters only
    constraint_scales: Row  #: (m,) typical size of each row's residual, of parameters only
    n_dof: int  #: degrees of freedom; n - n_dof is the rank of C_q
    preferred: tuple[int, ...]  #: n_dof indices into v: independent velocities, in the order of v_i
    parent: tuple[int, ...]  #: per velocity the next one towards ground (-1: none), always a smaller index
    quaternion_slots: tuple[
        tuple[int, int], ...
    ] = ()  #: where Euler parameters start in q, and their angular velocity in v
    rates: Row = ()  #: q' where there are Euler parameters or states, or where it is given
    given_rates: bool = False  #: whether q' = N(q, t) v + b(q, t) is given; then n_q and n have nothing to do with
    #: each other
    paired: tuple[int, ...] = ()  #: with ``given_rates``: per velocity the coordinate whose rate it is, -1 for none
    coordinate_slopes: tuple[Row, ...] = ()  #: with ``given_rates``: (m_h, n_q) dC/dq

    centroidal: Row = ()  #: (18 + 3n,) of (q, v), all bodies, ground axes; empty for a system without mass: centre of
    #: mass, its Jacobian, linear momentum, angular momentum and inertia (9) about the centre of mass
    finite_forces: Row = ()  #: (n_finite_forces,) of (q, v): 1 where a force element's loads are finite, else 0

    accelerations: Row | None = None  #: (n,) a of (q, v) with M a + h = 0, of a method that has it without M
    wrenches: JointWrenches | None = None  #: what joints exert, formed when it is asked for
    inertial: Callable[[], Sequence[Expr]] | None = None  #: (22 n_bodies,) motion of bodies and their parameters
    pivots: Row = ()  #: (n,) of q, with ``accelerations``: positive where M is positive definite
    system: LinearSystem | None = None  #: of a method that solves it for the accelerations
    slopes: Callable[[], ForceSlopes] | None = None  #: derivatives of the inverse dynamics by recursion
    canonical: Row = ()  #: (2n,) of (q, v), by method hamilton: momenta and their rates
    turned: Turned | None = None  #: the tree's system in other velocities, in which it is solved; else None
    constrained: Callable[..., TreeMotion] | None = None  #: constraint rows -> a, by articulated bodies; else None
    events: Row = ()  #: of (q, v): their zeros are the events of the model
    resets: Row = ()  #: of (q, v): new values of states after events
    held_errors: Row = ()  #: of (q, v): of each closed row of constraints that close and open, its error and its rate
    meeting_times: Row = ()  #: (0 or 5,) of (q, v, a): how long a step may be that passes over no contact, and
    #: penetration, thickness and numbers of the deepest two shapes
    near_pairs: Row = ()  #: of q: the lists of pairs of shapes that are near each other
    motion_axes: Row = ()  #: (6 n,) of q, with such lists: the twist that each velocity causes, at the origin
    input_rates: tuple[tuple[str, str], ...] = ()  #: inputs with the input that is their rate
    impacts: bool = False  #: whether an event is a gap with a restitution
    row_groups: tuple[int, ...] = ()  #: per row which it is compared with, as in kinematics/row_groups.py; none: all
    n_states: int = 0  #: first-order states, the last of the velocities: of unit inertia, no coordinate's rate
    projects: bool = True  #: whether rhs takes the projected state; not with Baumgarte's stabilisation

    @property
    def n_v(self) -> int:
        """Number of velocities."""
        return len(self.v)

    @property
    def n_c(self) -> int:
        """Number of constraint rows, redundant and nonholonomic ones included."""
        return len(self.constraint_jacobian)

    @property
    def coordinate_of(self) -> tuple[int, ...]:
        """Per velocity the coordinate whose rate it is, -1 for angular velocities of spherical joints and states."""
        if self.given_rates:
            return self.paired
        turning = {k for _, j in self.quaternion_slots for k in range(j, j + 3)}
        turning |= set(range(self.n_v - self.n_states, self.n_v))
        parameters = {k for i, _ in self.quaternion_slots for k in range(i, i + 4)}
        plain = iter([k for k in range(len(self.q)) if k not in parameters])
        return tuple(-1 if k in turning else next(plain) for k in range(self.n_v))

    @property
    def q_dot(self) -> Row:
        """q', of (t, q, v)."""
        return self.rates or tuple(map(self.graph.symbol, self.v[: self.n_v - self.n_states]))

    @property
    def has_minimal_form(self) -> bool:
        """Whether positions follow from those of the independent velocities."""
        coordinates = self.coordinate_of
        return (
            not self.given_rates
            and self.n_c == len(self.constraints)
            and all(coordinates[k] >= 0 for k in self.preferred if k < self.n_v - self.n_states)
        )

    @property
    def n_loop_coordinates(self) -> int:
        """Number of coordinates of cut joints."""
        return len(self.loop_coordinate_jacobian)

    @property
    def by_columns(self) -> bool:
        """Whether the mass matrix is not written out: entries would be many, and little needs them."""
        return (self.accelerations or self.constrained) is not None and self.n_v > 0 and not self.mass_matrix

    def check_shapes(self) -> None:
        """Refuse terms whose sizes contradict each other.

        Raises
        ------
        UsageError
            Names the field and the sizes.
        """
        n, m = self.n_v, self.n_c
        sizes = {
            "q": (len(self.rates) if self.given_rates else n - self.n_states + len(self.quaternion_slots), len(self.q)),
            "a": (len(self.a), n),
            "multipliers": (len(self.multipliers), m),
            "mass_matrix": (len(self.mass_matrix), 0 if self.by_columns else n),
            "bias": (len(self.bias), n),
            "inverse_dynamics": (len(self.inverse_dynamics), n),
            "constraint_jacobian": (len(self.constraint_jacobian), m),
            "constraint_rate": (len(self.constraint_rate), m),
            "velocity_constraints": (len(self.velocity_constraints), m),
            "gamma": (len(self.gamma), m),
            "loop_coordinates": (len(self.loop_coordinates), 3 * self.n_loop_coordinates),
            "centroidal": (len(self.centroidal), 18 + 3 * n if self.centroidal else 0),
            "coordinate_scales": (len(self.coordinate_scales), n),
            "constraint_scales": (len(self.constraint_scales), m),
            "preferred": (len(self.preferred), self.n_dof),
            "parent": (len(self.parent), n),
            "accelerations": (n if self.accelerations is None else len(self.accelerations), n),
            "pivots": (len(self.pivots), 0 if self.accelerations is None else n),
        }
        wrong = [f"{field} has {given} entries, {expected} expected" for field, (given, expected) in sizes.items()
                 if given != expected]  # fmt: skip
        for name in ("mass_matrix", "constraint_jacobian", "loop_coordinate_jacobian"):
            wrong += [f"row {k} of {name} has {len(row)} entries, {n} expected"
                      for k, row in enumerate(getattr(self, name)) if len(row) != n]  # fmt: skip
        if m == 0 and self.n_dof != n:
            wrong.append(f"n_dof is {self.n_dof}, but {n} coordinates have no constraints")
        if not 0 <= self.n_dof <= n or not set(self.preferred) <= set(range(n)):
            wrong.append(f"preferred {self.preferred} are not {self.n_dof} indices below {n}")
        if any(not -1 <= parent < k for k, parent in enumerate(self.parent)):
            wrong.append(f"parent {self.parent} has an entry that is not smaller than its own index")
        if wrong:
            raise UsageError("; ".join(wrong))


def port_symbols(terms: SystemTerms, n_h: int) -> Mapping[str, tuple[str, ...]]:
    """Symbols by the name of the port; n_h holonomic rows have corrections."""
    independent, coordinate_of = terms.preferred, terms.coordinate_of
    return {
        "q": terms.q,
        "v": terms.v,
        "a": terms.a,
        "q_i": tuple(terms.q[coordinate_of[i]] for i in independent if i < terms.n_v - terms.n_states),
        "v_i": tuple(terms.v[i] for i in independent),
        "a_i": tuple(terms.a[i] for i in independent),
        "q_guess": tuple(f"guess({q})" for q in terms.q),
        "multipliers": terms.multipliers,
        "z": terms.system.unknowns if terms.system else (),
        "corrections": tuple(f"correction[{i}]" for i in range(n_h)),
        "q_rate": tuple(f"rate({q})" for q in terms.q),
        "multiplier_rates": tuple(f"rate({l})" for l in terms.multipliers),
        "correction_rates": tuple(f"rate(correction[{i}])" for i in range(n_h)),
        "cj": ("cj",),
        "impulses": tuple(f"impulse[{i}]" for i in range(len(terms.events))),
        "held_impulses": tuple(f"held_impulse[{i}]" for i in range(len(terms.held_errors) // 2)),
        "dq": tuple(f"d({q})" for q in terms.q),
        "dv": tuple(f"d({v})" for v in terms.v),
        "du": tuple(f"d({u})" for u in terms.u),
        "dp": tuple(f"d({p})" for p in terms.p),
        "da": tuple(f"d({a})" for a in terms.a),
    }


def with_states(terms: SystemTerms, names: Sequence[str], rates: Sequence[Expr]) -> SystemTerms:
    """The terms with states of these names and rates (n_s,), of (t, q, v, s, u); as they are without states."""
    if not names:
        return terms
    graph, n, count = terms.graph, terms.n_v, len(names)
    nothing: Row = (graph.zero,) * count
    accelerations = tuple(graph.symbol(acceleration_name(name)) for name in names)
    unit = tuple((graph.zero,) * (n + k) + (graph.one,) + (graph.zero,) * (count - 1 - k) for k in range(count))
    pairs = list(zip(accelerations, rates, strict=True))
    opposed, left = tuple(-f for f in graph.marked(rates)), tuple(a - f for a, f in graph.marked(pairs))
    mass = tuple((*row, *nothing) for row in terms.mass_matrix) + (unit if terms.mass_matrix or not n else ())
    return replace(
        terms,
        v=(*terms.v, *names),
        a=(*terms.a, *map(acceleration_name, names)),
        mass_matrix=mass,
        bias=(*terms.bias, *opposed),
        inverse_dynamics=(*terms.inverse_dynamics, *left),
        constraint_jacobian=tuple((*row, *nothing) for row in terms.constraint_jacobian),
        loop_coordinate_jacobian=tuple((*row, *nothing) for row in terms.loop_coordinate_jacobian),
        coordinate_scales=(*terms.coordinate_scales, *(graph.one,) * count),
        n_dof=terms.n_dof + count,
        preferred=(*terms.preferred, *range(n, n + count)),
        parent=(*terms.parent, *(-1,) * count),
        motion_axes=(*terms.motion_axes, *[graph.zero] * (6 * count if terms.motion_axes else 0)),
        rates=terms.q_dot,
        centroidal=_centroidal(terms.centroidal, n, nothing),
        accelerations=None if terms.accelerations is None else (*terms.accelerations, *rates),
        pivots=(*terms.pivots, *(graph.one,) * count) if terms.accelerations is not None else (),
        system=None if terms.system is None else _system(terms.system, rates),
        slopes=None,
        turned=None,
        constrained=None if terms.constrained is None else partial(_constrained, terms.constrained, n, tuple(rates)),
        n_states=count,
    )


def _centroidal(given: Row, n: int, nothing: Row) -> Row:
    """Centre (3), its Jacobian (3, n) with columns for the states, and what follows."""
    if not given:
        return ()
    rows = (given[3 + k * n : 3 + (k + 1) * n] for k in range(3))
    return (*given[:3], *(x for row in rows for x in (*row, *nothing)), *given[3 + 3 * n :])


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
    found = solve(moving, term, loaded=loaded, forces=None if forces is None else forces[:n])
    graph = rates[0].graph
    unloaded = [graph.zero] * len(rates) if forces is None else forces[n:]
    return found._replace(
        accelerations=(*found.accelerations, *(rates if loaded else unloaded)),
        pivots=(*found.pivots, *(graph.one,) * len(rates)),
    )


def _system(system: LinearSystem, rates: Sequence[Expr]) -> LinearSystem:
    """The linear system of a method: the rates of the states are no unknowns of it."""
    return replace(system, accelerations=(*system.accelerations, *rates))


def constraint_forces(terms: SystemTerms) -> list[Expr]:
    """C_q^T l (n,)."""
    forces = [terms.graph.zero] * terms.n_v
    for row, name in zip(terms.constraint_jacobian, terms.multipliers, strict=True):
        l = terms.graph.symbol(name)
        forces = [r + c * l for r, c in zip(forces, row, strict=True)]
    return forces


def force_residual(terms: SystemTerms) -> list[Expr]:
    """r1 = M a + h + C_q^T l (n,)"""
    r1 = list(terms.inverse_dynamics)
    for row, name in zip(terms.constraint_jacobian, terms.multipliers, strict=True):
        l = terms.graph.symbol(name)
        r1 = [r + c * l for r, c in zip(r1, row, strict=True)]
    return r1


def acceleration_residual(terms: SystemTerms) -> list[Expr]:
    """r2 = C_q a + gamma (m,)"""
    a = [terms.graph.symbol(name) for name in terms.a]
    r2 = []
    for row, r in zip(terms.constraint_jacobian, terms.gamma, strict=True):
        for c, x in zip(row, a, strict=True):
            r = r + c * x
        r2.append(r)
    return r2
