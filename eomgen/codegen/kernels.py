"""SystemTerms -> blocks: the expressions of every kernel, and of what drivers call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from ..base.kernel_table import DAE, NAMED, Sizes
from ..graph.core import Expr
from ..graph.count import count
from ..graph.differentiate import jacobian, jvp
from ..graph.pair_calls import pairs_of_bodies, without_pairs
from ..graph.substitute import substitute, symbols_of
from ..graph.traverse import reachable
from .factor import articulated_positivity, factorize, is_unrolled, positivity, solve
from .held_columns import HELD, HeldColumns, held_columns
from .jacobian_blocks import Entries, ResidualSlopes, unrolled_jacobian, unrolled_shift
from .loops.block_groups import ALONG, COMPOSED, RATES, REGULAR, SHIFTS, USUAL, flat
from .loops.body_loops import BodyLoops
from .loops.loop_blocks import LoopBlocks
from .loops.loop_slopes import BY_BODIES, LoopSlopes
from .loops.regular_loops import RegularLoops
from .loops.straight_loops import regular_loops, straight_loops
from .program import Block, Limits, Port
from .terms import SystemTerms, acceleration_residual, force_residual, port_symbols


def dae_kinematics(terms: SystemTerms, rates: Sequence[str], corrections: Sequence[str]) -> list[Expr]:
    """q' - N (v - S^2 C_q^T mu): kinematics with corrections (C. W. Gear, B. Leimkuhler, G. K. Gupta, 1985).

    Parameters
    ----------
    terms : SystemTerms
    rates, corrections : sequences of str
        Symbols of q' and of mu, one for each holonomic row.
    """
    graph = terms.graph
    v = [graph.symbol(name) for name in terms.v]
    moved = list(v)
    for row, name in zip(terms.constraint_jacobian, corrections, strict=False):
        mu = graph.symbol(name)
        moved = [x - s * s * c * mu for x, s, c in zip(moved, terms.coordinate_scales, row, strict=True)]
    flow = substitute(terms.q_dot, dict(zip(v, moved, strict=True)))
    return [graph.symbol(name) - f for name, f in zip(rates, flow, strict=True)]


def derivatives(terms: SystemTerms, rows: Sequence[Expr], names: Sequence[str]) -> list[Expr]:
    """All derivatives of rows by symbols."""
    graph = terms.graph
    entries = jacobian(rows, [graph.symbol(name) for name in names])
    return [entries.get((i, k), graph.zero) for i in range(len(rows)) for k in range(len(names))]


def by_everything(terms: SystemTerms, rows: Sequence[Expr]) -> list[Expr]:
    """Derivatives by coordinates, velocities, time, inputs and parameters."""
    return derivatives(terms, rows, (*terms.q, *terms.v, terms.t, *terms.u, *terms.p))


def assembly_jacobian(terms: SystemTerms, n_loop_coordinates: int) -> list[Expr]:
    """Constraints, their rates, and the n_loop_coordinates coordinates of cut joints with theirs, by q, v, u and p."""
    rows = [*terms.constraints, *terms.velocity_constraints, *terms.loop_coordinates[: 2 * n_loop_coordinates]]
    return derivatives(terms, rows, (*terms.q, *terms.v, *terms.u, *terms.p))


def output_derivatives(terms: SystemTerms) -> list[Expr]:
    """Outputs by q, v, a, u and p, each at fixed others."""
    return derivatives(terms, terms.outputs, (*terms.q, *terms.v, *terms.a, *terms.u, *terms.p))


def strike_rows(terms: SystemTerms, impulses: Sequence[str], of_held: Sequence[str]) -> list[Expr]:
    """What rules velocities at an instant, a being their change.

    The momentum balance with impulses l of constraints, g of gaps with normals n, and those of constraints that close
    and open; the least scaled change; constraints of velocities; the events' rates; those of what is closed.  Impulses
    are given by their symbols.
    """
    graph = terms.graph
    v, a, l = ([graph.symbol(name) for name in names] for names in (terms.v, terms.a, terms.multipliers))
    q = [graph.symbol(name) for name in terms.q]
    rates = jvp(terms.events, dict(zip(q, terms.q_dot, strict=True)))
    moving = {graph.symbol(u): graph.symbol(rate) for u, rate in terms.input_rates}
    drift = jvp(terms.events, {graph.symbol(terms.t): graph.one} | moving)
    normals = jacobian(rates, v)
    change = jvp(terms.inverse_dynamics, {x: x for x in a})
    least = [x / (s * s) for x, s in zip(a, terms.coordinate_scales, strict=True)]
    for row, one in zip(terms.constraint_jacobian, l, strict=True):
        change = [x + c * one for x, c in zip(change, row, strict=True)]
        least = [x + c * one for x, c in zip(least, row, strict=True)]
    for i, g in enumerate(map(graph.symbol, impulses)):
        change = [x - normals.get((i, k), graph.zero) * g for k, x in enumerate(change)]
    held = terms.held_errors[1::2]
    by_held = jacobian(held, v[: terms.n_v - terms.n_states])
    for (i, k), slope in by_held.items():
        change[k] = change[k] + slope * graph.symbol(of_held[i])
    moved = [x + y for x, y in zip(rates, drift, strict=True)]
    return [*change, *least, *terms.velocity_constraints, *moved, *held]


def inverse_slopes(terms: SystemTerms, slopes: ResidualSlopes) -> list[Expr] | None:
    """(n, n_q + 2 n) row-major; None if written out it would be too long.

    By recursion over composite bodies, whose mass matrix comes along, or by differentiating the formula.
    """
    found: list[Entries] = []
    width = len(terms.q) + terms.n_v
    if slopes.forces is not None:
        mass = slopes.mass_matrix
        found.append(slopes.by_recursion | {(i, width + k): x for i, row in enumerate(mass) for k, x in enumerate(row)})
    symbols = [terms.graph.symbol(name) for name in (*terms.q, *terms.v, *terms.a)]
    nodes = len(reachable(terms.graph, (x.id for x in terms.inverse_dynamics)))
    if len(symbols) * nodes <= slopes.limits.jacobian_recursive:
        found.append(jacobian(list(terms.inverse_dynamics), symbols))
    if not found:
        return None
    entries = min(found, key=lambda one: count(list(one.values())).total)
    zero = terms.graph.zero
    return [entries.get((i, k), zero) for i in range(terms.n_v) for k in range(width + terms.n_v)]


def written_derivative(
    terms: SystemTerms, slopes: ResidualSlopes, name: str, unrolled: bool, touching: bool
) -> tuple[list[Expr], list[Expr]] | None:
    """A derivative of the inverse dynamics, or of a small tree's right-hand side, and checks of its mass matrix."""
    if touching and name not in SHIFTS:
        return None
    if name == "inverse_dynamics_derivatives":
        found = inverse_slopes(terms, slopes)
        return None if found is None else (found, [])
    if not unrolled or name not in ("jacobian", *SHIFTS):
        return None
    if name == "jacobian":
        return unrolled_jacobian(terms, slopes)
    return unrolled_shift(terms, slopes, terms.u if SHIFTS[name] == "input" else terms.p)


class BlockMaker:
    """Makes the blocks of one system, each when it is asked for."""

    def __init__(self, terms: SystemTerms, sizes: Sizes, limits: Limits) -> None:
        self.terms = terms
        self.sizes = sizes
        self.limits = limits

    # -- choices --------------------------------------------------------------------------------------------------
    @property
    def has_loops(self) -> bool:
        """Whether there are constraint rows."""
        return self.sizes.n_c > 0

    @property
    def unrolled(self) -> bool:
        """Whether the right-hand side is straight-line code."""
        terms, short = self.terms, is_unrolled(self.terms.parent, self.limits.unrolled)
        return not self.has_loops and terms.system is None and (terms.accelerations is not None or short)

    @cached_property
    def _loops(self) -> LoopBlocks | None:
        """The straight-line form of a right-hand side with loops, if it is not too long."""
        return straight_loops(self.terms, self.limits.unrolled_loops) if self.limits.unrolled_loops else None

    @cached_property
    def _regular(self) -> RegularLoops | None:
        """The shorter form that is tried before that one."""
        return regular_loops(self._loops, self.limits.unrolled_loops)

    @cached_property
    def _loop_slopes(self) -> LoopSlopes | None:
        """The derivatives of that form along directions, if it goes by articulated bodies."""
        if not isinstance(self._loops, BodyLoops):
            return None
        return LoopSlopes(self._loops, self.port("dq").symbols, self.port("dv").symbols)

    @cached_property
    def outputs_need_accelerations(self) -> bool:
        """Whether an output depends on an acceleration."""
        return not symbols_of(self.terms.outputs).isdisjoint(self.terms.a)

    @cached_property
    def by_direction(self) -> bool:
        """Whether the Jacobian of the residuals is too large to be written out."""
        if self._touching:
            return True
        if not self.has_loops and self.slopes.recursive and self.slopes.operations <= self.limits.jacobian_recursive:
            return False
        residuals = [*self._force_residual, *self._acceleration_residual, *self.terms.velocity_constraints]
        nodes = len(reachable(self.terms.graph, (r.id for r in residuals)))
        return self.sizes.n_x * nodes > self.limits.jacobian_nodes

    @cached_property
    def _touching(self) -> bool:
        """Whether contacts between groups couple too many pairs of bodies for their derivatives to be written out."""
        return pairs_of_bodies(self.terms.graph) > self.limits.jacobian_pairs

    @cached_property
    def held(self) -> HeldColumns | None:
        """The columns of states of contacts, where the Jacobian of a tree is made direction by direction."""
        plain = self.limits.unrolled_loops > 0 and not self.has_loops  # drivers over arrays take all terms
        return held_columns(self.terms) if plain and self.by_direction else None

    @cached_property
    def slopes(self) -> ResidualSlopes:
        """The derivatives of the residuals."""
        return ResidualSlopes(self.terms, self.limits)

    # -- shared expressions ---------------------------------------------------------------------------------------
    @cached_property
    def _accelerations(self) -> tuple[list[Expr], list[Expr]]:
        """v' of a tree in terms of (q, v), and the conditions for it to exist."""
        terms = self.terms
        if terms.accelerations is not None and terms.pivots:
            checks = articulated_positivity(terms.pivots, terms.coordinate_scales, terms.parent)
            return list(terms.accelerations), [*self._turned, *checks]
        mass, bias = terms.turned.system if terms.turned else (terms.mass_matrix, terms.bias)
        factor = factorize(mass, terms.parent)
        checks = positivity(mass, factor, terms.coordinate_scales)
        solution = solve(factor, [-h for h in bias])
        return (terms.turned.accelerations(solution) if terms.turned else solution), [*self._turned, *checks]

    def _symbols(self, names: Sequence[str]) -> list[Expr]:
        return [self.terms.graph.symbol(name) for name in names]

    @cached_property
    def _force_residual(self) -> list[Expr]:
        return force_residual(self.terms)

    @cached_property
    def _acceleration_residual(self) -> list[Expr]:
        return acceleration_residual(self.terms)

    @cached_property
    def _squares(self) -> list[Expr]:
        """|e|^2 of each set of Euler parameters, as rotations have it."""
        sets = (self._symbols(self.terms.q[i : i + 4]) for i, _ in self.terms.quaternion_slots)
        return [e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3] for e in sets]

    @property
    def _turned(self) -> list[Expr]:
        """Conditions: no set of Euler parameters is zero, which no result need show where no rotation matters."""
        graph = self.terms.graph
        return [graph.apply("lt", graph.zero, square) for square in self._squares]

    @cached_property
    def _dae_residual(self) -> list[Expr]:
        rest = [*self._force_residual, *self.terms.constraints, *self.terms.velocity_constraints]
        return [*dae_kinematics(self.terms, self.port("q_rate").symbols, self.port("corrections").symbols), *rest]

    def _dae_tangent(self) -> Block:
        given = [self.port(name) for name in DAE]
        y = [symbol for port in given for symbol in port.symbols]
        along = Port("directions", tuple(f"d({symbol})" for symbol in y))
        seeds = dict(zip(self._symbols(y), self._symbols(along.symbols), strict=True))
        outputs = tuple(jvp(self._dae_residual, seeds))
        return Block("dae_tangent", (*given, along), outputs, (len(outputs),), public=False)

    def _through(self, ports: str) -> list[Expr]:
        return self._symbols([symbol for name in ports.split() for symbol in self.port(name).symbols])

    def _normalised(self) -> list[Expr]:
        """q with Euler parameters of length 1."""
        q = self._symbols(self.terms.q)
        for (i, _), square in zip(self.terms.quaternion_slots, self._squares, strict=True):
            length = self.terms.graph.apply("sqrt", square)
            q[i : i + 4] = [x / length for x in q[i : i + 4]]
        return q

    # -- blocks ---------------------------------------------------------------------------------------------------
    def port(self, name: str) -> Port:
        """The symbols behind the name of a port."""
        return Port(name, self._port_symbols[name])

    @cached_property
    def _port_symbols(self) -> Mapping[str, tuple[str, ...]]:
        loads = {"loads": self.held.loads} if self.held is not None else {}
        return {**port_symbols(self.terms, self.sizes.n_h), **loads}

    def _internal(
        self, name: str, ports: str, outputs: Sequence[Expr], checks: Sequence[Expr] = (), guards: Sequence[Expr] = ()
    ) -> Block:
        inputs = tuple(map(self.port, ports.split()))
        return Block(name, inputs, tuple(outputs), (len(outputs),), tuple(checks), tuple(guards), public=False)

    def public(self, name: str) -> Block | None:
        """The public kernel of this name if it is straight-line code for this system, else None."""
        kernel = NAMED[name]
        terms = self.terms
        always: dict[str, Callable[[], Sequence[Expr]]] = {
            "mass_matrix": lambda: flat(terms.mass_matrix),
            "bias": lambda: terms.bias,
            "inverse_dynamics": lambda: terms.inverse_dynamics,
            "energy": lambda: (terms.kinetic, terms.potential),
            "centroidal": lambda: terms.centroidal,
            "constraints": lambda: terms.constraints,
            "constraint_jacobian": lambda: flat(terms.constraint_jacobian),
            "coordinate_slopes": lambda: flat(terms.coordinate_slopes),
            "velocity_constraints": lambda: terms.velocity_constraints,
            "poses": lambda: terms.poses,
            "loop_coordinates": lambda: terms.loop_coordinates,
            "loop_coordinate_jacobian": lambda: flat(terms.loop_coordinate_jacobian),
            "alignment": lambda: terms.alignment,
            "motion_outputs": lambda: terms.outputs,
            "canonical": lambda: terms.canonical,
            "dae_residual": lambda: self._dae_residual,
            "finite_forces": lambda: terms.finite_forces,
            "meeting_time": lambda: terms.meeting_times,
            "near_pairs": lambda: terms.near_pairs,
            "bias_apart": lambda: without_pairs(terms.bias, terms.near_pairs),
            "motion_axes": lambda: terms.motion_axes,
            "events": lambda: terms.events,
            "resets": lambda: terms.resets,
            "held_errors": lambda: terms.held_errors,
            "event_slopes": lambda: derivatives(terms, terms.events, (*terms.q, *terms.v)),
            "event_derivatives": lambda: by_everything(terms, [*terms.events, *terms.resets]),
            "strike_derivatives": lambda: by_everything(
                terms, strike_rows(terms, self.port("impulses").symbols, self.port("held_impulses").symbols)
            ),
            "assembly_jacobian": lambda: assembly_jacobian(terms, self.sizes.n_loop_coordinates),
            "output_derivatives": lambda: output_derivatives(terms),
            "needed_wrenches": lambda: terms.wrenches.needed if terms.wrenches else (),
            "wrench_geometry": lambda: terms.wrenches.geometry if terms.wrenches else (),
            "inertial_terms": lambda: terms.inertial() if terms.inertial else (),
            "scales": lambda: (*terms.coordinate_scales, *terms.constraint_scales),
        }
        trees: dict[str, Callable[[], Sequence[Expr]]] = {
            "project": lambda: [*self._normalised(), *self._symbols(terms.v)],
            "embedded_mass_matrix": lambda: [terms.mass_matrix[i][k] for i in terms.preferred for k in terms.preferred],
            "kinematics": lambda: self._symbols((*terms.q, *terms.v, *terms.a)),
        }
        checks: list[Expr] = []
        if terms.by_columns and name in ("mass_matrix", "embedded_mass_matrix"):
            return None
        if name in always:
            outputs = always[name]()
            checks = self._turned if name == "bias" else []  # drivers of large trees go by it
        elif name in trees and not self.has_loops:
            outputs = trees[name]()
        elif name == "rhs" and self.unrolled:
            accelerations, checks = self._accelerations
            outputs = [*terms.q_dot, *accelerations]
        elif (found := written_derivative(terms, self.slopes, name, self.unrolled, self._touching)) is not None:
            outputs, checks = found[0], [*self._turned, *found[1]]
        elif name == "outputs" and not self.has_loops and not self.outputs_need_accelerations:
            outputs = terms.outputs
        elif name == "outputs" and self.unrolled:
            accelerations, checks = self._accelerations
            outputs = substitute(terms.outputs, dict(zip(self._symbols(terms.a), accelerations, strict=True)))
        else:
            return None
        ports = tuple(map(self.port, kernel.inputs))
        return Block(name, ports, tuple(outputs), kernel.shape(self.sizes), tuple(checks))

    def drivers_need(self, name: str) -> tuple[str, ...]:
        """Names of the blocks behind a public kernel that is not straight-line code."""
        given = (*RATES, *(("coordinate_slopes",) if self.terms.coordinate_slopes else ()))
        return (*self._behind(name), *(given if self.terms.given_rates else ()))

    def _behind(self, name: str) -> tuple[str, ...]:
        if name in ALONG:
            return (ALONG[name],)
        residual = "residual_tangent" if self.by_direction else "residual_jacobian"
        shift = SHIFTS.get(name)
        if shift and self.terms.by_columns and not self.has_loops:
            return (f"{shift}_acceleration",)
        if shift and not self.has_loops:
            return ("mass_matrix", "bias", "scales", f"{shift}_shift")
        formed = COMPOSED if self.terms.by_columns else ("terms",)
        if shift:
            return ("scales", "position", "rate", *formed, residual, f"{shift}_shift")
        if self.terms.by_columns and (not self.has_loops or name == "mass_matrix"):
            if name != "jacobian":
                return ("mass_times",)
            return ("acceleration_tangent",) if self.by_direction else ("terms", "scales", "residual_jacobian")
        if self.terms.system and (name in ("rhs", "outputs") or (name == "jacobian" and not self.terms.projects)):
            return self._system_needs(name, residual)
        if not self.has_loops:  # their terms are put together from two blocks, which share next to nothing
            terms = ("mass_matrix", "bias", "scales")
            return {
                "rhs": terms,
                "jacobian": (*terms, residual) if self.held is None else ("scales", residual, *HELD),
                "outputs": (*terms, "accelerated_outputs"),
            }[name]
        project = ("scales", "position", "rate")
        accelerate = formed if self.outputs_need_accelerations else ()
        mass = "mass_times" if self.terms.by_columns else "mass_matrix"
        direct = (*USUAL, *(REGULAR if self._regular else ())) if self._loops is not None else ()
        along = (*direct, *BY_BODIES) if self._loop_slopes is not None else ()
        return {
            "rhs": (*project, *formed, *direct),
            "jacobian": (*project, *formed, residual, *along),
            "embedded_mass_matrix": ("scales", "position", mass),
            "project": project,
            "outputs": (*project, *accelerate, "accelerated_outputs"),
            "kinematics": (*project, *formed),
        }[name]

    def _system_needs(self, name: str, residual: str) -> tuple[str, ...]:
        """What drivers need that solve the linear system of a method."""
        closing = self.has_loops and (self.terms.projects or name == "outputs")
        project = ("scales", "position", "rate") if closing else ()
        if name == "outputs":
            accelerate = ("system", "joint_accelerations") if self.outputs_need_accelerations else ()
            return (*project, *accelerate, "accelerated_outputs")
        return (*project, "system", "joint_accelerations", *((residual,) if name == "jacobian" else ()))

    def internal(self, name: str) -> Block:
        """A block that only drivers call; layouts in the generated source."""
        terms, n = self.terms, self.sizes.n_v
        match name:
            case "terms":  # M lower packed, h, C_q, gamma
                mass = self.slopes.mass_matrix if terms.by_columns else terms.mass_matrix
                lower = [mass[i][k] for i in range(n) for k in range(i + 1)]
                every = [*lower, *terms.bias, *flat(terms.constraint_jacobian), *terms.gamma]
                return self._internal(name, "q v", every, self._turned)
            case "position":  # C, C_q
                return self._internal(name, "q", [*terms.constraints, *flat(terms.constraint_jacobian)])
            case "closing" | "dynamics" | "regular_closing" | "regular_dynamics":
                form = self._loops if name in USUAL else self._regular
                assert form is not None
                if name.endswith("closing"):  # a Newton step
                    return self._internal(name, "q", form.closing(), guards=form.guards)
                outputs, checks = form.dynamics()  # v, a, whether these are sound
                return self._internal(name, "q v", outputs, [*self._turned, *checks])
            case "loop_slopes" | "slopes_by_position" | "slopes_by_velocity":
                assert self._loop_slopes is not None
                return self._loop_slopes.block(name, list(map(self.port, ("q", "v", "dq", "dv"))), self._turned)
            case "gamma":
                return self._internal(name, "q v", terms.gamma)
            case "rate":  # C_t
                return self._internal(name, "q", terms.constraint_rate)
            case "system":  # entries of K, then r, then sizes of equations and of unknowns
                assert terms.system is not None
                system = terms.system
                return self._internal(name, "q v", [*system.entries, *system.right, *system.sizes])
            case "joint_accelerations":
                assert terms.system is not None
                return self._internal(name, "q v z", terms.system.accelerations)
            case "accelerated_outputs":
                return self._internal(name, "q v a", terms.outputs)
            case "residual_jacobian":  # r1_q, r1_v, r2_q, r2_v, r3_q
                return self._internal(name, "q v a multipliers", self.slopes.packed())
            case "held_terms" | "held_operands" | "held_loads":
                assert self.held is not None
                ports, outputs = self.held.block(name, terms)
                return self._internal(name, ports, outputs, self._turned if name == "held_terms" else ())
            case "dae_tangent":  # dF along (dy, dy')
                return self._dae_tangent()
            case "inverse_tangent":  # d(M a + h) along (dq, dv, da)
                seeds = dict(zip(self._through("q v a"), self._through("dq dv da"), strict=True))
                return self._internal(name, "q v a dq dv da", jvp(terms.inverse_dynamics, seeds))
            case "mass_times":  # M a
                along = {a: a for a in self._symbols(terms.a)}
                return self._internal(name, "q a", jvp(terms.inverse_dynamics, along))
            case "rates":  # q'
                return self._internal(name, "q v", terms.rates)
            case "moved" | "rates_along":  # N dv; dq' along (dq, dv)
                held = dict.fromkeys(self._symbols(terms.q), terms.graph.zero) if name == "moved" else {}
                return self._internal(name, "q v a multipliers dq dv", jvp(terms.rates, self._directions | held))
            case "acceleration_tangent":  # dv' along (dq, dv)
                accelerations, checks = self._accelerations
                return self._internal(name, "q v dq dv", jvp(accelerations, self._directions), checks)
            case "residual_tangent":  # dr1, dr2, dr3 along (dq, dv)
                residuals = [*self._force_residual, *self._acceleration_residual, *terms.velocity_constraints]
                return self._internal(name, "q v a multipliers dq dv", jvp(residuals, self._directions))
            case "input_shift" | "parameter_shift":  # dC, dr1, dr2, dr3 along du or dp
                residuals = [*terms.constraints, *self._force_residual, *self._acceleration_residual]
                residuals += terms.velocity_constraints
                port, seeds = self._seeds(name.removesuffix("_shift"))
                return self._internal(name, f"q v a multipliers {port}", jvp(residuals, seeds))
            case "input_acceleration" | "parameter_acceleration":  # dv' along du or dp
                accelerations, checks = self._accelerations
                port, seeds = self._seeds(name.removesuffix("_acceleration"))
                return self._internal(name, f"q v {port}", jvp(accelerations, seeds), checks)
        raise KeyError(name)

    def _seeds(self, what: str) -> tuple[str, dict[Expr, Expr]]:
        """The port of the changes of inputs or parameters, and what changes -> the symbol of its change."""
        port, names = ("du", self.terms.u) if what == "input" else ("dp", self.terms.p)
        return port, dict(zip(self._symbols(names), self._symbols(self.port(port).symbols), strict=True))

    @property
    def _directions(self) -> dict[Expr, Expr]:
        """q and v -> the symbols of their changes."""
        seeds = [*self.port("dq").symbols, *self.port("dv").symbols]
        return dict(zip(self._symbols((*self.terms.q, *self.terms.v)), self._symbols(seeds), strict=True))
