"""Kinematics and values of parameters -> constraints as functions of numbers, the sizes of their rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.assembly import RESTARTS, Assembly, ConstraintSystem, CutJoints, close, close_nearest
from ..base.limits.numbers import BY_CHANCE, LARGE_LOOP, ROUNDED, SMALL_LOOP, TINY_ROOT
from ..base.scales import Scales, Space
from ..expr.core import Expr, reachable, substitute, symbols_of
from ..expr.evaluate import Evaluator
from ..expr.identity import is_rounding, terms_of, with_bounds
from .kinematics import Kinematics

# -- typical sizes -----------------------------------------------------------------------------------------------------


class Units:
    """Typical sizes of what the equations are made of, in any units: a length, a mass, and 1 s."""

    def __init__(self, kinematics: Kinematics) -> None:
        graph, length = kinematics.graph, kinematics.length_scale
        self.size = {"angle": graph.one, "length": length}
        mass = graph.zero
        for link in kinematics.links:
            turning = link.inertia[0][0] + link.inertia[1][1] + link.inertia[2][2]
            mass = mass + link.mass + turning / (length * length)
        # bodies without inertia are recognized by the solution, not by a division by zero
        some = graph.make("lt", graph.zero.id, mass.id)
        mass = Expr(graph, graph.make("select", some, mass.id, graph.one.id))
        #: twice the kinetic energy
        self.energy = mass * length * length
        self.motion = [graph.one] * 3 + [length] * 3  #: a twist or acceleration
        self.wrench = [self.energy] * 3 + [self.energy / length] * 3
        #: force along each coordinate of the tree
        self.force = [self.energy / self.of(kind) for kind in kinematics.velocity_kinds]

    def of(self, kind: str | float) -> Expr:
        """The size of a coordinate or constraint of this kind; those without a unit count as angles."""
        return self.size.get(kind, self.size["angle"]) if isinstance(kind, str) else self.size["angle"]


# -- row groups --------------------------------------------------------------------------------------------------------

# Entries of the scaled Jacobian are about 1 in a loop of a few links. In one of a hundred, gaps change by its radius,
# thirty times the length of a link, while directions turn as in a small one; loops of one mechanism differ in size,
# too. A row tells little where its entries are small beside what they can be:
#
# - those of the three components of a gap that a joint closes, beside the largest of the three rows: the derivative of
# a column a x r by another angle is b x (a x r) or that of the other's column, and neither is longer than its column; -
# those of a direction that a joint closes, beside 1, which bounds them and their derivatives; - others beside the
# largest entry of all rows, as nothing tells how large they can be.


ALL, UNIT = 0, -1  #: compared with all rows, with 1; gaps are numbered from 1
COMPONENTS = ("r_x", "r_y", "r_z")


def row_groups(kinematics: Kinematics) -> tuple[int, ...]:
    """The group of each row (m,)."""
    c, coupled = kinematics.constraints, set(kinematics.coupled)
    declared = {*c.labels, *c.vanishing}
    gaps: dict[str, int] = {}
    result = []
    for label, kind, written in zip(c.labels, c.kinds, c.written, strict=True):
        joint, _, component = label.rpartition(".")
        if written or label in coupled:
            result.append(ALL)
        elif kind != "length":
            result.append(UNIT)
        elif component in COMPONENTS and all(f"{joint}.{other}" in declared for other in COMPONENTS):
            result.append(gaps.setdefault(joint, 1 + len(gaps)))
        else:
            result.append(ALL)
    return tuple(result)


def row_velocities(kinematics: Kinematics) -> tuple[tuple[int, ...], ...]:
    """The velocities that each row and its rate can know (m,), those of a gap together; none where all rows know all.

    The noise of a row near a change point is of the size of these velocities, whatever else moves faster.
    Nonholonomic rows count as knowing all, as their factors depend on coordinates that do not move them.
    """
    c, n = kinematics.constraints, len(kinematics.velocity_names)
    known = [{k for k, entry in enumerate(row) if not entry.is_zero} for row in c.jacobian]
    known[len(c.values) :] = [set(range(n))] * c.nonholonomic
    of_gaps: dict[int, set[int]] = {}
    groups = row_groups(kinematics)
    for group, labels in zip(groups, known, strict=True):
        if group > 0:
            of_gaps.setdefault(group, set()).update(labels)
    result = [of_gaps[group] if group > 0 else labels for group, labels in zip(groups, known, strict=True)]
    if kinematics.general_rates or all(len(labels) == n for labels in result):
        return ()
    return tuple(tuple(sorted(labels)) for labels in result)


# -- row scales --------------------------------------------------------------------------------------------------------

# A gap of a joint or contact changes by about as much as the coordinates that make it: its size is that of its kind,
# the length scale of the mechanism or 1. That of a loop far smaller than the mechanism, a thousandth or less, is the
# length of its own scaled gradient, or its rows would be lost beside the others. The three rows of a gap in a loop of
# many links have the typical length of their columns as their size, or all others would be lost beside them. A relation
# written by a user may be multiplied by anything, areas in m^2 or numbers of teeth; its size is the length of its
# scaled gradient, so that a factor does not matter (row equilibration: A. van der Sluis, Numerische Mathematik 14,
# 1969). A gradient that may be rounding of the terms that were added in it (:mod:`~..expr.identity`)
# is no size: such a row counts as nothing beside those terms. Factors that are parameters stay symbols.


PLAIN = 4.0  #: a row whose gradient is a number within this factor of the kind's size keeps that


class Length(NamedTuple):
    """The length of a gradient at one place, 0 where it is rounding, and of the terms that were added in it."""

    value: float
    terms: float


def row_scales(kinematics: Kinematics) -> tuple[Expr, ...]:
    """The size of each row (m,), an expression of parameters; found once for each Kinematics."""
    kept: dict[str, tuple[Expr, ...]] = vars(kinematics)
    if "_row_scales" not in kept:
        kept["_row_scales"] = _find_scales(kinematics)
    return kept["_row_scales"]


def _find_scales(kinematics: Kinematics) -> tuple[Expr, ...]:
    graph, c = kinematics.graph, kinematics.constraints
    sizes = {"length": kinematics.length_scale, "angle": graph.one}
    result = [sizes[kind] for kind in c.kinds]
    zero = graph.zero.id
    measured: dict[int, list[Expr]] = {}  # gradients whose lengths are looked at, by row
    for i, row in enumerate(c.jacobian):
        entries = ((x, kind) for x, kind in zip(row, kinematics.velocity_kinds, strict=True) if x.id != zero)
        gradient = [x * sizes[kind] for x, kind in entries]
        written = c.written[i]
        if not gradient or (not written and c.kinds[i] != "length"):
            continue
        if written and _is_plain([x / result[i] for x in gradient]):
            continue
        if written and not _moves(kinematics, row):
            result[i] = _coefficient_size(gradient)
            continue
        measured[i] = gradient
    if not measured:
        return tuple(result)
    places = _places(kinematics)
    gradients = [[kinematics.length_scale], *measured.values()]
    (smallest, *at_first), (_, *at_second) = (_lengths_at(gradients, _numbers(kinematics, place)) for place in places)
    for (i, gradient), first, second in zip(measured.items(), at_first, at_second, strict=True):
        written = c.written[i]
        largest = max(first.value, second.value)
        terms = max(first.terms, second.terms)
        if written and largest <= TINY_ROOT and terms > 0.0:
            result[i] = graph.constant(terms)
        elif written and largest <= TINY_ROOT:  # nothing at the declared values of its factors
            result[i] = _length(substitute(gradient, places[1]))
        elif written or TINY_ROOT < largest < SMALL_LOOP * smallest.value:
            place = places[first.value < BY_CHANCE * second.value]
            result[i] = _length(substitute(gradient, place))
    lengths = dict(zip(measured, at_first, strict=True))
    for rows in _gaps(kinematics, measured):
        total = sum(lengths[i].value ** 2 for i in rows)
        if total <= (LARGE_LOOP * smallest.value) ** 2:
            continue
        columns = len({k for i in rows for k, x in enumerate(c.jacobian[i]) if not x.is_zero})
        if total > columns * (LARGE_LOOP * smallest.value) ** 2:
            typical = _length(substitute([x for i in rows for x in measured[i]], places[0])) * (1.0 / columns**0.5)
            for i in rows:
                result[i] = typical
    return tuple(result)


def _gaps(kinematics: Kinematics, measured: Mapping[int, object]) -> list[list[int]]:
    """The measured rows of each gap."""
    members: dict[int, list[int]] = {}
    for i, group in enumerate(row_groups(kinematics)):
        if group > 0 and i in measured:
            members.setdefault(group, []).append(i)
    return list(members.values())


def _moves(kinematics: Kinematics, row: Sequence[Expr]) -> bool:
    moving = {*kinematics.names, *kinematics.velocity_names, *kinematics.input_names, "t"}
    return not symbols_of(row).isdisjoint(moving)


def _is_plain(gradient: Sequence[Expr]) -> bool:
    values = [x.value for x in gradient]
    numbers = [x for x in values if x is not None]
    return len(numbers) == len(values) and (not numbers or 1 / PLAIN <= float(np.linalg.norm(numbers)) <= PLAIN)


def _coefficient_size(gradient: Sequence[Expr]) -> Expr:
    """The length of a gradient of parameters only, or of its terms where their values make it rounding."""
    size, graph = _length(gradient), gradient[0].graph
    if not any(graph.nodes[i][0] in ("add", "sub") for i in reachable(graph, [x.id for x in gradient])):
        return size
    terms = _length([terms_of(x) for x in gradient])
    return graph.apply("select", graph.apply("lt", terms * ROUNDED, size), size, terms)


def _length(gradient: Sequence[Expr]) -> Expr:
    total = gradient[0] * gradient[0]
    for x in gradient[1:]:
        total = total + x * x
    graph = total.graph
    return graph.apply("max", graph.apply("sqrt", total), graph.constant(TINY_ROOT))


def _places(kinematics: Kinematics) -> list[dict[Expr, Expr]]:
    """The initial values, and a place beside them where nothing vanishes by chance."""
    graph, m = kinematics.graph, kinematics.mechanism
    inputs = {graph.symbol(u.name): graph.constant(u.value) for u in m.inputs}
    declared = {**m.defaults.guess, **m.defaults.initial}
    known = dict(zip(declared, substitute(list(declared.values()), inputs), strict=True))
    unit = {"length": kinematics.length_scale, "angle": graph.one}
    first: dict[Expr, Expr] = {}
    second: dict[Expr, Expr] = {}
    real = {i for i, _ in kinematics.quaternion_slots}
    for j, (symbol, name, kind) in enumerate(zip(kinematics.q, kinematics.names, kinematics.kinds, strict=True)):
        first[symbol] = known.get(name, graph.one if j in real else graph.zero)
        second[symbol] = first[symbol] + unit.get(kind, graph.one) * (0.3 + 0.07 * j)
    still = {kinematics.t: graph.zero} | dict.fromkeys(kinematics.v, graph.zero) | inputs
    return [first | still, second | still]


def _numbers(kinematics: Kinematics, place: Mapping[Expr, Expr]) -> dict[str, float]:
    """A place in numbers, with the declared parameter values, 1 where there is none."""
    numbers = {p.name: 1.0 if p.value is None else float(p.value) for p in kinematics.mechanism.parameters}
    return numbers | dict(zip((x.node[1] for x in place), with_bounds(list(place.values()), numbers)[0], strict=True))


def _lengths_at(gradients: Sequence[Sequence[Expr]], numbers: Mapping[str, float]) -> list[Length]:
    """The lengths of some gradients at one place; what they share is evaluated once."""
    values, bounds = with_bounds([x for gradient in gradients for x in gradient], numbers, likely=True)
    ends = np.cumsum([len(gradient) for gradient in gradients])[:-1]
    return [_length_of(*parts) for parts in zip(np.split(values, ends), np.split(bounds, ends), strict=True)]


def _length_of(values: np.ndarray, bounds: np.ndarray) -> Length:
    nothing = not np.isfinite(values).all() or bool(is_rounding(values, bounds).all())
    terms = float(np.linalg.norm(bounds)) if np.isfinite(bounds).all() else 0.0
    return Length(0.0 if nothing else float(np.linalg.norm(values)), terms)


Array = NDArray[np.float64]


class ConstraintFunctions:
    """The constraints of a kinematics as functions of numbers, with numbers for parameters and inputs."""

    def __init__(self, kinematics: Kinematics, values: Mapping[str, float]) -> None:
        self.kinematics = kinematics
        self.values = dict(values)
        c, loop = kinematics.constraints, kinematics.loop_coordinates
        self.n, self.m, self.h = len(kinematics.v), len(c.labels), len(c.values)
        space = Space.of(self.n, kinematics.quaternion_slots)
        self.neutral = np.zeros(len(kinematics.names)) if space is None else space.neutral()
        self._names = (*kinematics.names, *self.values, "t")
        self._hints = self._compile([value for _, value in kinematics.hints])
        length, *sizes = self._compile([kinematics.length_scale, *row_scales(kinematics)])(self.neutral, 0.0)
        self.length_scale = float(length)
        self.scales = place = Scales.of_kinds(kinematics.velocity_kinds, sizes, self.length_scale, space)
        self._position = position = self._split(c.values, c.jacobian)
        if kinematics.general_rates:  # positions do not move with velocities
            place = Scales.of_kinds(kinematics.kinds, sizes[: self.h], self.length_scale)
            position = self._split(c.values, c.slopes, len(kinematics.names))
        sizes_of_loops = np.array([self.length_scale if kind == "length" else 1.0 for kind in loop.kinds])
        cut = CutJoints(loop.names, loop.kinds, sizes_of_loops, self._split(loop.values, loop.jacobian))
        aligned = self._compile(list(c.aligned)) if c.aligned else None
        self.system = ConstraintSystem(position, place, kinematics.names, kinematics.kinds, c.labels, cut, aligned)

    @classmethod
    def at_declared(cls, kinematics: Kinematics) -> ConstraintFunctions:
        """With the declared parameters and inputs, 0 where there is none."""
        return cls(kinematics, {name: float(x or 0.0) for name, x in kinematics.mechanism.declared.items()})

    def _compile(self, outputs: Sequence[Expr]) -> Callable[[Array, float], Array]:
        evaluator, rest = Evaluator(list(outputs), self._names), list(self.values.values())

        def call(q: Array, t: float) -> Array:
            with np.errstate(all="ignore"):
                return np.array(evaluator([*map(float, q), *rest, t]), dtype=float)

        return call

    def _split(
        self, values: Sequence[Expr], slopes: Sequence[Sequence[Expr]], width: int | None = None
    ) -> Callable[[Array, float], tuple[Array, Array]]:
        """Functions and their slopes (n_v wide by default) in one evaluation; those that vanish are not evaluated."""
        zero, k, shape = self.kinematics.graph.zero.id, len(values), (len(slopes), self.n if width is None else width)
        entries = [(i, j, e) for i, row in enumerate(slopes) for j, e in enumerate(row) if e.id != zero]
        rows, columns = [i for i, _, _ in entries], [j for _, j, _ in entries]
        evaluate = self._compile([*values, *(e for _, _, e in entries)])

        def call(q: Array, t: float) -> tuple[Array, Array]:
            result, matrix = evaluate(q, t), np.zeros(shape)
            matrix[rows, columns] = result[k:]
            return result[:k], matrix

        return call

    def position(self, q: Array, t: float = 0.0) -> tuple[Array, Array]:
        """C (h,) of the holonomic rows and C_q (m, n) of all."""
        return self._position(q, t)

    def with_rows(self, rows: Sequence[int]) -> ConstraintSystem:
        """The system with some of the constraint rows only."""
        chosen = np.array(rows, dtype=int)
        system = self.system

        def evaluate(q: Array, t: float) -> tuple[Array, Array]:
            C, C_q = system.evaluate(q, t)
            return C[chosen[chosen < self.h]], C_q[chosen[chosen < len(C_q)]]

        scales = system.scales._replace(c=system.scales.c[chosen[chosen < len(system.scales.c)]])
        return system._replace(evaluate=evaluate, scales=scales, labels=[system.labels[i] for i in rows])

    def place_jacobian(self, q: Array) -> Array:
        """J of the holonomic rows, scaled as positions are."""
        return self.system.scales.jacobian(self.system.position(q)[1][: self.h])

    def scaled_jacobian(self, q: Array, t: float = 0.0) -> Array:
        """J (m, n)."""
        return self.scales.jacobian(self.position(q, t)[1])

    def close(
        self,
        declared: Mapping[str, float],
        guess: Mapping[str, float],
        restarts: int = RESTARTS,
        system: ConstraintSystem | None = None,
    ) -> Assembly:
        """Assemble with the given values exact, near the guess; with the rows of another system if there is one."""
        system = self.system if system is None else system
        declared, guess = system.settle(declared), system.settle(guess)
        start = system.with_values(system.with_values(self.neutral, guess), declared)
        rough = system.wanted(guess)
        if rough is not None:  # come near the guessed coordinates of cut joints first
            start = close(system.closure(declared)._replace(equations=rough), start)[0]
        return system.close(self._hinted(start, {**declared, **guess}, system.t), declared, restarts)

    def close_nearest(self, declared: Mapping[str, float], guess: Mapping[str, float]) -> Assembly:
        """Assemble with the given values exact, on the branch that is nearest to the guess."""
        values = self.system.settle(declared), self.system.settle(guess)
        known = {**values[0], **values[1]}
        if guess:
            result = close_nearest(self.system, self.neutral, *values, lambda q: self._hinted(q, known, self.system.t))
            if result is not None:
                return result
        return self.close(declared, guess)

    def _hinted(self, q: Array, known: Mapping[str, float], t: float) -> Array:
        """A position with the coordinates of contact points that nobody knows where they may be."""
        for (name, _), value in zip(self.kinematics.hints, self._hints(q, t), strict=True):
            if name not in known and np.isfinite(value):
                q = self.system.with_values(q, {name: value})
        return q
